"""PyVista's datasets with `mesh.pns`: import this module, and every PolyData has it.

import pns_common.pyvista

smooth = mesh.pns.subdivide(levels=2)
"""

from __future__ import annotations

from base64 import b64encode
from io import BytesIO
from typing import Any

import numpy as np
import pyvista

from pns_common.interop.subdivide import subdivide
from pns_common.mesh.mesh import Mesh
from pns_common.operator.scheme import Scheme, loop


@pyvista.register_dataset_accessor("pns", pyvista.PolyData)
class PnsAccessor:
    """Refines a PolyData; point, cell and field data are kept."""

    def __init__(self, mesh: pyvista.PolyData):
        self._mesh = mesh

    def subdivide(
        self, levels: int | None = None, scheme: Scheme | None = None, **options: Any
    ) -> pyvista.PolyData:
        """Return the refined mesh; arguments and errors as of ``pns_common.subdivide``."""
        return subdivide(self._mesh, levels, scheme, **options)

    def loop(self, levels: int | None = None, **options: Any) -> pyvista.PolyData:
        """Return the mesh refined by Loop's rules alone."""
        return subdivide(self._mesh, levels, loop(), **options)


def picture(mesh: Mesh) -> str:
    """Return a mesh's picture as HTML; edges are drawn where there are few."""
    padded = np.insert(mesh.corners, mesh.offsets[:-1], np.diff(mesh.offsets))
    surface = pyvista.PolyData(mesh.vertices, faces=padded)
    plotter, png = pyvista.Plotter(off_screen=True, window_size=[360, 270]), BytesIO()
    plotter.add_mesh(surface, color="#c08457", show_edges=len(mesh.offsets) < 2000)
    plotter.screenshot(png)
    plotter.close()
    return f'<img alt="" src="data:image/png;base64,{b64encode(png.getvalue()).decode()}"/>'

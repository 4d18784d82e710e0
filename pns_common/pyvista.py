"""PyVista's datasets with `mesh.pns`: import this module, and every PolyData has it.

import pns_common.pyvista

smooth = mesh.pns.subdivide(levels=2)
"""

from __future__ import annotations

from typing import Any

import pyvista

from pns_common.interop.subdivide import subdivide
from pns_common.refinement import DEFAULT_LEVELS
from pns_common.schemes import Scheme, loop


@pyvista.register_dataset_accessor("pns", pyvista.PolyData)
class PnsAccessor:
    """Refines a PolyData of triangles; point, cell and field data are kept."""

    def __init__(self, mesh: pyvista.PolyData):
        self._mesh = mesh

    def subdivide(
        self, levels: int = DEFAULT_LEVELS, scheme: Scheme | None = None, **options: Any
    ) -> pyvista.PolyData:
        """Return the refined mesh; arguments and errors as of ``pns_common.subdivide``."""
        return subdivide(self._mesh, levels, scheme, **options)

    def loop(self, levels: int = DEFAULT_LEVELS, **options: Any) -> pyvista.PolyData:
        """Return the mesh refined by Loop's rules alone."""
        return subdivide(self._mesh, levels, loop(), **options)

"""The first picture of README and docs: PyVista's ant as it is, refined by Loop, and by PNS.

python docs/picture.py            # writes docs/picture.png
"""

from __future__ import annotations

from pathlib import Path

import pyvista
from pyvista import examples

from pns_common import Mesh, loop, refine, subdivide

OUTPUT = Path(__file__).with_name("picture.png")
LEVELS = 3
AMBER = "#c08457"
VIEW = [(0.5, 1.2, -0.7), (0, 0, 0), (0, 1, 0)]


def main() -> None:
    """Refine the ant, rounding all of it, and draw three panels."""
    ant = pyvista.read(examples.antfile)
    coarse = Mesh(ant.points, ant.regular_faces)
    smooth = {
        "Loop subdivision": refine(coarse, loop(), LEVELS).mesh,
        "PNS": subdivide(coarse, LEVELS, creases=None),
    }
    plotter = pyvista.Plotter(off_screen=True, shape=(1, 3), window_size=(1560, 600), border=False)
    plotter.subplot(0, 0)
    show(plotter, coarse, f"The mesh, {len(coarse.faces)} faces", show_edges=True)
    for place, (name, mesh) in enumerate(smooth.items(), start=1):
        plotter.subplot(0, place)
        show(plotter, mesh, name, smooth_shading=True)
    plotter.screenshot(OUTPUT)
    print(OUTPUT)


def show(plotter: pyvista.Plotter, mesh: Mesh, title: str, **look: bool) -> None:
    """Draw a mesh under its title."""
    surface = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    plotter.add_mesh(
        surface, color=AMBER, edge_color="#5a3a24", specular=0.25, specular_power=25, **look
    )
    plotter.add_text(title, position="lower_edge", font_size=12, color="#30343a")
    plotter.camera_position = VIEW
    plotter.reset_camera()
    plotter.camera.zoom(1.3)


if __name__ == "__main__":
    main()

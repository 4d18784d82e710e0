"""The picture of the guide to few faces: whole levels beside faces where the surface bends.

python docs/few_faces.py          # writes docs/few_faces.png
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista
from picture import show
from shapes import coarse, head, part

from pns_common import refine
from train.metrics.surface_distance import face_tree, nearest

OUTPUT = Path(__file__).with_name("few_faces.png")
LEVELS, FINE, MOST = 2, 5, 5000


def main() -> None:
    """Draw the file, whole levels and so many faces, with edges, for a part and a head."""
    rows = {
        "part": (part(0.02, 0.5), (1.6, 2.2, 2.5)),
        "head": (coarse(head(), 700), (1.4, 0.5, 3.0)),
    }
    plotter = pyvista.Plotter(
        off_screen=True, shape=(len(rows), 3), window_size=(1500, 480 * len(rows)), border=False
    )
    for row, (name, (mesh, towards)) in enumerate(rows.items()):
        fine = refine(mesh, "pns", FINE).mesh.vertices
        size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
        panels = {
            "the file": mesh,
            f"--levels {LEVELS}": refine(mesh, "pns", LEVELS).mesh,
            f"--max-faces {MOST}": refine(mesh, "pns", max_faces=MOST).mesh,
        }
        for column, (title, made) in enumerate(panels.items()):
            error = 100 * nearest(face_tree(made), fine).distance.max() / size
            title = f"{title}: {made.face_count:,} faces, {error:.2f} %"
            print(name, title)
            show(plotter, (row, column), made, towards, title, flat=True)
    plotter.screenshot(OUTPUT)


if __name__ == "__main__":
    main()

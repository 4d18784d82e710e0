"""README's picture: the example part, coarse, refined by the default model, and by its ratio.

python docs/picture.py            # writes docs/picture.png
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from jaxtyping import Float, Int
from matplotlib import colors
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from pns_common import Mesh, Refinement, load_model, pns, refine
from pns_common.files import replacing
from service.meshes.weld import weld
from service.meshfiles.example import part

OUTPUT = Path(__file__).with_name("picture.png")
LEVELS = 2
VIEW = np.array([0.35, -0.72, 0.6])  # from the part towards the eye, y up
LIGHT = np.array([-0.35, 0.75, 0.55])
STEEL = np.array([0.62, 0.68, 0.76])


def main() -> None:
    """Refine the part and draw all three."""
    triangles = part()
    welded = weld(triangles.vertices, triangles.faces)
    coarse = Mesh(welded.points, welded.faces)
    scheme = pns(load_model())
    refined = refine(coarse, scheme, LEVELS)
    # Later levels are Loop's: a face shows what was spent on the one that it was cut from.
    learned = min(scheme.learned_levels or LEVELS, LEVELS)
    ratio = np.repeat(face_ratio(refine(coarse, scheme, learned)), 4 ** (LEVELS - learned))

    figure = Figure(figsize=(12, 4.2), dpi=150, layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    draw(left, coarse.vertices, coarse.faces, np.tile(STEEL, (len(coarse.faces), 1)), 0.35)
    left.set_title(f"Control mesh, {len(coarse.faces):,} faces")
    faces = refined.mesh.faces
    draw(middle, refined.mesh.vertices, faces, np.tile(STEEL, (len(faces), 1)), 0)
    middle.set_title(f"Refined by {LEVELS} levels, {len(faces):,} faces")
    palette = ScalarMappable(colors.Normalize(0, ratio.max()), mpl.colormaps["cividis"])
    draw(right, refined.mesh.vertices, faces, palette.to_rgba(ratio)[:, :3], 0)
    right.set_title("Where the budget is spent")
    figure.colorbar(palette, ax=right, label="proximity ratio  ‖q − q0‖ R / (C h²)", shrink=0.8)
    with replacing(OUTPUT) as temporary:
        figure.savefig(temporary, format="png")
    print(f"{OUTPUT}: largest ratio {ratio.max():.3f}")


def face_ratio(refined: Refinement) -> Float[np.ndarray, " F"]:
    """Return the largest proximity ratio among each face's vertices."""
    return refined.ratio[refined.mesh.faces].max(axis=1)


def draw(
    axes: Axes,
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    base: Float[np.ndarray, "F 3"],
    line_width: float,
) -> None:
    """Draw faces towards the eye, far ones first, in flat shading."""
    forward = VIEW / np.linalg.norm(VIEW)
    right = np.cross([0.0, 0.0, 1.0], forward)
    right /= np.linalg.norm(right)
    up = np.cross(forward, right)
    # The part's axis is y; the picture's is z.
    points = vertices[:, [0, 2, 1]] * [1, -1, 1]
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    seen = np.flatnonzero(normals @ forward > 0)
    order = seen[np.argsort((corners[seen].mean(axis=1)) @ forward)]
    light = np.array([LIGHT[0], -LIGHT[2], LIGHT[1]]) / np.linalg.norm(LIGHT)
    brightness = 0.45 + 0.6 * np.clip(normals[order] @ light, 0, 1)
    shade = np.clip(base[order] * brightness[:, None], 0, 1)
    outline = "#20242a" if line_width else shade
    flat = np.stack([corners[order] @ right, corners[order] @ up], axis=-1)
    # Faces without an outline get one of their own colour, which hides the seams between them.
    axes.add_collection(
        PolyCollection(flat, facecolors=shade, edgecolors=outline, linewidths=line_width or 0.3)
    )
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.axis("off")


if __name__ == "__main__":
    main()

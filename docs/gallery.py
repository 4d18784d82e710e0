"""The gallery's pictures: python docs/gallery.py writes docs/gallery/*.png."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from pns_common import Mesh, load_model, loop, pns, refine, subdivide
from pns_common.files import replacing

FOLDER = Path(__file__).with_name("gallery")
VIEW = np.array([0.35, -0.72, 0.6])  # from the part towards the eye, y up
LIGHT = np.array([-0.35, 0.75, 0.55])
STEEL = np.array([0.62, 0.68, 0.76])


def main() -> None:
    """Draw all of them."""
    FOLDER.mkdir(exist_ok=True)
    for name, figure in (("cube", cube()), ("texture", texture())):
        path = FOLDER / f"{name}.png"
        with replacing(path) as temporary:
            figure.savefig(temporary, format="png")
        print(path)


def panels(count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes beside each other."""
    figure = Figure(figsize=(3.6 * count, 3.9), dpi=110, layout="constrained")
    return figure, list(figure.subplots(1, count))


def show(axes: Axes, mesh: Mesh, title: str, base: np.ndarray | None = None) -> None:
    """Draw a mesh, coarse ones with their edges."""
    base = np.tile(STEEL, (len(mesh.faces), 1)) if base is None else base
    draw(axes, mesh.vertices, mesh.faces, base, 0.4 if len(mesh.faces) < 1000 else 0)
    axes.set_title(f"{title}, {len(mesh.faces):,} faces")


def cube() -> Figure:
    """Return a cube refined by Loop, by PNS, and by PNS with creases."""
    box = trimesh.creation.box().subdivide()
    mesh = Mesh(box.vertices, box.faces)
    edges = box.edges_unique
    ends = mesh.vertices[edges]
    # Along the upper rim: both ends at the top, and on one of its sides.
    upper = (ends[..., 1] == 0.5).all(axis=1)
    upper &= ((np.abs(ends[..., 0]) == 0.5).all(axis=1)) | (
        (np.abs(ends[..., 2]) == 0.5).all(axis=1)
    )
    model = pns(load_model())
    figure, axes = panels(4)
    show(axes[0], mesh, "Control mesh")
    show(axes[1], refine(mesh, loop(), 4).mesh, "Loop")
    show(axes[2], refine(mesh, model, 4).mesh, "PNS")
    show(axes[3], refine(mesh, model, 4, creases=edges[upper]).mesh, "PNS, creases")
    return figure


def texture() -> Figure:
    """Return a coarse sphere with a seam in its texture, and the same refined."""
    coarse = trimesh.creation.uv_sphere(count=[6, 10])
    seamed = with_seam(coarse)
    fine = subdivide(seamed, levels=4)
    figure, axes = panels(2)
    for place, mesh, title in ((axes[0], seamed, "Control mesh"), (axes[1], fine, "PNS")):
        faces = Mesh(mesh.vertices, mesh.faces)
        show(place, faces, title, checks(mesh.visual.uv[mesh.faces].mean(axis=1)))
    return figure


def with_seam(sphere: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a sphere of its own vertex at each corner, with longitude and latitude as texture."""
    corners = sphere.vertices[sphere.faces]
    turn = np.arctan2(corners[..., 1], corners[..., 0]) / (2 * np.pi)
    # Each face lies on one side of the seam, and a pole has no longitude of its own.
    pole = np.hypot(corners[..., 0], corners[..., 1]) < 1e-9
    turn = np.where(pole, np.nan, turn)
    first = np.nanmin(turn, axis=1, keepdims=True)
    turn = np.where(turn - first > 0.5, turn - 1, turn)
    turn = np.where(pole, np.nanmean(turn, axis=1, keepdims=True), turn)
    uv = np.stack([turn, corners[..., 2] / 2], axis=-1).reshape(-1, 2)
    visual = trimesh.visual.TextureVisuals(uv=uv)
    numbers = np.arange(corners.shape[0] * 3).reshape(-1, 3)
    return trimesh.Trimesh(corners.reshape(-1, 3), numbers, visual=visual, process=False)


def checks(uv: Float[np.ndarray, "F 2"]) -> Float[np.ndarray, "F 3"]:
    """Return a colour for each face: checks of a tenth of the way round."""
    dark = np.floor(uv * 10).sum(axis=1) % 2 == 0
    return np.where(dark[:, None], [0.20, 0.33, 0.50], [0.86, 0.80, 0.66])


def draw(
    axes: Axes,
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    base: Float[np.ndarray, "F 3"],
    line_width: float,
) -> None:
    """Draw faces towards the eye, far ones first, in flat shading with highlights."""
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
    # A highlight shows dents and bumps that flat colours hide.
    halfway = (light + forward) / np.linalg.norm(light + forward)
    shine = 0.5 * np.clip(normals[order] @ halfway, 0, 1) ** 60
    shade = np.clip(base[order] * brightness[:, None] + shine[:, None], 0, 1)
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

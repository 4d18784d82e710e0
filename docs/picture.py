"""The first picture of README and docs, and the page's example, of shapes made by code.

python docs/picture.py            # writes docs/picture.png and web/static/example.glb
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista
import trimesh
from shapes import coarse, head, part, plinth, text, tree
from trimesh.transformations import rotation_matrix
from trimesh.visual.material import PBRMaterial

from pns_common import Mesh, loop, refine, sharp_edges, subdivide
from pns_common.files import replace_file
from train.baselines.pn_triangles import pn_triangles
from train.refining import refine as refine_by_method

OUTPUT = Path(__file__).with_name("picture.png")
EXAMPLE = Path(__file__).parents[1] / "web" / "static" / "example.glb"
LEVELS = 3
SPLIT = 40.0  # degrees
SAMPLES = 20_000
CLAY, EDGES = "#c9a27c", "#5a3a24"
# Of the example: the base colour, and how rough.
STONE, SLATE = ([0.62, 0.57, 0.5, 1.0], 0.85), ([0.16, 0.2, 0.25, 1.0], 0.5)


def main() -> None:
    """Draw a row for each shape, and write the example."""
    face = coarse(head(), 700)
    rows = {
        "head": (head(), face, (1.4, 0.5, 3.0)),
        "machine part": (part(5e-4, 0.05), part(0.02, 0.5), (1.6, 2.2, 2.5)),
        "tree": (tree(), coarse(tree(), 700), (1.4, 0.8, 3.0)),
        "text": (text("PNS", 16), text("PNS", 2), (-0.6, 0.5, 3.0)),
    }
    plotter = pyvista.Plotter(
        off_screen=True, shape=(len(rows), 5), window_size=(1600, 330 * len(rows)), border=False
    )
    for row, (name, (original, mesh, towards)) in enumerate(rows.items()):
        creases = sharp_edges(mesh, SPLIT)
        panels = {
            "Loop": refine(mesh, loop(), LEVELS).mesh,
            "PN triangles": refine_by_method(
                mesh, pn_triangles(SPLIT), LEVELS, creases=creases
            ).mesh,
            "PNS": subdivide(mesh, LEVELS),
            "Original": original,
        }
        show(plotter, (row, 0), mesh, towards, f"{len(mesh.faces)} faces", flat=True)
        for column, (title, made) in enumerate(panels.items(), start=1):
            if made is not original:
                title = f"{title}: {distance(made, original):.2f} %"
                print(name, title)
            show(plotter, (row, column), made, towards, title)
    plotter.screenshot(OUTPUT)
    replace_file(EXAMPLE, example(face))


def show(
    plotter: pyvista.Plotter,
    place: tuple[int, int],
    mesh: Mesh,
    towards: tuple[float, float, float],
    title: str,
    *,
    flat: bool = False,
) -> None:
    """Draw a mesh under its title, seen from a direction."""
    plotter.subplot(*place)
    surface = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    shading = (
        {} if flat else {"smooth_shading": True, "split_sharp_edges": True, "feature_angle": 30}
    )
    plotter.add_mesh(
        surface, color=CLAY, show_edges=flat, edge_color=EDGES, specular=0.2, **shading
    )
    plotter.add_text(title, position="lower_edge", font_size=11, color="#30343a")
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    centre, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    plotter.camera_position = [
        centre + 4 * radius * np.array(towards) / np.linalg.norm(towards),
        centre,
        (0, 1, 0),
    ]
    plotter.camera.zoom(1.05)


def distance(made: Mesh, original: Mesh) -> float:
    """Return the mean distance of two surfaces, from the side where it is larger, in % of size."""
    size = np.linalg.norm(np.ptp(original.vertices, axis=0))
    sides = [trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in (made, original)]
    means = []
    for one, other in (sides, sides[::-1]):
        points, _ = trimesh.sample.sample_surface(one, SAMPLES, seed=0)
        surface = pyvista.PolyData.from_regular_faces(other.vertices, other.faces)
        _, nearest = surface.find_closest_cell(points, return_closest_point=True)
        means.append(np.linalg.norm(points - nearest, axis=1).mean())
    return 100 * max(means) / size


def example(face: Mesh) -> bytes:
    """Return a stone head on a plinth as a GLB without normals."""
    scene = trimesh.Scene()
    # The page looks from 30 degrees beside the front: the face is on the side of the result.
    turned = Mesh(face.vertices @ rotation_matrix(-np.pi / 3, [0, 1, 0])[:3, :3], face.faces)
    for name, mesh, (colour, rough) in (("head", turned, STONE), ("plinth", plinth(0.35), SLATE)):
        shape = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        look = PBRMaterial(
            name=name, baseColorFactor=colour, metallicFactor=0.0, roughnessFactor=rough
        )
        shape.visual = trimesh.visual.TextureVisuals(material=look)
        scene.add_geometry(shape, geom_name=name, node_name=name)
    return trimesh.exchange.gltf.export_glb(scene, include_normals=False)


if __name__ == "__main__":
    main()

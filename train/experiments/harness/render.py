"""Shaded renders without a display: by pyvista where it is installed (the extra `render`).

Without it matplotlib draws the same view, flat-shaded and sorted by depth. Camera, light and
colours are one and the same.
"""

import importlib.util
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from pns_common import Mesh
from train.experiments.harness.style import SEQUENTIAL
from train.vectors import face_normals

WIDTH, HEIGHT = 1000, 680
ASPECT = HEIGHT / WIDTH
LIGHT = np.array([-0.35, -0.5, 0.8])
AMBIENT = 0.35
# Half the width of the view, in the patch's units.
HALF_WIDTH = 1.38

CENTRE = np.array([0.0, 0.0, 0.05])


@dataclass(frozen=True, slots=True)
class Camera:
    """A parallel view of a patch; angles in degrees."""

    azimuth: float
    elevation: float

    def axes(self) -> Float[np.ndarray, "3 3"]:
        """Return rows: right, up, and towards the viewer."""
        a, e = np.radians([self.azimuth, self.elevation])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.stack([right, np.cross(towards, right), towards])


def shaded_image(
    mesh: Mesh, values: Float[np.ndarray, " V"], largest: float, camera: Camera
) -> UInt8[np.ndarray, "H W 3"]:
    """Return a picture of a mesh coloured by a value at each vertex, 0 … `largest`."""
    if importlib.util.find_spec("pyvista") is None:
        return by_matplotlib(mesh, values, largest, camera)
    return by_pyvista(mesh, values, largest, camera)


def by_pyvista(mesh: Mesh, values: np.ndarray, largest: float, camera: Camera) -> np.ndarray:
    """Render off-screen through VTK; on Linux it needs EGL or falls back to software."""
    import pyvista

    plotter = pyvista.Plotter(off_screen=True, window_size=[WIDTH, HEIGHT], lighting=None)
    surface = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    plotter.add_mesh(
        surface,
        scalars=values,
        cmap=SEQUENTIAL,
        clim=(0, largest),
        show_scalar_bar=False,
        smooth_shading=False,
        ambient=AMBIENT,
        diffuse=1 - AMBIENT,
        specular=0.15,
    )
    plotter.add_light(pyvista.Light(position=tuple(10 * LIGHT), light_type="scene light"))
    towards = camera.axes()[2]
    plotter.camera_position = [tuple(CENTRE + 8 * towards), tuple(CENTRE), (0, 0, 1)]
    plotter.renderer.enable_parallel_projection()
    plotter.camera.parallel_scale = HALF_WIDTH * ASPECT
    plotter.renderer.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(image)


def by_matplotlib(mesh: Mesh, values: np.ndarray, largest: float, camera: Camera) -> np.ndarray:
    """Draw triangles from back to front, each in one lit colour."""
    seen = (mesh.vertices - CENTRE) @ camera.axes().T
    depth = seen[mesh.faces, 2].mean(axis=1)
    order = np.argsort(depth)
    normals = face_normals(mesh.vertices, mesh.faces)
    # Both sides of a face are lit.
    lit = np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT)))
    colours = SEQUENTIAL(np.clip(values[mesh.faces].mean(axis=1) / largest, 0, 1))[:, :3]
    colours = colours * (AMBIENT + (1 - AMBIENT) * lit)[:, None]
    figure = Figure(figsize=(WIDTH / 150, HEIGHT / 150), dpi=150)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set(xlim=(-HALF_WIDTH, HALF_WIDTH), ylim=(-ASPECT * HALF_WIDTH, ASPECT * HALF_WIDTH))
    shown = np.clip(colours, 0, 1)[order]
    # Edges in the face's own colour close the hairlines between antialiased triangles.
    axes.add_collection(
        PolyCollection(
            list(seen[mesh.faces][order, :, :2]), facecolors=shown, edgecolors=shown, lw=0.3
        )
    )
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()

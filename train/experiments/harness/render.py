"""Shaded renders without a display, by pyvista; on Linux it needs EGL or falls back to software."""

from dataclasses import dataclass

import numpy as np
import pyvista
from jaxtyping import Float, UInt8

from pns_common import Mesh
from train.experiments.harness.style import SEQUENTIAL

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

    def towards(self) -> Float[np.ndarray, "3"]:
        """Return the direction to the viewer."""
        a, e = np.radians([self.azimuth, self.elevation])
        return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def shaded_image(
    mesh: Mesh, values: Float[np.ndarray, " V"], largest: float, camera: Camera
) -> UInt8[np.ndarray, "H W 3"]:
    """Return a picture of a mesh coloured by a value at each vertex, 0 … `largest`."""
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
    towards = camera.towards()
    plotter.camera_position = [tuple(CENTRE + 8 * towards), tuple(CENTRE), (0, 0, 1)]
    plotter.renderer.enable_parallel_projection()
    plotter.camera.parallel_scale = HALF_WIDTH * ASPECT
    plotter.renderer.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(image)

"""A sheet: a column for each variant of a mesh, a row for each look; one light, one scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from .looks import LOOKS, bar, heat, ink
from .stage import RIGHT, UP, VIEW, at, camera, facing, light
from .variants import Shape

# Of a cell, the part that is left free around its mesh; of a cell's height, that of a row of text.
MARGIN, TEXT = 0.06, 0.11
# Each row is so much nearer to the eye than the one above, which would throw its shadow on it.
NEARER = 6.0
FIELDS = {"distance": "Distance from Loop", "ratio": "Proximity ratio"}


@dataclass(frozen=True, eq=False)
class Row:
    """One mesh in some look, in all variants; a cell without a shape is left free."""

    look: str
    shapes: Sequence[Shape]


def build(rows: Sequence[Row], turn: float) -> tuple[float, float]:
    """Put everything on stage, turned (degrees); the sheet's size in cells' widths."""
    columns = max(len(row.shapes) for row in rows)
    extents = [extent(row.shapes, turn) for row in rows]
    heights = [min(1.0, high / wide) if wide > 0 else 1.0 for wide, high in extents]
    total = sum(heights) + TEXT
    left, top = -columns / 2, total / 2
    for column, shape in enumerate(rows[0].shapes):
        text(shape.title, left + column + 0.5, top - 0.6 * TEXT, 0.07)
    top -= TEXT
    for number, (row, (wide, _), height) in enumerate(zip(rows, extents, heights, strict=True)):
        scale = (1 - 2 * MARGIN) / wide
        _build_row(row, (left, top - height / 2, NEARER * number), scale, turn)
        top -= height
    camera(columns, total)
    light()
    return columns, total


def extent(shapes: Sequence[Shape], turn: float) -> tuple[float, float]:
    """Return how wide and high the widest and highest are in the picture, with its margin."""
    sizes = [_box(shape, turn) for shape in shapes]
    wide = max(high[0] - low[0] for low, high in sizes)
    tall = max(high[1] - low[1] for low, high in sizes)
    return max(wide, tall * 0.9), tall / (1 - 2 * MARGIN)


def text(words: str, across: float, along: float, size: float, align: str = "CENTER") -> None:
    """Write letters that face the eye."""
    curve = bpy.data.curves.new("text", "FONT")
    curve.body, curve.size, curve.align_x, curve.align_y = words, size, align, "CENTER"
    curve.materials.append(ink())
    letters = bpy.data.objects.new("text", curve)
    letters.matrix_world = Matrix.Translation(at(across, along, 5)) @ facing()
    bpy.context.scene.collection.objects.link(letters)


def legend(title: str, highest: float, across: float, along: float) -> None:
    """Draw the colours from 0 to ``highest``, with a title."""
    corners = [(-0.3, -0.03, 0), (0.3, -0.03, 0), (0.3, 0.03, 0), (-0.3, 0.03, 0)]
    mesh = bpy.data.meshes.new("bar")
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.materials.append(bar())
    plane = bpy.data.objects.new("bar", mesh)
    plane.matrix_world = Matrix.Translation(at(across, along, 5)) @ facing()
    bpy.context.scene.collection.objects.link(plane)
    text(title, across, along + 0.09, 0.055)
    text("0", across - 0.3, along - 0.08, 0.05)
    text(f"{highest:.3g}", across + 0.3, along - 0.08, 0.05)


def _build_row(row: Row, where: tuple[float, float, float], scale: float, turn: float) -> None:
    left, middle, depth = where
    if row.look in LOOKS:
        material = LOOKS[row.look]()
        shown = [True] * len(row.shapes)
    else:
        highest = max(float(s.fields[row.look].max()) for s in row.shapes if row.look in s.fields)
        material = heat(row.look, highest)
        shown = [row.look in shape.fields for shape in row.shapes]
        free = shown.index(False) if False in shown else 0
        legend(FIELDS[row.look], highest, left + free + 0.5, middle)
    for column, (shape, show) in enumerate(zip(row.shapes, shown, strict=True)):
        if show:
            place(shape, material, at(left + column + 0.5, middle, depth), scale, turn)


def place(
    shape: Shape, material: bpy.types.Material, where: Vector, scale: float, turn: float
) -> None:
    """Put the middle of a shape's picture there."""
    low, high = _box(shape, turn)
    middle = (low + high) / 2
    shift = RIGHT * middle[0] + UP * middle[1] + VIEW * middle[2]
    obj = bpy.data.objects.new(shape.title, _mesh(shape, material))
    obj.matrix_world = Matrix.Translation(where - shift * scale) @ Matrix.Scale(scale, 4)
    obj.rotation_euler.z = math.radians(turn)
    bpy.context.scene.collection.objects.link(obj)


def _mesh(shape: Shape, material: bpy.types.Material) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(shape.title)
    mesh.vertices.add(len(shape.vertices))
    mesh.vertices.foreach_set("co", centred(shape).astype(np.float32).ravel())
    mesh.loops.add(3 * len(shape.faces))
    mesh.loops.foreach_set("vertex_index", shape.faces.astype(np.int32).ravel())
    mesh.polygons.add(len(shape.faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(shape.faces), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    if shape.smooth:
        mesh.shade_smooth()
        ends = np.empty((len(mesh.edges), 2), np.int32)
        mesh.edges.foreach_get("vertices", ends.ravel())
        keys = [len(shape.vertices), 1]
        sharp = np.isin(np.sort(ends, axis=1) @ keys, np.sort(shape.sharp, axis=1) @ keys)
        mesh.attributes.new("sharp_edge", "BOOLEAN", "EDGE").data.foreach_set("value", sharp)
    else:
        mesh.shade_flat()
    for name, values in shape.fields.items():
        field = mesh.attributes.new(name, "FLOAT", "POINT")
        field.data.foreach_set("value", values.astype(np.float32))
    mesh.materials.append(material)
    return mesh


def centred(shape: Shape) -> np.ndarray:
    """Return the vertices around the middle of their box."""
    points = shape.vertices
    return points - (points.min(axis=0) + points.max(axis=0)) / 2


def _box(shape: Shape, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where a turned shape begins and ends along the picture's axes."""
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    turned = centred(shape) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    seen = turned @ np.array([RIGHT, UP, VIEW]).T
    return seen.min(axis=0), seen.max(axis=0)

"""Meshes of quads as snapshots, for what needs no Blender."""

from dataclasses import replace

import numpy as np

from addons.blender.pns_refine.refining.snapshot import Layer, Snapshot
from pns_common import Mesh
from pns_common.carry import rules
from pns_common.mesh.mesh import fans
from pns_common.mesh.topology import following
from tests.support.polygons import CUBE, CUBE_FACES, cylinder

CUBE_POINTS, CUBE_SIDES = 2 * CUBE - 1, np.array(CUBE_FACES)


def layer(domain, rule, values, name="mine", kind="FLOAT", **more):
    """An attribute."""
    return Layer(np.asarray(values), rule, name=name, kind=kind, domain=domain, **more)


def switch(name, domain, on):
    """An attribute of yes and no."""
    return layer(domain, rules.old, np.asarray(on, dtype=bool)[:, None], name, "BOOLEAN")


def cube(sharpness=0.0, *layers):
    """A cube of six quads, whose edges are all this sharp."""
    return snapshot(CUBE_POINTS, CUBE_SIDES, sharpness, layers)


def grid(cells, *layers):
    """A hilly square of so many quads a side."""
    side = cells + 1
    across, along = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    points = np.stack([across, along, 0.2 * np.sin(3 * across) * np.cos(2 * along)], axis=-1)
    first = (np.arange(cells)[:, None] * side + np.arange(cells)).reshape(-1)
    quads = np.stack([first, first + side, first + side + 1, first + 1], axis=1)
    return snapshot(points.reshape(-1, 3), quads, 0.0, layers)


def drum():
    """Seven quads between two lids of seven corners."""
    points, faces = cylinder()
    return snapshot(points, faces)


def cut(shape):
    """The same mesh, whose polygons are the triangles."""
    count = len(shape.triangles)
    starts, corners = 3 * np.arange(count + 1), np.arange(3 * count).reshape(-1, 3)
    return replace(shape, corners=corners, polygons=np.arange(count), polygon_corners=starts)


def snapshot(points, faces, sharpness=0.0, layers=()):
    """The snapshot of these faces, each cut along the diagonals from its first corner."""
    mesh = Mesh(points, faces)
    corners, polygons = fans(mesh.offsets)
    sides = np.stack([mesh.corners, mesh.corners[following(mesh.offsets)]], axis=1)
    edges = np.unique(np.sort(sides, axis=1), axis=0).astype(np.int64)
    return Snapshot(
        points=points,
        triangles=mesh.corners[corners].astype(np.int64),
        corners=corners,
        polygons=polygons,
        polygon_corners=mesh.offsets,
        edges=edges,
        crease_sharpness=np.broadcast_to(np.asarray(sharpness, float), len(edges)).copy(),
        vertex_sharpness=np.zeros(len(points)),
        groups=np.zeros((len(points), 0)),
        offsets=np.zeros((0, len(points), 3)),
        layers=tuple(layers),
    )

"""The quads that Catmull–Clark's first level makes of polygons, as a control mesh of triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.carry.carried import in_type_of
from pns_common.mesh.creases import Creases
from pns_common.mesh.mesh import Cleaned, Mesh
from pns_common.mesh.rows import marked
from pns_common.mesh.topology import build_topology, halves_of
from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK

from ...meshes.barycentric_grid import HALVES, barycentric_grid
from ...meshes.uv_charts import refined_charts, uv_blend
from ...meshes.weld import Weld
from ...options import Options
from ...stages import Stages
from ..read.primitives import TrianglePrimitive
from ..read.schema import Accessor
from .attributes import Columns, RefinedPrimitive, blend, refined_primitives
from .control_mesh import ControlMesh, slices
from .mesh_refine import RefinedMesh
from .normals import own_of_rows
from .polygons import Polygons, PolygonSplit, polygon_ids

PAIR = HALVES.reshape(-1)


def refined_polygons(
    control: ControlMesh,
    polygons: Polygons,
    refined: RefinedMesh,
    creases: Creases,
    options: Options,
    stages: Stages,
) -> list[RefinedPrimitive]:
    """Return the refined primitives of a control mesh that was refined as polygons."""
    levels, finer = options.levels - 1, level_one(control, polygons, creases, options)
    blend = uv_blend(options, creases_below(polygons, creases), CATMULL_CLARK)
    ids = polygon_ids(polygons, refined.mesh, levels)
    made = refined_primitives(finer, refined, barycentric_grid(levels), blend, stages, ids=ids)
    sources = {primitive.number: primitive for primitive in control.primitives}
    return [replace(each, source=sources[each.source.number]) for each in made]


def creases_below(polygons: Polygons, creases: Creases) -> Creases:
    """Return the creases of the quads that the first level makes of polygons."""
    named = creases.named
    if named is None or not len(named) or not creases.sharp_at(1):
        return Creases(border=creases.border)
    mesh = polygons.mesh.topology()
    sharpness, corners = creases.sharpness, creases.soft_corners
    new = np.zeros(len(mesh.edges) + mesh.face_count)
    return replace(
        creases,
        named=halves_of(mesh, mesh.rows_of(named)),
        sharpness=None if sharpness is None else np.repeat(sharpness, 2),
        levels=None if creases.levels is None else creases.levels - 1,
        soft_corners=None if corners is None else np.concatenate([corners, new]),
    )


def level_one(
    control: ControlMesh, polygons: Polygons, creases: Creases, options: Options
) -> ControlMesh:
    """Return the control mesh of the triangles of the quads of polygons.

    The triangles of a quad follow each other. Only what the refined positions do not say is right:
    positions are those of a split without masks.
    """
    mesh = polygons.mesh.topology()
    points = PolygonSplit(mesh).linear(polygons.mesh.vertices)
    quads = _quads_of(polygons)
    own = own_of_rows(control)
    made: list[TrianglePrimitive] = []
    shares: list[Float[np.ndarray, " N"]] = []
    ends = np.cumsum(control.kept_counts)
    owner = np.searchsorted(ends, polygons.corners[polygons.offsets[:-1]] // 3, side="right")
    vertex_of, faces = [], []
    for number, primitive in enumerate(control.primitives):
        first, last = np.searchsorted(owner, [number, number + 1])
        start, stop = polygons.offsets[[first, last]].tolist()
        corners = polygons.corners[start:stop] - 3 * (ends[number] - control.kept_counts[number])
        rows = primitive.corners[control.kept[number]].reshape(-1)[corners]
        offsets = polygons.offsets[first : last + 1] - start
        used = np.flatnonzero(marked(rows, len(primitive.rows)))
        rows = np.searchsorted(used, rows)
        primitive = _taken(primitive, used)
        split = PolygonSplit(build_topology((rows, offsets), len(used)))
        vertices = control.cleaned.vertex_map[control.weld.vertex_of[control.rows[number]][used]]
        made.append(_split_primitive(primitive, split, vertices[rows], creases, options))
        if own is not None:
            shares.append(split.linear(own[control.rows[number]][used, None])[:, 0])
        of_row = np.full(len(made[-1].rows), -1, dtype=np.int64)
        of_row[split.quads] = quads[start:stop]
        vertex_of.append(of_row)
        faces.append(quads[start:stop][:, PAIR].reshape(-1, 3))
    every = np.concatenate(faces)
    identity = np.arange(len(every))
    return replace(
        control,
        primitives=made,
        weld=Weld(points, every, np.concatenate(vertex_of)),
        rows=slices([len(primitive.rows) for primitive in made]),
        kept=[np.ones(len(own_faces), dtype=bool) for own_faces in faces],
        cleaned_or_none=Cleaned(
            Mesh.of_refined(points, every), np.arange(len(points)), identity, identity, 0, 0, 0
        ),
        authored=False,
        own=np.concatenate(shares) if own is not None else None,
    )


def _quads_of(polygons: Polygons) -> Int[np.ndarray, "H 4"]:
    """Return the vertices of the quads that the first level makes of polygons and their copies."""
    quads = CATMULL_CLARK.faces(polygons.mesh.topology(), Blocks(), np.int64)[polygons.source]
    turned = np.repeat(polygons.turned, np.diff(polygons.offsets))
    quads[turned] = quads[turned][:, [0, 3, 2, 1]]
    return quads


def _taken(primitive: TrianglePrimitive, rows: Int[np.ndarray, " U"]) -> TrianglePrimitive:
    """Return a primitive with some of its rows; its corners are left as they were."""
    attributes, *targets = (
        {name: values[rows] for name, values in columns.items()}
        for columns in (primitive.attributes, *primitive.targets)
    )
    return replace(
        primitive, rows=primitive.rows[rows], attributes=attributes, targets=tuple(targets)
    )


def _split_primitive(
    primitive: TrianglePrimitive,
    split: PolygonSplit,
    vertex: Int[np.ndarray, " H"],
    creases: Creases,
    options: Options,
) -> TrianglePrimitive:
    """Return the triangles of a primitive's quads; `vertex` is that of each corner of polygons."""

    def columns(before: Columns, accessors: dict[str, Accessor]) -> Columns:
        after: Columns = {}
        for name, values in before.items():
            if name == "TANGENT" and values.shape[1] > 3:
                along, sign = split.linear(values[:, :3]), split.nearest(values[:, 3:])
                after[name] = np.hstack([along, sign]).astype(values.dtype)
            elif name.startswith("TEXCOORD_") and before is primitive.attributes and smooth:
                after[name] = in_type_of(
                    values, _smooth(values, split, vertex, creases, limit=on_limit)
                )
            else:
                after[name] = blend(name, split, values, accessors[name])
        return after

    smooth, on_limit = options.uv == "smooth", options.limit and options.levels == 1
    attributes = columns(primitive.attributes, primitive.accessors)
    return replace(
        primitive,
        rows=np.arange(len(attributes["POSITION"])),
        corners=split.quads[:, PAIR].reshape(-1, 3),
        attributes=attributes,
        targets=tuple(map(columns, primitive.targets, primitive.target_accessors)),
    )


def _smooth(
    uv: Shaped[np.ndarray, "N 2"],
    split: PolygonSplit,
    vertex: Int[np.ndarray, " H"],
    creases: Creases,
    *,
    limit: bool,
) -> Float[np.ndarray, "M 2"]:
    """Return texture coordinates of a split that is smooth inside charts."""
    mesh = split.mesh
    asked = uv[mesh.corners], vertex, mesh.offsets, 1, creases, CATMULL_CLARK
    values, corners = refined_charts(*asked, limit=limit)
    made = np.zeros((mesh.vertex_count + len(mesh.edges) + mesh.face_count, 2))
    made[split.quads.reshape(-1)] = values[corners.reshape(-1)]
    return made

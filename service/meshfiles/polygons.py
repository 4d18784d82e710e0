"""Refine polygons as polygons, by Catmull–Clark: quads come out, and what corners and faces carry.

Values at corners follow the split of the faces that they are at: those of one vertex with one value
stay one, so seams stay seams. Where some faces are refined alone, all are, and of the others only
the corners are kept that `pns_common.mesh.selection` keeps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int

from pns_common.carry import rules
from pns_common.carry.carried import Carrier, Column
from pns_common.mesh.creases import Creases
from pns_common.mesh.mesh import Mesh, fans
from pns_common.mesh.normals import ONE_TRIANGLE, angle_weighted_normals, smooth_fans
from pns_common.mesh.rows import distinct_rows, dot, number_by_first_appearance
from pns_common.mesh.topology import following
from pns_common.operator.scheme import Scheme
from pns_common.parallel import Blocks, available_threads
from pns_common.refined import Refinement
from pns_common.refinement import refine
from pns_common.report import Report
from pns_common.schemes import CATMULL_CLARK

from ..advice import Bends, count_bends
from ..changes import Change, counted
from ..errors import UnrefinableError
from ..gltf.refine.changes import near_miss_changes, near_misses
from ..gltf.refine.mesh_refine import GATE, RATIO
from ..gltf.refine.normals import safe_unit
from ..meshes.creases import chosen_creases, hard_edges
from ..meshes.weld import Weld, weld, weld_by_label, weld_within
from ..options import Options
from ..stages import Stages
from .mesh_file import COLOUR, NONE, NORMAL, UV, Labels, Layer, MeshFile, offsets_of
from .parts import chosen_of
from .triangulate import cut_blocks

# All four triangles of a quad: its normal does not depend on a diagonal.
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]])


@dataclass(frozen=True, eq=False)
class _Control:
    """Polygons to refine.

    Attributes:
        mesh: welded.
        places: (H,) which corner of the file each of its corners is.
        faces: (F,) which face of the file each of its faces is.
        vertices: (V,) a vertex of the file at each of its vertices.
        near: vertices that were joined within the tolerance.
    """

    mesh: Mesh
    places: Int[np.ndarray, " H"]
    faces: Int[np.ndarray, " F"]
    vertices: Int[np.ndarray, " V"]
    near: int


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined mesh file.

    Attributes:
        mesh: the mesh.
        corners: vertices of the file that were refined, one or more times each.
        primitives: how many it was refined as.
        degenerate: number of faces without three different vertices.
        copies: number of faces with the vertices of an earlier face.
        report: the operator's.
        bends: steep edges, and those in doubt.
        changes: what was joined or dropped.
    """

    mesh: MeshFile
    corners: Int[np.ndarray, " C"]
    primitives: int
    degenerate: int
    copies: int
    report: Report
    bends: Bends
    changes: list[Change]


def refine_polygons(
    mesh: MeshFile, scheme: Scheme, options: Options, stages: Stages, *, traced: bool
) -> Refined:
    """Refine polygons; `traced` asks for the parents of vertices.

    Raises:
        MeshError: a face cannot be refined.
        UnrefinableError: no face of three different vertices.
    """
    with stages.stage("weld", 0.0, 0.1):
        control = _control(mesh, options)
        creases = _creases(control, mesh, options, scheme)
    picked = chosen_of(mesh, options)
    if picked is not None:
        picked = picked[control.faces]
        if not picked.any():
            raise UnrefinableError("no chosen face has three different vertices")
    with stages.stage("refine", 0.1, 0.7):
        made = refine(
            control.mesh,
            scheme,
            options.levels,
            options.reference_length,
            limit=options.limit,
            creases=creases,
            faces=picked,
            progress=lambda done, total: stages.reach(done / total),
        )
    with stages.stage("attributes", 0.7, 1.0):
        refined = _with_layers(mesh, control, made, options)
    if traced:
        parents, shape = made.parents, (len(refined.vertices), len(mesh.vertices))
        parents = replace(parents, columns=control.vertices[parents.columns], shape=shape)
        refined = replace(refined, parents=parents)
    (misses,) = near_misses(control.mesh.vertices, made.topologies[0], [made.reference_length])
    told = {
        "joined": control.near,
        "repeated-corners": int(mesh.sizes[control.faces].sum()) - len(control.places),
    }
    changes = counted(told)
    refined_faces = np.isin(np.repeat(np.arange(len(mesh.sizes)), mesh.sizes), control.faces)
    return Refined(
        mesh=refined,
        corners=mesh.corners[refined_faces],
        primitives=1,
        degenerate=len(mesh.sizes) - len(control.faces),
        copies=0,
        report=made.report,
        bends=count_bends(control.mesh, creases, options)[0],
        changes=[*changes, *near_miss_changes(misses, "")],
    )


def _control(mesh: MeshFile, options: Options) -> _Control:
    """Weld vertices; drop corners that repeat the one before, and faces of fewer than three."""
    welded, near = _welded(mesh, options)
    corner = welded.faces.reshape(-1)
    differs = corner != corner[following(mesh.offsets)]
    sizes = np.add.reduceat(differs, mesh.offsets[:-1], dtype=np.int64)
    faces = np.flatnonzero(sizes >= 3)
    if not len(faces):
        raise UnrefinableError("no face has three different vertices")
    kept = differs & np.repeat(sizes >= 3, mesh.sizes)
    places = np.flatnonzero(kept)
    number, first = number_by_first_appearance(corner[places])
    points = welded.points[corner[places[first]]]
    made = Mesh(points, (number, offsets_of(sizes[faces])))
    return _Control(made, places, faces, mesh.corners[places[first]], near)


def _welded(mesh: MeshFile, options: Options) -> tuple[Weld, int]:
    """Weld corners, one a row; return also how many vertices the tolerance joined."""
    if options.weld == "position":
        exact = weld(mesh.vertices, mesh.corners[:, None])
        near = weld_within(exact, options.weld_tolerance, options.weld_unit, None)
        return near, len(exact.points) - len(near.points)
    labels = mesh.corners
    if options.weld == "off":
        rows = [layer.rows for layer in mesh.layers.values()]
        labels = distinct_rows(np.stack([mesh.corners, *rows], axis=1))
    corners = np.arange(len(labels))[:, None]
    return weld_by_label(mesh.vertices[mesh.corners], corners, labels), 0


def _creases(control: _Control, mesh: MeshFile, options: Options, scheme: Scheme) -> Creases:
    found = chosen_creases(control.mesh, options, scheme, lambda: _hard_edges(control, mesh))
    if options.crease != "auto" or mesh.tags is None:
        return found
    vertex_of = np.full(len(mesh.vertices), NONE)
    vertex_of[mesh.corners[control.places]] = control.mesh.corners
    return mesh.tags.creases(control.mesh, vertex_of, found)


def _hard_edges(control: _Control, mesh: MeshFile) -> Int[np.ndarray, "N 2"]:
    """Return the edges that normals make hard; a corner without one makes none so."""
    normals = mesh.layers.get(NORMAL)
    if normals is None:
        return np.zeros((0, 2), dtype=np.int64)
    label = distinct_rows(normals.values)
    label[~normals.values.any(axis=1)] = NONE
    rows = normals.rows[control.places]
    return hard_edges(control.mesh.topology(), np.where(rows < 0, NONE, label[rows]))


def _with_layers(mesh: MeshFile, control: _Control, made: Refinement, options: Options) -> MeshFile:
    """Return the refined mesh with all that the file's corners and faces carry."""
    corners, selected = made.mesh.corners, made.selected
    carrier = Carrier(made.topologies, CATMULL_CLARK, options.limit, Blocks(available_threads()))
    of_face = control.faces[carrier.face_parents]
    layers = {
        name: _refined(name, layer, control, carrier, options)
        for name, layer in mesh.layers.items()
    }
    still = np.zeros(0, dtype=np.int64)
    if selected is not None:
        of_face = of_face[selected.places[selected.offsets[:-1]] // 4]
        still = np.flatnonzero(np.isin(corners, np.flatnonzero(selected.still)))
        source = control.places[selected.places[still] // 4**options.levels]
        for name, layer in mesh.layers.items():
            layers[name] = _kept(layers[name], selected.places, still, layer, source)
    if options.normals == "smooth":
        layers[NORMAL] = _on_limit(_smooth_normals(made), made, still)
    elif NORMAL in layers:
        before = layers[NORMAL]
        own = _on_limit(_normals(made.mesh, before.rows), made, still)
        layers[NORMAL] = _with(own, still, before, still)
    if options.diagnostics == "full":
        scalars = {RATIO: made.ratio, GATE: made.gate}
        layers |= {
            name: Layer(np.array(values)[:, None], corners) for name, values in scalars.items()
        }
    return replace(
        mesh,
        vertices=made.mesh.vertices,
        offsets=made.mesh.offsets,
        corners=corners,
        layers=layers,
        face_values={name: values[of_face] for name, values in mesh.face_values.items()},
        labels={kind: Labels(own.names, own.of_face[of_face]) for kind, own in mesh.labels.items()},
        changes=(),
        tags=None,
    )


def _kept(
    layer: Layer,
    places: Int[np.ndarray, " H"],
    still: Int[np.ndarray, " N"],
    before: Layer,
    source: Int[np.ndarray, " N"],
) -> Layer:
    """Return a layer at `places`; corners that stay have the values of `before` at `source`."""
    made = _with(Layer(layer.values, layer.rows[places]), still, before, source)
    used = np.unique(made.rows[made.rows >= 0])
    rows = np.where(made.rows >= 0, np.searchsorted(used, made.rows), NONE)
    return Layer(made.values[used], rows)


def _with(
    layer: Layer, at: Int[np.ndarray, " N"], other: Layer, source: Int[np.ndarray, " N"]
) -> Layer:
    """Return a layer with the values at some corners that another one has at `source`."""
    rows, theirs = layer.rows[at], other.rows[source]
    both = (rows >= 0) & (theirs >= 0)
    if not both.any():
        return layer
    values = np.array(layer.values)
    values[rows[both]] = other.values[theirs[both]]
    return Layer(values, layer.rows)


def _refined(
    name: str, layer: Layer, control: _Control, carrier: Carrier, options: Options
) -> Layer:
    """Refine values at corners: corners of one vertex with one value stay one."""
    rows = layer.rows[control.places]
    values = layer.values[np.maximum(rows, 0)]
    if name == UV and options.uv == "smooth":
        column = Column(values, rules.smooth)
    else:
        whole = values.dtype.kind != "f" and name != COLOUR
        column = Column(values, rules.nearest if whole else rules.linear, same=rows[:, None])
    values, corners = carrier.at_points(column)
    bare = np.logical_or.reduceat(rows < 0, control.mesh.offsets[:-1])
    if not bare.any():
        return Layer(values, corners)
    bare = np.repeat(bare[carrier.face_parents], 4)
    used, inside = np.unique(corners[~bare], return_inverse=True)
    corners = np.full(len(corners), NONE)
    corners[~bare] = inside
    return Layer(values[used], corners)


def _normals(mesh: Mesh, groups: Int[np.ndarray, " C"]) -> Layer:
    """Return the normals of groups of corners; corners of no group have none."""
    own = np.where(groups >= 0, groups, groups.max(initial=0) + 1 + np.arange(len(groups)))
    number, _ = number_by_first_appearance(own)
    count, blocks = int(number.max()) + 1, Blocks(available_threads())
    if (np.diff(mesh.offsets) == 4).all():
        rows, triangles = (mesh.corners.reshape(-1, 4), number.reshape(-1, 4)), TRIANGLES
    else:
        places, triangles = _covering(mesh), ONE_TRIANGLE
        rows = mesh.corners[places], number[places]
    normals = angle_weighted_normals(mesh.vertices, *rows, count, blocks, triangles)
    return Layer(safe_unit(normals), np.where(groups >= 0, number, NONE))


def _on_limit(layer: Layer, made: Refinement, still: Int[np.ndarray, " S"]) -> Layer:
    """Return the limit surface's normals for groups that are alone at their vertex.

    `still` are the corners that were not refined.
    """
    if made.normals is None:
        return layer
    vertex, corners = np.empty(len(layer.values), dtype=np.int64), made.mesh.corners
    used = layer.rows != NONE
    vertex[layer.rows[used]] = corners[used]
    exact = made.normals[vertex]
    alone = (np.bincount(vertex, minlength=len(made.normals)) == 1)[vertex] & exact.any(axis=1)
    alone[layer.rows[still]] = False
    # A face that is turned over shows the other side.
    side = np.where(dot(exact, layer.values) < 0, -1.0, 1.0)[:, None]
    return Layer(np.where(alone[:, None], side * exact, layer.values), layer.rows)


def _covering(mesh: Mesh) -> Int[np.ndarray, "T 3"]:
    """Return triangles that cover each face twice, by their corners: all four of a quad."""
    starts, sizes = mesh.offsets[:-1], np.diff(mesh.offsets)
    others = np.flatnonzero(sizes != 4)
    offsets = offsets_of(sizes[others])
    place = np.arange(offsets[-1]) + np.repeat(starts[others] - offsets[:-1], sizes[others])
    rest = MeshFile(mesh.vertices, offsets, mesh.corners[place])
    cuts = np.concatenate([cut.places for cut in cut_blocks(rest)])
    quads = (starts[sizes == 4][:, None, None] + TRIANGLES).reshape(-1, 3)
    return np.concatenate([quads, np.repeat(place[cuts], 2, axis=0)])


def _smooth_normals(made: Refinement) -> Layer:
    """Return normals that are smooth but across the edges that are sharp at the last level."""
    mesh, last, sharp = made.mesh, made.topologies[-1], None
    if last.is_sharp.any():
        fine = CATMULL_CLARK.split(last, Blocks())
        begins = fine.is_sharp[fine.corner_edges]
        begins = begins if made.selected is None else begins[made.selected.places]
        ends = mesh.corners[following(mesh.offsets)]
        sharp = np.stack([mesh.corners, ends], axis=1)[begins]
    places, _ = fans(mesh.offsets)
    made_fans = smooth_fans(mesh.corners[places], len(mesh.vertices), sharp)
    groups = np.empty(len(mesh.corners), dtype=np.int64)
    # Of two triangles at a corner the first counts.
    groups[places[::-1]] = made_fans[::-1]
    return _normals(mesh, groups)

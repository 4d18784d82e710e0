"""One part of a large mesh, as a worker does it: counted once, then refined and written."""

from __future__ import annotations

import json
import resource
import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int

from pns_common.base.whole_file import replace_file, replacing
from pns_common.connectivity.creases import NO_CREASES
from pns_common.crease_lines import turns_of_parts
from pns_common.errors import PnsError
from pns_common.fused import kernel_blocks, load_kernels
from pns_common.geometry.sharp_edges import edges_sharper_than
from pns_common.geometry.side_lengths import SideLengths
from pns_common.pieces import Piece, RefinedPiece, ThinHaloError, halo_rings, refine_piece
from pns_common.pieces.halo import ROWS_REACH
from pns_common.schemes import Scheme

from ...errors import LimitError, NoModelError, UnrefinableError
from ...gltf.subdivide import make_scheme
from ...meshes.shape_creases import lines_of
from ...options import Options
from ..same_model import check_same_model
from .adjacency import Adjacency
from .arrays import ArrayMesh, open_mesh
from .cutout import Cutout, cutout
from .numbering import BASES, Numbering, shown_first
from .partition import Parts
from .target import Target
from .tiles import Tiles, write_tile

COUNT, REFINE = "count", "refine"
# Names of what they leave behind.
_DONE = {COUNT: "count-{:05}.npz", REFINE: "part-{:05}.json"}
# What may be counted of a part with the faces around it: edges that own faces are first to show,
# and own edges that turn by more than each of the angles of lines.
EDGES, TURNS = "edges", "turns"

# No part takes less for a face that it makes, beside what any worker takes (docs/scale.md).
LEAST_BYTES_PER_FACE = 150


@dataclass(frozen=True)
class PartTask:
    """What a worker is told of a part.

    Attributes:
        stage: COUNT or REFINE.
        mesh, work: folders of the mesh and of what is known of it.
        length, sides: R, and the sides of all faces.
        model_hash: of the model that the run began with; None without one.
        counts: what COUNT counts: EDGES, TURNS, or both.
        vertices: of each level of the whole mesh; empty while it is counted.
        target: where to write; None while it is counted.
        edged: whether the whole is an edged mesh, where lines ask for that.
        memory: bytes that the part may take; None: any.
        threads: of the worker.
    """

    stage: str
    part: int
    parts: int
    mesh: str
    work: str
    options: Options
    model: str | None
    model_hash: str | None
    length: float
    sides: SideLengths
    counts: tuple[str, ...] = ()
    vertices: tuple[int, ...] = ()
    target: Target | Tiles | None = None
    memory: int | None = None
    edged: bool | None = None
    threads: int = 1
    attempt: int = 1


@dataclass(frozen=True)
class PartDone:
    """A part that was done: in which try, and what it took of time and memory."""

    part: int
    attempts: int
    seconds: float
    peak_bytes: int


def done_file(work: Path, stage: str, part: int) -> Path:
    """Return what is there as soon as a part is done."""
    return work / _DONE[stage].format(part)


def run_part(task: PartTask) -> PartDone:
    """Do a part.

    Raises:
        UnrefinableError: it cannot be refined.
        LimitError: with its halo it is larger than its memory.
        NoModelError: there is no such model here.
        OSError: a file cannot be read or written.
    """
    began, work = time.perf_counter(), Path(task.work)
    file = done_file(work, task.stage, task.part)
    mesh, adjacency = open_mesh(Path(task.mesh)), Adjacency.open(work)
    own = Parts.open(work, task.parts).own(task.part)
    if task.stage == COUNT:
        rings = max(_COUNT_RINGS[name] for name in task.counts)
        piece = cutout(mesh, adjacency, own, rings).piece
        counted: dict[str, Any] = {name: _COUNTS[name](task, piece) for name in task.counts}
        with replacing(file) as temporary, temporary.open("wb") as stream:
            np.savez(stream, **counted)
    else:
        try:
            report = _refine(task, mesh, adjacency, own)
        except PnsError as error:
            # It crosses to the driver, which not all of these can.
            raise UnrefinableError(f"part {task.part}: {error}") from error
        replace_file(file, json.dumps(report).encode())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return PartDone(task.part, task.attempt, time.perf_counter() - began, peak)


def _refine(
    task: PartTask, mesh: ArrayMesh, adjacency: Adjacency, own: Int[np.ndarray, " N"]
) -> dict[str, Any]:
    """Refine the part, write it, and say what was done."""
    load_kernels()
    levels = task.options.levels
    scheme = _scheme(task).fitted(lambda: task.sides)
    rings, cut, made = _surely_refined(task, scheme, mesh, adjacency, own)
    box = None
    if isinstance(task.target, Tiles):
        box = write_tile(task.target, task.part, cut, made, levels)
    elif task.target is not None:
        bases = np.load(Path(task.work) / BASES, mmap_mode="r")
        write_part(task.target, cut, made, Numbering(bases, list(task.vertices)), levels)
    return {
        "own": len(own),
        "halo": len(cut.faces) - len(own),
        "rings": rings,
        "box": box,
        "multi_fan_vertices": made.multi_fan_vertices,
        "levels": [tally.as_dict() for tally in made.tallies],
    }


def _edges(task: PartTask, piece: Piece) -> Int[np.ndarray, "N L"]:
    return shown_first(piece, task.options.levels).astype(np.uint32)


def _turns(task: PartTask, piece: Piece) -> Int[np.ndarray, " 2"]:
    load_kernels()
    lines = lines_of(task.options, _scheme(task))
    of_own = piece.own.astype(np.int64)
    return turns_of_parts(piece.points, piece.faces, lines, of_own, 2)[1]


_COUNTS = {EDGES: _edges, TURNS: _turns}
_COUNT_RINGS = {EDGES: 1, TURNS: ROWS_REACH}


def _surely_refined(
    task: PartTask,
    scheme: Scheme,
    mesh: ArrayMesh,
    adjacency: Adjacency,
    own: Int[np.ndarray, " N"],
) -> tuple[int, Cutout, RefinedPiece]:
    """Refine the part with as many rings around it as it turns out to need; return how many.

    Raises:
        PnsError: it cannot be refined.
        LimitError: with its halo it is larger than its memory.
    """
    levels, guard_rings = task.options.levels, 1
    lines = lines_of(task.options, scheme)
    if mesh.creases is not None:
        lines = NO_CREASES  # as in Python: who names creases gets those
    looks, lines = lines.line_angle is not None, replace(lines, edged=task.edged)
    while True:
        rings = halo_rings(scheme, levels, guard_rings, lines)
        cut = cutout(mesh, adjacency, own, rings)
        _check_memory(task, cut, adjacency)
        piece = with_angle_creases(cut.piece, task.options.crease_angle)
        piece = replace(piece, creases=lines) if looks else piece
        blocks = kernel_blocks(task.threads)
        try:
            return rings, cut, refine_piece(piece, scheme, levels, task.length, blocks)
        except ThinHaloError:
            # Only the guard goes farther than is known beforehand, and in all of the mesh no more.
            guard_rings *= 2
            if cut.is_all or halo_rings(scheme, levels, guard_rings, lines) == rings:
                raise


def _check_memory(task: PartTask, cut: Cutout, adjacency: Adjacency) -> None:
    """Refuse a part that would take more than its memory for certain, rather than be killed for it.

    Raises:
        LimitError: it would.
    """
    least = LEAST_BYTES_PER_FACE * len(cut.faces) * 4**task.options.levels
    if task.memory is None or least <= task.memory:
        return
    hub = int(cut.vertices[np.argmax(adjacency.valence(cut.vertices))])
    valence = int(adjacency.valence(np.array([hub]))[0])
    raise LimitError(
        f"part {task.part} has {cut.piece.own.sum():,} faces of its own and, with the halo that "
        f"they need, {len(cut.faces):,}, which take {least / 2**30:.1f} GiB or more; at vertex "
        f"{hub} alone there are {valence:,}. More --memory, or fewer --levels",
        limit="part-memory",
        allowed=task.memory,
        found=least,
    )


def write_part(
    target: Target, cut: Cutout, made: RefinedPiece, numbering: Numbering, levels: int
) -> None:
    """Write own vertices and faces under the whole mesh's numbers."""
    edges = [numbering.of_edges(level, cut.faces, made.openers[level]) for level in range(levels)]
    ids = np.concatenate([cut.vertices, *edges])
    own = made.own_vertices
    target.write_vertices(ids[own], made.points[own])
    many = 4**levels
    children = made.faces.reshape(-1, many, 3)[cut.piece.own]
    target.write_children(cut.faces[cut.piece.own], ids[children])


def with_angle_creases(piece: Piece, angle: float | None) -> Piece:
    """Return the piece with its edges sharper than ``angle`` as creases too."""
    if angle is None:
        return piece
    sharp = edges_sharper_than(piece.points, piece.faces, angle)
    return replace(piece, creases=piece.creases.with_named(sharp))


def _scheme(task: PartTask) -> Scheme:
    """Return the scheme of a task.

    Raises:
        NoModelError: its model is not the one that the run began with, or there is none.
    """
    scheme = scheme_of(task.options, task.model)
    check_same_model(task.model, scheme.model_hash, task.model_hash)
    return scheme


@cache
def scheme_of(options: Options, model: str | None) -> Scheme:
    """Make the scheme of some options, once a worker.

    Raises:
        NoModelError: there is no such model, or it cannot be used.
    """
    from pns_common import ModelError, load_model

    if options.scheme != "pns":
        return make_scheme(options, None)
    try:
        return make_scheme(options, load_model(model))
    except ModelError as error:
        raise NoModelError(str(error)) from error

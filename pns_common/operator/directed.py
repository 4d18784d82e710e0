"""Networks of directed edges: their features, rounds of messages and answers on a mesh.

Each edge is two directed edges, a → b and b → a, with a state each. After r rounds a state depends
on what lies within r + 1 rings of the edge, and on nothing else. Features are in the edge's own
frame and in units of its length; sums around vertices are taken in double precision. Edges that a
user marks as sharp are seen as if they were not marked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float, Integer, UInt32

from pns_common.errors import ModelError
from pns_common.kernels import directed as kernels
from pns_common.operator.level import Level

# Edges of one call of a network, both ways: a chunk of rows.
EDGES_AT_ONCE = 2048

# Rows (N, K) → rows (N, A).
Network = Callable[[Float[np.ndarray, "N K"]], Float[np.ndarray, "N A"]]


@dataclass(frozen=True)
class DirectedNetworks:
    """The networks of a model of directed edges.

    Attributes:
        encoder: features → states, (N, W).
        rounds: of each the vertices' network and the edges': what is pooled at a vertex, (N, 2 W) →
            what it tells the edges that leave it and those that reach it, (N, 2 H); messages,
            (N, 2 W + H) → what is added to states.
        heads: states → answers, (N, 8): z, y, two logits; (N, 9) with a height for faces.
        width, hidden: W and H.
        answers: 8 or 9.
        feature_type: the floating type of all rows between them.
    """

    encoder: Network
    rounds: tuple[tuple[Network, Network], ...]
    heads: Network
    width: int
    hidden: int
    answers: int = kernels.FACE
    feature_type: type[np.floating[Any]] = np.float32


@dataclass(frozen=True, eq=False)
class Answers:
    """Answers of the network on a mesh, in world axes and in units of h.

    Attributes:
        edges, vertices: (E, 3), (V, 3): F z, where the vertex is asked to go from flat.
        faces: (F,) along the normals; (0,) where no head is for them.
        sharpness, corners: (E,), (V,) the sigmoids of the logits.
    """

    edges: Float[np.ndarray, "E 3"]
    vertices: Float[np.ndarray, "V 3"]
    faces: Float[np.ndarray, " F"]
    sharpness: Float[np.ndarray, " E"]
    corners: Float[np.ndarray, " V"]


def directed_features(
    level: Level, begin: int, end: int, feature_type: type[np.floating[Any]] = np.float32
) -> Float[np.ndarray, "D 28"]:
    """Return the features of edges begin … end − 1: of each a → b, then b → a.

    ``level`` must have no marks: ``level.unmarked``.
    """
    mesh, rings = level.topology, level.rings
    made = np.empty((2 * (end - begin), kernels.FEATURES), dtype=feature_type)
    measured = level.points, level.normals, rings.fields, rings.means, level.logs, _sizes(level)
    kernels.directed_features(begin, end, *measured, mesh.connectivity, made)
    return made


def _sizes(level: Level) -> Float[np.ndarray, "V 3"]:
    """Return the columns of ``kernels.measure_sizes``, made once."""
    kept = vars(level)
    if "sizes" not in kept:
        sizes, counts = np.empty((len(level.points), 3)), level.topology.sharp_count
        on_boundary = counts > 0 if len(counts) else np.zeros(len(sizes), dtype=bool)
        read = level.rings.means, level.rings.valence, on_boundary
        level.blocks.quiet().run(len(sizes), kernels.measure_sizes, *read, sizes)
        kept["sizes"] = sizes
    return kept["sizes"]


def answers_of(level: Level, networks: DirectedNetworks) -> Answers:
    """Return what the networks answer on a mesh; they are asked once.

    Raises:
        ModelError: an answer is not finite, or has another shape.
    """
    kept = vars(level.unmarked)
    if "answers" not in kept:
        kept["answers"] = ask(level.unmarked, networks)
    return kept["answers"]


def ask(level: Level, networks: DirectedNetworks) -> Answers:
    """Run the networks over a mesh without marks.

    Raises:
        ModelError: an answer is not finite, or has another shape.
    """
    mesh, edges, count = level.topology, level.topology.edges, len(level.topology.edges)
    level.measure(rings=True)
    _ = _sizes(level)
    starts = np.concatenate([[0], np.cumsum(mesh.valence)]).astype(np.int64)
    leaving = np.empty(2 * count, dtype=np.uint32)
    kernels.find_leaving(edges, starts[:-1].copy(), leaving)
    states = _states(level, networks, starts, leaving)
    asked, of_leaving = np.empty((count, 3)), np.empty((2 * count, 3))
    logits, corner_logits = np.empty(count), np.empty(2 * count)
    heights = np.empty(2 * count if networks.answers > kernels.FACE else 0)
    geometry = level.points, level.normals, level.rings.fields, mesh.connectivity

    def answer(begin: int, end: int) -> None:
        rows = slice(2 * begin, 2 * end)
        heads = checked_answers(networks.heads, states[rows], networks.answers).astype(np.float64)
        kernels.read_heads(begin, end, *geometry, heads, asked, of_leaving, logits)
        for own, column in (corner_logits, kernels.CORNER), (heights, kernels.FACE):
            if len(own):
                own[rows] = heads[:, column]

    level.blocks.of_rows(EDGES_AT_ONCE).run(count, answer)
    blocks, faces = level.blocks.quiet(), np.empty(mesh.face_count if len(heights) else 0)
    of_vertices, vertex_logits = np.empty(level.points.shape), np.empty(mesh.vertex_count)
    read = of_leaving, corner_logits, starts, leaving
    blocks.run(mesh.vertex_count, kernels.mean_leaving, *read, of_vertices, vertex_logits)
    blocks.run(len(faces), kernels.mean_in_faces, heights, mesh.connectivity, faces)
    return Answers(asked, of_vertices, faces, _sigmoid(logits), _sigmoid(vertex_logits))


def _states(
    level: Level,
    networks: DirectedNetworks,
    starts: Integer[np.ndarray, " V1"],
    leaving: UInt32[np.ndarray, " D"],
) -> Float[np.ndarray, "D W"]:
    """Return the states of directed edges after all rounds."""
    mesh, width, kind = level.topology, networks.width, networks.feature_type
    edges, count, blocks = mesh.edges, len(mesh.edges), level.blocks.of_rows(EDGES_AT_ONCE)
    states = np.empty((2 * count, width), dtype=kind)
    told = np.empty((mesh.vertex_count, 2 * networks.hidden), dtype=kind)

    def encode(begin: int, end: int) -> None:
        rows = directed_features(level, begin, end, kind)
        states[2 * begin : 2 * end] = checked_answers(networks.encoder, rows, width)

    def tell(network: Network, begin: int, end: int) -> None:
        pooled = np.empty((end - begin, 2 * width), dtype=kind)
        kernels.pool(begin, end, states, starts, leaving, np.empty(width), pooled)
        told[begin:end] = checked_answers(network, pooled, told.shape[1])

    def hear(update: Network, begin: int, end: int) -> None:
        messages = np.empty((2 * (end - begin), 2 * width + networks.hidden), dtype=kind)
        kernels.gather(begin, end, states, told, edges, messages)
        # Both ways of an edge stand in one block: nobody else reads these rows any more.
        states[2 * begin : 2 * end] += checked_answers(update, messages, width)

    blocks.run(count, encode)
    for at_vertices, at_edges in networks.rounds:
        blocks.quiet().run(mesh.vertex_count, partial(tell, at_vertices))
        blocks.run(count, partial(hear, at_edges))
    return states


def checked_answers(network: Network, rows: Float[np.ndarray, "N K"], columns: int) -> np.ndarray:
    """Return a network's answers.

    Raises:
        ModelError: an answer is not finite, or has another shape.
    """
    made = np.asarray(network(rows))
    if made.dtype.kind not in "fiub":
        raise ModelError("network", expected="real numbers", found=f"{made.dtype}")
    if made.shape != (len(rows), columns):
        expected = f"shape ({len(rows)}, {columns})"
        raise ModelError("network", expected=expected, found=f"{made.shape}")
    if not np.isfinite(made).all():
        raise ModelError("network", expected="finite answers", found="NaN or infinity")
    return made


def _sigmoid(logits: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return 1 / (1 + exp −x), for large x of either sign too."""
    shrunk = np.exp(-np.abs(logits))
    return np.where(logits >= 0, 1.0, shrunk) / (1 + shrunk)

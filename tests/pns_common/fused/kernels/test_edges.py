"""Edges by chains at their lower vertices, against dictionaries."""

import numpy as np
import pytest

from pns_common.fused.kernels.edges import (
    BOUNDARY,
    INTERIOR,
    IRREGULAR,
    NONE,
    SEVERAL,
    TOO_LONG,
    chain_edges,
    classify,
    count_ends,
)
from tests.support.kernels import WAYS
from tests.support.meshes import bow_tie, bumpy_sphere, one_way_pair, three_pages

REPEATED = (None, np.array([[0, 1, 1], [1, 2, 0]]))
TWICE = (None, np.array([[0, 1, 2], [1, 2, 0]]))
SHAPES = {
    "closed": bumpy_sphere(0, 0),
    "bow-tie": bow_tie(),
    "pages": three_pages(),
    "one-way": one_way_pair(),
    "repeated vertex": REPEATED,
    "repeated face": TWICE,
}


def chained(way, faces, most_steps=10**6):
    """What `chain_edges` writes, and how many edges it counts."""
    count = len(faces)
    head, low = np.full(faces.max() + 1, -1, np.int32), np.empty(3 * count, np.int32)
    links, face_edges = np.empty((3 * count, 4), np.int32), np.empty((count, 3), np.int32)
    plain = np.empty(1, np.int32)
    made = WAYS[way](chain_edges)(
        faces.astype(np.int32), most_steps, head, low, links, face_edges, plain
    )
    return made, low, links, face_edges, bool(plain[0])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("shape", SHAPES)
def test_edges_are_numbered_as_they_appear_and_told_by_their_faces(shape, way):
    faces = np.asarray(SHAPES[shape][1])
    uses = {}
    for half, (a, b) in enumerate(
        (face[i], face[(i + 1) % 3]) for face in faces.tolist() for i in range(3)
    ):
        uses.setdefault((min(a, b), max(a, b)), []).append((half, a))
    made, low, links, face_edges, plain = chained(way, faces)
    assert made == len(uses)
    edges, halves = (np.empty((made, 2), np.int32) for _ in range(2))
    kinds = np.empty(made, np.int8)
    narrow = faces.astype(np.int32)
    given = narrow, narrow.reshape(-1), low, links, int(plain), 0, made
    WAYS[way](classify)(*given, edges, halves, kinds)
    assert list(map(tuple, edges.tolist())) == list(uses)
    number = {edge: e for e, edge in enumerate(uses)}
    for face, three in zip(faces.tolist(), face_edges.tolist(), strict=True):
        pairs = zip(face, [*face[1:], face[0]], strict=True)
        assert three == [number[tuple(sorted(pair))] for pair in pairs]
    for (a, b), half, kind, seen in zip(uses, halves.tolist(), kinds, uses.values(), strict=True):
        second = [NONE, *(h for h, _ in seen[1:])][len(seen) - 1] if len(seen) < 3 else SEVERAL
        assert half == [seen[0][0], second]
        proper = a != b and all(len(set(faces[h // 3])) == 3 for h, _ in seen)
        lone, opposed = len(seen) == 1, len(seen) == 2 and seen[0][1] != seen[1][1]
        expected = BOUNDARY if lone else INTERIOR if opposed else IRREGULAR
        assert kind == (expected if proper else IRREGULAR)
    assert plain == (shape not in ("repeated vertex", "repeated face"))


@pytest.mark.parametrize("way", WAYS)
def test_chains_that_grow_too_long_are_given_up(way):
    hub = np.stack([np.zeros(20, int), np.arange(1, 21), np.arange(2, 22)], axis=1)
    assert chained(way, hub, most_steps=10)[0] == TOO_LONG
    assert chained(way, hub)[0] == 41


@pytest.mark.parametrize("way", WAYS)
def test_ends_of_some_edges_are_counted_at_their_vertices(way):
    edges = np.array([[0, 1], [1, 3], [0, 3], [2, 3]], dtype=np.int32)
    counts = np.zeros(5, dtype=np.int32)
    WAYS[way](count_ends)(edges, np.array([3, 1], dtype=np.int32), counts)
    assert counts.tolist() == [0, 1, 1, 2, 0]

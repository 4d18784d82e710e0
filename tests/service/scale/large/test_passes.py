"""The passes over a whole mesh, block by block: surveyed, sorted, cut, written in chunks."""

import numpy as np

from pns_common import Mesh, loop, refine
from pns_common.geometry.side_lengths import BLOCK_FACES, measure_sides
from service.scale.large import adjacency, partition, target
from service.scale.large.arrays import open_mesh
from service.scale.large.survey import survey
from tests.service.scale.large.parts import arrays, assert_is, many_kinds, refined
from tests.support.meshes import grid


def test_the_survey_is_that_of_the_whole_whatever_the_blocks(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    mesh = Mesh(rng.standard_normal((5000, 3)), rng.integers(0, 5000, (4000, 3)))
    folder = arrays(tmp_path / "in", mesh)
    length = refine(mesh, loop()).report["reference_length"]
    for rows in (7, 1000, 1 << 20):
        monkeypatch.setattr("service.scale.large.arrays.BLOCK", rows)
        monkeypatch.setattr("service.scale.large.survey.blocks_of", _blocks(rows))
        assert survey(open_mesh(folder)).reference_length == length


def test_sides_are_those_of_the_whole_whatever_is_read_at_once(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    mesh = Mesh(rng.standard_normal((500, 3)), rng.integers(0, 500, (3 * BLOCK_FACES + 5, 3)))
    opened = open_mesh(arrays(tmp_path / "in", mesh))
    for blocks in (1, 2, 64):
        monkeypatch.setattr("service.scale.large.survey.SIDE_ROWS", blocks * BLOCK_FACES)
        assert survey(opened).sides == measure_sides(mesh.vertices, mesh.faces)


def test_what_is_sorted_outside_memory_is_sorted(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    mesh = Mesh(rng.standard_normal((500, 3)), rng.integers(0, 500, (900, 3)))
    opened = open_mesh(arrays(tmp_path / "in", mesh))
    monkeypatch.setattr(adjacency, "RANGE", 64)
    monkeypatch.setattr(adjacency, "blocks_of", _blocks(50))
    monkeypatch.setattr(partition, "blocks_of", _blocks(70))
    adjacency.build(opened, tmp_path)
    known = adjacency.Adjacency.open(tmp_path)
    for vertex in range(0, 500, 7):
        faces = np.flatnonzero((mesh.faces == vertex).any(axis=1))
        assert known.faces_at(np.array([vertex])).tolist() == faces.tolist()
    partition.cut(opened, survey(opened), 7, tmp_path)
    parts = partition.Parts.open(tmp_path, 7)
    own = [parts.own(number) for number in range(7)]
    assert sorted(np.concatenate(own).tolist()) == list(range(900))
    assert {len(faces) for faces in own} <= {128, 129}
    assert all((np.diff(faces) > 0).all() for faces in own)


def test_parts_lie_together(tmp_path):
    mesh = Mesh(*grid(65))
    opened = open_mesh(arrays(tmp_path / "in", mesh))
    partition.cut(opened, survey(opened), 16, tmp_path)
    parts = partition.Parts.open(tmp_path, 16)
    for number in range(16):
        box = np.ptp(mesh.vertices[mesh.faces[parts.own(number)]].reshape(-1, 3), axis=0)
        assert (box[:2] <= 0.6).all()


def _blocks(rows):
    return lambda count, _=None: (
        slice(start, min(start + rows, count)) for start in range(0, count, rows)
    )


def test_rows_are_written_in_chunks(tmp_path, monkeypatch):
    monkeypatch.setattr(target, "ROWS", 16)
    mesh = many_kinds()
    refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 2)
    assert_is(tmp_path / "out", refine(mesh, loop(), 2))

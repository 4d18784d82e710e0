"""One mesh cut into parts: the bits of `refine`, whatever the parts, their order, their faults."""

import io
import json
import random
import shutil
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console
from typer.testing import CliRunner

from pns_common import Mesh, MeshError, load_model, loop, pns, refine
from pns_common.topology import build_topology
from service.cli import app
from service.errors import (
    InvalidParameter,
    LimitError,
    UnreadableError,
    UnrefinableError,
    WorkerDied,
)
from service.options import Options
from service.scale.engines import local
from service.scale.large import adjacency, part, partition, target
from service.scale.large.arrays import open_mesh, reserve
from service.scale.large.part import run_part
from service.scale.large.plan import Large
from service.scale.large.run import large_work, parts_for, run_large
from service.scale.large.survey import survey
from tests.service.scale.large.jobs import dies_at_first, dies_often
from tests.support.meshes import bent, bow_tie, grid, manifolds, soups, three_pages

LOOP = Options(scheme="loop", levels=2)


def here(tasks):
    """An engine without processes, in any order."""
    tasks = list(tasks)
    random.Random(len(tasks)).shuffle(tasks)
    return map(run_part, tasks)


def arrays(folder, mesh, creases=None, positions="<f8", faces="<i4"):
    folder.mkdir()
    np.save(folder / "positions.npy", mesh.vertices.astype(positions))
    np.save(folder / "faces.npy", mesh.faces.astype(faces))
    if creases is not None:
        np.save(folder / "creases.npy", creases)
    return folder


def refined(source, output, parts, options=LOOP, engine=here, model=None):
    large = Large(source, output, options, 2**31, parts, model)
    report, _ = run_large(large, engine, Console(file=io.StringIO()))
    return report


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def assert_is(folder, whole):
    points, faces = np.load(folder / "positions.npy"), np.load(folder / "faces.npy")
    assert points.tobytes() == whole.mesh.vertices.tobytes()
    assert (faces == whole.mesh.faces).all()


def many_kinds():
    """Boundaries, pages, bow-ties, duplicates, degenerate and isolated ones, in any order."""
    rng = np.random.default_rng(7)
    points, faces = grid(12, bent)
    points = points + 0.1 * rng.standard_normal(points.shape)  # rough enough to be guarded
    for other_points, other_faces in (bow_tie(), three_pages()):
        faces = np.concatenate([faces, other_faces + len(points)])
        points = np.concatenate([points, other_points])
    faces = np.concatenate([faces, faces[:3], [[0, 1, 1]], rng.integers(0, len(points), (5, 3))])
    points = np.concatenate([points, [[9.0, 9, 9]], points[:1] - 2])
    order = rng.permutation(len(points))
    renumbered = np.empty_like(points)
    renumbered[order] = points
    return Mesh(renumbered, rng.permutation(order[faces]))


@pytest.mark.parametrize("parts", [1, 2, 7, 64])
@pytest.mark.parametrize("creased", [False, True])
def test_parts_of_any_number_are_the_whole(tmp_path, parts, creased):
    mesh = many_kinds()
    edges = build_topology(mesh.faces, len(mesh.vertices)).edges
    creases = edges[::9] if creased else None
    report = refined(arrays(tmp_path / "in", mesh, creases), tmp_path / "out", parts)
    whole = refine(mesh, loop(), 2, creases=creases)
    assert_is(tmp_path / "out", whole)
    assert report["reference_length"] == whole.report["reference_length"]
    for level, expected in zip(report["levels"], whole.report["levels"], strict=True):
        assert {name: level[name] for name in ("vertices", "faces", "edges")} == {
            name: expected[name] for name in ("vertices", "faces", "edges")
        }


def test_parts_of_the_default_model_are_the_whole(tmp_path):
    mesh = many_kinds()
    report = refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 3, Options(levels=2))
    whole = refine(mesh, pns(load_model()), 2)
    assert_is(tmp_path / "out", whole)
    assert report["limit_distance"] == whole.report["limit_distance"] > 0
    assert report["levels"][0]["guarded"] == whole.report["levels"][0]["guarded"] > 0


@settings(max_examples=10)
@given(mesh=st.one_of(manifolds(), soups()), parts=st.integers(1, 64), levels=st.integers(1, 3))
def test_any_mesh_in_parts_is_the_whole(tmp_path_factory, mesh, parts, levels):
    folder = tmp_path_factory.mktemp("large")
    source = arrays(folder / "in", mesh)
    parts = min(parts, len(mesh.faces))
    refined(source, folder / "out", parts, Options(scheme="loop", levels=levels))
    assert_is(folder / "out", refine(mesh, loop(), levels))


def test_the_report_does_not_depend_on_the_parts(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    one, many = (refined(source, tmp_path / f"out{p}", p) for p in (1, 13))
    assert one == many
    assert contents(tmp_path / "out1") == contents(tmp_path / "out13")


@pytest.mark.parametrize(("positions", "faces"), [("<f4", "<i4"), ("<f8", "<i8")])
def test_arrays_may_be_of_either_width(tmp_path, positions, faces):
    mesh = many_kinds()
    source = arrays(tmp_path / "in", mesh, positions=positions, faces=faces)
    refined(source, tmp_path / "out", 5)
    kept = Mesh(mesh.vertices.astype(positions), mesh.faces)
    assert_is(tmp_path / "out", refine(kept, loop(), 2))


def test_creases_by_angle_cross_parts(tmp_path):
    mesh = Mesh(*grid(13, lambda x, y: np.abs(x)))
    options = Options(scheme="loop", levels=2, crease="angle:60")
    report = refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 9, options)
    assert report["levels"][0]["edges"]["crease"] == 12
    one = refined(tmp_path / "in", tmp_path / "one", 1, options)
    assert one == report
    assert contents(tmp_path / "one") == contents(tmp_path / "out")


def test_the_survey_is_that_of_the_whole_whatever_the_blocks(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    mesh = Mesh(rng.standard_normal((5000, 3)), rng.integers(0, 5000, (4000, 3)))
    folder = arrays(tmp_path / "in", mesh)
    length = refine(mesh, loop()).report["reference_length"]
    for rows in (7, 1000, 1 << 20):
        monkeypatch.setattr("service.scale.large.arrays.BLOCK", rows)
        monkeypatch.setattr("service.scale.large.survey.blocks_of", _blocks(rows))
        assert survey(open_mesh(folder)).reference_length == length


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


def test_a_driver_that_was_stopped_goes_on(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    refined(source, tmp_path / "expected", 9)
    done = []

    def stops(tasks):
        for number, task in enumerate(tasks):
            if task.stage == part.REFINE and number == 4:
                raise KeyboardInterrupt
            done.append((task.stage, task.part))
            yield run_part(task)

    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", 9, engine=stops)
    assert not (tmp_path / "out").exists()
    first = set(done)
    done.clear()

    def goes_on(tasks):
        for task in tasks:
            done.append((task.stage, task.part))
            yield run_part(task)

    refined(source, tmp_path / "out", 9, engine=goes_on)
    assert not first & set(done)
    assert contents(tmp_path / "out") == contents(tmp_path / "expected")
    assert not (tmp_path / "out.work").exists()


def test_another_input_or_option_begins_anew(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())

    def stops(tasks):
        yield run_part(next(tasks))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", 3, engine=stops)
    shutil.rmtree(source)
    mesh = Mesh(*grid(9, bent))
    refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 3)
    assert_is(tmp_path / "out", refine(mesh, loop(), 2))


def test_two_runs_do_not_share_a_work(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())

    def second(tasks):
        with pytest.raises(InvalidParameter, match="another run"):
            refined(source, tmp_path / "out", 3)
        return map(run_part, tasks)

    refined(source, tmp_path / "out", 3, engine=second)


def test_workers_that_are_killed_change_nothing(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    refined(source, tmp_path / "expected", 4)
    refined(source, tmp_path / "out", 4, engine=local(large_work(dies_at_first), 2))
    assert contents(tmp_path / "out") == contents(tmp_path / "expected")


def test_a_part_that_kills_each_of_its_workers_is_told(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    work = replace(large_work(dies_often), most_attempts=2)
    with pytest.raises(WorkerDied, match=r"part 1: its worker ended, twice.*--parts"):
        refined(source, tmp_path / "out", 2, engine=local(work, 1))


@pytest.mark.filterwarnings("ignore")
def test_ray_makes_the_same_bytes(tmp_path, monkeypatch):
    pytest.importorskip("ray", reason="the extra [ray] is not installed")
    from service.scale.engines import on_ray

    monkeypatch.setenv("RAY_raylet_start_wait_time_s", "300")
    source = arrays(tmp_path / "in", many_kinds())
    refined(source, tmp_path / "expected", 3)
    refined(source, tmp_path / "out", 3, engine=on_ray(large_work(), None, 1))
    assert contents(tmp_path / "out") == contents(tmp_path / "expected")


def test_the_command_refines_and_reports(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = Mesh(*grid(5, bent))
    arrays(tmp_path / "in", mesh)
    arguments = ["large", "in", "out", "--scheme", "loop", "--parts", "2", "--workers", "1"]
    done = CliRunner().invoke(app, [*arguments, "--report", "r.json"])
    assert done.exit_code == 0, done.output
    assert_is(tmp_path / "out", refine(mesh, loop(), 1))
    assert json.loads((tmp_path / "r.json").read_text())["levels"][0]["faces"] == 4 * len(
        mesh.faces
    )


def test_memory_says_how_many_parts():
    assert parts_for(1000, 2**31) == 1
    assert parts_for(10**9, 2**32) > parts_for(10**9, 2**33) > 10
    with pytest.raises(InvalidParameter, match="MiB or more"):
        parts_for(1000, 10**6)


def test_more_parts_than_faces_are_refused(tmp_path):
    with pytest.raises(InvalidParameter, match="parts"):
        refined(arrays(tmp_path / "in", Mesh(*bow_tie())), tmp_path / "out", 3)


@pytest.mark.parametrize("name", ["out.xyz", "in", "missing"])
def test_what_cannot_be_read_or_written_is_told(tmp_path, name):
    source = arrays(tmp_path / "in", Mesh(*bow_tie()))
    with pytest.raises(InvalidParameter):
        refined(tmp_path / "no" if name == "missing" else source, tmp_path / name, 1)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("positions", np.zeros((3, 2))),
        ("positions", np.zeros((3, 3), dtype="<i4")),
        ("faces", np.zeros((1, 3))),
        ("faces", np.asfortranarray(np.zeros((2, 3), dtype="<i4"))),
        ("creases", np.zeros((1, 3), dtype="<i4")),
        ("faces", None),
    ],
)
def test_arrays_of_another_kind_are_refused(tmp_path, name, array):
    source = arrays(tmp_path / "in", Mesh(*bow_tie()))
    if array is None:
        (source / f"{name}.npy").write_bytes(b"no array")
    else:
        np.save(source / f"{name}.npy", array)
    with pytest.raises(UnreadableError, match=name):
        refined(source, tmp_path / "out", 1)


@pytest.mark.parametrize(
    ("name", "array", "words"),
    [
        ("faces", np.zeros((0, 3), dtype="<i4"), "no faces"),
        ("faces", np.array([[0, 1, 9]], dtype="<i4"), "face 0"),
        ("positions", np.full((5, 3), np.nan), "vertex 0"),
        ("positions", np.eye(5, 3) * 1e-80, "extent"),
    ],
)
def test_meshes_that_cannot_be_refined_are_told(tmp_path, name, array, words):
    source = arrays(tmp_path / "in", Mesh(*bow_tie()))
    np.save(source / f"{name}.npy", array)
    with pytest.raises(UnrefinableError, match=words):
        refined(source, tmp_path / "out", 1)


def test_a_part_that_cannot_be_refined_is_told(tmp_path, monkeypatch):
    def too_large(*_):
        raise MeshError("refined coordinates are too large")

    monkeypatch.setattr(part, "refine_piece", too_large)
    with pytest.raises(UnrefinableError, match="part 0: refined coordinates"):
        refined(arrays(tmp_path / "in", many_kinds()), tmp_path / "out", 1)


def test_a_disk_without_room_is_told_beforehand(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(LimitError, match="GB are needed"):
        reserve(tmp_path / "file", 2**43)


def test_rows_are_written_in_chunks(tmp_path, monkeypatch):
    monkeypatch.setattr(target, "ROWS", 16)
    mesh = many_kinds()
    refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 2)
    assert_is(tmp_path / "out", refine(mesh, loop(), 2))

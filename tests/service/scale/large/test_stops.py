"""Drivers that are stopped, workers that are killed: nothing is lost, and nothing done twice."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pns_common import Mesh, loop, refine
from pns_common.runtimes.onnx_model import BUNDLED
from service.errors import (
    InvalidParameter,
    NoModelError,
    UnreadableError,
    WorkerDied,
)
from service.options import Options
from service.scale.engines.local import local
from service.scale.large import formats, part, readers
from service.scale.large.part import run_part
from service.scale.large.run import large_work
from tests.service.scale.large.jobs import dies_at_first, dies_often
from tests.service.scale.large.parts import (
    LOOP,
    arrays,
    assert_is,
    contents,
    here,
    many_kinds,
    refined,
)
from tests.support.meshes import bent, grid


def test_a_driver_that_was_stopped_goes_on(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    refined(source, tmp_path / "expected", 9)
    done = []

    def stops(tasks):
        for number, task in enumerate(tasks):
            if task.stage == part.REFINE and number == 4:
                raise KeyboardInterrupt
            done.append((task.stage, task.part))
            yield [run_part(task)]

    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", 9, engine=stops)
    assert not (tmp_path / "out").exists()
    first = set(done)
    done.clear()

    def goes_on(tasks):
        for task in tasks:
            done.append((task.stage, task.part))
            yield [run_part(task)]

    refined(source, tmp_path / "out", 9, engine=goes_on)
    assert not first & set(done)
    assert contents(tmp_path / "out") == contents(tmp_path / "expected")
    assert not (tmp_path / "out.work").exists()


def stops_after_one(tasks):
    yield [run_part(next(tasks))]
    raise KeyboardInterrupt


@pytest.mark.parametrize("change", [{"parts": 5}, {"options": LOOP}, {"model": "full"}], ids=str)
def test_other_parts_or_options_or_another_model_begin_anew(tmp_path, change):
    first = {"parts": 3, "options": Options(levels=1), "model": "paper"}
    source, given = arrays(tmp_path / "in", many_kinds()), first | change
    refined(source, tmp_path / "expected", **given)
    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", **first, engine=stops_after_one)
    (before,) = (path for path in (tmp_path / "out.work").iterdir() if path.is_dir())
    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", **given, engine=stops_after_one)
    assert not before.exists()
    refined(source, tmp_path / "out", **given)
    assert contents(tmp_path / "out") == contents(tmp_path / "expected")


def test_another_input_begins_anew(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", 3, engine=stops_after_one)
    shutil.rmtree(source)
    mesh = Mesh(*grid(9, bent))
    refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 3)
    assert_is(tmp_path / "out", refine(mesh, loop(), 2))


def test_another_input_of_the_same_size_and_date_begins_anew(tmp_path):
    """As archives and reproducible builds make them."""
    source = arrays(tmp_path / "in", Mesh(*grid(9)))

    def stops(tasks):
        for task in tasks:
            yield [run_part(task)]
            if task.stage == part.REFINE:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", 3, engine=stops)
    date = (source / "positions.npy").stat().st_mtime_ns
    mesh = Mesh(*grid(9, bent))
    np.save(source / "positions.npy", mesh.vertices)
    os.utime(source / "positions.npy", ns=(date, date))
    refined(source, tmp_path / "out", 3)
    assert_is(tmp_path / "out", refine(mesh, loop(), 2))


def test_an_input_with_other_dates_rights_and_names_is_the_same(tmp_path):
    """Also in the middle of the work: whoever links to a file, as backups do, changes its entry."""
    source = arrays(tmp_path / "in", many_kinds())
    refined(source, tmp_path / "expected", 3)
    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", 3, engine=stops_after_one)
    (before,) = (path for path in (tmp_path / "out.work").iterdir() if path.is_dir())
    moved = source.rename(tmp_path / "elsewhere")
    (moved / "positions.npy").chmod(0o400)
    (moved / "faces.npy").touch()

    def linked(tasks):
        assert before.exists()
        for array in moved.glob("*.npy"):
            array.with_suffix(f".{len(list(moved.iterdir()))}").hardlink_to(array)
        return here(tasks)

    refined(moved, tmp_path / "out", 3, engine=linked)
    assert contents(tmp_path / "out") == contents(tmp_path / "expected")


@pytest.mark.parametrize(
    "name", ["plan.json", "survey.json", "count-00001.npz", "target.json", "part-00002.json"]
)
def test_a_work_that_is_damaged_is_told_and_begun_anew(tmp_path, name):
    source = arrays(tmp_path / "in", many_kinds())
    refined(source, tmp_path / "expected", 3)

    def stops(tasks):
        for task in tasks:
            yield [run_part(task)]
        if task.stage == part.REFINE:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refined(source, tmp_path / "out", 3, engine=stops)
    (file,) = (tmp_path / "out.work").glob(f"*/{name}")
    file.write_bytes(b"")
    if name.startswith("count"):
        (file.parent / "numbered.json").unlink()
    with pytest.raises(UnreadableError, match="begins anew"):
        refined(source, tmp_path / "out", 3)
    refined(source, tmp_path / "out", 3)
    assert contents(tmp_path / "out") == contents(tmp_path / "expected")


def test_what_is_told_to_be_there_is_on_the_disk(tmp_path, monkeypatch):
    """A power cut leaves zeros in what is not, and a later run would go on from them."""
    arrays_of_work = ("order.npy", "faces-at.npy", "starts.npy")
    told = {
        "positions.npy": "mesh.json",
        "faces.npy": "mesh.json",
        "part-00000.glb": "../part-00000.json",
    } | {f"{name}.tmp": name for name in arrays_of_work}
    synced = set()

    def fsync(descriptor):
        file = Path(f"/proc/self/fd/{descriptor}").readlink()
        synced.add(file.name)
        assert not (file.parent / told[file.name]).exists()

    monkeypatch.setattr(os, "fsync", fsync)
    source = tmp_path / "in.obj"
    source.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    refined(source, tmp_path / "out.3dtiles", 1)
    assert synced == told.keys()


def test_an_input_that_changes_meanwhile_is_told(tmp_path):
    """Some parts would be of what it was, others of what it is."""
    source = arrays(tmp_path / "in", many_kinds())

    def changes(tasks):
        positions = np.load(source / "positions.npy")
        np.save(tmp_path / "changed.npy", 2 * positions)
        (tmp_path / "changed.npy").replace(source / "positions.npy")
        return here(tasks)

    with pytest.raises(UnreadableError, match="in: it changed"):
        refined(source, tmp_path / "out", 3, engine=changes)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in"]


def test_a_file_that_changes_while_it_is_read_is_told(tmp_path, monkeypatch):
    source = tmp_path / "in.obj"
    source.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")

    def reads(path, sink):
        readers.read_obj(path, sink)
        with path.open("a") as file:
            file.write("v 0 0 1\nf 1 2 4\n")

    monkeypatch.setitem(formats.READERS, ".obj", reads)
    with pytest.raises(UnreadableError, match=r"in\.obj: it changed"):
        refined(source, tmp_path / "out", 1)
    assert [path.name for path in tmp_path.iterdir()] == ["in.obj"]


def test_a_model_that_is_replaced_meanwhile_is_told(tmp_path):
    model = tmp_path / "m.onnx"
    shutil.copy(str(BUNDLED / "general.onnx"), model)

    def replaced(tasks):
        shutil.copy(str(BUNDLED / "paper.onnx"), model)
        part.scheme_of.cache_clear()  # as in a worker, which has loaded none yet
        return here(tasks)

    source = arrays(tmp_path / "in", many_kinds())
    with pytest.raises(NoModelError, match="not the model that this run began with"):
        refined(source, tmp_path / "out", 3, Options(), engine=replaced, model=str(model))
    assert not (tmp_path / "out").exists()


def test_two_runs_do_not_share_a_work(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())

    def second(tasks):
        with pytest.raises(InvalidParameter, match="another run"):
            refined(source, tmp_path / "out", 3)
        return here(tasks)

    refined(source, tmp_path / "out", 3, engine=second)


def test_workers_that_are_killed_change_nothing(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    refined(source, tmp_path / "expected", 2)
    refined(source, tmp_path / "out", 2, engine=local(large_work(dies_at_first), 2))
    assert contents(tmp_path / "out") == contents(tmp_path / "expected")


def test_a_part_that_kills_each_of_its_workers_is_told(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    work = replace(large_work(dies_often), most_attempts=2)
    with pytest.raises(WorkerDied, match=r"part 1: its worker ended, twice.*--parts"):
        refined(source, tmp_path / "out", 2, engine=local(work, 1))

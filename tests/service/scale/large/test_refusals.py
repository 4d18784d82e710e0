"""What cannot be read, cut, refined or written is told, and says why."""

from types import SimpleNamespace

import numpy as np
import pytest

from pns_common import Mesh, MeshError
from pns_common.pieces import ThinHaloError
from service.errors import (
    InvalidParameter,
    LimitError,
    NoModelError,
    UnreadableError,
    UnrefinableError,
)
from service.options import Options
from service.scale.large import part, room
from service.scale.large.arrays import open_mesh, reserve
from service.scale.large.formats import output_kind
from service.scale.large.run import parts_for
from service.scale.large.survey import survey
from tests.service.scale.large.parts import arrays, many_kinds, refined
from tests.support.meshes import bent, bow_tie, bumpy_sphere, grid


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


def test_a_part_that_stays_uncertain_ends_with_all_of_the_mesh_around_it(tmp_path, monkeypatch):
    seen = []

    def never_certain(piece, *_):
        seen.append(len(piece.faces))
        raise ThinHaloError(0, 1)

    monkeypatch.setattr(part, "refine_piece", never_certain)
    source = arrays(tmp_path / "in", Mesh(*grid(16, bent)))
    with pytest.raises(UnrefinableError, match="not certain"):
        refined(source, tmp_path / "out", 2, Options(levels=1), model="general")
    # Of a part, and of more and more around it.
    assert seen == sorted(set(seen))
    assert seen[-1] == 2 * 15**2


def test_a_model_that_is_gone_is_told(tmp_path):
    source = arrays(tmp_path / "in", Mesh(*grid(3, bent)))
    with pytest.raises(NoModelError, match="gone"):
        refined(source, tmp_path / "out", 1, Options(), model=str(tmp_path / "gone.onnx"))


def test_a_tile_beyond_single_precision_is_told(tmp_path):
    far = Mesh(1e39 * np.eye(3), np.array([[0, 1, 2]]))
    with pytest.raises(UnrefinableError, match="float32"):
        refined(arrays(tmp_path / "in", far), tmp_path / "out.3dtiles", 1)


def test_a_disk_that_is_too_small_is_told_before_any_part_is_done(tmp_path, monkeypatch):
    def never(_):
        raise AssertionError("no part is asked for")

    monkeypatch.setattr(room.shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
    source = arrays(tmp_path / "in", Mesh(*grid(9, bent)))
    with pytest.raises(LimitError, match=r"out.work.*GB are needed, 0.0 GB are free"):
        refined(source, tmp_path / "out", 1, engine=never)
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


@pytest.mark.parametrize("name", ["out.ply", "out", "out.3dtiles"])
def test_the_room_that_is_asked_for_is_what_a_run_takes(tmp_path, name):
    mesh = Mesh(*bumpy_sphere(subdivisions=3))
    refined(arrays(tmp_path / "in", mesh), tmp_path / name, 1)
    files = [tmp_path / name] if name.endswith("ply") else list((tmp_path / name).iterdir())
    written = sum(path.stat().st_size for path in files)
    about = survey(open_mesh(tmp_path / "in"))
    passes = room.PASSES_BYTES_PER_FACE * len(mesh.faces)
    needed = room.bytes_needed(about, 2, output_kind(tmp_path / "new" / name)) - passes
    assert 0.9 * written <= needed <= 1.1 * written


def test_a_disk_without_room_is_told_beforehand(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(LimitError, match="GB are needed"):
        reserve(tmp_path / "file", 2**43)

"""Kernels are kept where nobody else can write, and a read-only package brings its own."""

import itertools
import os
import subprocess
import sys

import pytest

from pns_common import Mesh, loop, refine
from pns_common.fused import COST_TO_COMPILE, COST_TO_LOAD, _Work, kernels_pay, storage
from pns_common.levels.progress import level_costs
from tests.support.kernels import by_arrays
from tests.support.meshes import bumpy_sphere


@pytest.fixture(autouse=True)
def _ask_again(monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    storage.cache_folder.cache_clear()
    yield
    storage.cache_folder.cache_clear()


def test_a_package_that_can_be_written_keeps_its_kernels(monkeypatch, tmp_path):
    monkeypatch.setattr(storage, "BUILT", tmp_path)
    assert storage.cache_folder() == tmp_path


def test_a_folder_that_was_asked_for_is_taken(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert storage.cache_folder() == tmp_path


def test_a_read_only_package_has_a_private_folder(monkeypatch, tmp_path):
    writable = storage._is_writable
    monkeypatch.setattr(storage, "_is_writable", lambda f: f != storage.BUILT and writable(f))
    monkeypatch.setattr(storage, "BUILT", storage.KERNELS)
    monkeypatch.setattr(storage.tempfile, "gettempdir", lambda: str(tmp_path))
    folder = storage.cache_folder()
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_can_write_is_not_used(tmp_path):
    folder = storage.private_folder(tmp_path)
    folder.chmod(0o777)
    assert storage.private_folder(tmp_path) is None


def test_a_link_to_somewhere_else_is_not_used(tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (tmp_path / f"pns-kernels-{os.getuid()}").symlink_to(other)
    assert storage.private_folder(tmp_path) is None


def test_without_any_folder_there_are_no_kernels(monkeypatch):
    monkeypatch.setattr(storage, "_is_writable", lambda folder: False)
    assert storage.cache_folder() is None


def test_kernels_that_came_with_the_package_are_taken_before_any_others(monkeypatch, tmp_path):
    built, written = tmp_path / "built", tmp_path / "written"
    built.mkdir()
    monkeypatch.setattr(storage, "BUILT", built)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(written))
    assert storage.kernel_file("1").parent == written
    assert not storage.kernels_are_kept()
    (built / storage.kernel_file("1").name).write_bytes(b"code")
    assert storage.kernel_file("1").parent == built
    assert storage.kernel_file("2").parent == written
    assert storage.kernels_are_kept()


@pytest.fixture
def fresh(monkeypatch):
    """A process that has done nothing yet."""
    monkeypatch.setattr("pns_common.fused.kernels_loaded", lambda: False)
    monkeypatch.setattr("pns_common.fused._work", _Work())
    monkeypatch.setattr("pns_common.fused.kernels_are_kept", lambda: True)


@pytest.mark.usefixtures("fresh")
def test_small_meshes_do_not_wait_for_kernels():
    costs = level_costs(COST_TO_LOAD // (4 + 16) - 1000, 2, learned_levels=0)
    assert not kernels_pay(costs)
    assert kernels_pay(costs)


@pytest.mark.usefixtures("fresh")
def test_a_learned_level_pays_for_kernels_sooner():
    faces = COST_TO_LOAD // 8
    assert not kernels_pay(level_costs(faces, 1, learned_levels=0))
    assert kernels_pay(level_costs(faces, 1, learned_levels=1))


@pytest.mark.usefixtures("fresh")
def test_kernels_pay_for_many_meshes_however_small():
    levels = level_costs(4, 3, learned_levels=0)
    meshes = next(count for count in itertools.count(1) if kernels_pay(levels))
    assert meshes * sum(levels) < COST_TO_LOAD / 10


@pytest.mark.usefixtures("fresh")
def test_kernels_that_must_be_compiled_pay_later(monkeypatch):
    monkeypatch.setattr("pns_common.fused.kernels_are_kept", lambda: False)
    assert not kernels_pay([COST_TO_LOAD])
    assert kernels_pay([COST_TO_COMPILE])


def test_importing_the_package_loads_no_compiler():
    code = "import sys, pns_common; sys.exit(bool({'numba', 'llvmlite'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_both_ways_give_one_result_while_kernels_are_not_loaded(monkeypatch):
    mesh = Mesh(*bumpy_sphere(0))
    monkeypatch.setattr(sys.modules["pns_common.refine"], "kernels_pay", lambda faces: False)
    assert refine(mesh, loop()).mesh.vertices.tobytes() == by_arrays(mesh, 1).points.tobytes()

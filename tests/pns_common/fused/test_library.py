"""Kernels are loaded without their compiler, and take no array for what it is not."""

import subprocess
import sys

import numpy as np
import pytest

from pns_common.fused import library, load_kernels
from pns_common.fused.kernels import masks, normals
from pns_common.fused.kernels.masks import largest_coordinate, sum_rings
from pns_common.fused.library import kernel_modules, kernels_of, key_of

LOADED_ALONE = """
import sys
from pns_common import Mesh, loop, refine
from pns_common.fused import load_kernels
load_kernels()
refined = refine(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), loop())
assert len(refined.mesh.faces) == 4 and "llvmlite" in sys.modules
sys.exit("numba" in sys.modules)
"""


@pytest.mark.spawning
def test_kernels_are_loaded_without_numba():
    assert load_kernels()  # compiled, that is
    assert subprocess.run([sys.executable, "-c", LOADED_ALONE], check=False).returncode == 0


def test_kernels_that_cannot_be_kept_serve_all_the_same(tmp_path, monkeypatch):
    """On a full disk, or in a folder that cannot be made."""
    monkeypatch.setattr("pns_common.fused.compiler.compile_kernels", lambda modules: b"code")
    (tmp_path / "file").touch()
    assert library._compiled([], tmp_path / "file" / "kernels.o") == b"code"
    assert library._compiled([], tmp_path / "new" / "kernels.o") == b"code"
    assert (tmp_path / "new" / "kernels.o").read_bytes() == b"code"


def test_every_kernel_has_a_name_of_its_own():
    names = [kernel.name for kernel in kernels_of(kernel_modules())]
    assert len(set(names)) == len(names) > 30


def test_rows_are_read_wherever_an_array_lies():
    points = np.arange(30.0).reshape(10, 3)
    points.flags.writeable = False
    assert largest_coordinate(points, 0, 10) == 29
    assert largest_coordinate(points[2:5], np.int64(0), np.int32(2)) == 11


POINTS, EDGES = np.zeros((2, 3)), np.array([[0, 1]], dtype=np.int32)
GOOD = {"points": POINTS, "edges": EDGES, "reach": EDGES, "begin": 0, "end": 2}
BAD = {
    "numbers of another precision": {"points": POINTS.astype(np.float32)},
    "indices of another width": {"edges": EDGES.astype(np.int64)},
    "columns in a row": {"points": POINTS.reshape(-1)},
    "another order in memory": {"points": np.asfortranarray(POINTS)},
    "every other row": {"points": np.zeros((4, 3))[::2]},
    "bytes the other way round": {"points": POINTS.astype(">f8")},
    "an odd address": {"points": np.frombuffer(bytes(49), offset=1).reshape(2, 3)},
}


def _sums(values):
    sums, valence = np.zeros((2, 3)), np.zeros(2, dtype=np.int32)
    sum_rings(*values.values(), sums, valence)
    return valence.tolist()


@pytest.mark.parametrize("bad", BAD)
def test_an_array_of_another_kind_is_refused(bad):
    assert _sums(GOOD) == [1, 1]
    with pytest.raises(TypeError, match="a kernel takes"):
        _sums(GOOD | BAD[bad])


def test_nothing_is_written_where_that_is_not_allowed():
    sums, valence = np.zeros((2, 3)), np.zeros(2, dtype=np.int32)
    sums.flags.writeable = False
    with pytest.raises(TypeError, match="written=True"):
        sum_rings(*GOOD.values(), sums, valence)


def test_a_number_in_place_of_an_array_is_refused():
    with pytest.raises(AttributeError):
        largest_coordinate(1.0, 0, 1)
    with pytest.raises(ValueError, match="zip"):
        largest_coordinate(POINTS, 0)


def test_other_numbers_and_other_processors_have_other_code(monkeypatch):
    modules = kernel_modules()
    key = key_of(modules)
    assert key_of(modules) == key
    with monkeypatch.context() as changed:
        changed.setattr(normals, "COSINE_MARGIN", 1e-13)
        assert key_of(modules) != key
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert key_of(modules) != key


def test_another_source_has_other_code(monkeypatch, tmp_path):
    modules = kernel_modules()
    key = key_of(modules)
    other = tmp_path / "masks.py"
    other.write_text("# changed\n")
    monkeypatch.setattr(masks, "__file__", str(other))
    assert key_of(modules) != key

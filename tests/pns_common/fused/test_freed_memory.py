"""What a process frees it has again without the system's help, once the kernels are loaded."""

import os
import platform
import subprocess
import sys

import pytest

from pns_common.fused import freed_memory

PROGRAM = """
import resource
import numpy as np
from pns_common.fused.freed_memory import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    tables = [np.ones(3 * 2**20, dtype=np.uint8) for _ in range(6)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

{first}
faults()
print(faults())
"""

ROOM = """
import numpy as np
from pns_common.fused.freed_memory import LARGEST_KEPT, keep_freed_memory, make_room

def mib():
    with open("/proc/self/statm") as status:
        return int(status.read().split()[1]) >> 8

keep_freed_memory()
tables = [np.ones(3 * 2**20, dtype=np.uint8) for _ in range(12)]
last = np.ones(2**20, dtype=np.uint8)
del tables
before = mib()
make_room(LARGEST_KEPT)
kept = mib()
make_room(LARGEST_KEPT + 1)
print(before - kept, before - mib())
"""
GLIBC = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")


@GLIBC
def test_tables_of_the_second_call_are_the_firsts_memory():
    counts = [
        int(subprocess.check_output([sys.executable, "-c", PROGRAM.format(first=first)]))
        for first in ("", "keep_freed_memory()")
    ]
    # 18 MiB are 4,608 pages, or 9 where they are huge.
    assert counts[1] <= counts[0] // 4
    assert counts[1] < 500


@GLIBC
def test_there_is_room_for_what_cannot_be_made_of_freed_memory():
    kept, given_back = map(int, subprocess.check_output([sys.executable, "-c", ROOM]).split())
    assert kept == 0
    assert given_back > 20


@GLIBC
@pytest.mark.parametrize(
    "setting",
    [
        {"MALLOC_TRIM_THRESHOLD_": "65536", "MALLOC_MMAP_THRESHOLD_": "1048576"},
        {"MALLOC_MMAP_THRESHOLD_": "1048576"},
        {"GLIBC_TUNABLES": "glibc.malloc.trim_threshold=65536"},
    ],
    ids=["trim", "mmap", "tunables"],
)
def test_the_environment_may_say_what_is_kept(setting):
    program = PROGRAM.format(first="keep_freed_memory()")
    given = os.environ | setting
    faults = int(subprocess.check_output([sys.executable, "-c", program], env=given))
    assert faults >= 9  # each page is a new one, and huge at most


def test_elsewhere_nothing_is_done(monkeypatch):
    monkeypatch.setattr(sys, "platform", "another")
    freed_memory._of_glibc.cache_clear()
    try:
        freed_memory.keep_freed_memory()
        freed_memory.make_room(freed_memory.LARGEST_KEPT + 1)
        assert freed_memory._of_glibc("malloc_trim") is freed_memory._nothing
    finally:
        freed_memory._of_glibc.cache_clear()

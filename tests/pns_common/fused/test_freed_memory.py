"""What a process frees it has again without the system's help, once the kernels are loaded."""

import platform
import subprocess
import sys

import pytest

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


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
def test_tables_of_the_second_call_are_the_firsts_memory():
    counts = [
        int(subprocess.check_output([sys.executable, "-c", PROGRAM.format(first=first)]))
        for first in ("", "keep_freed_memory()")
    ]
    # 18 MiB are 4,608 pages, or 9 where they are huge.
    assert counts[1] <= counts[0] // 4
    assert counts[1] < 500

"""Bit-reproducible torch on one machine, and a fingerprint that says whether it is the same one."""

import hashlib
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch

# The matrices are small: one thread is as fast as two, and the order of sums is fixed.
THREADS = 1


@contextmanager
def deterministic() -> Iterator[None]:
    """Run torch with deterministic algorithms on a fixed number of threads; then restore both."""
    # A GPU's matrix products are deterministic only with a workspace of fixed size.
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    algorithms, threads = torch.are_deterministic_algorithms_enabled(), torch.get_num_threads()
    filling: Any = torch.utils.deterministic
    filled = filling.fill_uninitialized_memory
    torch.use_deterministic_algorithms(True)
    # Nothing here reads memory that was not written: filling it first takes a sixth of a step.
    filling.fill_uninitialized_memory = False
    torch.set_num_threads(THREADS)
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(algorithms)
        filling.fill_uninitialized_memory = filled
        torch.set_num_threads(threads)


def machine_fingerprint() -> str:
    """Return a short hash of what may change the last bits: processor, GPU and libraries."""
    facts = [
        platform.machine(),
        _processor_model(),
        torch.backends.cpu.get_cpu_capability(),
        torch.__version__,
        np.__version__,
    ]
    if torch.cuda.is_available():
        facts.append(torch.cuda.get_device_name())
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()[:16]


def _processor_model() -> str:
    # platform.processor() is empty on most Linux systems.
    cpu_info = Path("/proc/cpuinfo")
    if not cpu_info.exists():
        return platform.processor()
    lines = cpu_info.read_text(encoding="utf-8").splitlines()
    return next((line for line in lines if line.startswith("model name")), platform.processor())

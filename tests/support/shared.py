"""Data that lies beside the project: the tests that read it skip where it is absent."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared"


def shared_path(relative):
    """A file or folder of the shared data."""
    path = SHARED / relative
    if not path.exists():
        pytest.skip(f"needs {relative} of the shared data beside the project")
    return path


@cache
def _arrays(path):
    with np.load(path) as data:
        return {key: data[key] for key in data.files}


def published(name):
    """Arrays of the paper author's published data."""
    return _arrays(shared_path("published") / name)

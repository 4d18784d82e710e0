"""Readers of the files that the command line wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from service.gltf.read.container import read_glb

# Of the example.
FACES = 1920


def tree_of(path: Path) -> dict[str, Any]:
    return msgspec.json.decode(read_glb(path.read_bytes()).text)


def tree_of_bytes(glb: bytes) -> dict[str, Any]:
    return msgspec.json.decode(read_glb(glb).text)

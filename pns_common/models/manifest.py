"""The hashes of the bundled model files: a file that changed by one bit is not served.

`SHA256SUMS` lies beside the files and reads as sha256sum writes it: `sha256sum -c SHA256SUMS`.
"""

from __future__ import annotations

import hashlib
from importlib.resources.abc import Traversable
from pathlib import Path

from pns_common.base.whole_file import replace_file
from pns_common.errors import ModelError

MANIFEST = "SHA256SUMS"


def check_listed(folder: Traversable, name: str, data: bytes) -> None:
    """Check a bundled model's bytes against the manifest beside it.

    Raises:
        ModelError: they are not those that were bundled, or there are no hashes to compare with.
    """
    digest = hashlib.sha256(data).hexdigest()
    path = folder / MANIFEST
    if not path.is_file():
        raise ModelError(name, expected=f"{MANIFEST} beside the bundled models", found="none")
    listed = dict(line.split()[::-1] for line in path.read_text().splitlines())
    wanted = listed.get(f"{name}.onnx", "not listed")
    if digest != wanted:
        raise ModelError(name, expected=f"sha256 {wanted} ({MANIFEST})", found=digest)


def write_manifest(folder: Path) -> None:
    """List every model file of a folder, in one piece."""
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n"
        for path in sorted(folder.glob("*.onnx"))
    ]
    replace_file(folder / MANIFEST, "".join(lines).encode())

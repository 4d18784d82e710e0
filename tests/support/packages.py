"""Folders of bundled models, as another version of the package might have them."""

from __future__ import annotations

from pathlib import Path

from pns_common.model.file import BUNDLED, DEFAULT_MODEL, write_manifest
from tests.support.networks import default_model_bytes, perceptron_bytes, random_layers


def several_models(folder: Path) -> Path:
    """The default model, the paper's, one with a vertex rule, and one whose file is cut short."""
    folder.mkdir()
    for name in {DEFAULT_MODEL, "paper"}:
        (folder / f"{name}.onnx").write_bytes((BUNDLED / f"{name}.onnx").read_bytes())
    (folder / "vertices.onnx").write_bytes(default_model_bytes(0))
    (folder / "broken.onnx").write_bytes(default_model_bytes(0)[:1000])
    write_manifest(folder)
    return folder


def served_file(path: Path) -> str:
    """A model file that is no bundled one."""
    path.write_bytes(perceptron_bytes(random_layers(0)))
    return str(path)

"""`pns info`: a model's card as a table."""

from __future__ import annotations

import json
from typing import Any

from rich.console import Console
from rich.table import Table

from pns_common.onnx_model import OnnxModel


def print_model(model: OnnxModel) -> None:
    """Print what the file says of itself, and its size and hash."""
    card = model.card
    table = Table(title=model.name, show_header=False, title_justify="left")
    rows: dict[str, Any] = {
        "format": card.format,
        "features": card.features,
        "gate sharpness c": card.gate_sharpness,
        "budget C": card.budget,
        "orientation": card.orientation,
        **{f"training: {name}": value for name, value in card.training.items()},
        **{f"metric: {name}": value for name, value in card.metrics.items()},
        "bytes": model.size,
        "sha256": model.hash,
    }
    for name, value in rows.items():
        table.add_row(name, _text(value))
    Console(soft_wrap=True).print(table)


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return value if isinstance(value, str) else json.dumps(value)

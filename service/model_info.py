"""`pns info`: bundled models, and a model's card, as tables."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from pns_common.model_card import ModelCard
from pns_common.onnx_model import DEFAULT_MODEL, OnnxModel

# A metric on the card: what was measured, and its improvement over the reference in per cent.
METRIC_COLUMNS = ("reference_mean", "method_mean", "percent", "low", "high")


def print_models(models: Iterable[OnnxModel]) -> None:
    """Print a line a model."""
    table = Table("model", "features", "budget C", "gate sharpness c", "bytes")
    for model in models:
        name = f"{model.name} (default)" if model.name == DEFAULT_MODEL else model.name
        card = model.card
        values = [card.budget, card.gate_sharpness, model.size]
        table.add_row(name, card.features, *(_text(value) for value in values))
    Console(soft_wrap=True).print(table)


def print_model(model: OnnxModel) -> None:
    """Print what the file says of itself, and its size and hash."""
    card = model.card
    table = Table(title=model.name, show_header=False, title_justify="left")
    table.add_column()
    table.add_column(overflow="fold")  # a hash cut short is no hash
    rows: dict[str, Any] = {
        "format": card.format,
        "features": card.features,
        "gate sharpness c": card.gate_sharpness,
        "budget C": card.budget,
        "orientation": card.orientation,
        **_vertex_rows(card),
        **{f"training: {name}": value for name, value in card.training.items()},
        "bytes": model.size,
        "sha256": model.hash,
    }
    tables = []
    for name, value in card.metrics.items():
        if _is_measured(value):
            tables.append(_metrics_table(name, value))
        else:
            rows[f"metric: {name}"] = value
    for name, value in rows.items():
        table.add_row(name, _text(value))
    console = Console(soft_wrap=True)
    for each in [table, *tables]:
        console.print(each)


def _vertex_rows(card: ModelCard) -> dict[str, Any]:
    """What the card says of the vertex rule, where there is one."""
    if card.vertex_features is None:
        return {}
    return {
        "vertex features": card.vertex_features,
        "vertex gate sharpness c": card.vertex_gate_sharpness,
    }


def _is_measured(value: Any) -> bool:
    """Whether a card's metric is a table of rows as this project's export writes them."""
    return isinstance(value, Mapping) and all(
        isinstance(row, Mapping) and set(METRIC_COLUMNS) <= set(row) for row in value.values()
    )


def _metrics_table(name: str, rows: Mapping[str, Mapping[str, Any]]) -> Table:
    table = Table(title=name, title_justify="left")
    table.add_column("metric")
    for heading in ("Loop", "model", "improvement %", "95 % from", "to"):
        table.add_column(heading, justify="right")
    for metric, row in rows.items():
        cells = [_text(row[column]) for column in METRIC_COLUMNS]
        table.add_row(metric.replace("_", ", "), *cells)
    return table


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return value if isinstance(value, str) else json.dumps(value)

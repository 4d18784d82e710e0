"""`pns info`: the bundled models side by side, and a model's card whole, as tables."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from pns_common.model.card import ModelCard
from pns_common.model.file import DEFAULT_MODEL
from pns_common.model.session import OnnxModel

# What a card holds, by what users call it.
ROWS = {
    "format": "format",
    "features": "features",
    "gate_sharpness": "gate sharpness c",
    "budget": "budget C",
    "orientation": "orientation",
    "vertex_gate_sharpness": "vertex gate sharpness c",
    "base": "base scheme",
    "boundary_strength": "boundary strength b",
    "network_scale": "network scale τ",
    "fold_angle": "fold angle θ",
    "sharpness_levels": "sharpness levels",
    "width": "width W",
    "hidden": "hidden units H",
    "rounds": "rounds",
}
# A metric on the card: what was measured, and its improvement over the reference in per cent.
HEADINGS = {
    "reference_mean": "Loop",
    "method_mean": "model",
    "percent": "improvement %",
    "low": "95 % from",
    "high": "to",
}
# What models are compared by: short headings, each with its data set and metric.
HEADLINE_COLUMNS = {
    "near": ("ridge-held-out", "distance_near"),
    "all": ("ridge-held-out", "distance"),
    "four\nlevels": ("ridge-held-out after 4 levels", "distance"),
}
_LEGEND = """
* default. C: budget; c: sharpness of the gate. Last columns: how much nearer
than Loop to held-out ridges, in %: one level, near the ridge and everywhere;
four levels, everywhere."""
# More columns than this do not fit a terminal; such data are shown row by row.
WIDEST_GRID = 5


def print_models(models: Iterable[OnnxModel]) -> None:
    """Print a line a model, the default one marked."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("model", overflow="fold")
    for heading in ("features", "orientation"):
        table.add_column(heading)
    for heading in ("C", "c", *HEADLINE_COLUMNS):
        table.add_column(heading, justify="right")
    for model in models:
        card = model.card
        name = f"{model.name} *" if model.name == DEFAULT_MODEL else model.name
        values = [_text(card.budget), _text(card.gate_sharpness), *_headline(card)]
        table.add_row(name, card.features, card.orientation, *values)
    console = Console(soft_wrap=True)
    console.print(table, _LEGEND, sep="\n", markup=False, highlight=False)


def print_model(model: OnnxModel) -> None:
    """Print what the file says of itself, and its size and hash."""
    card = model.card
    given = {label: getattr(card, name) for name, label in ROWS.items()}
    rows = {label: value for label, value in given.items() if value is not None}
    rows |= {"runs on": ", ".join(model.providers), "bytes": model.size, "sha256": model.hash}
    console = Console(soft_wrap=True)
    console.print(_list(model.name, rows))
    for title, data in (("training", card.training), ("metrics", card.metrics)):
        for table in _tables(title, data):
            console.print(table)


def _headline(card: ModelCard) -> list[str]:
    """Return the improvements that models are compared by; a dash for what a card does not hold."""
    shown: list[str] = []
    for dataset, metric in HEADLINE_COLUMNS.values():
        row = card.metrics.get(dataset, {}).get(metric)
        shown.append("–" if row is None else f"{row['percent']:+.1f}")
    return shown


def _tables(title: str, data: Mapping[str, Any]) -> Iterator[Table]:
    """Yield nested data as tables: single values in a list, rows of the same columns in a grid."""
    if _is_grid(data):
        yield _grid(title, data)
        return
    inner = {name: value for name, value in data.items() if isinstance(value, Mapping)}
    if single := {name: value for name, value in data.items() if name not in inner}:
        yield _list(title, single)
    for name, value in inner.items():
        yield from _tables(f"{title}: {name}", value)


def _is_grid(data: Mapping[str, Any]) -> bool:
    rows = list(data.values())
    if not rows or not all(isinstance(row, Mapping) and list(row) == list(rows[0]) for row in rows):
        return False
    if any(isinstance(cell, Mapping | list) for row in rows for cell in row.values()):
        return False
    return 0 < len(rows[0]) <= WIDEST_GRID


def _grid(title: str, rows: Mapping[str, Mapping[str, Any]]) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column()
    for heading in next(iter(rows.values())):
        table.add_column(HEADINGS.get(heading, heading), justify="right")
    for name, row in rows.items():
        table.add_row(name.replace("_", ", "), *(_text(value) for value in row.values()))
    return table


def _list(title: str, rows: Mapping[str, Any]) -> Table:
    table = Table(title=title, show_header=False, title_justify="left")
    table.add_column()
    table.add_column(overflow="fold")  # a hash cut short is no hash
    for name, value in rows.items():
        table.add_row(name, _text(value))
    return table


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return value if isinstance(value, str) else json.dumps(value)

"""Tables of improvements over Loop, each row with the envelope's limit and others' numbers."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from train.experiments.harness.experiment import Cell, Column
from train.metrics.one_step import METRICS, Improvement
from train.metrics.tables import METRIC_TITLES

COLUMNS = (
    Column("method", "Method"),
    Column("dataset", "Data"),
    Column("metric", "Metric"),
    Column("loop", "Loop", ".6f"),
    Column("mean", "Mean", ".6f"),
    Column("improvement_percent", "Improvement %", "+.2f"),
    Column("low", "95 % low", "+.2f"),
    Column("high", "95 % high", "+.2f"),
    Column("limit_percent", "Limit %", "+.2f"),
    Column("share_of_limit", "Used", ".0%"),
    Column("paper_percent", "Paper %", "+.1f"),
    Column("paper_low", "Paper low", "+.1f"),
    Column("paper_high", "Paper high", "+.1f"),
    Column("published_percent", "Published %", "+.2f"),
)
SMALLEST_LIMIT = 0.1
"""Per cent of improvement below which no share of the limit is given."""

NOTHING: Mapping[str, Any] = MappingProxyType({})

LIMIT_NOTE = (
    "*Limit* is the best that any network could do with the same C and c: the distance minimised "
    "over each vertex's ball. *Used* is the share of it that the row reaches."
)


def comparison_rows(
    method: str,
    dataset: str,
    improvements: Mapping[str, Improvement],
    *,
    limit: Mapping[str, Improvement] = NOTHING,
    paper: Mapping[str, tuple[float, float, float]] = NOTHING,
    published: Mapping[str, float] = NOTHING,
) -> list[tuple[Cell, ...]]:
    """Return one row a metric; `limit` is left out for methods that know no envelope."""
    rows: list[tuple[Cell, ...]] = []
    for metric in METRICS:
        improvement = improvements[metric]
        best = limit[metric].percent if metric in limit else None
        rows.append(
            (
                method,
                dataset,
                METRIC_TITLES[metric],
                improvement.reference_mean,
                improvement.method_mean,
                improvement.percent,
                improvement.low,
                improvement.high,
                best,
                # A share of next to nothing says nothing, nor does a share of a loss.
                improvement.percent / best
                if best and best > SMALLEST_LIMIT and improvement.percent > 0
                else None,
                *paper.get(metric, (None, None, None)),
                published.get(metric),
            )
        )
    return rows

"""Tables of improvements over Loop, each row with the envelope's limit and others' numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from train.experiments.harness.experiment import column
from train.metrics.one_step import METRIC_TITLES, METRICS, Improvement

# Per cent of improvement below which no share of the limit is given.
SMALLEST_LIMIT = 0.1

NOTHING: Mapping[str, Any] = {}

LIMIT_NOTE = (
    "*Limit* is the best that any network could do with the same C and c: the distance minimised "
    "over each vertex's ball. *Used* is the share of it that the row reaches."
)


@dataclass(frozen=True, slots=True)
class Comparison:
    """One metric of one method on one data set, over Loop."""

    method: str = column("Method")
    dataset: str = column("Data")
    metric: str = column("Metric")
    loop: float = column("Loop", ".6f")
    mean: float = column("Mean", ".6f")
    improvement_percent: float = column("Improvement %", "+.2f")
    low: float = column("95 % low", "+.2f")
    high: float = column("95 % high", "+.2f")
    limit_percent: float | None = column("Limit %", "+.2f")
    share_of_limit: float | None = column("Used", ".0%")
    paper_percent: float | None = column("Paper %", "+.1f")
    paper_low: float | None = column("Paper low", "+.1f")
    paper_high: float | None = column("Paper high", "+.1f")
    published_percent: float | None = column("Published %", "+.2f")


def comparison_rows(
    method: str,
    dataset: str,
    improvements: Mapping[str, Improvement],
    *,
    limit: Mapping[str, Improvement] = NOTHING,
    paper: Mapping[str, tuple[float, float, float]] = NOTHING,
    published: Mapping[str, float] = NOTHING,
) -> list[Comparison]:
    """Return one row a metric; `limit` is left out for methods that know no envelope."""
    rows: list[Comparison] = []
    for metric in METRICS:
        improvement = improvements[metric]
        best = limit[metric].percent if metric in limit else None
        printed, low, high = paper.get(metric, (None, None, None))
        rows.append(
            Comparison(
                method=method,
                dataset=dataset,
                metric=METRIC_TITLES[metric],
                loop=improvement.reference_mean,
                mean=improvement.method_mean,
                improvement_percent=improvement.percent,
                low=improvement.low,
                high=improvement.high,
                limit_percent=best,
                # A share of next to nothing says nothing, nor does a share of a loss.
                share_of_limit=improvement.percent / best
                if best and best > SMALLEST_LIMIT and improvement.percent > 0
                else None,
                paper_percent=printed,
                paper_low=low,
                paper_high=high,
                published_percent=published.get(metric),
            )
        )
    return rows

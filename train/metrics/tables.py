"""Result tables for the terminal."""

from collections.abc import Mapping

from rich.table import Table

from train.metrics.one_step import Improvement

METRIC_TITLES: Mapping[str, str] = {
    "distance_near": "Distance RMSE, near",
    "distance": "Distance RMSE, all",
    "hausdorff_near": "Hausdorff, near",
    "hausdorff": "Hausdorff, all",
    "normal_near": "Normal error, near",
    "normal": "Normal error, all",
    "jump": "Largest normal jump",
}


def improvement_table(title: str, improvements: Mapping[str, Improvement]) -> Table:
    """Return one row a metric: Loop's mean, the method's, and the improvement in per cent.

    Fits a terminal of 80 columns.
    """
    table = Table(title=title, title_justify="left")
    table.add_column("Metric")
    for heading in ("Loop", "PNS", "Improvement", "95 % interval"):
        table.add_column(heading, justify="right")
    for metric, row in improvements.items():
        table.add_row(
            METRIC_TITLES[metric],
            f"{row.reference_mean:.6f}",
            f"{row.method_mean:.6f}",
            f"{row.percent:+.2f} %",
            f"{row.low:+.2f} … {row.high:+.2f}",
        )
    return table

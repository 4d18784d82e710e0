"""One style for all figures: readable in print, in grey and by the colour-blind."""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

# Width of a full-width figure, inches.
TEXT_WIDTH = 6.6

STYLE: Mapping[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.labelsize": 8,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.3,
    "lines.markersize": 4,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 160,
    # Text stays text, and the file says nothing of when it was made.
    "pdf.fonttype": 42,
}

# Okabe and Ito's palette; marker and dash differ too, so that grey print keeps them apart.
COLOURS: Mapping[str, str] = {
    "loop": "#0072B2",
    "butterfly": "#E69F00",
    "pn-triangles": "#56B4E9",
    "quadric": "#F0E442",
    "normal-displacement": "#CC79A7",
    "curvature-adaptive": "#999999",
    "pns": "#009E73",
    "unconstrained": "#D55E00",
    "surface": "#000000",
}
# Light where there is nothing to see, so that shading and thin lines stay readable.
SEQUENTIAL = LinearSegmentedColormap.from_list("sequential", ["#DADADA", "#E69F00", "#7A1F00"])

MARKERS: Mapping[str, str] = {
    "loop": "o",
    "butterfly": "^",
    "pn-triangles": "v",
    "quadric": "P",
    "normal-displacement": "x",
    "curvature-adaptive": "d",
    "pns": "s",
    "unconstrained": "X",
}
TITLES: Mapping[str, str] = {
    "loop": "Loop",
    "butterfly": "Modified Butterfly",
    "pn-triangles": "PN-triangles",
    "quadric": "1-ring quadric",
    "normal-displacement": "Normal displacement",
    "curvature-adaptive": "Curvature-adaptive",
    "pns": "PNS",
    "unconstrained": "Unconstrained MLP",
    "surface": "Analytic surface",
}


def panels(columns: int, height: float, rows: int = 1, **options: Any) -> tuple[Figure, list[Any]]:
    """Return a full-width figure of equal panels, row by row; call it within `shared_style`."""
    figure = Figure(figsize=(TEXT_WIDTH, height))
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(axes.reshape(-1))


def method_style(name: str) -> dict[str, object]:
    """Return colour, marker and label of a method's line."""
    dark = COLOURS[name] if name != "quadric" else "#B8A800"
    return {"color": dark, "marker": MARKERS[name], "label": TITLES[name]}


def zero_line(axes: Axes) -> None:
    """Draw the line of no change."""
    axes.axhline(0, color="0.3", linewidth=0.7, zorder=1)


def shared_style() -> AbstractContextManager[None]:
    """Return a context in which figures are drawn and saved in the shared style."""
    return matplotlib.rc_context(dict(STYLE))

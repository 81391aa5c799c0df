"""One look for every figure: Okabe–Ito colours, each with a shape of its own, legible in print and on a screen."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

BLACK = "#222222"
GREY = "#767676"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
BLUE = "#0072B2"
VERMILION = "#D55E00"
PURPLE = "#CC79A7"

_SETTINGS: dict[str, Any] = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "lines.markersize": 5.5,
    "savefig.dpi": 150,
    "figure.facecolor": "white",
    "svg.fonttype": "path",
    "svg.hashsalt": "draglag",
}


@contextmanager
def house_style() -> Iterator[None]:
    """Draw inside this."""
    import matplotlib as mpl

    with mpl.rc_context(_SETTINGS):
        yield


def new_figure(width_in: float = 7.2, height_in: float = 4.2) -> Any:
    """An empty figure with an off-screen canvas; no pyplot, no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Any, folder: Any, name: str) -> str:
    """Write ``name``.svg and ``name``.png; returns the SVG's text for embedding."""
    import io

    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": "draglag"})
    svg = buffer.getvalue().decode()
    (folder / f"{name}.svg").write_text(svg, "utf-8")
    figure.savefig(folder / f"{name}.png", metadata={"Software": "draglag"})
    return svg

"""The look of all figures: Okabe–Ito colours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from draglag.provenance import Source

BLACK = "#222222"
GREY = "#767676"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
BLUE = "#0072B2"
VERMILION = "#D55E00"
PURPLE = "#CC79A7"

# For pages whose reader may like them dark. Drawings (``themed``) bring colours of their own for that; of pictures
# made of points, light and dark are turned round and hues kept.
FIGURE_CSS = """
figure{margin:1.5rem 0}figcaption{font-size:.9rem}
figure svg,figure img{display:block;margin:0 auto;max-width:100%;height:auto;border-radius:6px}
@media (prefers-color-scheme:dark){figure img[src^="data:image/png"]{filter:invert(.9) hue-rotate(180deg)}}
@media print{figure img[src^="data:image/png"]{filter:none}}
"""
# Colour on paper → its name and what it is on a dark ground.
_DARK = {
    BLACK: ("ink", "#e6e9ec"),
    "#000000": ("text", "#e6e9ec"),
    "#ffffff": ("paper", "#20252a"),
    "#dddddd": ("grid", "#3a424a"),
    GREY: ("grey", "#a2abb3"),
    GREEN: ("green", "#2fc49b"),
    BLUE: ("blue", "#56a9e8"),
    VERMILION: ("vermilion", "#ee7a3b"),
}

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
    "figure.autolayout": False,  # nor the other: a figure has the layout it was made with
    "figure.constrained_layout.use": False,
    "svg.fonttype": "path",
    "text.parse_math": False,  # a name with $ in it is a name
    "svg.hashsalt": "draglag",
}


@contextmanager
def house_style() -> Iterator[None]:
    """Context in which to draw."""
    import matplotlib as mpl

    with mpl.rc_context(_SETTINGS):
        yield


def plain_log_ticks(axis: Any) -> None:
    """Label a logarithmic axis, once all is drawn, with plain numbers: 20, 50, 100 …"""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = axis.get_view_interval()
    # Within less than one decade, 1, 2 and 5 may leave no more than one label.
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)) if high > 5 * low else MaxNLocator(5))
    axis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def new_figure(width_in: float = 7.2, height_in: float = 4.2) -> Any:
    """An empty figure, without pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def themed(svg: str) -> str:
    """The SVG for a page: light on dark on a dark page, unchanged on paper."""
    start = svg.index("<svg")
    drawing = svg[start:]
    for paper, (name, _) in _DARK.items():
        drawing = drawing.replace(paper.lower(), f"var(--figure-{name})")
    light = ";".join(f"--figure-{name}:{paper.lower()}" for paper, (name, _) in _DARK.items())
    dark = ";".join(f"--figure-{name}:{colour}" for name, colour in _DARK.values())
    # Text has no colour of its own in what matplotlib writes: it is black by default.
    look = (
        f"<style>svg{{{light};fill:var(--figure-text)}}"
        f"@media screen and (prefers-color-scheme:dark){{svg{{{dark}}}}}</style>"
    )
    inside = drawing.index(">") + 1
    return svg[:start] + drawing[:inside] + look + drawing[inside:]


MARK_PT, MARK_SHARE = 38.0, 0.2  # size of the letters of SIMULATED, and their most of a low figure's height


def sign(figure: Any, source: Source) -> None:
    """Write its source at a figure's foot, and SIMULATED across it if simulated."""
    figure.supxlabel(source.line(), x=0.995, ha="right", fontsize=6.5, color=GREY)
    if source.simulated:  # its margins hold legends and titles
        size_pt = min(MARK_PT, MARK_SHARE * 72 * figure.get_figheight())
        look = {"color": "#808080", "alpha": 0.25, "rotation": 20, "ha": "center", "va": "center"}
        figure.text(0.5, 0.55, "SIMULATED", fontsize=size_pt, **look)


def save(figure: Any, folder: Any, name: str, source: Source) -> str:
    """The SVG for embedding; ``name``.svg and ``name``.png are written, signed."""
    import io

    sign(figure, source)
    lay_out(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": "draglag"})
    svg = buffer.getvalue().decode()
    (folder / f"{name}.svg").write_text(svg, "utf-8")
    figure.savefig(folder / f"{name}.png", metadata={"Software": "draglag"})
    return svg


def lay_out(figure: Any) -> None:
    """Place the figure's parts for good: with a layout engine, ``savefig`` does so and draws twice for each format."""
    figure.set_dpi(_SETTINGS["savefig.dpi"])  # widths of letters depend on it
    if figure.axes:
        figure.get_layout_engine().execute(figure)
    figure.set_layout_engine(None)

"""A session's figures for a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from draglag.analysis import Analysis
from draglag.drawing import style
from draglag.errors import DataError, cause
from draglag.messages import message
from draglag.recording import Session
from draglag.report import figures

WIDTHS_MM = {"single": 85.0, "double": 180.0}
"""One and two columns of the common formats (Elsevier 90 and 190, Springer 84 and 174, IEEE 88 and 181 mm)."""

_MM = 1 / 25.4
_LETTERS_PT = {"single": 7.0, "double": 8.0}  # journals ask for 6 to 8 pt in print
_RATIO = 0.68  # height over width


def write_journal_figures(session: Session, analysis: Analysis, folder: Path | str) -> list[Path]:
    """PDF and SVG files of every main figure, in both widths.

    Raises DataError if the folder holds something or cannot be written.
    """
    out = Path(folder)
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise DataError(message("{path}: is not empty", path=out), "Choose a new or an empty folder")
    except OSError as error:
        raise DataError(
            message("{path}: cannot be made ({why})", path=out, why=cause(error)), "Choose another folder"
        ) from None
    written = []
    for name, draw in _drawings(session, analysis):
        for columns, width_mm in WIDTHS_MM.items():
            with style.house_style():
                drawn = draw()
                _fit(drawn, width_mm * _MM, _LETTERS_PT[columns])
                for suffix in ("pdf", "svg"):
                    path = out / f"{name}-{width_mm:.0f}mm.{suffix}"
                    # Of the same data the same file: no date.
                    drawn.savefig(path, metadata={"CreationDate" if suffix == "pdf" else "Date": None})
                    written.append(path)
    return written


def _drawings(session: Session, analysis: Analysis) -> list[tuple[str, Any]]:
    made: list[tuple[str, Any]] = []
    if any(run.latency_ms is not None for run in analysis.runs):
        made.append(("latency", lambda: figures.latency_figure(analysis)))
        made.append(("width", lambda: figures.width_figure(analysis, session)))
    if analysis.taps:
        made.append(("taps", lambda: figures.taps_figure(analysis)))
    if analysis.validation and analysis.curve is not None:
        made.append(("validation", lambda: figures.speeds_figure(analysis)))
    return made


def _fit(drawn: Any, width_in: float, letters_pt: float) -> None:
    from matplotlib.text import Text

    drawn.set_size_inches(width_in, _RATIO * width_in)
    for text in drawn.findobj(Text):
        text.set_fontsize(letters_pt)

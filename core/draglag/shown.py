"""Results as a notebook or a prompt shows them."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping, Sequence, Sized
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

LONGEST = 60  # letters of one value


def brief(record: Any) -> str:
    """``repr`` of a dataclass with lengths of arrays and lists; empty ones left out."""
    parts = [
        f"{spec.name}={words}"
        for spec in fields(record)
        if spec.repr and (words := _word(getattr(record, spec.name))) is not None
    ]
    return f"{type(record).__name__}({', '.join(parts)})"


def chance(p_value: float) -> str:
    """A p-value, as everywhere in windows, reports and commands."""
    return "p < 0.001" if p_value < 1e-3 else f"p = {p_value:.2g}"


def _word(value: object) -> str | None:
    if value is None or (isinstance(value, Sized) and not len(value)):
        return None
    if isinstance(value, np.ndarray):
        return f"<{'×'.join(map(str, value.shape))}>"
    if isinstance(value, float | np.floating):
        return f"{float(value):.6g}"
    if isinstance(value, str):
        return repr(value if len(value) <= LONGEST else value[:LONGEST] + "…")
    if isinstance(value, Mapping) or (isinstance(value, Sequence | set | frozenset) and _is_large(value)):
        return f"<{len(value)}>"
    if isinstance(value, tuple):
        return f"({', '.join(filter(None, map(_word, value)))})"
    if is_dataclass(value):
        return f"<{type(value).__name__}>"
    text = repr(value)
    return text if len(text) <= LONGEST else f"<{type(value).__name__}>"


def _is_large(values: Iterable[object]) -> bool:
    items = list(values)
    return len(items) > 4 or any(not isinstance(item, str | int | float) for item in items)


def table_html(title: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A titled table: cells escaped, numbers to four digits, None a dash."""
    cells = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
    lines = "".join("<tr>" + "".join(f"<td>{html.escape(_cell(cell))}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<p><b>{html.escape(title)}</b></p><table><thead><tr>{cells}</tr></thead><tbody>{lines}</tbody></table>"


def matched(value: float, half_interval: float) -> str:
    """Value ± half interval: the latter with two digits."""
    if not (math.isfinite(value) and math.isfinite(half_interval)) or half_interval <= 0.0:
        return f"{value:.4g}"
    place = 1 - math.floor(math.log10(half_interval))
    rounded = round(half_interval, place)
    if rounded >= 10 ** (2 - place):  # 0.0996 is 0.10, not 0.100
        place -= 1
    places = max(0, place)
    return f"{round(value, place):.{places}f} ± {round(half_interval, place):.{places}f}"


def _cell(value: object) -> str:
    if value is None or value != value:
        return "–"
    return f"{float(value):.4g}" if isinstance(value, float | np.floating) else str(value)

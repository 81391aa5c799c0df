"""The HTML page of many sessions."""

from __future__ import annotations

import html
from collections.abc import Sequence

from draglag_app.cli.batch import Outcome, Sparkline

WIDTH, HEIGHT, EDGE = 160, 36, 3  # of a picture, CSS pixels

_CSS = """:root{color-scheme:light dark}
body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:90rem;padding:0 1rem}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}
th,td{padding:.25rem .6rem;border-bottom:1px solid #8884;text-align:right}
td{white-space:nowrap}th{vertical-align:bottom}
th:first-child,td:first-child,.text{text-align:left}td.problem{text-align:left;white-space:normal}
.wide{overflow-x:auto}svg{display:block}circle{fill:#767676}
polyline{fill:none;stroke:#0072b2;stroke-width:1.5}line{stroke:#d55e00;stroke-dasharray:3 2}"""


def page(title: str, head: Sequence[str], rows: Sequence[tuple[Outcome, Sequence[str]]], legend: str) -> str:
    """The page; ``legend``: of the pictures."""
    frame = _frame([outcome.picture for outcome, _ in rows])
    columns = list(zip(*(cells for outcome, cells in rows if not outcome.problem), strict=True)) or [()] * len(head)
    types = [_column_type(column) for column in columns]
    heads = f"<th>{html.escape(head[0])}</th><th></th>"
    heads += "".join(f"<th{look}>{html.escape(name)}</th>" for name, look in zip(head[1:], types[1:], strict=True))
    lines = []
    for outcome, cells in rows:
        first = f"<td>{html.escape(cells[0])}</td><td>{sparkline(outcome.picture, frame)}</td>"
        if outcome.problem:
            rest = f'<td class="problem" colspan="{len(head) - 1}">{html.escape(outcome.problem)}</td>'
        else:
            rest = "".join(
                f"<td{look}>{html.escape(cell)}</td>" for cell, look in zip(cells[1:], types[1:], strict=True)
            )
        lines.append(f"<tr>{first}{rest}</tr>")
    failed = sum(bool(outcome.problem) for outcome, _ in rows)
    said = f"{len(rows)} sessions{f', {failed} of them failed' if failed else ''}. {legend}"
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{_CSS}</style></head><body><h1>{html.escape(title)}</h1><p>{html.escape(said)}</p>"
        f'<div class="wide"><table><thead><tr>{heads}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'
        "</body></html>"
    )


def _column_type(column: Sequence[str]) -> str:
    return "" if all(not cell or cell[-1].isdigit() for cell in column) else ' class="text"'


def _frame(pictures: Sequence[Sparkline]) -> tuple[float, float]:
    xs = [x for p in pictures for x in (*p.x, *(mark[0] for mark in p.marks))]
    ys = [y for p in pictures for y in (*p.y, *(mark[1] for mark in p.marks), *([p.floor] if p.floor else []))]
    return max(xs, default=1.0) or 1.0, max(ys, default=1.0) or 1.0


def sparkline(picture: Sparkline, frame: tuple[float, float]) -> str:
    """Inline SVG; ``frame``: greatest x and y."""

    def at(x: float, y: float) -> tuple[float, float]:
        across = EDGE + (WIDTH - 2 * EDGE) * x / frame[0]
        return round(across, 1), round(HEIGHT - EDGE - (HEIGHT - 2 * EDGE) * max(y, 0.0) / frame[1], 1)

    parts = []
    if picture.floor is not None:
        _, y = at(0.0, picture.floor)
        parts.append(f'<line x1="{EDGE}" x2="{WIDTH - EDGE}" y1="{y}" y2="{y}"/>')
    if picture.x:
        points = " ".join("{},{}".format(*at(x, y)) for x, y in zip(picture.x, picture.y, strict=True))
        parts.append(f'<polyline points="{points}"/>')
    marks = picture.marks or ([(picture.x[0], picture.y[0])] if len(picture.x) == 1 else [])
    parts += ['<circle cx="{}" cy="{}" r="1.6"/>'.format(*at(*mark)) for mark in marks]
    size = f'width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
    return f'<svg {size} role="img" aria-label="sparkline">{"".join(parts)}</svg>'

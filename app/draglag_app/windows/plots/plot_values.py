"""Values under the mouse; files of a plot."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, cast

import numpy as np
from pyqtgraph.exporters import ImageExporter, SVGExporter
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter

from draglag.errors import DataError, cause
from draglag.messages import message
from draglag.system.temporary import new_file

Column = np.ndarray[Any, Any]
_DOT_PX, _LINE_PX = 14.0, 8.0


@dataclass(frozen=True)
class Series:
    """Points, or a line; ``words``: per point, or none."""

    x: Column
    y: Column
    joined: bool = False
    words: Sequence[str] = ()


@dataclass(frozen=True)
class Near:
    """A place and its text."""

    x: float
    y: float
    words: str


def near(view: Any, at: Any, shown: Mapping[str, Series], axes: tuple[str, str]) -> Near | None:
    """The point, else the place on a line, close to ``at`` in pyqtgraph's ``view``."""
    (x0, x1), (y0, y1) = view.viewRange()
    first, second = view.mapViewToScene(_point(x0, y0)), view.mapViewToScene(_point(x1, y1))
    across, down = (second.x() - first.x()) / ((x1 - x0) or 1.0), (second.y() - first.y()) / ((y1 - y0) or 1.0)
    mouse = np.array([at.x(), at.y()])
    best: tuple[bool, float, Near] | None = None
    for name, series in shown.items():
        table = np.column_stack([np.asarray(series.x, float), np.asarray(series.y, float)])
        if not len(table):
            continue
        pixels = (table - [x0, y0]) * [across, down] + [first.x(), first.y()]
        if series.joined and len(table) > 1:
            k, share, apart = _on_segments(pixels, mouse)
            place, limit = table[k] + share * (table[k + 1] - table[k]), _LINE_PX
        else:
            gaps = np.where(np.isfinite(pixels).all(1), np.hypot(*(pixels - mouse).T), np.inf)
            k = int(np.argmin(gaps))
            apart, place, limit = float(gaps[k]), table[k], _DOT_PX
        if not apart < limit or not np.isfinite(place).all():
            continue
        said = series.words[k] if k < len(series.words) else _said(name, place, axes)
        rank = (series.joined, apart)
        if best is None or rank < best[:2]:
            best = (*rank, Near(float(place[0]), float(place[1]), said))
    return None if best is None else best[2]


def _point(x: float, y: float) -> Any:
    from PySide6.QtCore import QPointF

    return QPointF(x, y)


def _on_segments(pixels: Column, mouse: Column) -> tuple[int, float, float]:
    start, way = pixels[:-1], np.diff(pixels, axis=0)
    length = (way**2).sum(1)
    share = np.clip(((mouse - start) * way).sum(1) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    gaps = np.hypot(*(start + share[:, None] * way - mouse).T)
    gaps = np.where(np.isfinite(gaps), gaps, np.inf)
    k = int(np.argmin(gaps))
    return k, float(share[k]), float(gaps[k])


def _said(name: str, place: Column, axes: tuple[str, str]) -> str:
    return "\n".join([name, *(f"{value:.4g} {unit(title)}".strip() for value, title in zip(place, axes, strict=True))])


def unit(title: str) -> str:
    """The unit in brackets, or empty."""
    found = re.search(r"\(([^()]*)\)\s*$", title)
    return "" if found is None else found[1].removeprefix("± ")


def as_csv(axes: tuple[str, str], numbers: Mapping[str, tuple[Column, ...]]) -> str:
    """CSV with the axes' titles as header."""
    rows = [f"series,{_plain(axes[0])},{_plain(axes[1])},more"]
    for name, columns in numbers.items():
        rows += [",".join([_plain(name), *(f"{value:.9g}" for value in row)]) for row in zip(*columns, strict=False)]
    return "\n".join(rows) + "\n"


def _plain(text: str) -> str:
    return text.replace(",", ";")


def write_picture(item: Any, path: Path, width_px: int, source: str) -> None:
    """Write an SVG or PNG with its source. Raises DataError."""
    try:
        if path.suffix == ".svg":
            with new_file(path, replace=True) as growing:
                growing.write_bytes(signed_svg(SVGExporter(item).export(toBytes=True), source))
            return
        exporter = ImageExporter(item)
        exporter.parameters()["width"] = width_px
        image = signed(exporter.export(toBytes=True), source)
        with new_file(path, replace=True) as growing:
            if not image.save(str(growing), cast(Any, "PNG")):  # which takes text, whatever its stubs say
                raise DataError(
                    message("{path}: the picture cannot be written", path=path), "Make room or choose another folder"
                )
    except OSError as error:
        raise cannot_write(path, error) from None


def signed(image: QImage, source: str) -> QImage:
    """The picture with its source below."""
    high_px = max(14, round(0.016 * image.width()))
    out = QImage(image.width(), image.height() + round(1.6 * high_px), QImage.Format.Format_RGB32)
    out.fill(image.pixelColor(0, 0))
    painter = QPainter(out)
    painter.drawImage(0, 0, image)
    font = painter.font()
    font.setPixelSize(high_px)
    painter.setFont(font)
    painter.setPen(QColor("#808080"))
    strip = QRectF(0, image.height(), image.width() - high_px, 1.5 * high_px)
    painter.drawText(strip, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, source)
    painter.end()
    return out


def signed_svg(svg: bytes, source: str) -> bytes:
    """The drawing with its source below; unchanged if of unknown size."""
    text = svg.decode()
    box = re.search(r'viewBox\s*="([-\d.]+) ([-\d.]+) ([\d.]+) ([\d.]+)"', text)
    if box is None:
        return svg
    x, y, wide, high = (float(value) for value in box.groups())
    more = max(14.0, 0.025 * wide)
    text = text.replace(box[0], f'viewBox="{x:g} {y:g} {wide:g} {high + more:g}"', 1)
    line = (
        f'<text x="{x + wide - 4:g}" y="{y + high + 0.75 * more:g}" text-anchor="end" font-family="sans-serif" '
        f'font-size="{0.6 * more:g}" fill="#808080">{escape(source)}</text>'
    )
    end = text.rindex("</svg>")
    return (text[:end] + line + text[end:]).encode()


def write_text(text: str, path: Path) -> None:
    """Write a text file. Raises DataError."""
    try:
        with new_file(path, replace=True) as growing:
            growing.write_text(text, "utf-8")
    except OSError as error:
        raise cannot_write(path, error) from None


def cannot_write(path: Path, error: OSError) -> DataError:
    return DataError(message("{path}: cannot be written ({why})", path=path, why=cause(error)), "Choose another folder")

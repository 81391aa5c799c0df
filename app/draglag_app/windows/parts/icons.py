"""Line icons in the theme's colours."""

from __future__ import annotations

import tempfile
from pathlib import Path

from PySide6.QtCore import QByteArray, Qt
from PySide6.QtGui import QIcon, QPainter, QPixmap
from PySide6.QtSvg import QSvgRenderer

from draglag_resources import resource


def icon(name: str, colour: str, side_px: int = 44) -> QIcon:
    """The icon, or an empty one."""
    file = resource("icons", f"{name}.svg")
    if not file.is_file():
        return QIcon()
    renderer = QSvgRenderer(QByteArray(file.read_text("utf-8").replace("currentColor", colour).encode()))
    pixmap = QPixmap(side_px, side_px)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    renderer.render(painter)
    painter.end()
    return QIcon(pixmap)


_folder: tempfile.TemporaryDirectory[str] | None = None


def icon_file(name: str, colour: str) -> str:
    """The icon as a file, for style sheets."""
    global _folder
    if _folder is None:
        _folder = tempfile.TemporaryDirectory(prefix="draglag-icons-")
    path = Path(_folder.name) / f"{name}-{colour.lstrip('#')}.svg"
    if not path.exists():
        text = resource("icons", f"{name}.svg").read_text("utf-8")
        path.write_text(text.replace("currentColor", colour), "utf-8")
    return path.as_posix()

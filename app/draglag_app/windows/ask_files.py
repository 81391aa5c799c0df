"""Asking for files and folders: the dialog begins in a folder that is there, a name gets the ending it needs."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget

_last = {"folder": ""}
"""Where something was read or written last: the next thing without a place of its own begins there."""


def start_folder(folder: str | Path) -> str:
    """The folder, or the nearest above it that is there: sessions may have none before the first."""
    place = Path(folder).expanduser()
    while not place.is_dir() and place != place.parent:
        place = place.parent
    return str(place)


def ask_open(parent: QWidget, title: str, folder: str | Path, kind: str) -> Path | None:
    """A file to read; None when the operator changes their mind."""
    name, _ = QFileDialog.getOpenFileName(parent, title, start_folder(folder), kind)
    return _remembered(name)


def _remembered(name: str) -> Path | None:
    if not name:
        return None
    _last["folder"] = str(Path(name).parent)
    return Path(name)


def ask_folder(parent: QWidget, title: str, folder: str | Path) -> Path | None:
    """A folder; None when the operator changes their mind."""
    name = QFileDialog.getExistingDirectory(parent, title, start_folder(folder))
    return Path(name) if name else None


def ask_new_folder(parent: QWidget, title: str, start: Path) -> Path | None:
    """A folder to write into, which need not be there yet: its name can be typed, ``start`` is proposed."""
    proposed = str(Path(start_folder(start.parent)) / start.name)
    name, _ = QFileDialog.getSaveFileName(parent, title, proposed, "", "", QFileDialog.Option.DontConfirmOverwrite)
    return _remembered(name)


def ask_save(parent: QWidget, title: str, start: str | Path, kind: str) -> Path | None:
    """Where to write; the ending is that of ``start`` unless another is typed. None when they change their mind.

    The dialog asks before a file is replaced that was named in full; this asks where the ending was added.
    """
    start = Path(start)
    folder = _last["folder"] or Path.home() if start.parent == Path() else start.parent
    name, _ = QFileDialog.getSaveFileName(parent, title, str(Path(start_folder(folder)) / start.name), kind)
    path = _remembered(name)
    if path is None:
        return None
    if path.suffix == start.suffix:
        return path
    path = path.with_name(path.name + start.suffix)
    if path.exists():
        text = QCoreApplication.translate("Files", "{name} exists already. Replace it?").format(name=path.name)
        answer = QMessageBox.question(parent, "draglag", text, defaultButton=QMessageBox.StandardButton.No)
        if answer != QMessageBox.StandardButton.Yes:
            return None
    return path

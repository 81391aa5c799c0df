"""Questions for files; ``then`` gets the answer, if any."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QWidget

from draglag_app.windows.parts.file_dialogs import Mode, ask_whether, pick_files

Then = Callable[[Path], None]

_last = {"folder": ""}
"""Where a file was last read or written: default of the next dialog."""


def start_folder(folder: str | Path) -> str:
    """The folder, or its nearest existing parent."""
    place = Path(folder).expanduser()
    while not place.is_dir() and place != place.parent:
        place = place.parent
    return str(place)


def ask_open(parent: QWidget, title: str, folder: str | Path, kind: str, then: Then) -> None:
    """Ask for a file to read."""
    ask_open_several(parent, title, folder, kind, lambda paths: then(paths[0]), Mode.ExistingFile)


def ask_open_several(
    parent: QWidget,
    title: str,
    folder: str | Path,
    kind: str,
    then: Callable[[list[Path]], None],
    mode: Mode = Mode.ExistingFiles,
) -> None:
    """Ask for files to read."""

    def chosen(paths: list[Path]) -> None:
        _remember(paths[0])
        then(paths)

    pick_files(parent, title, Path(start_folder(folder)), kind, mode, chosen)


def _remember(path: Path) -> None:
    _last["folder"] = str(path.parent)


def ask_folder(parent: QWidget, title: str, folder: str | Path, then: Then) -> None:
    """Ask for an existing folder."""
    pick_files(parent, title, Path(start_folder(folder)), "", Mode.Directory, lambda paths: then(paths[0]))


def ask_new_folder(parent: QWidget, title: str, start: Path, then: Then) -> None:
    """Ask for a folder to write."""

    def chosen(paths: list[Path]) -> None:
        _remember(paths[0])
        then(paths[0])

    pick_files(parent, title, Path(start_folder(start.parent)) / start.name, "", Mode.AnyFile, chosen)


def ask_save(parent: QWidget, title: str, start: str | Path, kind: str, then: Then) -> None:
    """Ask for a file to write, ending as ``start`` by default; replacing needs consent."""
    start = Path(start)
    folder = _last["folder"] or Path.home() if start.parent == Path() else start.parent

    def chosen(paths: list[Path]) -> None:
        path = paths[0]
        _remember(path)
        if path.suffix != start.suffix:
            path = path.with_name(path.name + start.suffix)
        if not path.exists():
            then(path)
            return
        text = QCoreApplication.translate("Files", "{name} exists already. Replace it?").format(name=path.name)
        ask_whether(parent, text, lambda: then(path))

    pick_files(parent, title, Path(start_folder(folder)) / start.name, kind, Mode.AnyFile, chosen)

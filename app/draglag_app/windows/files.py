"""Opening, importing, exporting and salvaging sessions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QMessageBox

from draglag.errors import DraglagError
from draglag.recording import Session
from draglag.store import clear_leftovers, final_name, partial_files, read_analyses, salvage
from draglag_app.windows.parts.ask_files import ask_folder, ask_new_folder, ask_open
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.tasks import Progress
from draglag_app.windows.wording.library_words import in_words

if TYPE_CHECKING:
    from draglag_app.windows.window import OperatorWindow


def tr(text: str) -> str:
    return QCoreApplication.translate("Files", text)


def open_session(window: OperatorWindow) -> None:
    """Ask for a session file."""

    def read(path: Path) -> None:
        window.space.open(path, lambda: window.go("results"))

    ask_open(window, tr("Open session"), window.space.settings.folder, tr("Sessions (*.h5)"), read)


def import_folder(window: OperatorWindow) -> None:
    """Ask for an exchange folder."""
    title = tr("Import exchange folder")
    ask_folder(window, title, window.space.settings.folder, lambda path: read_folder(window, path))


def read_folder(window: OperatorWindow, path: Path) -> None:
    """Open an exchange folder."""
    from draglag.exchange import read_exchange

    def take(session: Session) -> None:
        window.space.take(session, None)
        window.go("results")

    window.space.tasks.start(
        tr("Importing"), lambda progress: read_exchange(path), take, lambda text: window.notify("error", text)
    )


def export_session(window: OperatorWindow) -> None:
    """Write an exchange folder."""
    session = window.space.session
    if session is None:
        window.notify("info", tr("There is no session to export yet."))
        return
    title, source = tr("Export into which (new or empty) folder?"), window.space.path

    def write(path: Path) -> Path:
        from draglag.exchange import write_exchange

        results = () if source is None else read_analyses(source)
        return write_exchange(session, path, results=results)

    def begin(path: Path) -> None:
        do_work(window, tr("Exporting"), lambda progress: write(path), path)

    ask_new_folder(window, title, proposed(window, "exchange"), begin)


def write_report(window: OperatorWindow) -> None:
    """Write the report."""
    session, analysis = window.space.session, window.space.analysis
    if session is None or analysis is None:
        window.notify("info", tr("There are no results to report yet."))
        return

    def write(path: Path) -> Path:
        from draglag.report import write_report

        return write_report(session, analysis, path)

    def begin(path: Path) -> None:
        do_work(window, tr("Writing the report"), lambda progress: write(path), path)

    ask_new_folder(window, tr("Folder for the report"), proposed(window, "report"), begin)


def proposed(window: OperatorWindow, what: str) -> Path:
    """A path named after the session."""
    path, space = window.space.path, window.space
    stem = path.stem if path is not None else "session"
    return (path.parent if path is not None else Path(space.settings.folder)) / f"{stem}-{what}"


def do_work(window: OperatorWindow, what: str, work: Any, where: Path, more: str = "") -> None:
    """Run ``work`` in a worker, then show the result's path and ``more``."""
    page = where / "report.html"

    def done(result: object) -> None:
        window.notice.saved(page if page.is_file() else where, more)

    window.space.tasks.start(what, work, done, lambda text: window.notify("error", text))


def offer_salvage(window: OperatorWindow) -> None:
    """Ask about recordings that were not closed."""
    folder = Path(window.space.settings.folder)
    try:
        if folder.is_dir():
            clear_leftovers(folder)
        left = partial_files(folder) if folder.is_dir() else []
    except (DraglagError, OSError):
        left = []
    if not left:
        return
    names = "\n".join(path.name for path in left)
    question = tr("These recordings were cut short. Save what they hold?") + "\n\n" + names
    if QMessageBox.question(window, "draglag", plain(question)) != QMessageBox.StandardButton.Yes:
        return

    _save_each(window, left, None)


def _save_each(window: OperatorWindow, left: list[Path], folder: Path | None) -> None:
    def work(progress: Progress) -> tuple[list[str], list[Path], str]:
        saved, failed, why = [], [], ""
        for k, path in enumerate(left):
            progress(k / len(left), path.name)
            try:
                saved.append(salvage(path, None if folder is None else folder / final_name(path).name).path.name)
            except DraglagError as error:
                failed.append(path)
                why = error.message
        return saved, failed, why

    def done(result: tuple[list[str], list[Path], str]) -> None:
        saved, failed, why = result
        if not failed:
            window.notify("info", " · ".join(saved))
            return
        window.notify("error", " · ".join([*saved, in_words(why)]))
        title = tr("Another folder to save them in")
        ask_folder(window, title, window.space.settings.folder, lambda path: _save_each(window, failed, path))

    window.space.tasks.start(tr("Salvaging"), work, done, lambda text: window.notify("error", text))

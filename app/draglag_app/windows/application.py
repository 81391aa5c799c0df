"""The Qt application."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import cast

from platformdirs import user_log_path
from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QIcon, QPixmap
from PySide6.QtWidgets import QApplication

from draglag.errors import DraglagError
from draglag_app.windows.parts.garbage import collect_in_this_thread
from draglag_app.windows.parts.theme import apply_theme
from draglag_app.windows.settings import Settings
from draglag_app.windows.wording.i18n import translate, use_language
from draglag_resources import resource


def make_application(arguments: Sequence[str], settings: Settings | None = None) -> QApplication:
    """The process's only application, in the settings' theme and language."""
    present = QCoreApplication.instance()
    application = cast(QApplication, present) if present is not None else QApplication(list(arguments))
    collect_in_this_thread(application)
    application.setApplicationName("draglag")
    application.setDesktopFileName("draglag")
    settings = settings or Settings()
    use_language(application, settings.language)
    apply_theme(application, settings.theme, settings.text_scale)
    icon = resource("icons", "draglag.svg")
    if icon.is_file():
        pixmap = QPixmap()
        pixmap.loadFromData(icon.read_bytes())
        if not pixmap.isNull():
            application.setWindowIcon(QIcon(pixmap))
    return application


def install_excepthook(report: Callable[[str], None]) -> None:
    """Report unexpected errors; the traceback is in a file."""

    def hook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if issubclass(kind, KeyboardInterrupt):
            QCoreApplication.quit()
            return
        if isinstance(error, DraglagError):
            report(error.message)
            return
        where = write_fault(kind, error, trace)
        said = translate("Application", "Something went wrong ({error}). Details are in {where}.")
        report(said.format(error=str(error) or kind.__name__, where=where))

    sys.excepthook = hook


def write_fault(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> Path:
    """The file with the traceback appended."""
    path = user_log_path("draglag") / "faults.log"
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(f"--- {datetime.now().isoformat(timespec='seconds')}\n")
            file.writelines(traceback.format_exception(kind, error, trace))
    return path

"""Begin to measure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QMessageBox

from draglag.errors import DraglagError
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.session_dialog import SessionDialog
from draglag_app.windows.start import make_order, obstacles

if TYPE_CHECKING:
    from draglag_app.windows.window import OperatorWindow


def tr(text: str) -> str:
    return QCoreApplication.translate("beginning", text)


def begin(window: OperatorWindow, asked: bool = False) -> None:
    """Start recording; where something is missing, if the operator agrees.

    ``asked``: details were asked for already.
    """
    space = window.space
    if space.settings.ask_details and not asked:
        dialog = SessionDialog(space, window, starts=True)
        dialog.accepted.connect(lambda: begin(window, asked=True))
        dialog.open()
        return
    space.calibrating.cancel()
    window.go("record")
    window.notify("", "")
    found = obstacles(space)
    problems = [*(obstacle.sentence for obstacle in found), *window.header.faults()]
    if problems and not space.recording.active:
        if any(obstacle.hopeless for obstacle in found):
            window.notify("error", " ".join(problems))
            return
        if not _start_anyway(window, " ".join(problems)):
            return
    try:
        order = make_order(space)
        if order.display != "offscreen":
            window.pages.make_all()  # to make one during a run would hold up the target's picture
        space.recording.start(order)
    except DraglagError as error:
        window.notify("error", error.message)


def _start_anyway(window: OperatorWindow, problems: str) -> bool:
    question = plain(problems + "\n\n" + tr("Start anyway?"))
    answer = QMessageBox.question(window, "draglag", question, defaultButton=QMessageBox.StandardButton.No)
    return answer == QMessageBox.StandardButton.Yes

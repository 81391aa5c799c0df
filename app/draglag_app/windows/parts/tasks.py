"""Long work in a worker thread."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from PySide6.QtCore import QObject, Qt, QThreadPool, Signal

from draglag.errors import DraglagError
from draglag.messages import phrase
from draglag.system.packages import missing_package

Progress = Callable[[float, str], None]


class Cancelled(Exception):
    """Raised by a progress call after a cancel."""


@dataclass(eq=False)
class Task:
    """One piece of work. No QObject: it must not be deleted while a worker uses it."""

    label: str
    work: Callable[[Progress], Any]
    done: Callable[[Any], None]
    failed: Callable[[str], None]
    _cancelled: threading.Event = field(default_factory=threading.Event)

    def cancel(self) -> None:
        """End at the next progress call; nothing is reported."""
        self._cancelled.set()

    @property
    def cancelled(self) -> bool:
        return self._cancelled.is_set()


class Tasks(QObject):
    """Starts tasks; signals come in this object's thread."""

    progressed = Signal(float, str)
    changed = Signal()
    """A task began or ended."""
    _ended = Signal(object, object, object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pool = QThreadPool(self)
        # One of the two cores stays with the window and the recording.
        self._pool.setMaxThreadCount(1)
        self.running: list[Task] = []
        self._ended.connect(self._report, Qt.ConnectionType.QueuedConnection)

    def start(
        self,
        label: str,
        work: Callable[[Progress], Any],
        done: Callable[[Any], None],
        failed: Callable[[str], None],
    ) -> Task:
        """The task; ``done(result)`` or ``failed(sentence)`` is called in this thread."""
        task = Task(label, work, done, failed)
        self.running.append(task)
        self._pool.start(lambda: self._run(task))
        self.changed.emit()
        return task

    def cancel_all(self) -> None:
        for task in list(self.running):
            task.cancel()

    def finish(self) -> None:
        """Cancel all and wait."""
        self.cancel_all()
        self._pool.waitForDone()

    def _run(self, task: Task) -> None:
        def progress(fraction: float, text: str) -> None:
            if task.cancelled:
                raise Cancelled
            self.progressed.emit(fraction, text)

        result, fault = None, phrase("")
        try:
            if not task.cancelled:
                result = task.work(progress)
        except Cancelled:
            task.cancel()
        except DraglagError as error:
            fault = error.message
        except ModuleNotFoundError as missing:
            known = missing_package(missing)
            fault = phrase(f"{task.label}: {missing}") if known is None else known.message
        except Exception as error:  # whatever goes wrong is reported, the window stays
            fault = phrase(f"{task.label}: {error or type(error).__name__}")
        self._ended.emit(task, result, fault)

    def _report(self, task: Task, result: Any, fault: str) -> None:
        if task in self.running:
            self.running.remove(task)
        self.changed.emit()
        if task.cancelled:
            return
        if fault:
            task.failed(fault)
        else:
            task.done(result)

"""Long work beside the window: in a worker thread, with progress, and cancelled between steps."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QObject, QRunnable, Qt, QThreadPool, Signal

from draglag.errors import DraglagError

Progress = Callable[[float, str], None]


class Cancelled(Exception):
    """Raised out of a progress call when the operator cancelled."""


class Task(QObject):
    """One piece of work. ``work`` gets a progress function and returns the result."""

    progressed = Signal(float, str)
    ended = Signal()
    _reported = Signal(object, str)

    def __init__(
        self,
        label: str,
        work: Callable[[Progress], Any],
        done: Callable[[Any], None],
        failed: Callable[[str], None],
    ) -> None:
        super().__init__()
        self.label = label
        self._work = work
        self._done = done
        self._failed = failed
        self._cancel = threading.Event()
        self._reported.connect(self._report, Qt.ConnectionType.QueuedConnection)

    def cancel(self) -> None:
        """Ask the work to end at its next step; nothing is reported any more."""
        self._cancel.set()

    def run(self) -> None:
        """In the worker's thread."""
        result, fault = None, ""
        try:
            result = self._work(self._progress)
        except Cancelled:
            self._cancel.set()
        except DraglagError as error:
            fault = str(error)
        except Exception as error:  # whatever goes wrong is told, the window stays
            fault = f"{self.label}: {error or type(error).__name__}"
        self._reported.emit(result, fault)

    def _report(self, result: Any, fault: str) -> None:
        """In the window's thread."""
        self.ended.emit()
        if self._cancel.is_set():
            return
        if fault:
            self._failed(fault)
        else:
            self._done(result)

    def _progress(self, fraction: float, text: str) -> None:
        if self._cancel.is_set():
            raise Cancelled
        self.progressed.emit(fraction, text)


class _Runnable(QRunnable):
    def __init__(self, task: Task) -> None:
        super().__init__()
        self._task = task

    def run(self) -> None:
        self._task.run()


class Tasks(QObject):
    """Starts tasks and knows which are under way."""

    began = Signal(object)
    changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pool = QThreadPool(self)
        # One of the two cores stays with the window and the recording.
        self._pool.setMaxThreadCount(1)
        self.running: list[Task] = []

    def start(
        self,
        label: str,
        work: Callable[[Progress], Any],
        done: Callable[[Any], None],
        failed: Callable[[str], None],
    ) -> Task:
        """Do ``work(progress)`` in a worker; ``done(result)`` or ``failed(sentence)`` is called in this thread."""
        task = Task(label, work, done, failed)
        task.setParent(self)
        task.ended.connect(lambda: self._forget(task))
        self.running.append(task)
        self._pool.start(_Runnable(task))
        self.began.emit(task)
        self.changed.emit()
        return task

    def cancel_all(self) -> None:
        for task in list(self.running):
            task.cancel()

    def finish(self) -> None:
        """Cancel everything and wait for the workers to end."""
        self.cancel_all()
        self._pool.waitForDone(10_000)

    def _forget(self, task: Task) -> None:
        if task in self.running:
            self.running.remove(task)
            task.deleteLater()
            self.changed.emit()

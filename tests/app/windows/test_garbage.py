"""In which thread what is left of a closed window is finalised."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable

from PySide6.QtWidgets import QApplication, QLabel

from draglag_app.windows.parts.garbage import collect_in_this_thread


def test_a_window_in_a_cycle_is_finalised_by_its_own_thread_alone(qapp: QApplication, until: Callable) -> None:
    assert collect_in_this_thread(qapp) is collect_in_this_thread(qapp)
    window = QLabel("closed")
    window.itself = window  # type: ignore[attr-defined]
    where: list[threading.Thread] = []
    weakref.finalize(window, lambda: where.append(threading.current_thread()))
    del window
    # As much as would have Python look several times, in a thread of a device.
    made: list[list[object]] = []
    device = threading.Thread(target=lambda: made.extend([] for _ in range(100 * gc.get_threshold()[0])))
    device.start()
    device.join()
    assert not where
    until(lambda: bool(where))
    assert where == [threading.main_thread()]

"""A calibration in progress."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

from PySide6.QtCore import QCoreApplication, QObject, Signal

from draglag.errors import DataError, DraglagError
from draglag.instruments.calibration import target_places
from draglag.recording import Screen
from draglag_app.calibrating import NO_UNITS, SAME_PLACE, SLID, TARGETS, TOO_SHORT, Touches
from draglag_app.windows.participant.docked import show_picture
from draglag_app.windows.participant.screen_display import numbered_screen
from draglag_app.windows.participant.side_by_side import operators_window
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.settings import CalibrationSettings, Settings
from draglag_devices.rig import Rig, give_panel, make_rig
from draglag_devices.source import Batch, SourceInfo

# Simulated hands need a moment to see the next target.
_SEES_AFTER_S = 0.3
_STEP_S = 0.1
_READ_S = 0.05


def tr(text: str) -> str:
    return QCoreApplication.translate("Calibration", text)


def fault_words(fault: str) -> str:
    """What to do about a rejected touch."""
    return {
        "": "",
        TOO_SHORT: tr("That was too short: rest the stylus on the cross, then lift it."),
        SLID: tr("The stylus slid: rest it on the cross without moving."),
        SAME_PLACE: tr("That was the target before: touch the new cross."),
        NO_UNITS: tr("This touchscreen does not report its own units, so it cannot be calibrated."),
    }[fault]


@dataclass
class _Reader:
    """Shared by reading thread and window."""

    rig: Rig
    stop: threading.Event
    thread: threading.Thread | None = None


class Calibrating(QObject):
    """One calibration at a time. Signals come in the window's thread."""

    changed = Signal()
    """Began, ended, or another target is due."""
    made = Signal(object)
    """Fitted CalibrationSettings, not stored yet."""
    refused = Signal(object)
    """Why no calibration was made; a sentence with the remedy."""
    _opened = Signal(object, object)
    _arrived = Signal(object, object)
    _failed = Signal(object, object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.touches = Touches()
        self.window: ParticipantWindow | None = None
        self.dock: Callable[[ParticipantWindow], object] | None = None  # takes a picture that has no room of its own
        self.fault = ""
        self._reader: _Reader | None = None
        self._address = ""
        self._screen: Screen | None = None
        self._opened.connect(self._take_info)
        self._arrived.connect(self._take)
        self._failed.connect(self._fail)

    @property
    def active(self) -> bool:
        return self._reader is not None

    def start(self, settings: Settings) -> None:
        """Show the first target. Raises DraglagError."""
        if self.active:
            return
        address = settings.rig.touch
        screen, simulated = settings.touched_screen(), address.startswith("sim:")
        if not simulated and not address.startswith("evdev:"):
            raise DataError(
                tr("Only a touchscreen (evdev:…) or the simulated rig can be calibrated"), tr("choose it on Bench")
            )
        place = None
        if settings.rig.display.startswith("screen"):
            place = numbered_screen(int(settings.rig.display.split()[-1]))
        elif not simulated:
            problem = tr("Targets must be shown on the touchscreen itself")
            raise DataError(problem, tr("choose its screen under “Participant sees the target” on Bench"))
        rig = make_rig({"touch": address}, settings.panel.preset, fast=settings.rig.fast and simulated)
        give_panel(rig.sources, screen)
        self.touches, self.fault, self._screen = Touches(), "", screen
        self._address = address.partition("?")[0]
        self._reader = _Reader(rig, threading.Event())
        window = ParticipantWindow(screen)
        window.aborted.connect(self.cancel)
        window.closing.connect(self.cancel)
        window.stepped_back.connect(self.back)
        self.window = window
        if settings.rig.display != "offscreen":
            show_picture(window, place, operators_window(self), self.dock)
        self._show()
        self._reader.thread = threading.Thread(
            target=self._read, args=(self._reader,), name="draglag-calibration", daemon=True
        )
        self._reader.thread.start()
        self.changed.emit()

    def back(self) -> None:
        """Show the last target again."""
        if self.active:
            self.touches.back()
            self.fault = ""
            self._show()
            if self._reader is not None:
                self._reader.rig.stage.stop()
            self._ask_hand()
            self.changed.emit()

    def cancel(self) -> None:
        """End without a result."""
        if self.active:
            self._close()
            self.changed.emit()

    # --- in the reading thread --------------------------------------------------------------------------------

    def _read(self, reader: _Reader) -> None:
        source, time_base = reader.rig.sources[0], reader.rig.stage.time_base
        try:
            self._opened.emit(reader, source.open())
            while not reader.stop.is_set():
                if not time_base.realtime:  # as fast as the window can follow
                    time_base.advance_to(time_base.now() + _STEP_S)
                    reader.stop.wait(0.001)
                batch = source.read(_READ_S)
                if batch.touch is not None or batch.contacts is not None or not batch.alive:
                    self._arrived.emit(reader, batch)
        except DraglagError as error:
            self._failed.emit(reader, error.message)
        except Exception as error:  # a fault of a driver is reported, the window stays
            self._failed.emit(reader, f"{source.address}: {error or type(error).__name__}")
        finally:
            source.close()

    # --- in the window's thread -------------------------------------------------------------------------------

    def _take_info(self, reader: _Reader, info: SourceInfo) -> None:
        if reader is self._reader:
            self.touches.device = str(info.details.get("name", info.description))
            self.touches.axes = info.axes
            self._ask_hand()

    def _take(self, reader: _Reader, batch: Batch) -> None:
        if reader is not self._reader:
            return
        if batch.touch is not None and batch.touch.axes and not self.touches.axes:
            self.touches.axes = batch.touch.axes
        answers = self.touches.take(batch)
        if not batch.alive:
            answers = []
            self._fail(reader, tr("The touchscreen is gone: plug it in again, then calibrate."))
            return
        if not answers:
            return
        self.fault = fault_words(answers[-1])
        if answers[-1] == NO_UNITS:
            self._fail(reader, self.fault)
        elif self.touches.complete:
            self._finish()
        else:
            self._show()
            self._ask_hand()
            self.changed.emit()

    def _fail(self, reader: _Reader, text: str) -> None:
        if reader is self._reader:
            self._close()
            self.changed.emit()
            self.refused.emit(text)

    def _finish(self) -> None:
        screen, found, axes = self._screen, self.touches.found, self.touches.axes
        assert screen is not None
        x_raw, y_raw = (tuple(float(place[k]) for place in found) for k in (0, 1))
        made = CalibrationSettings(
            address=self._address, device=self.touches.device,
            made_utc=datetime.now(UTC).isoformat(timespec="seconds"),
            x_raw=x_raw, y_raw=y_raw, resolution=tuple(axis.resolution for axis in axes),
        )  # fmt: skip
        self._close()
        self.changed.emit()
        try:
            made.fit(screen)
        except DraglagError as error:
            self.refused.emit(error.message)
        else:
            self.made.emit(made)

    def _place_mm(self) -> tuple[float, float]:
        screen = self._screen
        assert screen is not None
        x_mm, y_mm = target_places(screen.width_mm, screen.height_mm, TARGETS)
        k = len(self.touches.found)
        return float(x_mm[k]), float(y_mm[k])

    def _show(self) -> None:
        if self.window is not None:
            k = len(self.touches.found) + 1
            words = tr("Touch the cross and lift: {k} of {n}").format(k=k, n=TARGETS)
            self.window.show_cross(*self._place_mm(), f"{words}\n{self.fault}")

    def _ask_hand(self) -> None:
        if self._reader is not None:
            stage = self._reader.rig.stage
            stage.begin_touch(*self._place_mm(), stage.time_base.now() + _SEES_AFTER_S)

    def _close(self) -> None:
        reader, self._reader = self._reader, None
        if reader is not None:
            reader.stop.set()
            if reader.thread is not None:
                reader.thread.join()
        if self.window is not None:
            self.window.close()
            self.window.deleteLater()
            self.window = None

"""One reading thread per source."""

from __future__ import annotations

import queue
import threading
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from draglag.messages import joined, message, phrase
from draglag.recording import concatenate, empty_laser, empty_touch
from draglag_app.session.orderly import Order
from draglag_devices.source import Batch, Concludes, DeviceError, Paced, Source, SourceInfo

READ_TIMEOUT_S = 0.1


@dataclass(frozen=True)
class Reported:
    role: str
    batch: Batch


@dataclass(frozen=True)
class Lost:
    """The source is gone for good."""

    role: str
    error: DeviceError


class OpenFaults(DeviceError):
    """Sources that cannot be opened; ``faults``: one each."""

    def __init__(self, faults: tuple[DeviceError, ...]) -> None:
        self.faults = faults
        super().__init__(faults[0].source, "")
        self.source = ", ".join(fault.source for fault in faults)
        self.problem = self.message = joined(" ", (fault.message for fault in faults))
        self.remedy = phrase("")
        self.args = (str(self.message),)


def open_all(sources: tuple[Source, ...]) -> dict[str, SourceInfo]:
    """Role → info of the opened sources. Raises OpenFaults, with all closed."""
    opened: list[Source] = []
    infos: dict[str, SourceInfo] = {}
    faults: list[DeviceError] = []
    for source in sources:
        try:
            infos[source.role] = source.open()
            opened.append(source)
        except DeviceError as error:
            faults.append(error)
        except Exception as error:  # a fault of one driver must not hide those of the others
            faults.append(as_device_error(source, error))
    if faults:
        for source in opened:
            source.close()
        raise OpenFaults(tuple(faults))
    return infos


def as_device_error(source: Source, error: Exception) -> DeviceError:
    """The exception as one about the source."""
    if isinstance(error, DeviceError):
        return error
    reason = str(error) or type(error).__name__
    return DeviceError(
        source.address,
        message("{role} stopped working ({why})", role=source.role, why=reason),
        "check the device and try again",
    )


class ReaderThread(threading.Thread):
    """Reads one source into a bounded queue.

    In simulation and replay a full queue blocks. What does not fit of a real device is counted, and sent as
    ``dropped``/``missed`` and a gap with the next samples that do.
    """

    def __init__(self, source: Source, post: queue.Queue[object], stop: threading.Event) -> None:
        super().__init__(name=f"draglag-{source.role}", daemon=True)
        self._source = source
        self._queue = post
        # Not ``_stop``: the thread class has a method of that name.
        self._stopping = stop
        self._realtime = source.realtime if isinstance(source, Paced) else True
        self._order = Order()
        self._lost = 0
        self._gap_from_s: float | None = None
        self._until_s: float | None = None

    def run(self) -> None:
        while not self._stopping.is_set():
            try:
                batch = self._source.read(READ_TIMEOUT_S)
            except Exception as error:  # whatever a driver raises ends this source, not the session
                self._put_waiting(Lost(self._source.role, as_device_error(self._source, error)))
                return
            self._forward(self._order.kept(batch))
        if isinstance(self._source, Concludes):
            notices = self._source.final_notices()
            with suppress(queue.Full):  # whoever saves has ended as well
                self._queue.put(Reported(self._source.role, Batch(-np.inf, notices=notices)), timeout=READ_TIMEOUT_S)

    def _forward(self, batch: Batch) -> None:
        if not self._realtime:
            self._put_waiting(Reported(self._source.role, batch))
            return
        whole = self._with_loss(batch) if self._lost else batch
        try:
            self._queue.put_nowait(Reported(self._source.role, whole))
        except queue.Full:
            if self._gap_from_s is None:
                self._gap_from_s = self._until_s if self._until_s is not None else batch.until_s
            self._lost += count_samples(batch)
        else:
            self._lost, self._gap_from_s = 0, None
        self._until_s = batch.until_s

    def _with_loss(self, batch: Batch) -> Batch:
        gap = np.array([[self._gap_from_s, batch.until_s]])
        if self._source.role == "laser":
            loss = replace(empty_laser(), gaps_s=gap, missed=self._lost)
            return replace(batch, laser=loss if batch.laser is None else concatenate([batch.laser, loss]))
        if self._source.role == "touch":
            lost = replace(empty_touch(), gaps_s=gap, dropped=self._lost)
            return replace(batch, touch=lost if batch.touch is None else concatenate([batch.touch, lost]))
        return batch

    def _put_waiting(self, item: object) -> None:
        while not self._stopping.is_set():
            try:
                self._queue.put(item, timeout=READ_TIMEOUT_S)
                return
            except queue.Full:
                continue


def count_samples(batch: Batch) -> int:
    """Touch events, edges and taps."""
    count = 0 if batch.touch is None else len(batch.touch.t_s)
    count += 0 if batch.laser is None else len(batch.laser.t_s)
    return count + (0 if batch.taps is None else len(batch.taps.physical_s))

"""A run's states; it has exactly one outcome.

::

    IDLE ─► PREPARING ─► COUNTDOWN ─► RECORDING ─► CLOSING ─► FINISHED
      │         │            │            │           ▲           ▲
      │         └────────────┴────────────┴───────────┘           │
      │            aborted, device lost or failed                 │
      └───────────────────────────────────────────────────────────┘
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum


class Phase(Enum):
    IDLE = "idle"
    PREPARING = "preparing"
    COUNTDOWN = "countdown"
    RECORDING = "recording"
    CLOSING = "closing"
    FINISHED = "finished"


class Signal(Enum):
    """Events of a run."""

    PREPARE = "prepare"
    READY = "ready"
    TARGET_MOVES = "target moves"
    TARGET_DONE = "target done"
    DRAINED = "drained"  # every source has reported past the end of the run
    ABORT = "abort"
    DEVICE_LOST = "device lost"
    FAILURE = "failure"


_FORWARD = {
    (Phase.IDLE, Signal.PREPARE): Phase.PREPARING,
    (Phase.PREPARING, Signal.READY): Phase.COUNTDOWN,
    (Phase.COUNTDOWN, Signal.TARGET_MOVES): Phase.RECORDING,
    (Phase.RECORDING, Signal.TARGET_DONE): Phase.CLOSING,
}
_ENDINGS = {
    Signal.TARGET_DONE: "complete",
    Signal.ABORT: "aborted",
    Signal.DEVICE_LOST: "device_lost",
    Signal.FAILURE: "failed",
}
# Of several endings the worst is reported: a failure to save outranks a lost device, that outranks the operator.
_SEVERITY = ("complete", "aborted", "device_lost", "failed")


@dataclass(frozen=True)
class RunState:
    """Phase and, once FINISHED, outcome: "complete", "aborted", "device_lost" or "failed"."""

    phase: Phase = Phase.IDLE
    ending: str | None = None

    @property
    def outcome(self) -> str | None:
        return self.ending if self.phase is Phase.FINISHED else None

    @property
    def recording(self) -> bool:
        """Whether samples belong to the run."""
        return self.phase in (Phase.RECORDING, Phase.CLOSING)


def advance(state: RunState, signal: Signal) -> RunState:
    """The next state; unchanged where a signal has no meaning."""
    if state.phase is Phase.FINISHED:
        return state
    if state.phase is Phase.CLOSING and signal is Signal.DRAINED:
        return replace(state, phase=Phase.FINISHED)
    forward = _FORWARD.get((state.phase, signal))
    if forward is not None:
        return RunState(forward, _worst(state.ending, _ENDINGS.get(signal)))
    if signal in (Signal.ABORT, Signal.DEVICE_LOST, Signal.FAILURE):
        # Before anything was prepared there is nothing to drain.
        phase = Phase.FINISHED if state.phase is Phase.IDLE else Phase.CLOSING
        return RunState(phase, _worst(state.ending, _ENDINGS[signal]))
    return state


def _worst(first: str | None, second: str | None) -> str | None:
    return max((e for e in (first, second) if e is not None), key=_SEVERITY.index, default=None)

"""A WALT by its protocol table: bytes in, bytes out with their times. No wire, no waiting.

The caller owns the host's clock (real or stepped). Commands run one after the other; while one blocks (``I``, ``U``,
``O``, ``D``) the next waits, and edges meanwhile add up in one line's count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

DIGIT_GAP_S = 737e-6
PING_LATER_S = 0.010
LOOP_S = 40e-6  # from an edge or a byte to the next turn of the main loop
PRINT_S = 15e-6  # from the stamp of a digit that is sent to its byte on the wire


@dataclass
class Faults:
    """Faults on the wire, on demand.

    Attributes:
        delay_s: each way, constant.
        jitter_s: scale of an exponential delay of every line.
        corrupt: share of lines with one byte changed.
        garbage: share of lines preceded by noise.
        mute: nothing is answered.
    """

    delay_s: float = 0.0
    jitter_s: float = 0.0
    corrupt: float = 0.0
    garbage: float = 0.0
    mute: bool = False


@dataclass
class _Detector:
    tag: str
    us: int = 0
    value: int = 0
    count: int = 0
    autosend: bool = False
    serve_s: float | None = None  # when the main loop will report the pending edges

    def line(self) -> str:
        return f"G {self.tag} {self.us} {self.value} {self.count}"


class Firmware:
    """The state machine. ``drift`` is by how much its clock runs fast (s/s); ``version`` what V answers."""

    def __init__(self, host_s: float, *, drift: float = 0.0, version: str = "6", seed: int = 0) -> None:
        self.drift = drift
        self.version = version
        self.faults = Faults()
        self._rng = np.random.default_rng(seed)
        self._zero_s = host_s - 12.5  # it has been switched on for a while
        self._free_s = host_s
        self._out: list[tuple[float, bytes]] = []
        self._last_out_s = host_s
        self._laser, self._screen = _Detector("L"), _Detector("S")
        self._armed = True
        self._shock_us = 0
        self._digits = [0] * 9
        self._read = 0
        self.levels = {"G": 480, "PD_screen": 3, "PD_laser": 910}
        self.unfelt: list[float] = []  # shocks while another was kept and nobody had asked for it
        self._acts = self._acts_by_command()
        self.commands = ""  # everything received, for conversations to be compared with

    # --- its clock --------------------------------------------------------------------------------------------

    def device_s(self, host_s: float) -> float:
        """What its clock would say, unwrapped and unrounded."""
        return (host_s - self._zero_s) * (1.0 + self.drift)

    def host_s(self, device_s: float) -> float:
        return self._zero_s + device_s / (1.0 + self.drift)

    def us(self, host_s: float) -> int:
        """The signed 32-bit count."""
        count = int(np.floor(self.device_s(host_s) * 1e6)) & 0xFFFFFFFF
        return count - (1 << 32) if count >= 1 << 31 else count

    def jump_clock(self, host_s: float, by_s: float) -> None:
        """The clock restarts by itself (a brown-out)."""
        self._zero_s = host_s - by_s

    # --- the world --------------------------------------------------------------------------------------------

    def edge(self, host_s: float, light: int) -> None:
        """The laser's light changes. Calls must come in order of time."""
        self._edge(self._laser, host_s, light)

    def screen_edge(self, host_s: float, light: int) -> None:
        self._edge(self._screen, host_s, light)

    def _edge(self, detector: _Detector, host_s: float, value: int) -> None:
        self.turn(host_s)
        detector.us, detector.value = self.us(host_s), value
        detector.count += 1
        if detector.serve_s is None:
            detector.serve_s = max(host_s, self._free_s) + LOOP_S

    def shock(self, host_s: float) -> None:
        """The accelerometer goes over its threshold."""
        if self._armed:
            self._armed, self._shock_us = False, self.us(host_s)
        else:
            self.unfelt.append(host_s)

    # --- the wire ---------------------------------------------------------------------------------------------

    def noise(self, host_s: float, data: bytes) -> None:
        """Bytes that nobody sent."""
        self._emit(host_s, data)

    def receive(self, data: bytes, host_s: float) -> None:
        """Bytes from the host, as they leave it."""
        for byte in data:
            at_s = max(host_s + self.faults.delay_s, self._free_s)
            self.turn(at_s)
            self.commands += chr(byte)
            self._free_s = self._obey(chr(byte), at_s)

    def turn(self, until_s: float) -> None:
        """The main loop runs up to a time: pending edges are reported."""
        for detector in (self._laser, self._screen):
            if detector.serve_s is not None and detector.serve_s <= until_s:
                at_s, detector.serve_s = detector.serve_s, None
                if detector.autosend:
                    self._line(at_s, detector.line())
                    detector.count = 0

    @property
    def next_s(self) -> float:
        """When something happens next by itself."""
        waiting = [d.serve_s for d in (self._laser, self._screen) if d.serve_s is not None]
        return min([*waiting, *(due for due, _ in self._out[:1])], default=np.inf)

    def take(self, until_s: float) -> bytes:
        """Bytes that have left by then."""
        self.turn(until_s)
        taken = b""
        while self._out and self._out[0][0] <= until_s:
            taken += self._out.pop(0)[1]
        return taken

    def _emit(self, at_s: float, data: bytes) -> None:
        self._last_out_s = max(self._last_out_s, at_s)
        self._out.append((self._last_out_s, data))

    def _line(self, at_s: float, text: str) -> None:
        if self.faults.mute:
            return
        data = text.encode("ascii")
        at_s += self.faults.delay_s
        if self.faults.jitter_s:
            at_s += self._rng.exponential(self.faults.jitter_s)
        if self.faults.garbage and self._rng.random() < self.faults.garbage:
            self._emit(at_s, bytes(self._rng.integers(0, 256, 7, dtype=np.uint8)) + b"\n")
        if self.faults.corrupt and self._rng.random() < self.faults.corrupt:
            spot = int(self._rng.integers(len(data)))
            data = data[:spot] + bytes([int(self._rng.integers(33, 255))]) + data[spot + 1 :]
        self._emit(at_s, data + b"\n")

    # --- commands ---------------------------------------------------------------------------------------------

    def _obey(self, command: str, at_s: float) -> float:
        """Run one command; returns when the firmware is free again."""
        act = self._acts.get(command)
        if act is None:
            self._line(at_s, f"Unknown command: {command}")
            return at_s
        return act(command, at_s)

    def _acts_by_command(self) -> dict[str, Callable[[str, float], float]]:
        each = {
            "Z": self._set_zero, "T": self._send_time, "P": self._echo, "D": self._ping_later, "F": self._reset,
            "V": self._send_version, "123456789": self._take_digit, "I": self._send_digits, "R": self._read_digit,
            "Ll": self._autosend, "Cc": self._autosend, "J": self._send_detector, "E": self._send_detector,
            "G": self._send_shock, "U": self._sample, "O": self._sample, "Q": self._send_levels,
        }  # fmt: skip
        return {command: act for commands, act in each.items() for command in commands}

    def _echo(self, command: str, at_s: float) -> float:
        self._line(at_s, command.swapcase())
        return at_s

    def _set_zero(self, command: str, at_s: float) -> float:
        self._zero_s = at_s
        return self._echo(command, at_s)

    def _ping_later(self, command: str, at_s: float) -> float:
        return self._echo(command, at_s + PING_LATER_S)

    def _send_time(self, command: str, at_s: float) -> float:
        self._line(at_s, f"t {self.us(at_s)}")
        return at_s

    def _send_version(self, command: str, at_s: float) -> float:
        self._line(at_s, f"v {self.version}")
        return at_s

    def _reset(self, command: str, at_s: float) -> float:
        self._laser.count = self._screen.count = 0
        self._laser.serve_s = self._screen.serve_s = None
        self._armed, self._shock_us = True, 0
        self._digits, self._read = [0] * 9, 0
        return self._echo(command, at_s)

    def _take_digit(self, command: str, at_s: float) -> float:
        self._digits[int(command) - 1] = self.us(at_s)
        self._read = 0
        return at_s

    def _send_digits(self, command: str, at_s: float) -> float:
        for digit in range(1, 10):
            at_s += DIGIT_GAP_S
            self._digits[digit - 1] = self.us(at_s)
            at_s += PRINT_S
            self._line(at_s, str(digit))
        self._read = 0
        return at_s

    def _read_digit(self, command: str, at_s: float) -> float:
        stored = self._digits[self._read] if self._read < 9 else 0
        self._line(at_s, f"{self._read + 1}:{stored}")
        self._read = min(self._read + 1, 9)
        return at_s

    def _detector(self, command: str) -> _Detector:
        return self._laser if command in "LlJ" else self._screen

    def _autosend(self, command: str, at_s: float) -> float:
        self._detector(command).autosend = command.isupper()
        return self._echo(command, at_s)

    def _send_detector(self, command: str, at_s: float) -> float:
        self._line(at_s, self._detector(command).line())
        return at_s

    def _send_shock(self, command: str, at_s: float) -> float:
        self._line(at_s, str(0 if self._armed else self._shock_us))
        self._armed, self._shock_us = True, 0
        return at_s

    def _sample(self, command: str, at_s: float) -> float:
        count, step_s = (1000, 1e-3) if command == "U" else (4000, 5e-4)
        self._echo(command, at_s)
        for k in range(count):
            at_s += step_s
            adc = int(512 + 400 * np.sin(2 * np.pi * 10 * k * step_s))
            self._line(at_s, f"{self.us(at_s)} {adc}")
        self._line(at_s, "end")
        return at_s

    def _send_levels(self, command: str, at_s: float) -> float:
        self._line(at_s, "q " + " ".join(f"{name}:{value}" for name, value in self.levels.items()))
        return at_s

"""``./run rig``: the emulated instruments, with their addresses, until the input ends (Ctrl-D).

Orders: draw SPEED SECONDS · tap COUNT · walt unplug|plug|noise SHARE|corrupt SHARE|delay SECONDS|quiet ·
touch unplug|plug|overflow · help
"""

from __future__ import annotations

import contextlib
import importlib
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Circle, Tap
from draglag_devices.sim.world import World
from emulators.play import play_laser, play_taps, play_touch
from emulators.touch import live
from emulators.walt.wires import WaltOnPty

LEAD_S = 1.0
OVERFLOW = [[3, 0x35, 100]]


@dataclass
class Wires:
    """What runs. ``panel`` and ``segment`` are None where they cannot run; one world moves all of them."""

    walt: WaltOnPty
    panel: live.LiveTouch | None
    segment: Any | None
    world: World

    def draw(self, speed_mm_s: float, duration_s: float) -> None:
        circle = Circle(150.0, 120.0, 50.0, speed_mm_s, duration_s=duration_s, sideways_mm_s=150.0 / duration_s)
        start_s = time.monotonic() + LEAD_S
        self.world.begin_run(PlannedRun("by-hand", circle, speed_mm_s, 50.0), start_s, "by-hand")
        run = self.world.truth[-1]
        play_laser(run, 0.0, walt=self.walt, segment=self.segment)
        if self.panel is not None:
            play_touch(self.panel, run, 0.0)

    def tap(self, count: int) -> None:
        self.world.begin_taps(Tap(150.0, 120.0, count), time.monotonic() + LEAD_S)
        if self.panel is not None:
            play_taps(self.panel, self.walt, self.world.true_taps[-1], 0.0)
        else:
            self.walt.shocks(self.world.true_taps[-1].physical_s)

    def obey(self, words: list[str]) -> None:
        """One order. Raises ValueError or IndexError for one that makes no sense."""
        match words:
            case ["draw", speed, duration]:
                self.draw(float(speed), float(duration))
            case ["tap", count]:
                self.tap(int(count))
            case ["walt", "unplug"]:
                self.walt.unplug()
            case ["walt", "plug"]:
                self.walt.plug()
            case ["walt", ("noise" | "corrupt" | "delay") as what, amount]:
                name = {"noise": "garbage", "corrupt": "corrupt", "delay": "delay_s"}[what]
                with self.walt.lock:
                    setattr(self.walt.firmware.faults, name, float(amount))
            case ["walt", "quiet"]:
                with self.walt.lock:
                    self.walt.firmware.faults = type(self.walt.firmware.faults)()
            case ["touch", ("unplug" | "plug") as what] if self.panel is not None:
                self.panel.do(what)
            case ["touch", "overflow"] if self.panel is not None:
                self.panel.do("lose", events=OVERFLOW)
            case _:
                raise ValueError


def segment_or_reason(name: str) -> tuple[Any | None, str]:
    """The emulated field bus, or why it cannot run."""
    try:
        ethercat = importlib.import_module("emulators.ethercat")
    except ModuleNotFoundError as missing:
        return None, f"{missing.name} is missing"
    reason = ethercat.why_not()
    if reason:
        return None, str(reason)
    try:
        return ethercat.start_segment(name), ""
    except RuntimeError as error:
        return None, str(error)


def main() -> int:
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="draglag-rig-")))
        walt = stack.enter_context(WaltOnPty(folder, drift=8e-6))
        reason = live.why_not()
        panel = None if reason else stack.enter_context(live.LiveTouch())
        segment, why = segment_or_reason("rig")
        if segment is not None:
            stack.enter_context(segment)
        wires = Wires(walt, panel, segment, World(start_s=time.monotonic()))
        arguments = ["--walt", f"serial:{walt.path}"]
        print(f"walt   serial:{walt.path}   (or as laser: serial:{walt.path}?role=laser)")
        if segment is not None:
            arguments += ["--laser", f"ethercat:{segment.iface}?channel=1"]
            print(f"laser  ethercat:{segment.iface}?channel=1")
        else:
            print(f"laser  not running: {why}")
        if panel is not None:
            arguments += ["--touch", f"evdev:{panel.node}"]
            print(f"touch  evdev:{panel.node}   (only where these are set:)")
            print(f"       export LD_PRELOAD=libumockdev-preload.so.0 UMOCKDEV_DIR={panel.root}")
        else:
            print(f"touch  not running: {reason}")
        print(f"try    draglag check {' '.join(arguments)}")
        print("orders: draw SPEED SECONDS · tap COUNT · help; Ctrl-D ends", flush=True)
        for text in sys.stdin:
            words = text.split()
            if words in (["help"], []):
                print(__doc__, flush=True)
                continue
            try:
                wires.obey(words)
            except (ValueError, IndexError):
                print("not understood; see help", flush=True)
            else:
                print("done", flush=True)
    return 0


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        raise SystemExit(main())

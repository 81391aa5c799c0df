"""Runs in the virtual machine: a touchscreen made with uinput, read by draglag's driver.

Prints a line that begins with RESULT, which ``test_touch_kernel`` judges.
"""

import json
import time

import evdev
from evdev import AbsInfo, UInput
from evdev import ecodes as e

from draglag_devices.addresses import parse_address
from draglag_devices.evdev_touch.source import EvdevTouch

WIDTH, HEIGHT, RESOLUTION = 5092, 2864, 10
NAME = "draglag kernel test"


def plug() -> UInput:
    """Ten slots, protocol B."""
    axes = [
        (e.ABS_MT_SLOT, AbsInfo(0, 0, 9, 0, 0, 0)),
        (e.ABS_MT_TRACKING_ID, AbsInfo(0, 0, 65535, 0, 0, 0)),
        (e.ABS_MT_POSITION_X, AbsInfo(0, 0, WIDTH - 1, 0, 0, RESOLUTION)),
        (e.ABS_MT_POSITION_Y, AbsInfo(0, 0, HEIGHT - 1, 0, 0, RESOLUTION)),
    ]
    return UInput(
        {e.EV_KEY: [e.BTN_TOUCH], e.EV_ABS: axes}, name=NAME, phys="emulated/input0", input_props=[e.INPUT_PROP_DIRECT]
    )


def node(panel: UInput) -> str:
    return panel.device.path


def put(panel: UInput, slot: int, number: int | None, x: int | None = None, y: int | None = None) -> None:
    """Part of a frame; ``number`` −1 lifts, None leaves the contact as it is."""
    panel.write(e.EV_ABS, e.ABS_MT_SLOT, slot)
    if number is not None:
        panel.write(e.EV_ABS, e.ABS_MT_TRACKING_ID, number)
    if x is not None:
        panel.write(e.EV_ABS, e.ABS_MT_POSITION_X, x)
    if y is not None:
        panel.write(e.EV_ABS, e.ABS_MT_POSITION_Y, y)


def take(source: EvdevTouch, until: float | None = None, alive: bool | None = None) -> dict:
    """Read for a while, or until the source is (not) alive."""
    end_s = time.monotonic() + (0.4 if until is None else until)
    seen: dict = {"t": [], "x": [], "y": [], "id": [], "dropped": 0, "gaps": [], "notices": [], "changes": [],
                  "alive": True}  # fmt: skip
    while time.monotonic() < end_s:
        batch = source.read(0.05)
        if batch.touch is not None:
            seen["t"] += batch.touch.t_s.tolist()
            seen["x"] += batch.touch.x_mm.tolist()
            seen["y"] += batch.touch.y_mm.tolist()
            seen["id"] += batch.touch.contact_id.tolist()
            seen["dropped"] += batch.touch.dropped
            seen["gaps"] += batch.touch.gaps_s.tolist()
        if batch.contacts is not None:
            seen["changes"] += [
                list(row)
                for row in zip(
                    batch.contacts.t_s.tolist(), batch.contacts.contact_id.tolist(), batch.contacts.down.tolist(),
                    strict=True,
                )
            ]  # fmt: skip
        seen["notices"] += [notice.text for notice in batch.notices]
        seen["alive"] = batch.alive
        if alive is not None and batch.alive == alive:
            break
    return seen


def frames(panel: UInput, count: int, first: int, pause_s: float) -> list[list[float]]:
    """``count`` frames of the contact in slot 0: [before, after, x, y]."""
    sent = []
    for k in range(count):
        x, y = first + 7 * k, 500 + 3 * k
        put(panel, 0, None, x, y)
        before = time.monotonic()
        panel.syn()
        sent.append([before, time.monotonic(), x, y])
        time.sleep(pause_s)
    return sent


def main() -> dict:
    result: dict = {"started_s": time.monotonic(), "real_s": time.time()}
    panel = plug()
    source = EvdevTouch(parse_address(f"evdev:{node(panel)}"))
    info = source.open()
    result["info"] = {"name": info.description, "details": dict(info.details),
                      "axes": [[a.name, a.minimum, a.maximum, a.resolution] for a in info.axes]}  # fmt: skip

    # A contact draws, a second one comes and goes.
    put(panel, 0, 100, 1000, 500)
    panel.syn()
    sent = frames(panel, 30, 1007, 0.008)
    put(panel, 1, 101, 3000, 2000)
    panel.syn()
    put(panel, 1, -1)
    panel.syn()
    put(panel, 0, -1)
    panel.syn()
    result["drawn"] = {"sent": sent, "seen": take(source)}

    # More frames than the kernel keeps for a reader that does not read; the contact changes meanwhile.
    put(panel, 0, 200, 100, 500)
    panel.syn()
    before = take(source)
    stalled_s = time.monotonic()
    lost = frames(panel, 600, 100, 0.0)
    put(panel, 0, -1)
    panel.syn()
    put(panel, 0, 201, 50, 60)
    panel.syn()
    over = take(source)
    after_sent = frames(panel, 20, 60, 0.008)
    result["overflow"] = {"before": before, "stalled_s": stalled_s, "sent": len(lost), "seen": over,
                          "after_sent": after_sent, "after": take(source)}  # fmt: skip
    put(panel, 0, -1)
    panel.syn()
    take(source)

    # Unplugged in the middle of a contact, and plugged in again.
    put(panel, 0, 300, 400, 400)
    panel.syn()
    held = take(source)
    panel.close()
    gone = take(source, 5.0, alive=False)
    panel = plug()
    back = take(source, 20.0, alive=True)
    put(panel, 0, 0, 700, 700)
    panel.syn()
    put(panel, 0, None, 710, 705)
    panel.syn()
    again = take(source)
    result["unplug"] = {"held": held, "gone": gone, "back": back, "again": again, "node": node(panel)}

    # Held exclusively: nobody else reads it, and it is let go of.
    source.close()
    alone = EvdevTouch(parse_address(f"evdev:{node(panel)}?exclusive=1"))
    put(panel, 0, -1)
    panel.syn()
    alone.open()
    take(alone, 0.2)
    other = evdev.InputDevice(node(panel))
    try:
        other.grab()
        result["held_exclusively"] = False
        other.ungrab()
    except OSError:
        result["held_exclusively"] = True
    alone.close()
    other.grab()
    other.ungrab()
    other.close()
    panel.close()
    result["ended_s"] = time.monotonic()
    return result


if __name__ == "__main__":
    print("RESULT " + json.dumps(main()), flush=True)

"""Prints each batch of a touch source as one JSON line until stdin closes, in a process that sees the emulated
touchscreen, unlike the test."""

import json
import select
import sys

from draglag_devices.opening import open_source
from draglag_devices.source import DeviceError


def main() -> None:
    source = open_source(sys.argv[1], "touch")
    try:
        info = source.open()
    except DeviceError as error:
        print(json.dumps({"error": str(error)}), flush=True)
        return
    print(json.dumps({"description": info.description, "axes": [vars(axis) for axis in info.axes]}), flush=True)
    while not select.select([sys.stdin], [], [], 0)[0]:
        batch = source.read(0.1)
        row = {"alive": batch.alive, "until_s": batch.until_s, "notices": [n.text for n in batch.notices]}
        if batch.touch is not None:
            touch = batch.touch
            row |= {"t_s": touch.t_s.tolist(), "x_mm": touch.x_mm.tolist(), "y_mm": touch.y_mm.tolist(),
                    "x_raw": touch.x_raw.tolist(), "id": touch.contact_id.tolist(), "gaps_s": touch.gaps_s.tolist(),
                    "dropped": touch.dropped}  # fmt: skip
        if batch.contacts is not None:
            row["down"] = batch.contacts.down.tolist()
        if len(row) > 3 or row["notices"]:
            print(json.dumps(row), flush=True)
    source.close()
    print(json.dumps({"closed": True}), flush=True)


main()

"""A recording in another process that announces each target, a JSON line each: a hand can follow it.

    python recorder.py PROTOCOL.toml SCREEN OUT.h5 ROLE=ADDRESS …

As ``draglag record``, with the simulated rig's beam, so that targets cross it.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

from draglag.protocol.runs import load_protocol
from draglag.protocol.targets import Target
from draglag.recording import Stylus
from draglag.simulation import rig_for_screen
from draglag_app.cli.record import session_options
from draglag_app.session import OffscreenDisplay, run_session
from draglag_devices.rig import make_rig

# From the word to the first movement: time enough for the hand to be computed on a busy machine.
COUNTDOWN_S = 2.0


class TellingDisplay(OffscreenDisplay):
    """Says what is shown, and from when on it moves (host clock)."""

    def show(self, target: Target, start_s: float) -> None:
        super().show(target, start_s)
        print(json.dumps({"kind": target.kind, "start_s": start_s}), flush=True)


def main(protocol: str, screen: str, out: str, *devices: str) -> None:
    known = rig_for_screen(screen)
    rig = make_rig(dict(device.split("=", 1) for device in devices), screen)
    options = session_options(rig, screen, None)
    stylus = Stylus(known.stylus.diameter_mm)
    options = replace(options, stylus=stylus, beam=known.beam, countdown_s=COUNTDOWN_S)
    run_session(load_protocol(protocol), rig, TellingDisplay(), Path(out), options)


if __name__ == "__main__":
    main(*sys.argv[1:])

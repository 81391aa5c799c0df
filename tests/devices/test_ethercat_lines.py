"""Lines that are set up differently from ours, and just as right: each gives every edge with its stamp."""

from __future__ import annotations

from typing import Any

import pytest

from devices.ethercat_rig import MS, Recording, blink, judge, needs_segment
from emulators.ethercat import Segment

pytestmark = needs_segment

EK1100, EL1002, EL1008, EL2008 = 0x044C2C52, 0x03EA3052, 0x03F03052, 0x07D83052
# What is on the line, and the working counter of a cycle: reading 1 a device, writing 2.
LINES: dict[str, tuple[dict[str, Any], int]] = {
    "an EK1100": ({"coupler": EK1100}, 1),
    "an EK1100 without a clock: the EL1252 is the reference": ({"coupler": EK1100, "clock": False}, 1),
    "inputs behind the EL1252": ({"behind": [EL1008]}, 3),
    "outputs and inputs behind the EL1252": ({"behind": [EL2008, EL1008]}, 5),
    "an EK1100 and outputs": ({"coupler": EK1100, "behind": [EL2008]}, 3),
    "two inputs before the EL1252, whose bits share no byte with it": ({"before": [EL1002]}, 3),
    "terminals before and behind": ({"before": [EL2008, EL1002], "behind": [EL1002, EL1002]}, 7),
    "another EEPROM and revision": ({"in_bytes": True}, 2),
    "slow changes of state that want process data": ({"slow_ns": 250 * MS}, 2),
}


@pytest.mark.parametrize("name", LINES)
def test_every_edge_comes_with_its_stamp(wired: Segment, name: str) -> None:
    identity, counter = LINES[name]
    wired.order("link", up=1)
    wired.order("identity", **identity)
    with Recording(wired) as rec:
        assert rec.info.details["working_counter"] == counter
        start_ns = wired.edges(blink(8, 110 * MS, 47 * MS, 10 * MS), relative=True)
        rec.read_past(start_ns + 900 * MS)
        true = rec.true_edges()
        judge(rec, true)
    assert len(true) == 16
    assert len(rec.laser.light) >= 4


def test_an_ek1100_line_is_watched_and_brought_back_too(wired: Segment) -> None:
    wired.order("link", up=1)
    wired.order("identity", coupler=EK1100)
    with Recording(wired) as rec:
        wired.order("unplug")
        rec.read_until(lambda: any("EL1252 does not answer" in text for text in rec.texts))
        wired.order("plug")
        wired.order("power")
        rec.read_until(lambda: any("is back" in text for text in rec.texts))
        start_ns = wired.edges(blink(3, 110 * MS, 47 * MS, 10 * MS), relative=True)
        rec.read_past(start_ns + 340 * MS)
        judge(rec, rec.true_edges())
    assert len(rec.laser.gaps_s) >= 1

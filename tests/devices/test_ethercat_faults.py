"""Every fault that an EtherCAT line is known to show: marked with what and when, and the laser comes back by itself."""

from __future__ import annotations

import os
import re
import signal
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from devices.ethercat_rig import MS, Recording, blink, children, judge, lost_edges, needs_segment
from emulators.ethercat import Segment

pytestmark = needs_segment

ENDURANCE_S = float(os.environ.get("DRAGLAG_ENDURANCE_S", "10"))


@dataclass(frozen=True)
class Fault:
    """Orders that break and heal, and words the operator reads."""

    name: str
    breaks: dict[str, Any]
    words: str
    heals: dict[str, Any] | None = field(default=None)


FAULTS = (
    Fault("network cable", {"do": "link", "up": 0}, "unplugged or the other end is off", {"do": "link", "up": 1}),
    Fault("coupler silent", {"do": "unplug", "slaves": 0}, "line does not answer", {"do": "plug"}),
    Fault("terminal unplugged", {"do": "unplug"}, "EL1252 does not answer", {"do": "plug"}),
    Fault("terminal in INIT", {"do": "state", "state": 1}, "EL1252 does not answer"),
    Fault("terminal power-cycled", {"do": "power", "which": "terminal"}, "EL1252 does not answer"),
    Fault("everything power-cycled", {"do": "power", "which": "all"}, "EL1252 does not answer"),
    Fault("SAFE-OP with error", {"do": "al_error"}, "EL1252 is in SAFE-OP"),
    Fault("16 answers late", {"do": "late", "next": 40, "ns": 150 * MS}, ""),
    Fault("every answer slow", {"do": "delay", "ns": 20 * MS}, "line does not answer", {"do": "delay", "ns": 0}),
    Fault("old answers from then on", {"do": "stale"}, "carry old data"),
    Fault("all frames lost", {"do": "loss", "share": 1.0}, "line does not answer", {"do": "loss"}),
    Fault("working counter short", {"do": "cheat", "next": 30}, "EL1252 does not answer"),
    Fault("latch unit off", {"do": "register", "address": 0x0981, "value": "00"}, "latch unit off"),
)  # fmt: skip


def test_an_answer_that_soem_misses_while_it_looks_for_devices_does_not_hold_it_up(segment: Segment) -> None:
    """Left alone, it takes the missing station address for 0 and asks that one for its EEPROM, for 25 to 50 s."""
    with Recording(segment) as rec:
        segment.order("unplug")
        rec.read_until(lambda: not rec.alive)
        segment.order("deaf", next=2)
        healed_ns = time.monotonic_ns()
        segment.order("plug")
        rec.read_until(lambda: any("is back" in text for text in rec.texts))
        start_ns = segment.edges(blink(3, 110 * MS, 47 * MS, 10 * MS), relative=True)
        rec.read_past(start_ns + 340 * MS)
        judge(rec, rec.true_edges())
    assert rec.laser.gaps_s[-1, 1] - healed_ns * 1e-9 < 12.0


def test_the_first_bring_up_survives_such_an_answer_too(segment: Segment) -> None:
    segment.order("deaf", next=1)
    with Recording(segment) as rec:
        assert rec.info.details["level_at_start"] == 0


def counted(rec: Recording) -> int:
    """Disturbed cycles that notices speak of, with the last words."""
    texts = [*rec.texts, *(notice.text for notice in rec.source.final_notices())]
    return sum(int(n) for text in texts if "were disturbed" in text for n in re.findall(r"(\d+) with", text))


def _covered(t_s: float, gaps_s: np.ndarray[Any, Any]) -> bool:
    """Inside a gap; edges at its very ends may fall on either side by the clocks' uncertainty."""
    return bool(((gaps_s[:, 0] - 1e-3 <= t_s) & (t_s <= gaps_s[:, 1] + 1e-3)).any())


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_is_marked_and_the_laser_comes_back(segment: Segment, fault: Fault) -> None:
    with Recording(segment) as rec:
        begun_ns = time.monotonic_ns()
        segment.edges(blink(400, 41 * MS, 9 * MS, begun_ns + 10 * MS))
        rec.read_past(begun_ns + 100 * MS)
        broken_s = time.monotonic()
        segment.order(**fault.breaks)
        rec.read_until(lambda: any(notice.level == "error" for notice in rec.notices))
        if fault.heals is not None:
            segment.order(**fault.heals)
        rec.read_until(lambda: any("is back" in text for text in rec.texts))
        rec.read_past(time.monotonic_ns() + 120 * MS)
        until_s = rec.until_s
        true = rec.true_edges()
    lost, back = (next(n for n in rec.notices if words in n.text) for words in ("is lost", "is back"))
    assert fault.words in lost.text
    assert lost.t_s < back.t_s
    assert (lost.state, back.state, back.level) == ("lost", "back", "info")
    gaps_s = rec.laser.gaps_s
    assert len(gaps_s) >= 1
    # The mark may start before the fault (the last time all was well), never after it.
    assert gaps_s[0, 0] <= broken_s + 0.05
    assert gaps_s[-1, 1] >= broken_s
    assert (gaps_s[:, 1] > gaps_s[:, 0]).all()
    # A new epoch, with clock pairs of its own, in which edges go on.
    assert int(rec.laser.epoch[0]) == 0
    assert int(rec.laser.epoch[-1]) >= 1
    assert {int(epoch) for bounds in rec.clocks for epoch in bounds.epoch} >= {0, int(rec.laser.epoch[-1])}
    # Nothing invented, and nothing lost that is not marked.
    recorded = set(rec.stamps_ns())
    stamped = {edge[3] for edge in true}
    assert recorded <= stamped
    for host_ns, _, _, stamp_ns in true:
        if begun_ns < host_ns < until_s * 1e9 and stamp_ns not in recorded:
            assert _covered(host_ns * 1e-9, gaps_s)
    # The map holds in the new epoch too.
    host_s = {edge[3]: edge[0] * 1e-9 for edge in true}
    errors = [t_s - host_s[stamp] for t_s, stamp in zip(rec.laser.t_s, rec.stamps_ns(), strict=True)]
    assert np.abs(errors).max() < 1e-3


def test_a_few_lost_frames_cost_no_edge_and_are_reported(segment: Segment) -> None:
    with Recording(segment) as rec:
        start_ns = segment.edges(blink(20, 60 * MS, 25 * MS, 10 * MS), relative=True)
        rec.read_past(start_ns + 100 * MS)
        segment.order("loss", next=3)
        rec.read_past(start_ns + 1300 * MS)
        rec.read_until(lambda: rec.source.disturbed.get("lost", 0) >= 3)
        judge(rec, rec.true_edges())
        assert counted(rec) == sum(rec.source.disturbed.values())


def test_a_terminal_whose_clock_goes_its_own_way_is_reported_once(segment: Segment) -> None:
    with Recording(segment) as rec:
        segment.order("astray", drift=400e-6)
        rec.read_until(lambda: any("does not follow" in text for text in rec.texts))
        rec.read_past(time.monotonic_ns() + 2200 * MS)
    assert sum("does not follow" in text for text in rec.texts) == 1


def test_the_laser_survives_the_end_of_its_process(segment: Segment) -> None:
    with Recording(segment) as rec:
        segment.edges(blink(200, 41 * MS, 9 * MS, 10 * MS), relative=True)
        rec.read_until(lambda: len(rec.laser.light) >= 4)
        rec.source._process.kill()
        rec.read_until(lambda: any("is back" in text for text in rec.texts))
        rec.read_past(time.monotonic_ns() + 100 * MS)
        stamped = {edge[3] for edge in rec.true_edges()}
    assert any("process ended" in text for text in rec.texts)
    assert len(rec.laser.gaps_s) >= 1
    assert set(rec.laser.epoch) == {0, 1}
    assert set(rec.stamps_ns()) <= stamped


def test_a_bus_process_that_hangs_is_replaced(segment: Segment) -> None:
    with Recording(segment) as rec:
        segment.edges(blink(400, 41 * MS, 9 * MS, 10 * MS), relative=True)
        rec.read_until(lambda: len(rec.laser.light) >= 4)
        (bus,) = children(rec.source._process.pid)
        os.kill(bus, signal.SIGSTOP)
        rec.read_until(lambda: any("is back" in text for text in rec.texts))
        rec.read_past(time.monotonic_ns() + 100 * MS)
        until_s = rec.until_s
        lost, unmarked = lost_edges(rec, [edge for edge in rec.true_edges() if edge[0] * 1e-9 < until_s])
    assert any("stands still" in text for text in rec.texts)
    assert lost
    assert unmarked == []
    assert set(rec.laser.epoch) == {0, 1}


def test_endurance_no_edge_is_lost_and_every_bad_cycle_is_accounted_for(segment: Segment) -> None:
    """DRAGLAG_ENDURANCE_S seconds (600 before a release) with a short working counter now and then."""
    period_ns, dark_ns = 97 * MS, 31 * MS
    count = int(ENDURANCE_S * 1e9 / period_ns)
    cheats = 5
    with Recording(segment) as rec:
        start_ns = segment.edges(blink(count, period_ns, dark_ns, 10 * MS), relative=True)
        for k in range(1, cheats + 1):
            rec.read_past(start_ns + int(ENDURANCE_S * 1e9 * k / (cheats + 2)))
            segment.order("cheat", next=1)
        rec.read_past(start_ns + count * period_ns + 10 * MS)
        # The last summary is reported within a second.
        rec.read_past(time.monotonic_ns() + 1100 * MS)
        true = rec.true_edges()
        judge(rec, true)
        disturbed = dict(rec.source.disturbed)
        said = counted(rec)
    assert len(true) == 2 * count
    # Each injected one was seen (or hit one of the questions about the state, 2 frames in 100), and nothing else
    # but answers that this machine was too busy to give in time.
    assert 1 <= disturbed.get("counter", 0) <= cheats
    assert set(disturbed) <= {"counter", "lost"}
    assert said == sum(disturbed.values())

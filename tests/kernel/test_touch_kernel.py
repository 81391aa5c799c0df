"""The touchscreen driver on a real kernel: uinput in a virtual machine. ``./run test-kernel``."""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kernel import machine

_WHY_NOT = machine.why_not() if os.environ.get("DRAGLAG_TEST_KERNEL") else "takes a while: ./run test-kernel"
pytestmark = pytest.mark.skipif(bool(_WHY_NOT), reason=_WHY_NOT or "-")

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 240.0


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    roots = ":".join(str(ROOT / part) for part in ("core", "devices", "app", "resources"))
    guest = str(ROOT / "tests" / "kernel" / "guest.py")
    command = ["/usr/bin/env", f"PYTHONPATH={roots}", sys.executable, "-B", guest]
    code, said = machine.run(tmp_path_factory.mktemp("machine"), command, ROOT, PATIENCE_S)
    assert code == 0, said[-3000:]
    line = re.search(r"RESULT (\{.*\})", said)  # the console puts its own codes before it
    assert line, said[-3000:]
    found: dict[str, Any] = json.loads(line[1])
    return found


def test_it_is_described_as_the_kernel_has_it(seen: dict[str, Any]) -> None:
    info = seen["info"]
    assert info["name"] == "draglag kernel test"
    assert info["details"]["slots"] == 10
    assert info["axes"] == [["ABS_MT_POSITION_X", 0, 5091, 10], ["ABS_MT_POSITION_Y", 0, 2863, 10]]


def test_frames_come_whole_with_the_kernels_monotonic_stamps(seen: dict[str, Any]) -> None:
    sent, got = np.array(seen["drawn"]["sent"]), seen["drawn"]["seen"]
    t_s, x_mm, y_mm = (np.array(got[name]) for name in ("t", "x", "y"))
    of_first = np.array(got["id"]) == 100
    # Boot was seconds ago, the epoch decades: no doubt which clock it is.
    assert abs(seen["real_s"] - seen["started_s"]) > 1e6
    moved = np.flatnonzero(of_first)[1:31]
    assert x_mm[moved] == pytest.approx(sent[:, 2] / 10, abs=0.051)
    assert y_mm[moved] == pytest.approx(sent[:, 3] / 10, abs=0.051)
    # The stamp was taken while the frame was written.
    assert (t_s[moved] >= sent[:, 0] - 1e-5).all()
    assert (t_s[moved] <= sent[:, 1] + 1e-5).all()
    assert got["dropped"] == 0
    assert got["notices"] == []


def test_contacts_begin_and_end(seen: dict[str, Any]) -> None:
    changes = [(number, down) for _, number, down in seen["drawn"]["seen"]["changes"]]
    assert changes == [(100, 1), (101, 1), (101, 0), (100, 0)]


def test_an_overflow_of_the_kernels_buffer_is_marked_and_the_slots_are_right_again(seen: dict[str, Any]) -> None:
    part = seen["overflow"]
    got, after = part["seen"], part["after"]
    assert any("overflowed" in text for text in got["notices"])
    # What the buffer still held is older than the slots; the loss is reported with the next frame.
    assert got["dropped"] + after["dropped"] >= 1
    gaps = np.array(got["gaps"] + after["gaps"])
    assert gaps[:, 0].min() <= part["stalled_s"]
    assert gaps[:, 1].max() >= part["stalled_s"]
    assert len(got["t"]) < part["sent"]
    # One contact ended unseen and one began: each once, and nothing of the first is taken for the second.
    assert [(number, down) for _, number, down in got["changes"] + after["changes"]] == [(200, 0), (201, 1)]
    sent = np.array(part["after_sent"])
    assert set(after["id"]) == {201}
    assert np.array(after["x"]) == pytest.approx(sent[:, 2] / 10, abs=0.051)
    assert (np.array(after["t"]) >= sent[:, 0] - 1e-5).all()


def test_an_unplugged_panel_is_reported_and_found_again(seen: dict[str, Any]) -> None:
    part = seen["unplug"]
    assert part["held"]["alive"]
    assert not part["gone"]["alive"]
    assert any("is gone" in text for text in part["gone"]["notices"])
    assert any("is back" in text for text in part["back"]["notices"])
    assert part["back"]["alive"]
    assert part["again"]["x"][-1] == pytest.approx(71.05, abs=0.06)
    # Ids go on counting: the contact after the gap is another one.
    assert not set(part["again"]["id"]) & set(part["held"]["id"])
    assert part["back"]["gaps"] or part["gone"]["gaps"]


def test_exclusive_use_is_the_kernels(seen: dict[str, Any]) -> None:
    assert seen["held_exclusively"]

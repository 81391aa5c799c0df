"""The touchscreen driver against a live device of umockdev, through the real evdev library."""

import json
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from emulators.touch import live
from emulators.touch.live import ABS_X, ABS_Y, BTN_TOUCH, EV_ABS, EV_KEY, LiveTouch, contact, lifted, moved, pressed

_WHY_NOT = live.why_not()
pytestmark = [pytest.mark.wire, pytest.mark.skipif(bool(_WHY_NOT), reason=_WHY_NOT or "-")]

PATIENCE_S = 15.0
READER = Path(live.__file__).with_name("reader.py")


class Reader:
    """The driver in a process that sees the emulated touchscreen."""

    def __init__(self, panel, options=""):
        command = [sys.executable, str(READER), f"evdev:{panel.node}{options}"]
        self.process = subprocess.Popen(
            command, env=panel.environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.killer = threading.Timer(2 * PATIENCE_S, self.process.kill)
        self.killer.start()
        self.rows = []
        self.hello = json.loads(self.process.stdout.readline())

    def until(self, wanted):
        """Rows up to one with which ``wanted(rows)`` holds; fails when the process ends before."""
        while not wanted(self.rows):
            line = self.process.stdout.readline()
            assert line, f"the reader ended: {self.rows}"
            self.rows.append(json.loads(line))

    def column(self, name):
        return [value for row in self.rows for value in row.get(name, [])]

    def finish(self):
        """Let it end in order; the rest of its rows are read."""
        if self.process.poll() is None:
            self.process.stdin.close()
            self.rows += [json.loads(line) for line in self.process.stdout]
            self.process.wait(PATIENCE_S)
        self.killer.cancel()


@pytest.fixture
def start():
    """Start panels and readers that are ended with the test."""
    opened = []

    def begin(options="", already=(), **panel_options):
        panel = LiveTouch(**panel_options).__enter__()
        opened.append(lambda: panel.__exit__(None, None, None))
        if already:
            panel.frame(already)  # before the driver looks
        reader = Reader(panel, options)
        opened.append(reader.finish)
        return panel, reader

    yield begin
    for end in reversed(opened):
        end()


def test_two_seconds_of_drag_at_120_hz_arrive_whole_with_their_stamps(start):
    panel, reader = start()
    assert reader.hello["description"] == "Emulated Touchscreen"
    assert reader.hello["axes"][0]["resolution"] == 10
    assert panel.do("state")["clock"] == time.CLOCK_MONOTONIC
    begin_s = time.monotonic() + 0.2
    true_s = [begin_s + k / 120 for k in range(241)]
    panel.frame(contact(0, 7, 1000, 500), true_s[0])
    for k, at_s in enumerate(true_s[1:], 1):
        panel.frame(moved(0, 1000 + 5 * k, 500), at_s)
    panel.frame(lifted(0), true_s[-1] + 0.01)
    reader.until(lambda rows: 0 in reader.column("down"))
    assert reader.column("t_s") == pytest.approx(true_s, abs=2e-6)
    assert reader.column("x_mm") == pytest.approx([100 + 0.5 * k for k in range(241)])
    assert set(reader.column("id")) == {7}
    assert reader.column("down") == [1, 0]
    assert reader.column("gaps_s") == []


def test_an_overflow_is_counted_resynced_and_marked(start):
    panel, reader = start()
    panel.frame(contact(0, 7, 1000, 500))
    reader.until(lambda rows: reader.column("id") == [7])
    # While the buffer overflows the finger lifts and another comes down.
    panel.do("lose", events=[*lifted(0), *contact(0, 8, 3000, 900)])
    reader.until(lambda rows: any("overflowed" in text for text in reader.column("notices")))
    panel.frame(moved(0, 3010, 900))
    reader.until(lambda rows: 8 in reader.column("id"))
    assert reader.column("x_raw") == [1000, 3010]
    assert len(reader.column("gaps_s")) == 1
    assert reader.column("down") == [1, 0, 1]


def test_a_panel_without_slots_that_is_touched_already_and_overflows_keeps_its_drag(start):
    panel, reader = start(already=pressed(1000, 500), slots=0)
    panel.frame([[EV_ABS, ABS_X, 1010]])
    reader.until(lambda rows: reader.column("x_raw") == [1010])
    panel.do("lose", events=[[EV_ABS, ABS_X, 1300], [EV_ABS, ABS_Y, 520]])
    reader.until(lambda rows: any("overflowed" in text for text in reader.column("notices")))
    panel.frame([[EV_ABS, ABS_X, 1310]])
    reader.until(lambda rows: 1310 in reader.column("x_raw"))
    panel.frame([[EV_KEY, BTN_TOUCH, 0]])
    reader.until(lambda rows: 0 in reader.column("down"))
    assert reader.column("y_mm") == pytest.approx([50.0, 52.0])
    assert len(set(reader.column("id"))) == 1
    assert reader.column("down") == [0]  # it did not begin now
    assert len(reader.column("gaps_s")) == 1


@pytest.mark.parametrize("number", [5, 9])
def test_unplugged_and_plugged_in_there_or_elsewhere_it_goes_on(start, number):
    panel, reader = start()
    panel.frame(contact(0, 7, 1000, 500))
    reader.until(lambda rows: reader.column("id") == [7])
    panel.do("unplug")
    reader.until(lambda rows: any("is gone" in text for text in reader.column("notices")))
    panel.do("plug", number=number)
    reader.until(lambda rows: any(f"back at /dev/input/event{number}" in text for text in reader.column("notices")))
    panel.frame(contact(0, 7, 1000, 500))
    reader.until(lambda rows: len(reader.column("id")) == 2)
    assert len(set(reader.column("id"))) == 2
    assert len(reader.column("gaps_s")) >= 1
    # Stamped on the monotonic clock again, which a new node does not do by itself.
    assert abs(reader.column("t_s")[-1] - time.monotonic()) < PATIENCE_S


def test_exclusive_use_waits_for_the_finger_to_lift(start):
    panel, reader = start("?exclusive=1", already=contact(0, 7, 1000, 500))
    panel.frame(moved(0, 1010, 500))
    reader.until(lambda rows: reader.column("x_raw") == [1010])
    panel.frame(lifted(0))
    reader.until(lambda rows: reader.column("down") == [0])
    # Taken once the lift has been read, which a busy machine does when it gets to it.
    deadline_s = time.monotonic() + 10
    while not panel.do("state")["grab_log"] and time.monotonic() < deadline_s:
        pass
    reader.finish()
    log = panel.do("state")["grab_log"]
    assert [taken for taken, _ in log] == [True, False]
    assert not any(down for _, down in log)


def test_fuzz_is_reported_over_the_wire(start):
    _, reader = start(fuzz=4)
    reader.until(lambda rows: any("fuzz of 4" in text for text in reader.column("notices")))
    assert reader.hello["axes"][0]["fuzz"] == 4


def test_a_device_that_is_not_there_is_reported(start):
    panel, _ = start()
    panel.node = "/dev/input/event77"
    reader = Reader(panel)
    assert "there is no such device" in reader.hello["error"]
    reader.finish()

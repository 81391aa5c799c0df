"""The pre-flight: every fault is a row with a remedy, and the exit status says whether one may measure."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from draglag.recording import AxisInfo, ClockBounds, LaserTrace, Screen, TouchTrace
from draglag_app import preflight as module
from draglag_app.cli import cli
from draglag_app.preflight import preflight, ready
from draglag_devices.rig import Rig
from draglag_devices.source import Batch, DeviceError, Notice, SourceInfo
from draglag_devices.stage import Stage
from draglag_devices.timebase import SteppedTime
from emulators.walt.wires import WaltOnPty

FAST = "sim:?speed=fast"


def run(*arguments):
    return CliRunner().invoke(cli, ["check", *map(str, arguments)])


def test_the_simulated_rig_is_ready():
    result = run("--touch", FAST, "--laser", FAST, "--walt", FAST, "--seconds", 60)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[-1] == "Ready."
    assert all(line.startswith("✓ ") for line in lines[:-1])
    names = [line[2:].split("  ")[0].strip() for line in lines[:-1]]
    assert names == ["disk", "touch", "touch events", "laser", "laser edges", "laser clock", "laser drift",
                     "walt", "walt clock", "walt drift"]  # fmt: skip
    clock = next(line for line in lines if "laser clock" in line)
    assert "limit ±1.00 ms" in clock
    drift = next(line for line in lines if "laser drift" in line)
    assert "ppm" in drift


def test_json_is_one_object_with_every_row():
    result = run("--touch", FAST, "--json")
    content = json.loads(result.stdout)
    assert content["ready"] is True
    assert {row["name"] for row in content["checks"]} == {"disk", "touch", "touch events"}
    assert set(content["checks"][0]) == {"name", "state", "measured", "limit", "remedy"}


def test_what_is_missing_is_a_row_each_with_the_remedy_and_exit_1(tmp_path):
    result = run("--touch", "sim:", "--laser", f"serial:{tmp_path}/ttyACM0?role=laser", "--walt",
                 f"serial:{tmp_path}/ttyACM1", "--seconds", 0.5)  # fmt: skip
    assert result.exit_code == 1
    bad = [line for line in result.stdout.splitlines() if line.startswith("✗")]
    assert len(bad) == 2
    assert all("no such port" in line and "→ plug the WALT in" in line for line in bad)
    assert "Not ready: 2 of" in result.stdout
    assert "Traceback" not in result.output


def test_usage_and_wrong_addresses():
    assert run().exit_code == 2
    wrong = run("--touch", "usb:3")
    assert wrong.exit_code == 1
    assert "not a device address" in wrong.stdout
    assert wrong.stderr.startswith("draglag: not ready: addresses: usb:3: this is not a device address")
    assert len(wrong.stderr.splitlines()) == 1
    mixed = run("--touch", FAST, "--walt", "serial:/dev/ttyACM0")
    assert mixed.exit_code == 1
    assert "cannot run faster than time" in mixed.stdout


class Fake:
    """A source that gives one batch out, then empty ones."""

    def __init__(self, role, time, first=None, *, axes=(), fault=None):
        self.address, self.role, self._time, self._first = f"fake:{role}", role, time, first
        self._axes, self._fault, self.closed = axes, fault, False

    def open(self):
        return SourceInfo(self.address, self.role, f"fake {self.role}", "compared", axes=self._axes)

    def read(self, timeout_s):
        if self._fault:
            raise self._fault
        first, self._first = self._first, None
        return first or Batch(self._time.now())

    def close(self):
        self.closed = True


def rows(monkeypatch, make, screen=None):
    time = SteppedTime(100.0)
    sources = tuple(make(time))
    monkeypatch.setattr(module, "make_rig", lambda addresses, screen_name: Rig(sources, Stage(time)))
    found = list(preflight({}, screen, watch_s=2.0))
    assert all(source.closed for source in sources)
    return {row.name: row for row in found}, found


def test_wide_and_drifting_clocks_are_warned_of_with_figures(monkeypatch):
    at_s = np.linspace(0, 600, 60)
    host_s = at_s * (1 + 40e-6) + 100
    wide = ClockBounds("walt", at_s, host_s - 3e-3, host_s + 3e-3)
    by_name, found = rows(monkeypatch, lambda time: [Fake("walt", time, Batch(100.0, clock=wide))])
    assert by_name["walt clock"].state == "warning"
    assert "USB" in by_name["walt clock"].remedy
    assert by_name["walt drift"].state == "warning"
    measured = by_name["walt drift"].measured.split()
    assert float(measured[1]) == pytest.approx(40, abs=10)
    assert measured[3].rstrip(",") == "slow"  # 1 s of the device is 1 s and 40 µs of the host
    assert ready(found)  # for the operator to judge


def test_a_clock_never_compared_is_a_fault(monkeypatch):
    by_name, found = rows(monkeypatch, lambda time: [Fake("walt", time)])
    assert by_name["walt clock"].state == "fault"
    assert not ready(found)


def test_lost_edges_fuzz_and_a_wrong_size_are_warned_of(monkeypatch):
    axes = tuple(AxisInfo(f"ABS_MT_POSITION_{n}", 0, 4999, 10, 4) for n in "XY")
    touch = TouchTrace(*(np.linspace(100, 101, 11) for _ in range(3)), dropped=2)
    laser = LaserTrace(np.array([100.5]), np.array([1]), missed=3)
    by_name, _ = rows(
        monkeypatch,
        lambda time: [
            Fake("touch", time, Batch(100.0, touch=touch), axes=axes),
            Fake("laser", time, Batch(100.0, laser=laser, notices=(Notice(100.0, "error", "The cable is loose."),))),
        ],
        Screen("test", 510.0, 500.0, 1920, 1080),
    )
    assert by_name["touch size"].state == "ok"  # 2 % is just the limit
    assert by_name["touch fuzz"].state == "warning"
    assert by_name["touch events"].state == "warning"
    assert "10 Hz, 2 lost" in by_name["touch events"].measured
    assert "1 seen, 3 missed" in by_name["laser edges"].measured
    assert by_name["laser"].measured == "The cable is loose."  # the last row of that name
    by_name, _ = rows(monkeypatch, lambda time: [Fake("touch", time, axes=axes)], Screen("t", 400.0, 500.0, 1, 1))
    assert by_name["touch size"].state == "warning"
    assert "25.0 % off" in by_name["touch size"].measured


def test_a_device_lost_while_watching_is_a_fault_and_the_others_are_still_judged(monkeypatch):
    gone = DeviceError("fake:touch", "the cable was pulled", "plug it in")
    by_name, found = rows(monkeypatch, lambda time: [Fake("touch", time, fault=gone), Fake("laser", time)])
    assert by_name["touch"].state == "fault"
    assert by_name["touch"].remedy == "plug it in."
    assert by_name["laser edges"].state == "warning"
    assert not ready(found)


@pytest.mark.wire
def test_a_walt_on_a_wire_is_checked(tmp_path):
    with WaltOnPty(tmp_path, drift=5e-6) as pen:
        result = run("--walt", f"serial:{pen.path}", "--seconds", 1.2)
        assert result.exit_code == 0, result.output
        assert "firmware 6" in result.stdout
    with WaltOnPty(tmp_path, version="4") as pen:
        result = run("--walt", f"serial:{pen.path}", "--seconds", 1)
        assert result.exit_code == 1
        assert "firmware 4" in result.stdout


def test_a_folder_that_is_made_when_the_first_session_is_saved_is_no_fault(tmp_path):
    (disk,) = [row for row in preflight({"touch": FAST}, watch_s=0.5, folder=tmp_path / "new" / "sessions")
               if row.name == "disk"]  # fmt: skip
    assert disk.state == "ok"
    assert "GB free" in disk.measured

import gzip

import numpy as np
import pytest

from draglag.exchange import write_exchange
from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Circle
from draglag.simulation import simulate_session
from draglag.store import write_session
from draglag_devices.opening import open_source
from draglag_devices.rig import make_rig
from draglag_devices.source import DeviceError

PLANNED = PlannedRun("run-01", Circle(100, 100, 50, 200, 5.0), 200.0, 50.0)
EVEMU = """N: panel
A: 35 0 3999 0 0 40
A: 36 0 1999 0 0 40
E: 500.000 3 39 1
E: 500.000 3 35 400
E: 500.000 3 36 800
E: 500.000 0 0 0
E: 500.010 3 35 440
E: 500.010 0 0 0
E: 500.020 3 39 -1
E: 500.020 0 0 0
"""


def play(rig, start_s=10.0, seconds=60.0):
    """Everything that the sources of a rig report of one run, by role."""
    for source in rig.sources:
        source.open()
    rig.stage.begin_run(PLANNED, start_s, PLANNED.id)
    rig.stage.time_base.advance_to(start_s + seconds)
    out = {}
    for source in rig.sources:
        batches = [source.read(0.0)]
        while batches[-1].until_s < start_s + seconds:
            batches.append(source.read(0.0))
        out[source.role] = batches
    return out


def joined(batches, kind, column):
    return np.concatenate([getattr(getattr(b, kind), column) for b in batches if getattr(b, kind) is not None])


def test_an_evemu_recording_is_played_in_mm_from_the_start_of_the_run(tmp_path):
    path = tmp_path / "drag.events.gz"
    path.write_bytes(gzip.compress(EVEMU.encode()))
    played = play(make_rig({"touch": f"replay:{path}"}, fast=True), seconds=1.0)
    np.testing.assert_allclose(joined(played["touch"], "touch", "t_s"), [10.0, 10.01], atol=1e-9)
    np.testing.assert_allclose(joined(played["touch"], "touch", "x_mm"), [10.0, 11.0])
    np.testing.assert_allclose(joined(played["touch"], "touch", "y_raw"), [800, 800])
    assert joined(played["touch"], "contacts", "down").tolist() == [1, 0]


def test_an_evemu_recording_without_axes_needs_a_scale(tmp_path):
    path = tmp_path / "drag.events"
    path.write_text("\n".join(line for line in EVEMU.splitlines() if not line.startswith("A:")))
    with pytest.raises(DeviceError, match="units_per_mm"):
        open_source(f"replay:{path}", "touch").open()
    played = play(make_rig({"touch": f"replay:{path}?units_per_mm=40"}, fast=True), seconds=1.0)
    np.testing.assert_allclose(joined(played["touch"], "touch", "x_mm"), [10.0, 11.0])


def test_csv_files_of_touch_and_laser(tmp_path):
    touch, laser = tmp_path / "t.csv", tmp_path / "l.csv"
    touch.write_text("t_s,x_mm,y_mm\n5.0,1,2\n5.5,3,4\n")
    laser.write_text("t_s,light\n7.0,0\n7.25,1\n")
    played = play(make_rig({"touch": f"csv:{touch}", "laser": f"csv:{laser}"}, fast=True), seconds=1.0)
    np.testing.assert_allclose(joined(played["touch"], "touch", "t_s"), [10.0, 10.5])
    np.testing.assert_allclose(joined(played["laser"], "laser", "t_s"), [10.0, 10.25])
    assert joined(played["laser"], "laser", "light").tolist() == [0, 1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,x,y\n1,2,3\n", "line 1"),
        ("t_s,x_mm,y_mm\n1,2,3\n1.1,oops,3\n", "line 3"),
        ("t_s,x_mm,y_mm\n1,2\n", "line 2"),
        ("t_s,x_mm,y_mm\n2,2,2\n1,2,2\n", "line 3"),
        ("t_s,x_mm,y_mm\nnan,2,2\n", "line 2"),
    ],
)
def test_malformed_csv_names_file_and_line(tmp_path, text, words):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(DeviceError, match=words) as caught:
        open_source(f"csv:{path}", "touch").open()
    assert "bad.csv" in str(caught.value)


def test_a_missing_or_unknown_file_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(DeviceError, match="no such file"):
        open_source(f"replay:{tmp_path / 'nothing.h5'}", "touch").open()
    with pytest.raises(DeviceError, match="not known"):
        open_source(f"replay:{tmp_path / 'notes.txt'}", "touch").open()


@pytest.mark.parametrize("kind", ["session", "folder"])
def test_a_session_is_played_run_by_run_with_touch_and_laser_together(tmp_path, kind):
    session = simulate_session("screen-1", _short_protocol(tmp_path), seed=1)
    if kind == "session":
        path = write_session(session, tmp_path / "old.h5")
    else:
        path = write_exchange(session, tmp_path / "folder")
    rig = make_rig({"touch": f"replay:{path}", "laser": f"replay:{path}"}, fast=True)
    played = play(rig, seconds=8.0)
    run = session.runs[0]
    shift = 10.0 - run.start_s
    # Text keeps microseconds at least.
    np.testing.assert_allclose(joined(played["touch"], "touch", "t_s"), run.touch.t_s + shift, atol=1e-6)
    np.testing.assert_allclose(joined(played["laser"], "laser", "t_s"), run.laser.t_s + shift, atol=1e-6)
    np.testing.assert_array_equal(joined(played["laser"], "laser", "light"), run.laser.light)


def _short_protocol(folder):
    path = folder / "short.toml"
    path.write_text('name = "short"\n[[runs]]\nkind = "circle"\nspeed_mm_s = 200\nduration_s = 5.0\n')
    return path

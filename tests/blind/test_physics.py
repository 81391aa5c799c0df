"""The generator against its own truth: the true latency puts edges on the beam; each effect moves what it should."""

import gzip
import json

import numpy as np
import pytest

from blind.conditions import STREAM, sized
from blind.physics import make_session
from blind.physics.effects import EFFECTS, LIBRARY, UNKNOWN
from blind.physics.rig import Profile
from blind.visibility import residuals, visibility

# Without noise, so that what is left is interpolation (tenths of a tenth of a mm) and the effect.
CLEAN = Profile(
    noise=0.0, hand=0.3, protocol="repeats", n_speeds=5, run_s=25.0,
    between_runs=False, losses=False, varied_runs=False, taps="both",
)  # fmt: skip
NOISY = Profile(
    between_runs=False, losses=False, varied_runs=True, n_speeds=8, protocol="speeds", run_s=25.0, taps="both"
)
SEED = 11


@pytest.fixture(scope="module")
def twin(tmp_path_factory):
    return make_session(tmp_path_factory.mktemp("twin"), SEED, {}, CLEAN)


@pytest.fixture(scope="module")
def noisy_twin(tmp_path_factory):
    return make_session(tmp_path_factory.mktemp("noisy"), SEED, {}, NOISY)


def read(folder, run, stream):
    with gzip.open(folder / f"{run}.{stream}.csv.gz", "rt") as file:
        return np.loadtxt(file, delimiter=",", skiprows=1)


def shift_ms(truth, twin, chosen=lambda d: d["edge_s"] > -1, against=None):
    """Latency ms that the effect adds at each edge where `chosen(details)`; with `against`, that detail next to it."""
    out = []
    before, after = residuals(twin, twin), residuals(truth, twin)
    for run, (r1, at1) in after.items():
        r0, at0 = before[run]
        _, i1, i0 = np.intersect1d(at1, at0, return_indices=True)
        keys = ("edge_s", "x_mm", "vy_mm_s", "speed_mm_s")
        details = {key: twin.details[run][key][at0[i0]] for key in keys}
        # square to the beam: where the path only grazes it, its curvature counts too
        good = (np.abs(details["vy_mm_s"]) > np.maximum(60, 0.8 * details["speed_mm_s"])) & chosen(details)
        late = -1e3 * (r1[i1] - r0[i0])[good] / details["vy_mm_s"][good]
        out.append(np.column_stack([late, details[against or "edge_s"][good]]))
    both = np.concatenate(out)
    return both if against else both[:, 0]


def test_true_latency_aligns_every_edge(twin):
    left = np.concatenate([r for r, _ in residuals(twin, twin).values()])
    assert len(left) > 300
    assert np.sqrt(np.mean(left**2)) < 0.05
    assert np.abs(left.mean()) < 0.01


def test_noise_is_what_was_drawn(noisy_twin):
    circles = {run.id for run in noisy_twin.rig.plan if run.protocol == "circle"}
    left = np.concatenate([r for run, (r, _) in residuals(noisy_twin, noisy_twin).items() if run in circles])
    # Between two samples linear interpolation averages white noise: 2/3 of the variance; correlated noise loses less.
    assert 0.7 < left.std() / noisy_twin.rig.noise_mm < 1.1


def test_same_seed_same_bytes_and_truth_stays_outside(tmp_path):
    for name in ("a", "b"):
        make_session(tmp_path / name, 3, {"clock_drift": 30.0}, CLEAN)
    files = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert "truth.json" not in files
    for name in files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    reported = (tmp_path / "a" / "session.json").read_text()
    assert "clock_drift" not in reported
    assert json.loads(reported)["format"] == "draglag-exchange"


def test_latency_effects_have_their_size(tmp_path, twin):
    def made(name, size):
        return make_session(tmp_path / name, SEED, {name: size}, CLEAN)

    down = shift_ms(made("direction_asymmetry", 0.006), twin, lambda d: d["vy_mm_s"] > 0)
    assert down.mean() == pytest.approx(3.0, abs=0.3)
    # half of the edges are stamped late, which makes latency look short
    assert shift_ms(made("laser_hysteresis", 0.002), twin).mean() == pytest.approx(-1.0, abs=0.3)
    assert np.median(shift_ms(made("clock_offset", 0.005), twin)) == pytest.approx(-5.0, abs=0.3)
    # where the curve is flat: elsewhere the trace itself runs faster or slower than the stylus did
    late_ms, x_mm = shift_ms(made("scan_skew", 0.010), twin, lambda d: d["speed_mm_s"] > 250, against="x_mm").T
    per_mm, at_left = np.polyfit(x_mm, late_ms, 1)
    assert per_mm * twin.rig.screen[1] == pytest.approx(10.0, abs=0.5)
    assert at_left == pytest.approx(0.0, abs=0.4)


def test_clocks_part_and_latency_creeps(tmp_path, twin):
    for name, size, ms_per_s in (("clock_drift", 100.0, -0.1), ("thermal_drift", 0.36, 0.1)):
        truth = make_session(tmp_path / name, SEED, {name: size}, CLEAN)
        late_ms, at_s = shift_ms(truth, twin, against="edge_s").T
        assert np.polyfit(at_s, late_ms, 1)[0] == pytest.approx(ms_per_s, rel=0.08), name


def test_taps_know_thermal_drift_but_not_the_laser_clock(tmp_path, twin):
    def creep(effects):
        folder = tmp_path / next(iter(effects))
        make_session(folder, SEED, effects, CLEAN)
        with gzip.open(folder / "taps.csv.gz", "rt") as file:
            taps = np.loadtxt(file, delimiter=",", skiprows=1)
        late = taps[:, 1] - taps[:, 0]
        middle = taps[:, 0].mean()
        return late[taps[:, 0] > middle].mean() - late[taps[:, 0] < middle].mean()

    # About 80 taps of 4 ms and two of them a tap: the difference of halves is good to about 1 ms.
    between = twin.rig.plan[-1].start_s + 100
    assert creep({"thermal_drift": 0.5}) - creep({"clock_drift": 80.0}) == pytest.approx(0.5 * between / 3600, rel=0.3)


def test_width_and_plateau(tmp_path, twin):
    wide = make_session(tmp_path / "wide", SEED, {"beam_width": 1.0}, CLEAN)
    moved = []
    for run, base in wide.details.items():
        away = base["y_mm"] - wide.rig.beam_intercept_mm - wide.rig.beam_slope * base["x_mm"]
        moved.append(np.abs(away))
        assert len(base["edge_s"]) >= 0.9 * len(twin.details[run]["edge_s"])
    assert 2 * np.concatenate(moved).mean() == pytest.approx(wide.rig.diameter_mm + 1.0, abs=0.02)
    flat = make_session(tmp_path / "flat", SEED, {"low_speed_plateau": 200.0}, CLEAN)
    slow = np.concatenate([d["latency_s"][d["speed_mm_s"] < 180] for d in flat.details.values()])
    law = flat.rig.law.parameters
    at_200 = law["a1"] * np.exp(-law["a2"] * 200) + law["a4"] * np.exp(-law["a5"] * 200) + law["a7"]
    np.testing.assert_allclose(slow, at_200, atol=1e-6)


def bend_mm(touch):
    """How far each sample lies off the line through its neighbours, mm in either axis, the larger."""
    t, xy = touch[:, 0], touch[:, 1:]
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    return np.abs(xy[1:-1] - xy[:-2] - share * (xy[2:] - xy[:-2])).max(axis=1)


def test_streams_show_their_effects(tmp_path):
    """Ticks, groups, quanta, holes, straight lines and chatter are in the files as described."""
    sizes = {
        "sample_hold": 80.0, "frame_batching": 2.0, "timestamp_quantisation": 0.005, "frame_drop": 0.2,
        "laser_bounce": 0.001, "loss_of_contact": 0.5, "stalls": 0.05,
    }  # fmt: skip
    plain = make_session(tmp_path / "plain", SEED, {}, NOISY)
    run = plain.rig.plan[0].id
    t0 = read(tmp_path / "plain", run, "touch")[:, 0]
    period = 1 / plain.rig.rate_hz
    seen = {}
    for name, size in sizes.items():
        make_session(tmp_path / name, SEED, {name: size}, NOISY)
        seen[name] = read(tmp_path / name, run, "touch")
    ticks = seen["sample_hold"]
    assert np.median(np.diff(ticks[:, 0])) == pytest.approx(1 / 80, abs=1e-4)
    pairs = np.diff(seen["frame_batching"][:, 0])
    assert np.mean(pairs < 2e-4) == pytest.approx(0.5, abs=0.02)
    quanta = seen["timestamp_quantisation"][:, 0] / 0.005
    assert np.abs(quanta - np.round(quanta)).max() < 1e-3
    assert len(seen["frame_drop"]) / len(t0) == pytest.approx(0.8, abs=0.05)
    # straight at constant pace, where noise never is
    assert np.mean(bend_mm(seen["loss_of_contact"]) < 0.001) > 0.02
    assert np.mean(bend_mm(read(tmp_path / "plain", run, "touch")) < 0.001) < 0.002
    assert np.diff(seen["stalls"][:, 0]).max() > 0.04 > 3 * period
    chatter = np.diff(read(tmp_path / "laser_bounce", run, "laser")[:, 0])
    assert np.mean(chatter < 0.001) > 0.3
    light = read(tmp_path / "laser_bounce", run, "laser")[:, 1]
    assert np.all(np.diff(light) != 0)


@pytest.mark.parametrize("name", [name for name in LIBRARY + UNKNOWN if name not in STREAM])
def test_nominal_sizes_show(name, tmp_path, noisy_twin):
    """Every effect that moves residuals shows at twice its nominal size, above what Eq. 5 can absorb."""
    if name in ("clock_offset", "contact_trail"):
        pytest.skip("moves taps against the curve, or is a 1/v term that Eq. 5 takes for its own")
    truth = make_session(tmp_path, SEED, sized((name,), 2.0, SEED), NOISY)
    d = visibility(truth, noisy_twin)
    assert d is not None
    assert d > 4, f"{EFFECTS[name].meaning}: d = {d:.1f}"

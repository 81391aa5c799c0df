"""Sessions with something in every field, for the tests of files."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from draglag.recording import (
    AxisInfo,
    Beam,
    ClockBounds,
    DisplayTrace,
    LaserTrace,
    LogEntry,
    Run,
    Screen,
    Session,
    Stylus,
    Taps,
    TouchCalibration,
    TouchTrace,
)


def touch(n: int, start_s: float) -> TouchTrace:
    rng = np.random.default_rng(n)
    t_s = start_s + 0.01 * np.arange(n)
    return TouchTrace(
        t_s,
        100 + rng.normal(0, 10, n),
        100 + rng.normal(0, 10, n),
        np.repeat([3, 7], [n // 2, n - n // 2]),
        rng.integers(0, 4095, n).astype(float),
        rng.integers(0, 4095, n).astype(float),
        t_s * 1.00001 - 5,
        np.array([[start_s + 0.5, start_s + 0.75]]),
        4,
        (AxisInfo("ABS_MT_POSITION_X", 0, 4095, 13, 2), AxisInfo("ABS_MT_POSITION_Y", -1, 4094)),
    )


def laser(n: int, start_s: float) -> LaserTrace:
    t_s = start_s + 0.13 * np.arange(n)
    return LaserTrace(t_s, np.arange(n) % 2, t_s + 11, np.zeros(n, np.int64), np.empty((0, 2)), 1)


def full_run(run_id: str, start_s: float, protocol: str = "circle") -> Run:
    bounds = ClockBounds(
        "laser 1/DC", np.arange(3.0), np.arange(3.0) + 1, np.array([1.5, np.inf, 3.5]), np.zeros(3, int)
    )
    return Run(
        id=run_id,
        protocol=protocol,
        start_s=start_s,
        duration_s=2.0,
        touch=touch(200, start_s),
        laser=laser(12, start_s),
        nominal_speed_mm_s=None if protocol == "chirp" else 123.4,
        radius_mm=50.9,
        target={"kind": "circle", "turns": 3, "rate_hz": 0.5},
        display=DisplayTrace(start_s + np.arange(5) / 60, np.arange(5.0), np.arange(5.0) + 1, 2),
        sync=(bounds,),
        log=(
            LogEntry(start_s, "warning", "touch", "Zeit läuft rückwärts " * 40),
            LogEntry(start_s + 1, "note", "op", "ä"),
        ),
        outcome="complete",
        seed=2**70,
    )


def full_session() -> Session:
    return Session(
        name="Prüfling A",
        screen=Screen("Dell P2314T", 509.2, 286.4, 1920, 1080),
        stylus=Stylus(7.0, "Bamboo"),
        runs=(full_run("run-01", 10.0), full_run("run-02", 20.0, "chirp")),
        taps=Taps(np.arange(4.0), np.arange(4.0) + 0.028, np.array([1, 0, 1, 0]), {"too close": 2}),
        beam=Beam(0.01, 149.5),
        clocks=(ClockBounds("walt", np.zeros(2), np.zeros(2), np.ones(2)),),
        started_utc="2026-03-01T10:00:00+00:00",
        started_s=5.0,
        notes=(LogEntry(1.0, "note", "operator", "Schirm gereinigt"),),
        protocol_toml='[sweep]\nname = "ü"\n' * 4000,
        seed=7,
        devices={"touch": "evdev:/dev/input/event3", "laser": "sim:"},
        details={"participant": "P07", "operator": "Zoë", "room": "B 2.14"},
        software="draglag test",
        calibration=TouchCalibration(
            np.arange(9.0), np.arange(9.0) ** 2, np.arange(9.0) / 20, np.arange(9.0) / 30,
            np.array([[0.05, 1e-4, -3.0], [2e-4, 0.04, 1.5]]), "Panel", "2026-03-01T09:00:00+00:00",
        ),
    )  # fmt: skip


def bare_session(run: Run | None = None) -> Session:
    return Session("bare", Screen("s", 300.0, 200.0, 1024, 768), Stylus(7.0), () if run is None else (run,))


def assert_same(a: Any, b: Any, where: str = "session") -> None:
    """Equality of two recordings, arrays and all, bit by bit (NaN equals NaN)."""
    assert type(a) is type(b) or not is_dataclass(a), where
    if is_dataclass(a):
        for spec in fields(a):
            assert_same(getattr(a, spec.name), getattr(b, spec.name), f"{where}.{spec.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, where
        np.testing.assert_array_equal(a, b, err_msg=where)
    elif isinstance(a, tuple):
        assert len(a) == len(b), where
        for k, (one, two) in enumerate(zip(a, b, strict=True)):
            assert_same(one, two, f"{where}[{k}]")
    else:
        assert a == b, where

"""A recording of which everything is known: commits of 0.2 s, what each holds, and what of it was found again."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from draglag.recording import (
    ClockBounds,
    DisplayTrace,
    LaserTrace,
    LogEntry,
    Run,
    Screen,
    Session,
    Stylus,
    Taps,
    TouchTrace,
    empty_laser,
    empty_touch,
)
from draglag.store import SessionWriter, read_session
from draglag.store.journal import nodes, open_journal, survey

COMMIT_S = 0.2
_RATE_HZ = 240
HEADER = Session(
    "trial", Screen("s", 509.2, 286.4, 1920, 1080), Stylus(7.0), (), started_utc="2026-01-01T00:00:00+00:00",
    started_s=100.0, protocol_toml="name = 'trial'\n" * 20, devices={"touch": "sim:", "laser": "sim:"}, seed=1,
)  # fmt: skip


@dataclass(frozen=True)
class Commit:
    """What one flush brings to the disk: the beginning of a run, samples, its end, or taps between runs."""

    kind: str
    run: str = ""
    touch: TouchTrace | None = None
    laser: LaserTrace | None = None
    taps: Taps | None = None
    t_s: float = 0.0


@dataclass
class Held:
    """What a file holds: run → column → values, outcomes, taps, and what it says is missing."""

    touch: dict[str, dict[str, Any]] = field(default_factory=dict)
    laser: dict[str, dict[str, Any]] = field(default_factory=dict)
    outcomes: dict[str, str] = field(default_factory=dict)
    taps: int = 0
    losses: tuple[str, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """Commits on the disk but not found; values never recorded; damaged runs claimed whole; whether losses were
    reported."""

    lost: tuple[int, ...]
    wrong: bool
    short: bool
    silent: bool
    uncommitted_s: float


def commits(runs: int = 3, seconds: float = 4.0, taps: int = 4) -> list[Commit]:
    """Taps, then runs; the last run is never ended."""
    rng = np.random.default_rng(1)
    found, t_s = [], 100.0
    for _ in range(taps):
        t_s += COMMIT_S
        pairs = Taps(np.array([t_s, t_s + 0.1]), np.array([t_s + 0.03, t_s + 0.13]), np.array([1, 0]), {"late": 0})
        found.append(Commit("taps", taps=pairs, t_s=t_s))
    for number in range(1, runs + 1):
        run = f"run-{number:02d}"
        t_s += COMMIT_S
        found.append(Commit("begin", run, t_s=t_s))
        for _ in range(round(seconds / COMMIT_S)):
            n = round(_RATE_HZ * COMMIT_S)
            at_s = t_s + np.arange(n) / _RATE_HZ
            x, y, raw, other = rng.normal(100, 30, (4, n))
            touch = TouchTrace(at_s, x, y, np.full(n, number), raw, other)
            laser = LaserTrace(t_s + np.arange(4) * 0.05, np.array([0, 1, 0, 1]), rng.normal(0, 1, 4))
            t_s = round(t_s + COMMIT_S, 6)
            found.append(Commit("data", run, touch, laser, t_s=t_s))
        if number < runs:
            found.append(Commit("end", run, t_s=t_s))
    return found


def play(writer: SessionWriter, plan: Iterable[Commit], done: Callable[[int], None] = lambda number: None) -> None:
    """Record; ``done`` is called with the number of every commit that is on the disk."""
    for number, commit in enumerate(plan):
        give(writer, commit)
        writer.flush()
        done(number)


def give(writer: SessionWriter, commit: Commit) -> None:
    """Hand a commit to the writer. Raises DataError where the disk refuses it: it then waits in memory."""
    if commit.kind == "taps" and commit.taps is not None:
        writer.append_taps(commit.taps)
        writer.append_log(LogEntry(commit.t_s, "note", "operator", "tapped"))
    elif commit.kind == "begin":
        writer.begin_run(Run(commit.run, "circle", commit.t_s, 4.0, empty_touch(), empty_laser(), 44.0))
    elif commit.kind == "end":
        writer.end_run(commit.run, "complete", 4.0)
    elif commit.touch is not None and commit.laser is not None:
        writer.append_touch(commit.run, commit.touch)
        writer.append_laser(commit.run, commit.laser)
        at_s = commit.touch.t_s[:12]
        writer.append_display(commit.run, DisplayTrace(at_s, at_s, at_s))
        writer.append_clock(ClockBounds("laser", at_s[:1], at_s[:1] - 1e-4, at_s[:1] + 1e-4), commit.run)


def in_journal(path: Path) -> Held:
    """What salvaging a journal would write, without writing it. Raises DataError."""
    held = Held()
    rows: dict[str, list[dict[str, Any]]] = {}
    with open_journal(path) as fd:
        found = survey(fd, str(path))
        held.losses = (*found.losses, *(loss for run in found.runs.values() for loss in run.losses))
        for node in nodes(fd, found):
            if node.rows:
                rows.setdefault(node.path, []).append(dict(node.rows))
            if node.path.count("/") == 1 and "outcome" in node.attrs:
                held.outcomes[node.path.split("/")[1]] = str(node.attrs["outcome"])
    held.taps = sum(len(part["physical_s"]) for part in rows.get("taps", []))
    for run in held.outcomes:
        for stream, kept in (("touch", held.touch), ("laser", held.laser)):
            parts = rows.get(f"runs/{run}/{stream}", [])
            names = ("time", "x_mm", "y_mm", "x_raw") if stream == "touch" else ("time", "light", "device_s")
            parts = [part for part in parts if len(part.get("time", ()))]
            kept[run] = {n: np.concatenate([part[n] for part in parts]) if parts else np.empty(0) for n in names}
    return held


def in_session(path: Path, losses: tuple[str, ...] = ()) -> Held:
    """What a session file holds. Raises DataError."""
    session = read_session(path)
    held = Held(losses=losses, taps=0 if session.taps is None else len(session.taps.physical_s))
    for run in session.runs:
        held.outcomes[run.id] = run.outcome
        touch, laser = run.touch, run.laser
        held.touch[run.id] = {"time": touch.t_s, "x_mm": touch.x_mm, "y_mm": touch.y_mm, "x_raw": touch.x_raw}
        held.laser[run.id] = {"time": laser.t_s, "light": laser.light, "device_s": laser.device_t_s}
    return held


def judge(held: Held, plan: list[Commit], done: int) -> Verdict:
    """``done``: number of the last commit that was on the disk, -1 for none."""
    truth = _truth(plan)
    wrong = short = False
    for run, columns in held.touch.items():
        wrong |= run not in truth or not _all_in(columns, truth[run][0])
        wrong |= run in truth and not _all_in(held.laser[run], truth[run][1])
        if held.outcomes[run] == "complete" and run in truth:
            short |= len(columns["time"]) < len(truth[run][0]["time"])
            short |= len(held.laser[run]["time"]) < len(truth[run][1]["time"])
    missing = [number for number, commit in enumerate(plan) if not _there(held, plan, number, commit)]
    lost = tuple(number for number in missing if number <= done)
    spared = COMMIT_S * sum(plan[number].kind in ("data", "taps") for number in missing if number == done + 1)
    return Verdict(lost, wrong, short, bool(lost) and not held.losses, spared)


def _truth(plan: list[Commit]) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    truth = {}
    for run in {commit.run for commit in plan if commit.run}:
        touch = [c.touch for c in plan if c.run == run and c.touch is not None]
        laser = [c.laser for c in plan if c.run == run and c.laser is not None]
        names = {"time": "t_s", "x_mm": "x_mm", "y_mm": "y_mm", "x_raw": "x_raw"}
        edges = {"time": "t_s", "light": "light", "device_s": "device_t_s"}
        truth[run] = (
            {key: np.concatenate([getattr(part, name) for part in touch]) for key, name in names.items()},
            {key: np.concatenate([getattr(part, name) for part in laser]) for key, name in edges.items()},
        )
    return truth


def _all_in(columns: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Whether every row was recorded so, and none comes twice."""
    if not len(columns["time"]):
        return True
    at = np.minimum(np.searchsorted(truth["time"], columns["time"]), len(truth["time"]) - 1)
    return bool((np.diff(at) > 0).all()) and all(np.array_equal(columns[key], truth[key][at]) for key in columns)


def _there(held: Held, plan: list[Commit], number: int, commit: Commit) -> bool:
    if commit.kind == "taps":
        return held.taps >= 2 * (1 + sum(c.kind == "taps" for c in plan[:number]))
    if commit.kind == "begin":
        return commit.run in held.outcomes
    if commit.kind == "end":
        return held.outcomes.get(commit.run) in ("complete", "failed")  # the latter where rows are missing
    assert commit.touch is not None
    assert commit.laser is not None
    touch, laser = held.touch.get(commit.run), held.laser.get(commit.run)
    return (
        touch is not None
        and laser is not None
        and bool(np.isin(commit.touch.t_s, touch["time"]).all() and np.isin(commit.laser.t_s, laser["time"]).all())
    )

"""Speed and precision, printed: ``./run bench [RUNS]`` (default 1500 simulated runs at each speed)."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.rigs import bound_of, circle_run, rig_with_latency
from bench.walt_style import walt_style_latency_s
from draglag.analysis import analyze
from draglag.latency import estimate_run
from draglag.latency.efficient import solve
from draglag.latency.estimate import WINDOW_S, prepare
from draglag.latency.scan import scan
from draglag.latency.track import track_of
from draglag.protocol.runs import load_protocol
from draglag.recording import Run, Session
from draglag.simulation import simulate_session
from draglag.store import read_session, write_session

TRUE_S = {50.0: 0.140, 250.0: 0.090, 1000.0: 0.035}


def precision(n_runs: int) -> None:
    print(f"RMSE over the Cramér–Rao bound and coverage of the 95 % interval, {n_runs} simulated runs at each speed")
    print("(one latency at all speeds, the simulated participant, 120 Hz, 0.15 mm noise of which a fifth correlated)")
    print(f"{'mm/s':>6} {'edges':>6} {'bound ms':>9} {'efficient':>13} {'coverage':>14} {'none':>5} {'Eq. 2 raw':>10}")
    for speed, true_s in TRUE_S.items():
        rig = rig_with_latency(true_s, sensor_response_s=0.0)
        error, paper_error, covered, bounds, edges = [], [], [], [], []
        for seed in range(n_runs):
            run, truth, target, _ = circle_run(speed, seed, rig)
            if seed < 20:
                bounds.append(bound_of(run, truth, target, rig))
            found = estimate_run(run, 7.0)
            edges.append(found.n_edges)
            if found.latency_s is not None and found.latency_ci95_s is not None:
                error.append(found.latency_s - true_s)
                covered.append(found.latency_ci95_s[0] <= true_s <= found.latency_ci95_s[1])
            if seed < n_runs // 5:
                other = estimate_run(run, 7.0, "paper")
                paper_error.append((other.latency_s or np.nan) - true_s)
        bound = float(np.sqrt(np.mean(np.square(bounds))))
        ratio, other_ratio = (float(np.sqrt(np.nanmean(np.square(e)))) / bound for e in (error, paper_error))
        none = n_runs - len(error)
        # What so many runs leave open, one standard error: of a root mean square, and of a share.
        open_ratio = ratio / np.sqrt(2 * len(error))
        open_covered = 100 * float(np.std(covered)) / np.sqrt(len(covered))
        print(
            f"{speed:6.0f} {np.mean(edges):6.0f} {1e3 * bound:9.3f} {ratio:6.2f} ± {open_ratio:.2f} "
            f"{100 * np.mean(covered):6.1f} ± {open_covered:.1f}% "
            f"{none:5d} {other_ratio:10.2f}"
        )


def speed() -> None:
    protocol = load_protocol("latency-sweep")
    session = simulate_session("screen-1", protocol, seed=1)
    session = replace(session, runs=session.runs[:15])
    analyze(session)  # once for imports and caches
    # Turn about, the fastest of each: another job on the machine then slows neither alone.
    ours, bare, peer = (
        float(least)
        for least in np.min(
            [
                [
                    _cpu_s(lambda: analyze(session)),
                    _cpu_s(lambda: [_one_pass(run, session.stylus.diameter_mm) for run in session.runs]),
                    _cpu_s(lambda: [walt_style_latency_s(run) for run in session.runs]),
                ]
                for _ in range(7)
            ],
            axis=0,
        )
    )
    print(f"\nCPU of analyze, 15 runs: {ours:.3f} s; of a lean WALT-style minimisation of the same runs: {peer:.3f} s")
    print(f"ratio {ours / peer:.2f} (wished for: 0.25)")
    print(f"of one pass of the estimator alone, without lateness, flags, clocks and curve: {bare / peer:.2f}")
    reading, whole = _as_a_file_s(session)
    work = reading + ours
    print(f"CPU of reading its file: {reading:.3f} s; of reading and analysing it: {work:.3f} s (wished for: 0.6)")
    print(f"CPU of the whole command draglag analyze: {whole:.3f} s, {whole / work:.1f} times that work (bar: 2.5)")
    times = []
    for _ in range(3):
        start = time.perf_counter()
        subprocess.run([Path(sys.executable).with_name("draglag"), "--help"], capture_output=True, check=True)
        times.append(time.perf_counter() - start)
    print(f"draglag --help: {min(times):.3f} s (bar: 0.3)")


def _cpu_s(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def _one_pass(run: Run, diameter_mm: float) -> None:
    """The path smoothed, one scan of the latencies, one solution: what no run can do without."""
    ready = prepare(run, diameter_mm)
    track = track_of(ready)
    coarse = scan(ready.touch, ready.edges, WINDOW_S, diameter_mm, track.path, track.losses_s)
    solve(ready, float(coarse.latency_s[coarse.minima()[0]]), track)


def _as_a_file_s(session: Session) -> tuple[float, float]:
    """CPU time of reading the session's file, and of `draglag analyze` on it in a new process, s: the least of five."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_session(session, Path(folder) / "session.h5")
        reads, times = [], []
        for _ in range(5):
            start = time.process_time()
            read_session(path)
            reads.append(time.process_time() - start)
            before = os.times()
            subprocess.run(
                [Path(sys.executable).with_name("draglag"), "analyze", path, "--json"], capture_output=True, check=True
            )
            after = os.times()
            times.append(after.children_user + after.children_system - before.children_user - before.children_system)
        return min(reads), min(times)


if __name__ == "__main__":
    speed()
    precision(int(sys.argv[1]) if len(sys.argv) > 1 else 1500)

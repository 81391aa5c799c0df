"""How often the 95 % interval of a run's latency covers the truth, by speed: python -m tests.realistic.coverage"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from tests.blind.physics.law import FORMS

from draglag.analysis import analyze

from .session import make_session

BANDS_MM_S = ((0, 80), (80, 130), (130, 210), (210, 450), (450, 2000))


def rows_of(job: tuple[int, str] | tuple[int, str, float, float | None]) -> list[tuple[float, float, float, float]]:
    """Speed mm/s, error ms, lower and upper reach of the interval ms, of every run of one session."""
    session, truth = make_session(*job)
    out = []
    for run in analyze(session).runs:
        if run.latency_s is not None and run.latency_ci95_s is not None and run.speed_mm_s is not None:
            low, high = run.latency_ci95_s
            ms = [1e3 * q for q in (run.latency_s - truth[run.id], run.latency_s - low, high - run.latency_s)]
            out.append((run.speed_mm_s, *ms))
    return out


def table(rows: np.ndarray) -> list[str]:
    """One line a band of speed, and one for all: n, coverage, bias with its standard error, median half width."""
    out = []
    for low, high in (*BANDS_MM_S, (0, 2000)):
        part = rows[(rows[:, 0] >= low) & (rows[:, 0] < high)]
        error = part[:, 1]
        covered = (error <= part[:, 2]) & (-error <= part[:, 3])
        out.append(
            f"{low:5.0f} to {high:5.0f} mm/s  n {len(part):4d}  coverage {100 * covered.mean():5.1f} %  "
            f"bias {error.mean():+.3f} ± {error.std() / np.sqrt(len(part)):.3f} ms  "
            f"half width {np.median(0.5 * (part[:, 2] + part[:, 3])):.3f} ms"
        )
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=6, help="of each form of the law")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--poll-ms", type=float, nargs="*", default=(0, 1, 8), help="of the bus, in turn; 0: none")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    polls_s = [1e-3 * ms or None for ms in options.poll_ms]
    jobs = [
        (options.seed * 1000 + k, form, 25.0, polls_s[(k + j) % len(polls_s)])
        for k in range(options.sessions)
        for j, form in enumerate(FORMS)
    ]
    with ProcessPoolExecutor(options.jobs) as pool:
        found = list(pool.map(rows_of, jobs))
    for form in FORMS:
        part = np.array([row for job, rows in zip(jobs, found, strict=True) if job[1] == form for row in rows])
        print(f"{form}: {table(part)[-1]}")
    print("\n".join(table(np.array([row for rows in found for row in rows]))))


if __name__ == "__main__":
    main()

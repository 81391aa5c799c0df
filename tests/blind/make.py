"""Sessions to disk: python -m tests.blind.make --out DIR --condition none --n 12 (several conditions with commas)."""

import argparse
import json
import sys
import zlib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from .conditions import profile_for, sized
from .physics.effects import EFFECTS
from .physics.session import make_session


def effects_of(condition: str, scale: float, seed: int) -> dict[str, float]:
    """Effects of a condition: `none`, one id, or ids joined by `+`; sizes drawn around scale × nominal."""
    names = () if condition == "none" else tuple(condition.split("+"))
    unknown = [name for name in names if name not in EFFECTS]
    if unknown:
        raise ValueError(f"no such effect: {', '.join(unknown)}; there are: {', '.join(EFFECTS)}")
    return sized(names, scale, seed)


def session_seed(seed: int, condition: str, k: int) -> int:
    return (seed * 1_000_003 + zlib.crc32(condition.encode()) + 7919 * k) % 2**31


def _make(job: tuple[str, str, float, int]) -> tuple[str, dict[str, Any]]:
    folder, condition, scale, seed = job
    effects = effects_of(condition, scale, seed)
    truth = make_session(folder, seed, effects, profile_for(effects))
    return Path(folder).name, truth.to_dict() | {"condition": condition}


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument(
        "--condition", required=True, help="none, an effect, effects joined by +; several separated by commas"
    )
    parser.add_argument("--n", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scale", type=float, default=1.0, help="size, in nominal sizes")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args(argv)
    jobs = []
    for condition in options.condition.split(","):
        for k in range(options.n):
            folder = options.out / f"{condition}-{k + 1}"
            jobs.append((str(folder), condition, options.scale, session_seed(options.seed, condition, k)))
    options.out.mkdir(parents=True, exist_ok=True)
    where = options.out / "truth.json"
    truths = json.loads(where.read_text()) if where.exists() else {}
    try:
        if options.jobs > 1:
            with ProcessPoolExecutor(options.jobs) as pool:
                truths |= dict(pool.map(_make, jobs))
        else:
            truths |= dict(map(_make, jobs))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    where.write_text(json.dumps(truths, indent=1))
    print(f"{len(jobs)} sessions in {options.out}; what is hidden in them: {where}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

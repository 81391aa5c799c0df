"""Scores kept sessions, whichever seeds they are of: python -m tests.blind.kept DIR [--engine MODULE:FUNCTION].

DIR is what `draglag blind --keep` wrote: sessions/NAME are exchange folders, truth/NAME.json what is hidden in them.
With --reports, nothing runs: NAME.json there is what `draglag gap --json` printed for sessions/NAME.
"""

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from . import workflow
from .figure import draw_reliability
from .judge import Outcome, judge
from .known import from_json
from .score import score_worlds, table


def kept_names(keep: Path, only: str = "") -> list[str]:
    """Names of the sessions in a folder that contain `only`."""
    return sorted(path.stem for path in (keep / "truth").glob("*.json") if only in path.stem)


def judge_kept(keep: Path, name: str, engine: str | None = None, reports: Path | None = None) -> Outcome:
    """Judge one kept session by a report that is there already, or by one made now."""
    task, known = from_json(json.loads((keep / "truth" / f"{name}.json").read_text()))
    if reports is not None:
        return judge(task, known, json.loads((reports / f"{name}.json").read_text()))
    return judge(task, known, workflow.close(keep / "sessions" / name, task.excluded, engine=engine))


def _judge_all(options: argparse.Namespace, names: list[str]) -> list[Outcome]:
    """Outcomes in the order of `names`; each is written to stderr as it comes, for there may be many."""
    out, n = [], len(names)
    with ProcessPoolExecutor(options.jobs) as pool:
        found = pool.map(judge_kept, [options.keep] * n, names, [options.engine] * n, [options.reports] * n)
        for name, o in zip(names, found, strict=True):
            print(f"{name}: {o.answer}, {o.seconds:.1f} s", file=sys.stderr)
            out.append(o)
    return out


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("keep", type=Path, metavar="DIR")
    parser.add_argument("--engine", help="module:function that is handed a folder and returns a report")
    parser.add_argument("--reports", type=Path, metavar="DIR", help="NAME.json of each session, made before")
    parser.add_argument("--only", default="", metavar="TEXT", help="sessions whose name contains it")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, metavar="DIR", help="also write kept.json and reliability.png there")
    options = parser.parse_args(argv)
    names = kept_names(options.keep, options.only)
    if options.reports is not None:
        names = [name for name in names if (options.reports / f"{name}.json").is_file()]
    if not names:
        parser.error(f"no session to score in {options.keep}; make some with draglag blind --keep")
    outcomes = _judge_all(options, names)
    summary = score_worlds(outcomes)
    print(table(summary))
    for name, o in zip(names, outcomes, strict=True):
        if not o.fair:
            print(f"{name}: {o.answer}{', ' + ', '.join(o.named) if o.named else ''}")
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        full = summary | {"outcomes": [asdict(o) | {"name": name} for name, o in zip(names, outcomes, strict=True)]}
        (options.out / "kept.json").write_text(json.dumps(full, indent=1))
        draw_reliability(options.out / "reliability.png", summary["worlds"])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

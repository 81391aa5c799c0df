"""What each constant of the gap is good for: python -m tests.blind.ablation DIR [--only TEXT] [--out FILE].

DIR is what `draglag blind --keep` wrote. Every number at the top of a module of draglag.gap is made three times as
large and a third as large, one at a time, and the kept sessions are judged again: answers that change, fair ones lost,
how far sizes move in half widths of their own intervals, how the last gap and the cost change. A constant with which
nothing changes either way decides nothing on these sessions.
"""

import argparse
import importlib
import json
import pkgutil
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from . import workflow
from .judge import Outcome, judge
from .kept import kept_names
from .known import from_json

FACTOR = 3  # up and down: a constant whose value matters is not free by so much


@dataclass(frozen=True)
class Constant:
    """A number at the top of a module."""

    module: str
    name: str
    value: float


@dataclass(frozen=True)
class Change:
    """What another value of a constant does to the sessions."""

    constant: str
    value: float
    fair: int
    answers_changed: tuple[str, ...]
    sizes_moved: float  # the farthest, in half widths of its 95 % interval
    gap_ratio: float  # last gap, the ratio farthest from 1
    cpu_ratio: float
    failed: str = ""


def constants_of(package: str = "draglag.gap") -> list[Constant]:
    """Numbers at the top of the package's modules, each where it is defined."""
    root = importlib.import_module(package)
    names = [package, *(m.name for m in pkgutil.walk_packages(root.__path__, f"{package}."))]
    found = []
    for module in map(importlib.import_module, names):
        source = Path(str(module.__file__)).read_text()
        for name, value in vars(module).items():
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if name.isupper() and number and re.search(rf"^(\w+, )*{name}\b", source, re.M):
                found.append(Constant(module.__name__, name, value))
    return found


@contextmanager
def changed(constant: Constant, value: float) -> Iterator[None]:
    """The constant has another value, in its own module and where it was imported by name."""
    own = sys.modules[constant.module]
    original = getattr(own, constant.name)
    users = [m for m in list(sys.modules.values()) if _uses(m, own, constant.name, original)]
    for module in users:
        setattr(module, constant.name, value)
    try:
        yield
    finally:
        for module in users:
            setattr(module, constant.name, original)


def _uses(module: ModuleType, own: ModuleType, name: str, value: object) -> bool:
    if module is own:
        return True
    if not getattr(module, "__name__", "").startswith("draglag") or vars(module).get(name) is not value:
        return False
    # An equal small number under the same name may be another module's own, or from a third one.
    source = Path(str(module.__file__)).read_text()
    return f"from {own.__name__} import" in source and f"\n{name} = " not in source


def other_values(value: float) -> list[float]:
    """A third and three times of it; whole numbers stay whole and positive, probabilities and shares below one."""
    if isinstance(value, int):
        return sorted({max(1, round(value / FACTOR)), value * FACTOR} - {value})
    larger = value * FACTOR if value >= 1 or value * FACTOR < 1 else 1 - (1 - value) / FACTOR
    return [value / FACTOR, larger]


@dataclass(frozen=True)
class Judged:
    """Kept sessions with one set of constants: their gap reports as JSON, the outcomes, and the cost, s of CPU."""

    names: tuple[str, ...]
    reports: tuple[dict[str, Any], ...]
    outcomes: tuple[Outcome, ...]
    seconds: float

    @property
    def fair(self) -> int:
        return sum(outcome.fair for outcome in self.outcomes)


def judged(keep: Path) -> Judged:
    """All sessions of a folder, judged with the constants as they are now."""
    began, names = time.process_time(), kept_names(keep)
    reports = [workflow.close(keep / "sessions" / name) for name in names]
    seconds = time.process_time() - began
    known = [from_json(json.loads((keep / "truth" / f"{name}.json").read_text())) for name in names]
    outcomes = [judge(*truth, report) for truth, report in zip(known, reports, strict=True)]
    return Judged(tuple(names), tuple(reports), tuple(outcomes), seconds)


def compare(usual: Judged, now: Judged) -> tuple[float, float]:
    """The farthest move of a size, in half widths of its interval, and the last gap's ratio farthest from 1."""
    moved, ratio = 0.0, 1.0
    for a, b in zip(usual.reports, now.reports, strict=True):
        pairs = zip(_sizes(a), _sizes(b), strict=False)
        moved = max([moved, *(abs(x - y) / half for (x, half), (y, _) in pairs if half > 0)])
        gaps = a.get("gap_last_mm"), b.get("gap_last_mm")
        if all(gaps) and abs(np.log(gaps[1] / gaps[0])) > abs(np.log(ratio)):
            ratio = gaps[1] / gaps[0]
    return moved, ratio


def _sizes(report: dict[str, Any]) -> list[tuple[float, float]]:
    out = []
    for step in report.get("steps", ()):
        for found in step.get("parameters", {}).values():
            low, high = found.get("ci95") or (0.0, 0.0)
            out.append((found["value"], (high - low) / 2))
            break
    return out


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("keep", type=Path, metavar="DIR")
    parser.add_argument("--only", default="", metavar="TEXT", help="constants whose module or name contains it")
    parser.add_argument("--out", type=Path, metavar="FILE", help="one JSON object a line, as they are found")
    options = parser.parse_args(argv)
    usual = judged(options.keep)
    print(f"{len(usual.names)} sessions, {usual.fair} fair, {usual.seconds:.1f} s", flush=True)
    for constant in constants_of():
        if options.only not in f"{constant.module}.{constant.name}":
            continue
        for value in other_values(constant.value):
            change = tried(constant, value, options.keep, usual)
            print(f"{change.constant} {constant.value:g} -> {value:g}: {_words(change, usual)}", flush=True)
            if options.out is not None:
                with options.out.open("a") as file:
                    file.write(json.dumps(asdict(change) | {"usual": constant.value}) + "\n")
    return 0


def tried(constant: Constant, value: float, keep: Path, usual: Judged) -> Change:
    """The kept sessions judged again with another value of one constant."""
    label = f"{constant.module.removeprefix('draglag.gap.')}.{constant.name}"
    try:
        with changed(constant, value):
            now = judged(keep)
    except Exception as problem:  # a value that cannot be is a finding, too
        return Change(label, value, 0, (), 0.0, 1.0, 1.0, f"{type(problem).__name__}: {problem}")
    different = tuple(
        f"{name}: {', '.join(a.named) or a.answer} -> {', '.join(b.named) or b.answer}"
        for name, a, b in zip(usual.names, usual.outcomes, now.outcomes, strict=True)
        if (a.named, a.answer) != (b.named, b.answer)
    )
    return Change(label, value, now.fair, different, *compare(usual, now), now.seconds / usual.seconds)


def _words(change: Change, usual: Judged) -> str:
    return change.failed or (
        f"fair {change.fair - usual.fair:+d}, {len(change.answers_changed)} answers changed, sizes moved "
        f"{change.sizes_moved:.2f}, gap x{change.gap_ratio:.3f}, cost x{change.cpu_ratio:.2f}"
    )


if __name__ == "__main__":
    raise SystemExit(main())

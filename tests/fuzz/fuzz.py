"""``./run fuzz``: every reader under many inputs, guided by the lines they reach where atheris is installed.

    ./run fuzz --inputs 1000000            every reader, half of the inputs by each engine
    ./run fuzz --inputs 100000 --only model

Inputs on which a reader did anything but accept or refuse in one sentence are kept in the folder of ``--out``.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fuzz.engine import GROWTH_MB, Outcome, try_reader
from fuzz.readers import readers
from fuzz.structure import changed_session

_GUIDED = Path(__file__).with_name("guided.py")
# In one process: atheris keeps the result of every comparison that it watches, which of arrays is some KB an input.
_GUIDED_AT_ONCE = 100_000


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="./run fuzz", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--inputs", type=int, default=100_000, help="for each reader (default 100000)")
    parser.add_argument("--only", default="", help="readers whose name holds this")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("fuzz-faults"))
    given = parser.parse_args()
    scratch = Path("/dev/shm") if os.access("/dev/shm", os.W_OK) else None
    bad = 0
    print(
        f"{'reader':<26}{'inputs':>10}{'guided':>10}{'accepted':>10}{'a second':>10}{'grown MB':>10}{'faults':>8}",
        flush=True,
    )
    with tempfile.TemporaryDirectory(prefix="draglag-fuzz-", dir=scratch) as place:
        for reader in (*readers(Path(place)), changed_session(Path(place))):
            if given.only not in reader.name:
                continue
            folder = Path(tempfile.mkdtemp(dir=place))
            guided = _guided(reader.name, given.inputs // 2, given.seed, given.out)
            outcome = try_reader(reader, folder, given.inputs - (guided or 0), given.seed)
            bad += _report(outcome, guided, given.out)
    return 1 if bad else 0


def _guided(name: str, inputs: int, seed: int, out: Path) -> int | None:
    """How many inputs the coverage-guided engine gave the reader; None where it is not installed."""
    total = 0
    with tempfile.TemporaryDirectory(prefix="draglag-corpus-") as corpus:
        while total < inputs:
            ran = _guided_at_once(name, min(inputs - total, _GUIDED_AT_ONCE), seed + total, out, corpus)
            if ran is None:
                return None
            total += ran
    return total


def _guided_at_once(name: str, inputs: int, seed: int, out: Path, corpus: str) -> int | None:
    command = [sys.executable, str(_GUIDED), name, str(inputs), str(seed), str(out), corpus]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode == 3:
        return None
    ran = re.findall(r"^#(\d+)\s+DONE", done.stdout, re.MULTILINE) or re.findall(
        r"stat::number_of_executed_units:\s*(\d+)", done.stdout
    )
    if done.returncode or not ran:
        print(done.stdout[-3000:], file=sys.stderr)
        raise SystemExit(f"{name}: the guided engine ended with {done.returncode}")
    return int(ran[-1])


def _report(outcome: Outcome, guided: int | None, out: Path) -> int:
    speed = outcome.inputs / max(outcome.seconds, 1e-9)
    grown = outcome.grown_mb > GROWTH_MB
    guided_inputs = "-" if guided is None else guided
    numbers = (
        outcome.inputs,
        guided_inputs,
        outcome.accepted,
        round(speed),
        round(outcome.grown_mb),
        len(outcome.faults),
    )
    print(f"{outcome.reader:<26}" + "".join(f"{cell:>10}" for cell in numbers), flush=True)
    for number, (trace, data) in enumerate(outcome.faults):
        out.mkdir(parents=True, exist_ok=True)
        path = out / f"{re.sub(r'[^a-z]+', '-', outcome.reader)}-{number}"
        path.write_bytes(data)
        print(f"  {path}: {trace.strip().splitlines()[-1]}", file=sys.stderr)
    return len(outcome.faults) + grown


if __name__ == "__main__":
    raise SystemExit(main())

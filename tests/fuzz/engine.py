"""One reader under many inputs in this process: what it did, and every input on which it did anything but its duty."""

from __future__ import annotations

import random
import resource as process
import signal
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

from fuzz.mutate import mutated
from fuzz.readers import Reader

PATIENCE_S = 5.0  # an input of at most 8 KB is read in milliseconds
GROWTH_MB = 100  # of the process, over all inputs of a reader
_KEPT = 64  # accepted inputs from which further ones are made


class TooSlow(Exception):
    """An input took longer than ``PATIENCE_S``."""


@dataclass
class Outcome:
    """What became of a reader's inputs. ``faults``: the traceback and the input of each unexpected end."""

    reader: str
    inputs: int = 0
    accepted: int = 0
    seconds: float = 0.0
    grown_mb: float = 0.0
    faults: list[tuple[str, bytes]] = field(default_factory=list)


def try_reader(reader: Reader, folder: Path, inputs: int, seed: int, until_s: float = float("inf")) -> Outcome:
    """Give the reader so many mutated inputs, or until ``time.monotonic()`` passes ``until_s``."""
    outcome, rng = Outcome(reader.name), random.Random(f"{reader.name} {seed}")
    reader.prepare(folder)
    known = list(reader.seeds)
    with _alarm():
        for data in reader.seeds:
            if not attempt(reader, folder, data, outcome):
                outcome.faults.append(("the reader refuses what it shall read\n", data))
        before_mb, began_s = _peak_mb(), time.monotonic()
        while outcome.inputs < inputs and time.monotonic() < until_s and len(outcome.faults) < 10:
            data = mutated(rng.choice(known), reader.seeds, rng)
            # What is still accepted after a change is nearer to the reader's inner checks than the seeds are.
            if attempt(reader, folder, data, outcome):
                if len(known) < _KEPT:
                    known.append(data)
                else:
                    known[rng.randrange(len(reader.seeds), _KEPT)] = data
    outcome.seconds = time.monotonic() - began_s
    outcome.grown_mb = _peak_mb() - before_mb
    return outcome


def attempt(reader: Reader, folder: Path, data: bytes, outcome: Outcome) -> bool:
    """One input; whether it was accepted."""
    outcome.inputs += 1
    signal.setitimer(signal.ITIMER_REAL, PATIENCE_S)
    try:
        accepted = reader.attempt(folder, data)
    except Exception:
        outcome.faults.append((traceback.format_exc(), data))
        return False
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    outcome.accepted += accepted
    return accepted


@contextmanager
def _alarm() -> Iterator[None]:
    def ring(number: int, frame: FrameType | None) -> None:
        raise TooSlow(f"more than {PATIENCE_S:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _peak_mb() -> float:
    return process.getrusage(process.RUSAGE_SELF).ru_maxrss / 1024

"""A recording that is killed at any file call, half way through a write, or when the power fails."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from draglag.errors import DataError
from draglag.store import SessionWriter, clear_leftovers, read_session, salvage, verify
from faults.conftest import Trial
from faults.disk import Call, Disk, after_power_cut, watched
from faults.stream import HEADER, Verdict, commits, in_journal, in_session, judge, play

PLAN = commits()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> list[Call]:
    """All file calls of a recording and of its closing."""
    folder = tmp_path_factory.mktemp("recorded")
    with watched(folder) as calls:
        writer = SessionWriter(folder / "s.h5", HEADER)
        play(writer, PLAN, lambda number: calls.mark(f"done {number}"))
        calls.mark("closing")
        writer.close()
        calls.mark("closed")
    assert [path.name for path in folder.iterdir()] == ["s.h5"]
    return calls.log


def look(folder: Path, done: int) -> Verdict:
    """What is left in the folder: the session file, else its journal."""
    final, journal = folder / "s.h5", folder / "s.h5.partial"
    if final.exists():
        return judge(in_session(final), PLAN, len(PLAN) - 1)
    if done < 0 and (not journal.exists() or journal.stat().st_size == 0):
        return Verdict((), False, False, False, 0.0)  # nothing was on the disk yet
    try:
        return judge(in_journal(journal), PLAN, done)
    except DataError:
        return Verdict(() if done < 0 else tuple(range(done + 1)), False, False, False, 0.0)


def done_by(calls: list[Call]) -> int:
    """The last commit that was confirmed to the recording is on the disk."""
    return max((int(c.name.split()[1]) for c in calls if c.kind == "mark" and c.name.startswith("done")), default=-1)


def test_killed_after_every_write_and_within_it(
    recorded: list[Call], folder: Path, trial: Callable[[str], Trial], few_or_all: Callable[[int, int], int]
) -> None:
    row = trial("killed after every write, and within it")
    every = few_or_all(6, 1)
    rng = random.Random(1)
    closing = next(k for k, call in enumerate(recorded) if call.name == "closing")
    disk, done, judged = Disk(), -1, -1
    for k, call in enumerate(recorded):
        if call.kind == "mark":
            done = int(call.name.split()[1]) if call.name.startswith("done") else done
            continue
        cuts = [len(call.data) // 2, rng.randrange(1, len(call.data))] if call.kind == "write" else []
        names = dict(disk.names)
        for cut in cuts if k < closing and k % every == 0 else ():
            before = bytes(disk.data[call.file])
            disk.apply(call, cut)
            disk.dump(folder)
            row.add(look(folder, done))
            disk.data[call.file] = bytearray(before)
        disk.apply(call)
        # While the session file is made only names matter: what it is made from stays as it is.
        if (k < closing and k % every == 0) or names != disk.names or k - judged > 200:
            judged = k
            disk.dump(folder)
            row.add(look(folder, done))
    row.must_be_clean()


@pytest.mark.parametrize("garbage", [0.0, 0.1])
def test_the_power_fails(
    recorded: list[Call],
    folder: Path,
    trial: Callable[[str], Trial],
    few_or_all: Callable[[int, int], int],
    garbage: float,
) -> None:
    row = trial("power cut" + (", rewritten pages garbage" if garbage else ", pages kept with p = 0.5"))
    rng = random.Random(7)
    closing = next(k for k, call in enumerate(recorded) if call.name == "closing")
    for k in range(few_or_all(40, 1000)):
        # Half of them while it closes, of these half around the moment the names change.
        end = rng.randrange(1, closing) if k % 2 else rng.randrange(closing, len(recorded))
        if k % 4 == 0:
            end = len(recorded) - rng.randrange(12)
        after_power_cut(recorded[:end], rng, garbage).dump(folder)
        row.add(look(folder, done_by(recorded[:end])))
    row.must_be_clean()


def test_killed_while_closing_leaves_nothing_that_is_not_cleared(recorded: list[Call], folder: Path) -> None:
    """After any kill the next start clears what is not needed, and what it leaves gives back everything."""
    disk, names = Disk(), {}
    seen = set()
    for call in recorded:
        if call.kind != "mark":
            disk.apply(call)
        if names == disk.names:
            continue
        names = dict(disk.names)
        disk.dump(folder)
        clear_leftovers(folder)
        left = tuple(sorted(path.name for path in folder.iterdir()))
        seen.add(left)
        assert left in (("s.h5.partial",), ("s.h5",))
        if left == ("s.h5",):
            assert judge(in_session(folder / "s.h5"), PLAN, len(PLAN) - 1).lost == ()
    assert len(seen) == 2


def test_what_is_salvaged_is_a_session_file_like_any_other(recorded: list[Call], folder: Path) -> None:
    end = next(k for k, call in enumerate(recorded) if call.name == "done 40")
    disk = Disk()
    for call in recorded[:end]:
        if call.kind != "mark":
            disk.apply(call)
    disk.dump(folder)
    before = (folder / "s.h5.partial").read_bytes()
    saved = salvage(folder / "s.h5.partial")
    assert saved.losses == ()
    assert judge(in_session(saved.path), PLAN, 40) == Verdict((), False, False, False, 0.2)
    assert [run.outcome for run in read_session(saved.path).runs] == ["complete", "aborted"]
    assert not [finding for finding in verify(saved.path) if finding.level == "error"]
    assert (folder / "s.h5.partial").read_bytes() == before

"""A journal of which bits, pages or stretches were changed: the rest comes back, what is missing is said."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from draglag.store import SessionWriter, read_session, salvage
from faults.conftest import Trial
from faults.disk import PAGE
from faults.stream import HEADER, commits, in_journal, in_session, judge, play

PLAN = commits()


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("journal")
    writer = SessionWriter(folder / "s.h5", HEADER)
    play(writer, PLAN)
    writer.abandon()
    return (folder / "s.h5.partial").read_bytes()


def _bit(data: bytearray, rng: random.Random) -> None:
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _page(data: bytearray, rng: random.Random) -> None:
    start = rng.randrange(len(data)) // PAGE * PAGE
    data[start : start + PAGE] = bytes(len(data[start : start + PAGE]))


def _burst(data: bytearray, rng: random.Random) -> None:
    start = rng.randrange(len(data))
    data[start : start + 200] = rng.randbytes(len(data[start : start + 200]))


def _many(data: bytearray, rng: random.Random) -> None:
    for _ in range(20):
        _burst(data, rng)


def _cut(data: bytearray, rng: random.Random) -> None:
    del data[rng.randrange(2 * PAGE, len(data)) :]


def _page_elsewhere(data: bytearray, rng: random.Random) -> None:
    one, other = (rng.randrange(len(data) // PAGE) * PAGE for _ in range(2))
    data[one : one + PAGE] = data[other : other + PAGE]


@pytest.mark.parametrize(
    ("harm", "most_lost"),
    [(_bit, 1), (_page, 1), (_burst, 2), (_page_elsewhere, 1), (_many, 40)],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_damage_costs_the_records_it_hits_and_is_said(
    journal: bytes,
    folder: Path,
    trial: Callable[[str], Trial],
    few_or_all: Callable[[int, int], int],
    harm: Callable[[bytearray, random.Random], None],
    most_lost: int,
) -> None:
    row = trial(f"damage: {harm.__name__.strip('_').replace('_', ' ')}")
    rng = random.Random(3)
    for _ in range(few_or_all(15, 300)):
        data = bytearray(journal)
        harm(data, rng)
        (folder / "s.h5.partial").write_bytes(data)
        verdict = judge(in_journal(folder / "s.h5.partial"), PLAN, len(PLAN) - 1)
        row.add(verdict)
        assert len(verdict.lost) <= most_lost
    row.must_be_clean(but_lost=True)


def test_what_was_cut_off_at_the_end_is_all_that_is_missing(
    journal: bytes, folder: Path, trial: Callable[[str], Trial], few_or_all: Callable[[int, int], int]
) -> None:
    row = trial("damage: cut off at the end")
    rng = random.Random(4)
    for _ in range(few_or_all(15, 300)):
        data = bytearray(journal)
        _cut(data, rng)
        (folder / "s.h5.partial").write_bytes(data)
        held = in_journal(folder / "s.h5.partial")
        verdict = judge(held, PLAN, len(PLAN) - 1)
        row.tries += 1
        row.wrong += verdict.wrong
        row.short += verdict.short
        # Nothing before the first record that is missing is missing itself.
        assert verdict.lost == tuple(range(len(PLAN) - len(verdict.lost), len(PLAN)))
    row.must_be_clean(but_lost=True)


def test_a_lost_record_becomes_a_gap_with_the_count_of_what_is_missing(journal: bytes, folder: Path) -> None:
    """The page in which the second run has a record in its middle is zeroed."""
    number = next(k for k, commit in enumerate(PLAN) if commit.run == "run-02" and commit.kind == "data") + 5
    lost = PLAN[number].touch
    assert lost is not None
    at = journal.index(lost.x_mm.tobytes()) // PAGE * PAGE
    data = bytearray(journal)
    data[at : at + PAGE] = bytes(PAGE)
    (folder / "s.h5.partial").write_bytes(data)
    saved = salvage(folder / "s.h5.partial")
    run = saved.session.run("run-02")
    assert run.outcome == "failed"
    assert run.touch.dropped == len(lost.t_s)
    assert run.laser.missed == 4
    before, after = (PLAN[number + step].touch for step in (-1, 1))
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(run.touch.gaps_s, [[before.t_s[-1], after.t_s[0]]])
    assert "48 touch events are missing" in run.log[-1].text
    assert any("run-02: 48 touch events are missing" in loss for loss in saved.losses)
    assert any("record" in loss for loss in saved.losses)
    assert [run.outcome for run in saved.session.runs] == ["complete", "failed", "aborted"]
    assert judge(in_session(saved.path, saved.losses), PLAN, len(PLAN) - 1).lost == (number,)


def test_the_first_pages_may_be_lost_and_what_the_session_is_is_known(journal: bytes, folder: Path) -> None:
    (folder / "s.h5.partial").write_bytes(bytes(6 * PAGE) + journal[6 * PAGE :])
    session = read_session(folder / "s.h5.partial")
    assert (session.name, session.screen, session.stylus) == (HEADER.name, HEADER.screen, HEADER.stylus)
    assert session.protocol_toml == HEADER.protocol_toml
    assert [run.id for run in session.runs] == ["run-01", "run-02", "run-03"]

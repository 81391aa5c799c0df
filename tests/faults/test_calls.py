"""File calls that fail: one clear sentence, nothing that was on the disk lost, and it can be tried again."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from draglag.errors import DataError
from draglag.recording import LogEntry
from draglag.store import SessionWriter, read_session, salvage
from faults.conftest import Trial
from faults.disk import watched
from faults.stream import HEADER, commits, give, in_journal, in_session, judge

PLAN = commits(2, 1.0, 2)


def record(folder: Path, done: list[int], again: bool) -> Path:
    """The recording; ``again``: what fails is tried a second time, as the operator may ask."""
    writer = SessionWriter(folder / "s.h5", HEADER)

    def twice(action: Callable[[], object], retry: Callable[[], object]) -> None:
        try:
            action()
        except DataError:
            if not again:
                raise
            retry()

    try:
        for number, commit in enumerate(PLAN):
            twice(lambda commit=commit: give(writer, commit), writer.flush)  # type: ignore[misc]
            twice(writer.flush, writer.flush)
            done[0] = number
        twice(writer.close, writer.close)
        return writer.path
    finally:
        writer.abandon()


def calls_of_a_recording(folder: Path) -> list[str]:
    with watched(folder) as calls:
        record(folder, [-1], again=False)
    shutil.rmtree(folder)
    folder.mkdir()
    return calls.names


@pytest.mark.parametrize("error", [errno.EIO, errno.ENOSPC, errno.EDQUOT, errno.EROFS])
@pytest.mark.parametrize("again", [False, True], ids=["ended", "tried again"])
def test_any_file_call_may_fail(
    folder: Path, trial: Callable[[str], Trial], few_or_all: Callable[[int, int], int], error: int, again: bool
) -> None:
    row = trial(f"{errno.errorcode[error]} of any file call, {'tried again' if again else 'ended'}")
    names = calls_of_a_recording(folder)
    closing = len(names) - names[::-1].index("posix_fallocate")
    writing = [k for k in range(closing, len(names)) if names[k] in ("pwrite", "pread")]
    others = sorted(set(range(len(names))) - set(writing))
    step = few_or_all(19, 1)
    for fail in [*others[error % step :: step], *writing[:: 40 * step]]:
        done = [-1]
        message = ""
        with watched(folder) as calls:
            calls.fail, calls.error = fail, error
            try:
                record(folder, done, again)
            except DataError as failure:
                message = str(failure)
        if message:
            assert "\n" not in message
            assert message.endswith(".")
        look(folder, row, done[0], message, again)
        shutil.rmtree(folder)
        folder.mkdir()
    row.must_be_clean()


def look(folder: Path, row: Trial, done: int, message: str, again: bool) -> None:
    final, journal = folder / "s.h5", folder / "s.h5.partial"
    if final.exists():
        row.add(judge(in_session(final), PLAN, len(PLAN) - 1))
    elif done >= 0:
        assert message
        row.add(judge(in_journal(journal), PLAN, done))
    else:
        row.tries += 1
        row.other += not message
    row.other += any(path.suffix == ".tmp" for path in folder.iterdir())
    # A file that was begun and not recorded into is taken away again; only a call that fails once more may keep it.
    row.other += again and not final.exists() and done >= 0


def test_a_journal_that_is_deleted_is_written_again(folder: Path) -> None:
    writer = SessionWriter(folder / "s.h5", HEADER)
    for number, commit in enumerate(PLAN):
        give(writer, commit)
        writer.flush()
        if number in (2, 5):
            writer.partial.unlink()
    assert judge(in_session(writer.close()), PLAN, len(PLAN) - 1).lost == ()
    assert [path.name for path in folder.iterdir()] == ["s.h5"]


def test_a_folder_that_is_removed_is_said_and_another_place_takes_everything(folder: Path) -> None:
    (folder / "gone").mkdir()
    (folder / "stick").mkdir()
    writer = SessionWriter(folder / "gone" / "s.h5", HEADER)
    for commit in PLAN[:5]:
        give(writer, commit)
    writer.flush()
    shutil.rmtree(folder / "gone")
    writer.append_log(LogEntry(101.0, "note", "operator", "the stick was pulled out"))
    with pytest.raises(DataError, match="Name another place: the folder was removed"):
        writer.flush()
    writer.move(folder / "stick" / "s.h5")
    for commit in PLAN[5:]:
        give(writer, commit)
        writer.flush()
    assert judge(in_session(writer.close()), PLAN, len(PLAN) - 1).lost == ()
    assert [path.name for path in (folder / "stick").iterdir()] == ["s.h5"]


def test_another_place_that_does_not_take_it_leaves_everything_where_it_is(folder: Path) -> None:
    writer = SessionWriter(folder / "s.h5", HEADER)
    for commit in PLAN[:5]:
        give(writer, commit)
        writer.flush()
    with pytest.raises(DataError, match="no such folder"):
        writer.move(folder / "none" / "s.h5")
    (folder / "t.h5").write_text("precious")
    with pytest.raises(DataError, match="not overwritten"):
        writer.move(folder / "t.h5")
    for commit in PLAN[5:]:
        give(writer, commit)
        writer.flush()
    assert writer.close() == folder / "s.h5"
    assert judge(in_session(folder / "s.h5"), PLAN, len(PLAN) - 1).lost == ()
    assert (folder / "t.h5").read_text() == "precious"


def test_where_there_are_no_locks_salvaging_gets_a_name_of_its_own(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The recording may still be going on: it is not made to look finished."""

    def none(fd: int, operation: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", none)
    writer = SessionWriter(folder / "s.h5", HEADER)
    for commit in PLAN[:5]:
        give(writer, commit)
        writer.flush()
    assert salvage(writer.partial).path == folder / "s-salvaged.h5"
    for commit in PLAN[5:]:
        give(writer, commit)
        writer.flush()
    assert len(read_session(writer.close()).runs) == 2

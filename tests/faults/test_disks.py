"""Disks that are full, read-only or under quota: file systems of the kernel's, mounted for the trial."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from draglag.errors import DataError
from draglag.store import SessionWriter, salvage
from faults.conftest import Trial
from faults.stream import HEADER, commits, give, in_journal, in_session, judge

PLAN = commits()
# From too small for the first record to more than journal and session file take together (kB).
_SMALLEST_KB, _LARGEST_KB = 40, 6000
_NOBODY = 65534


@contextmanager
def mounted(folder: Path, kind: str, size_kb: int, options: str = "") -> Iterator[Path]:
    """A file system with about so much room. Skips where it cannot be mounted."""
    place = folder / "disk"
    place.mkdir(exist_ok=True)
    image = folder / "image"
    try:
        if kind == "tmpfs":
            what = ["mount", "-t", "tmpfs", "-o", f"size={size_kb}k{options}", "tmpfs", str(place)]
        else:
            with image.open("wb") as file:
                file.truncate(16 << 20)
            subprocess.run(["mkfs.ext4", "-q", "-m", "0", str(image)], check=True, capture_output=True)
            what = ["mount", "-o", "loop", str(image), str(place)]
        subprocess.run(what, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        words = getattr(error, "stderr", b"") or str(error).encode()
        pytest.skip(f"{kind} cannot be mounted here: {words.decode(errors='replace').strip()}")
    try:
        if kind != "tmpfs":
            room = os.statvfs(place)
            ballast = room.f_bavail * room.f_frsize - size_kb * 1024
            with (place / "ballast").open("wb") as file:
                file.write(b"\1" * max(0, ballast))
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)
        image.unlink(missing_ok=True)


def in_child(record: Callable[[], str], user: int = 0) -> tuple[int, str]:
    """What a process of its own returned: its exit (negative for a signal) and what it said."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if user:
                os.setuid(user)
            os.write(write, record().encode())
            os._exit(0)
        except DataError as error:
            os.write(write, f"DataError {error}".encode())
            os._exit(3)
        except BaseException as error:
            os.write(write, repr(error).encode())
            os._exit(4)
    os.close(write)
    with os.fdopen(read) as pipe:
        said = pipe.read()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), said


def record(place: Path, marks: Path, elsewhere: Path | None) -> str:
    """The recording; ``marks`` gets a byte for every commit on the disk."""

    def go_on(failed: Callable[[], object], again: Callable[[], object]) -> None:
        try:
            failed()
        except DataError:
            if elsewhere is None:
                raise
            writer.move(elsewhere / "s.h5")
            again()

    with marks.open("wb", buffering=0) as done:
        writer = SessionWriter(place / "s.h5", HEADER)
        for commit in PLAN:
            go_on(lambda commit=commit: give(writer, commit), writer.flush)  # type: ignore[misc]
            go_on(writer.flush, writer.flush)
            done.write(b".")
        go_on(writer.close, writer.close)
    return str(writer.path)


def sizes(count: int) -> list[int]:
    return [round(_SMALLEST_KB * (_LARGEST_KB / _SMALLEST_KB) ** (k / (count - 1))) for k in range(count)]


@pytest.mark.parametrize("kind", ["tmpfs", "ext4"])
def test_a_full_disk(
    folder: Path, tmp_path: Path, trial: Callable[[str], Trial], few_or_all: Callable[[int, int], int], kind: str
) -> None:
    row = trial(f"full disk, {kind}")
    for size_kb in sizes(few_or_all(5, 30)):
        with mounted(folder, kind, size_kb) as place:
            ended, said = in_child(lambda place=place: record(place, tmp_path / "marks", None))  # type: ignore[misc]
            assert ended in (0, 3), (size_kb, ended, said)
            assert ended == 0 or said.startswith("DataError /")
            assert "\n" not in said
            done = (tmp_path / "marks").stat().st_size - 1
            final, journal = place / "s.h5", place / "s.h5.partial"
            row.other += bool(list(place.glob(".*.tmp")))
            if ended == 0 or final.exists():
                row.add(judge(in_session(final), PLAN, len(PLAN) - 1))
            elif done >= 0:
                row.add(judge(in_journal(journal), PLAN, done))
                saved = salvage(journal, tmp_path / f"saved-{size_kb}.h5")
                row.add(judge(in_session(saved.path, saved.losses), PLAN, done))
            else:
                row.tries += 1
    row.must_be_clean()


@pytest.mark.parametrize("kind", ["tmpfs", "ext4"])
def test_a_full_disk_and_another_place(
    folder: Path, tmp_path: Path, trial: Callable[[str], Trial], few_or_all: Callable[[int, int], int], kind: str
) -> None:
    row = trial(f"full disk, {kind}, another place named")
    for size_kb in sizes(few_or_all(3, 30)):
        elsewhere = tmp_path / f"elsewhere-{size_kb}"
        elsewhere.mkdir()
        with mounted(folder, kind, size_kb) as place:
            ended, said = in_child(lambda place=place, to=elsewhere: record(place, tmp_path / "marks", to))  # type: ignore[misc]
            if ended == 3 and (tmp_path / "marks").stat().st_size == 0:
                row.tries += 1  # there was no room to begin in
                continue
            assert ended == 0, (size_kb, said)
            verdict = judge(in_session(Path(said)), PLAN, len(PLAN) - 1)
            assert verdict.lost == ()
            row.add(verdict)
            row.other += bool(list(place.glob("*.h5.partial")))
        shutil.rmtree(elsewhere)
    row.must_be_clean()


def test_a_read_only_disk(folder: Path, tmp_path: Path, trial: Callable[[str], Trial]) -> None:
    """Nothing can be begun there, and what lies there is salvaged to another place."""
    row = trial("read-only disk")
    with mounted(folder, "tmpfs", _LARGEST_KB) as place:
        writer = SessionWriter(place / "s.h5", HEADER)
        for commit in PLAN[:20]:
            give(writer, commit)
            writer.flush()
        writer.abandon()
        subprocess.run(["mount", "-o", "remount,ro", str(place)], check=True)
        with pytest.raises(DataError, match="Read-only file system"):
            SessionWriter(place / "t.h5", HEADER)
        with pytest.raises(DataError, match="Read-only file system"):
            salvage(place / "s.h5.partial")
        saved = salvage(place / "s.h5.partial", tmp_path / "saved.h5")
        row.add(judge(in_session(saved.path), PLAN, 19))
    row.must_be_clean()


def test_a_quota(folder: Path, tmp_path: Path, trial: Callable[[str], Trial]) -> None:
    """The user may write less than the disk has room for."""
    row = trial("quota")
    options = ",usrquota,usrquota_block_hardlimit=300k,mode=1777"
    folder.chmod(0o755)
    tmp_path.chmod(0o777)
    (tmp_path / "marks").touch()
    (tmp_path / "marks").chmod(0o666)
    for parent in tmp_path.parents:
        if not os.stat(parent).st_mode & 0o001 and parent.stat().st_uid == os.getuid():
            parent.chmod(0o755)
    with mounted(folder, "tmpfs", _LARGEST_KB, options) as place:
        ended, said = in_child(lambda: record(place, tmp_path / "marks", None), _NOBODY)
        assert ended == 3, said
        assert "quota" in said.lower()
        done = (tmp_path / "marks").stat().st_size - 1
        row.add(judge(in_journal(place / "s.h5.partial"), PLAN, done))
    assert done > 5
    row.must_be_clean()

"""Session files changed in any way their structure allows, and journals with valid checksums and wrong contents.

They give one clear sentence, or a session with its faults reported; never a traceback, another file's data, or
unbounded memory.
"""

from __future__ import annotations

import json
import os
import shutil
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.store_sessions import bare_session, full_run
from draglag.errors import DataError
from draglag.recording import Session
from draglag.store import (
    SessionWriter,
    codec,
    read_session,
    salvage,
    session_nodes,
    verify,
)
from draglag.store.frames import FrameFile
from draglag.store.schema import Node
from fuzz.structure import MOVES, change, outcome_of, refused_or_noticed, sound_session, use_elsewhere

TRIES = settings(
    max_examples=int(os.environ.get("DRAGLAG_FUZZ", "20")),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Session, list[str]]:
    """A session file, what it holds, and the names of all its items."""
    path = tmp_path_factory.mktemp("sound") / "s.h5"
    return path, *sound_session(path)


changes = st.lists(
    st.tuples(st.sampled_from(MOVES), st.integers(0, 10_000), st.integers(0, 10_000)), min_size=1, max_size=3
)


@TRIES
@given(changes=changes)
def test_a_session_file_changed_in_its_structure_is_refused_or_says_so(
    sound: tuple[Path, Session, list[str]], tmp_path: Path, changes: list[tuple[Callable[..., None], int, int]]
) -> None:
    path, session, names = sound
    change(path, tmp_path / "changed.h5", names, changes)
    refused_or_noticed(tmp_path / "changed.h5", session)
    use_elsewhere(tmp_path / "changed.h5", tmp_path / "saved.h5")


def test_many_columns_that_pack_well_do_not_add_up(sound: tuple[Path, Session, list[str]], tmp_path: Path) -> None:
    """Each is within its bound, all together are not: 0.5 GB in a file of 0.7 MB."""
    shutil.copyfile(sound[0], tmp_path / "s.h5")
    packed = zlib.compress(bytes(8 * 2**20))
    with h5py.File(tmp_path / "s.h5", "r+") as file:
        for k in range(32):
            data = file.create_dataset(f"runs/run-01/more{k}", (2**21,), "f8", chunks=(2**20,), compression="gzip")
            for begin in (0, 2**20):
                data.id.write_direct_chunk((begin,), packed)
    assert (tmp_path / "s.h5").stat().st_size < 2**21
    with pytest.raises(DataError, match="too large when unpacked"):
        read_session(tmp_path / "s.h5")


def test_rows_of_which_only_the_number_is_left_are_none(sound: tuple[Path, Session, list[str]], tmp_path: Path) -> None:
    """Numbers pack a thousandfold: a small file would claim millions of empty entries, and take minutes to read."""
    shutil.copyfile(sound[0], tmp_path / "s.h5")
    with h5py.File(tmp_path / "s.h5", "r+") as file:
        for name in ("runs/run-01/log/entry", "runs/run-01/touch/gaps/gap", "taps/tap"):
            del file[name]
            file.create_dataset(name, data=np.zeros(20_000), compression="gzip")
    salvaged = salvage(tmp_path / "s.h5", tmp_path / "saved.h5")
    saved, (was,) = salvaged.session, sound[1].runs
    (run,) = saved.runs
    lost = 20_000 - len(was.touch.gaps_s)
    assert f"/runs/run-01/touch/gaps: {lost} unfinished rows are lost" in salvaged.losses
    assert [entry.text for entry in run.log] == [entry.text for entry in was.log]
    np.testing.assert_array_equal(run.touch.gaps_s, was.touch.gaps_s)
    assert saved.taps is not None
    assert sound[1].taps is not None
    np.testing.assert_array_equal(saved.taps.physical_s, sound[1].taps.physical_s)


# --- journals ---


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    """A sound journal."""
    writer = SessionWriter(tmp_path / "s.h5", bare_session(full_run("run-01", 10.0)))
    writer.abandon()
    return tmp_path / "s.h5.partial"


def with_payloads(path: Path, payloads: list[bytes]) -> Path:
    """A journal of these payloads, checksums and all."""
    path.unlink(missing_ok=True)
    file = FrameFile(path)
    for payload in payloads:
        file.append(payload)
    file.close()
    return path


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)


@TRIES
@given(head=st.fixed_dictionaries(dict.fromkeys(("nodes", "heads", "rows", "runs"), json_values)), rest=st.binary())
def test_records_that_no_recording_wrote_are_not_believed(head: dict[str, Any], rest: bytes) -> None:
    text = json.dumps(head).encode()
    with suppress(DataError):
        record = codec.decode(struct.pack("<I", len(text)) + text + rest)
        assert all(node.path == "" or node.path.split("/")[0] for node in record.nodes)


@pytest.mark.parametrize(
    "text",
    [
        b"[" * 100_000,
        b'{"nodes":[],"heads":[],"rows":{},"runs":' + b"9" * 5000 + b"}",
        b'{"nodes":[["/etc",{},{},{},"",[]]],"heads":[],"rows":{},"runs":0}',
        b'{"nodes":[["runs/../x",{},{},{},"",[]]],"heads":[],"rows":{},"runs":0}',
        b'{"nodes":[["runs/a/touch",{},{},{},"touch",[["time",1000000000000]]]],"heads":[],"rows":{},"runs":0}',
        b'{"nodes":[["runs/a/touch",{},{},{},"touch",[["time",-1]]]],"heads":[],"rows":{},"runs":0}',
        b'{"nodes":[["runs/a/touch",{},{"dropped":1e400},{},"",[]]],"heads":[],"rows":{},"runs":0}',
        b"",
    ],
)
def test_absurd_records_are_refused(text: bytes) -> None:
    with pytest.raises(DataError, match="the record"):
        codec.decode(struct.pack("<I", len(text)) + text)


words = st.sampled_from(["touch", "laser", "clock", "log", "taps", "gaps", "axes", "calibration", "display", ""])
paths = st.sampled_from(
    ["", "runs", "runs/run-01", "runs/run-01/touch", "runs/run-01/touch/gaps", "runs/run-01/laser", "taps", "notes",
     "clocks/x", "runs/new", "runs/new/touch", "screen", "runs/run-01/sync/x", "runs/run-01/log"]
)  # fmt: skip
numbers = st.sampled_from([0.0, 1.0, 10.5, 11.0, -1.0, float("nan"), float("inf"), 1e300])


counters = st.dictionaries(st.sampled_from(["dropped", "missed", "late"]), st.integers(0, 9), max_size=2)
keys = st.sampled_from(["outcome", "stream", "start_s", "width_mm", "name"])
values = numbers | st.integers(-5, 2**60) | st.text(max_size=5)


@st.composite
def odd_nodes(draw: st.DrawFn) -> Node:
    """A node of right types in a place where it need not belong."""
    table = codec.TABLES.get(draw(words))
    rows: dict[str, Any] = {}
    count = draw(st.integers(0, 3))
    for column in table.every() if table is not None and count else ():
        if column.optional and draw(st.booleans()):
            continue
        if column.kind.startswith("S"):
            rows[column.name] = np.full(count, b"a", column.dtype)
        else:
            drawn = np.array([draw(numbers) for _ in range(count)])
            rows[column.name] = drawn if column.kind == "f" else np.nan_to_num(drawn, posinf=9.0).clip(0, 9).astype(int)
    return Node(draw(paths), draw(st.dictionaries(keys, values, max_size=3)), draw(counters), {}, table, rows)


row_counts = st.dictionaries(paths, st.integers(0, 500), max_size=2)


@TRIES
@given(nodes=st.lists(odd_nodes(), min_size=1, max_size=4), rows=row_counts)
def test_a_journal_of_odd_records_is_read_or_refused_in_one_sentence(
    tmp_path: Path, nodes: list[Node], rows: dict[str, int]
) -> None:
    sound = codec.encode(codec.Record((), tuple(_head()), {}, 0))
    odd = codec.encode(codec.Record(tuple(nodes), tuple(_head()), rows, 1))
    path = with_payloads(tmp_path / "odd.h5.partial", [sound, odd])
    (tmp_path / "odd.h5").unlink(missing_ok=True)
    for action in (read_session, salvage):
        _, refused = outcome_of(action, path)
        assert refused is None or "\n" not in str(refused)
        assert refused is None or str(tmp_path) in str(refused)
    verify(path)
    assert {file.name for file in tmp_path.iterdir()} <= {"odd.h5.partial", "odd.h5"}


def _head() -> Iterator[Node]:
    session = bare_session()
    yield from (node for node in session_nodes.header_nodes(session) if node.table is None)
    run = full_run("run-01", 10.0)
    yield from (node for node in session_nodes.run_nodes(run, "recording") if node.path == "runs/run-01")


def test_a_journal_is_read_while_it_grows(journal: Path, tmp_path: Path) -> None:
    """Reading needs no lock: what is read is what was on the disk."""
    assert [run.id for run in read_session(journal).runs] == ["run-01"]
    assert any("not closed" in note.text for note in read_session(journal).notes)

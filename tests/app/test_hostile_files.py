"""Commands that are handed pipes, devices, bombs and impossible names: one sentence each, at once."""

from __future__ import annotations

import gzip
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import pytest
from click.testing import CliRunner

from draglag_app.cli import cli

SAMPLE = Path(__file__).parent.parent / "data" / "exchange" / "none-A"
# Each is refused in milliseconds; a command that waits for a pipe or reads a device waits for ever.
_TIMEOUT_S = 30


@pytest.fixture(autouse=True)
def no_command_hangs() -> Iterator[None]:
    def ring(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"more than {_TIMEOUT_S} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(_TIMEOUT_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    for ending in ("", ".h5", ".csv", ".json", ".toml", ".events"):
        os.mkfifo(folder / f"pipe{ending}")
        (folder / f"folder{ending}").mkdir()
        (folder / f"zero{ending}").symlink_to("/dev/zero")
        (folder / f"deep{ending}").write_text("[" * 10_000 + "]" * 10_000)
    bomb = gzip.compress(b"t_s,x_mm,y_mm\n" + b"1,2,3\n" * 3_000_000)
    for ending in (".csv.gz", ".events.gz"):
        (folder / f"bomb{ending}").write_bytes(bomb)
    return folder


def refused(*arguments: object) -> str:
    result = CliRunner().invoke(cli, [str(argument) for argument in arguments])
    assert result.exit_code in (1, 2), result.output
    assert "unexpected" not in result.output
    lines = result.stderr.strip().splitlines()
    if result.exit_code == 1:
        assert len(lines) == 1, lines
    return lines[-1]


SOURCES = ("pipe", "folder", "zero", "deep", "/dev/zero", "/dev/null", "/proc/self/mem", "x" * 300, "", "/")


@pytest.mark.parametrize("name", SOURCES)
def test_a_hostile_file_is_refused_by_every_command_that_reads_one(
    name: str, place: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path_factory.mktemp("empty"))  # what "" names

    def at(ending: str = "") -> str:
        return name if not name or name.startswith("/") else str(place / f"{name}{ending}")

    out = place / "out.h5"
    simulate = ("simulate", "--out", out, "--screen")
    record = ("record", "demo", "--screen", "screen-1", "--out", out, "--laser", "sim:", "--touch")
    # Of a folder they take the sessions in it, and / may hold some.
    of_many = () if name == "/" else (("analyze", at(".h5")), ("gap", at(".h5")))
    for command in (
        *of_many, ("verify", at(".h5")), ("import", at(), "--out", out),
        ("export", at(".h5"), "--to", "csv", "--out", place / "tables"),
        ("compensate", at(".json"), at(".csv"), place / "o.csv"),
        ("plan", at(".toml")), (*simulate, at(".toml")), (*simulate, "screen-1", "--model", at(".json")),
        (*simulate, "screen-1", "--protocol", at(".toml")), (*record, f"csv:{at('.csv')}"),
        (*record, f"replay:{at('.events')}"), (*record, "evdev:/dev/input/event0", "--calibration", at(".json")),
    ):  # fmt: skip
        refused(*command)
    assert not out.exists()


def test_a_gzip_bomb_is_refused(place: Path) -> None:
    record = ("record", "demo", "--screen", "screen-1", "--out", place / "out.h5", "--laser", "sim:", "--touch")
    for address in (f"csv:{place / 'bomb.csv.gz'}", f"replay:{place / 'bomb.events.gz'}"):
        assert "unpacks to more than" in refused(*record, address)


@pytest.mark.parametrize("name", ["/", ".", "..", "x" * 300, "/proc/x", "/dev/full/x", "no/such/x", "\u00e9" * 200])
def test_an_impossible_place_to_write_is_one_sentence(name: str, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)
    refused("import", SAMPLE, "--out", name)
    refused("simulate", "--screen", "screen-1", "--protocol", "taps-100", "--out", name)
    for kind in ("csv", "exchange", "mat", "netcdf"):
        refused("export", SAMPLE, "--to", kind, "--out", name)
    if name != ".":  # the folder one stands in is a place for a demo
        refused("demo", "--no-window", "--screen", "no-such", "--out", name)


@pytest.mark.parametrize("seed", ["9" * 400, "9" * 5000, "-1", "1e3"])
def test_a_seed_beyond_any_use_is_refused(seed: str, place: Path) -> None:
    assert "--seed" in refused("simulate", "--screen", "screen-1", "--seed", seed, "--out", place / "out.h5")
    protocol = place / "seed.toml"
    protocol.write_text(f'name = "x"\nseed = {seed}\n[taps]\n')
    refused("plan", protocol)

"""A device scheme from a package of its own is listed, opened by its address, read, and refused like any other."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from plugins import example, installed, python, with_packages

GROUP = "draglag.sources"

READ = """
import os, sys
from draglag_devices.opening import open_source
path = sys.argv[1]
source = open_source(f"fifo:{path}", "laser")
print(source.open().description)
with open(path, "wb", buffering=0) as pipe:
    pipe.write(b"0\\n1\\nwhat\\n0")
batch = source.read(5.0)
print(batch.laser.light.tolist(), len(batch.laser.t_s), [notice.text for notice in batch.notices])
with open(path, "wb", buffering=0) as pipe:
    pipe.write(b"\\n")
print(source.read(5.0).laser.light.tolist(), source.read(0.0).laser)
source.close()
source.close()
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return example("draglag-fifo-laser", GROUP, tmp_path_factory.mktemp("site"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_the_example_reads_the_edges_that_were_written(site: list[Path], tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    done = python(site, READ, pipe)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "pipe pipe",
        "[0, 1] 2 ['1 lines were neither 0 nor 1']",
        "[0] None",
    ]


def test_it_is_listed_and_refused_like_any_other(site: list[Path], tmp_path: Path) -> None:
    assert "fifo:/path/of/pipe" in with_packages(site, "devices").stdout
    record = ("record", "demo", "--touch", "sim:", "--screen", "screen-1", "--out", tmp_path / "s.h5", "--realtime")
    missing = with_packages(site, *record, "--laser", f"fifo:{tmp_path / 'none'}")
    assert missing.returncode == 1
    assert "cannot be opened (No such file or directory); check its name and rights" in missing.stderr
    wrong = with_packages(site, "check", "--touch", "fifo:/x")
    assert wrong.returncode == 1
    assert "cannot serve as touch" in wrong.stdout + wrong.stderr


def test_without_its_package_the_scheme_is_not_known() -> None:
    done = with_packages([], "check", "--laser", "fifo:/x")
    assert done.returncode == 1
    assert "this is not a device address" in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("scheme", "source", "said"),
    [
        ("mine", "ROLES = ('laser',)\nFORM = 'mine:X'", "it has no open_source"),
        ("mine", "ROLES = ('camera',)\nFORM = 'mine:X'\ndef open_source(*_): pass", "there is no role 'camera'"),
        ("sim", "ROLES = ('laser',)\nFORM = 'sim:X'\ndef open_source(*_): pass", "its scheme is taken"),
        ("mine", "ROLES = ('laser',)\nFORM = 'x:'\ndef open_source(*_): pass", "does not begin with mine:"),
    ],
)
def test_one_that_cannot_be_used_is_left_out_with_a_warning(
    tmp_path: Path, scheme: str, source: str, said: str
) -> None:
    (tmp_path / "strange.py").write_text(source)
    done = with_packages([installed(tmp_path, {scheme: "strange"}, GROUP)], "devices")
    assert done.returncode == 0
    assert f"source {scheme} (strange) is left out" in done.stderr
    assert said in done.stderr


def test_a_driver_that_fails_while_looking_hides_no_other(tmp_path: Path) -> None:
    (tmp_path / "strange.py").write_text(
        "ROLES = ('laser',)\nFORM = 'mine:X'\ndef open_source(*_): pass\ndef discover(): return 1 / 0"
    )
    done = with_packages([installed(tmp_path, {"mine": "strange"}, GROUP)], "devices")
    assert done.returncode == 0, done.stderr
    assert "sim:" in done.stdout
    assert "its driver fails (ZeroDivisionError" in done.stdout

"""The parts of the Debian package agree with the program; on request it is built, installed, used and removed."""

from __future__ import annotations

import gzip
import os
import re
import shutil
import subprocess
import tomllib
from configparser import RawConfigParser
from pathlib import Path
from xml.etree import ElementTree

import h5py
import pytest

from draglag.simulation import simulate_session
from draglag.store import write_session

ROOT = Path(__file__).parents[2]
PARTS = ROOT / "packaging" / "deb"
SCRIPT = Path(__file__).with_name("deb.sh")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
MIME = "{http://www.freedesktop.org/standards/shared-mime-info}"


@pytest.mark.skipif(
    os.environ.get("DRAGLAG_TEST_DEB") != "1",
    reason="the package is built and installed on minimal systems on request: ./run test-deb, or DRAGLAG_TEST_DEB=1",
)
@pytest.mark.parametrize("suite", ["bookworm", "trixie"])
def test_the_package_is_installed_used_and_removed_on_a_minimal_debian(suite: str) -> None:
    done = subprocess.run([SCRIPT, suite], stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode == 77:
        pytest.skip(done.stdout.strip())
    assert done.returncode == 0, done.stdout


def test_a_system_that_is_none_is_refused() -> None:
    done = subprocess.run([SCRIPT, "everything"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "everything: no such system. Systems: bookworm trixie\n")


@pytest.fixture
def entry() -> dict[str, str]:
    file = RawConfigParser()
    file.optionxform = str  # type: ignore[assignment,method-assign]
    file.read(PARTS / "draglag.desktop", "utf-8")
    return dict(file["Desktop Entry"])


@pytest.fixture
def mime_type() -> ElementTree.Element:
    found = ElementTree.parse(PARTS / "draglag.xml").getroot().find(f"{MIME}mime-type")
    assert found is not None
    return found


def test_the_desktop_entry_starts_the_program_on_a_session(
    entry: dict[str, str], mime_type: ElementTree.Element
) -> None:
    assert entry["Exec"].split() == ["draglag", "%f"]
    assert entry["Exec"].split()[0] in PROJECT["scripts"]
    assert entry["MimeType"].split(";") == [mime_type.get("type"), ""]
    assert (ROOT / "resources" / "draglag_resources" / "icons" / f"{entry['Icon']}.svg").is_file()
    assert entry["Comment"] == PROJECT["description"]


def test_the_metainfo_is_of_this_version_and_names_the_other_parts(
    entry: dict[str, str], mime_type: ElementTree.Element
) -> None:
    root = ElementTree.parse(PARTS / "draglag.metainfo.xml").getroot()
    assert root.findtext("launchable") == "draglag.desktop"
    assert root.findtext("name") == entry["Name"]
    assert root.findtext("project_license") == PROJECT["license"]
    assert root.findtext("provides/mediatype") == mime_type.get("type")
    newest = root.find("releases/release")
    assert newest is not None
    assert newest.get("version") == PROJECT["version"]


@pytest.mark.skipif(shutil.which("appstreamcli") is None, reason="appstreamcli is not installed")
def test_the_metainfo_is_valid() -> None:
    known = (PARTS / "metainfo-known").read_text("utf-8").split()  # there is no public address yet
    command = ["appstreamcli", "validate", "--no-net", PARTS / "draglag.metainfo.xml"]
    said = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    assert "Validation" in said
    issues = [line for line in said.splitlines() if line.startswith(("E:", "W:"))]
    assert not [line for line in issues if not any(tag in line for tag in known)]


def has_type(mime_type: ElementTree.Element, content: bytes) -> bool:
    """Whether a file is of a type by its magic, as the specification of shared MIME-info says."""

    def fits(match: ElementTree.Element) -> bool:
        value = match.get("value", "").encode().decode("unicode_escape").encode("latin-1")
        first, _, last = match.get("offset", "").partition(":")
        inner = match.findall(f"{MIME}match")
        here = content.find(value, int(first), int(last or first) + len(value)) >= 0
        return here and (not inner or any(map(fits, inner)))

    return any(fits(match) for match in mime_type.findall(f"{MIME}magic/{MIME}match"))


def test_sessions_are_known_by_their_content_and_other_files_are_not(
    mime_type: ElementTree.Element, tmp_path: Path
) -> None:
    write_session(simulate_session("screen-2", "demo", seed=1), tmp_path / "session.h5")
    assert has_type(mime_type, (tmp_path / "session.h5").read_bytes())
    with gzip.open(ROOT / "tests" / "data" / "session-v1.h5.gz") as oldest:
        assert has_type(mime_type, oldest.read())
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["draglag"] = [1.0]
    assert not has_type(mime_type, (tmp_path / "other.h5").read_bytes())
    assert not has_type(mime_type, b"draglag-session" * 1000)


def test_everything_that_the_package_is_built_from_is_there() -> None:
    text = (PARTS / "build.sh").read_text("utf-8")
    places = [
        words.replace("$place", "packaging/deb")
        for words in re.findall(r"^ +put \d+ ([^ $]\S+|\$place\S+)", text, re.M)
    ]
    assert len(places) > 6
    assert not [place for place in places if not (ROOT / place).is_file()]


@pytest.mark.parametrize("script", ["build.sh", "preinst", "postinst", "prerm", "postrm", "draglag-ethercat-setup"])
def test_the_scripts_are_posix_shell_and_can_be_run(script: str) -> None:
    done = subprocess.run(["sh", "-n", PARTS / script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert os.access(PARTS / script, os.X_OK)

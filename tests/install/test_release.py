"""All that names a version names this one."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parents[2]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]


def test_citation_changelog_and_notes_are_of_this_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^version: (.*)$", citation, re.MULTILINE) == [VERSION]
    newest = re.search(r"^## (\S+) \((\S+)\)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert newest is not None
    assert newest[1] == VERSION
    assert (ROOT / "docs" / "releases" / f"{VERSION}.md").read_text("utf-8").startswith(f"# draglag {VERSION}\n")
    metainfo = ElementTree.parse(ROOT / "packaging" / "deb" / "draglag.metainfo.xml").find("releases/release")
    assert metainfo is not None
    assert (metainfo.get("version"), metainfo.get("date")) == (newest[1], newest[2])

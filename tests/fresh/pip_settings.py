"""Writes this machine's pip settings into one file, and prints the local files and folders they name, one a line.

A root system with that file, and those places at the same paths, reaches the same packages.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from configparser import RawConfigParser
from pathlib import Path

Settings = dict[tuple[str, str], str]  # (section, key) → value


def read_settings(listed: str) -> Settings:
    """The settings of ``pip config list``; those of the environment come last, since they win."""
    found: Settings = {}
    for line in sorted(listed.splitlines(), key=lambda line: line.startswith(":env:")):
        name, _, value = line.partition("=")
        section, _, key = name.rpartition(".")
        found["global" if section == ":env:" else section, key] = str(ast.literal_eval(value))
    return found


def local_places(settings: Settings) -> list[Path]:
    """What exists here of the places that the settings name."""
    places: dict[Path, None] = {}
    for (_, key), value in settings.items():
        for word in value.split():
            if not word.startswith(("/", "file:///")):
                continue
            place = Path(word.removeprefix("file://"))
            if "index-url" in key and len(place.parts) > 2:
                place = place.parent  # the pages of an index lead to files next to it
            if place.exists():
                places[place] = None
    return list(places)


def as_file(settings: Settings) -> RawConfigParser:
    """The settings as pip reads them."""
    file = RawConfigParser()
    for (section, key), value in settings.items():
        if not file.has_section(section):
            file.add_section(section)
        file.set(section, key, " ".join(value.split()))
    return file


def main() -> None:
    """``pip_settings.py FILE``."""
    command = [sys.executable, "-m", "pip", "config", "list"]
    # Nothing is listed, and nothing to pass on, where there is no pip.
    settings = read_settings(subprocess.run(command, check=False, capture_output=True, text=True).stdout)
    with Path(sys.argv[1]).open("w", encoding="utf-8") as out:
        as_file(settings).write(out)
    for place in local_places(settings):
        print(place)


if __name__ == "__main__":
    main()

"""A session's details and file name."""

from __future__ import annotations

import re
import string
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path

from draglag.errors import DataError
from draglag.messages import Message, message

STANDARD = ("participant", "session", "operator")
TEMPLATE = "{date}_{time}_{protocol}-{screen}"
"""Unique by default: no two sessions begin in one second."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}\Z")  # also a name of HDF5, MATLAB and R
GIVEN = ("date", "time", "protocol", "screen")
"""Fields of a name that the program fills in."""
_LONGEST = 200  # of a stem, bytes: file systems take 255 with the endings


def check_name(name: str) -> str:
    """The name, if valid for a free field. Raises DataError."""
    if not _NAME.match(name) or name in GIVEN:
        raise DataError(
            message("“{name}” cannot be the name of a field", name=name[:60]),
            message("Use letters, digits and _, a letter first, and none of {names}", names=", ".join(GIVEN)),
        )
    return name


def parse_details(texts: Iterable[str]) -> dict[str, str]:
    """Details from texts NAME=TEXT. Raises DataError."""
    out = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise DataError(message("“{text}” is no detail", text=text[:60]), "Write NAME=TEXT, as participant=P07")
        out[check_name(name.strip())] = value.strip()
    return {name: value for name, value in out.items() if value}


def check_template(template: str, fields: Iterable[str] = ()) -> str:
    """The template, if valid for file names. Raises DataError."""
    known = {*GIVEN, *STANDARD, *fields}
    try:
        parts = [part for part in string.Formatter().parse(template) if part[1] is not None]
    except ValueError:
        raise DataError("a bracket of the file name is not closed", "Write fields as {participant}") from None
    # Widths and conversions would make names that nobody foresees: they are refused with the field.
    places = [f"{name}{':' + spec if spec else ''}{'!' + turn if turn else ''}" for _, name, spec, turn in parts]
    unknown = [place for place in places if place not in known]
    if unknown:
        raise DataError(
            message("the file name asks for {{{name}}}", name=unknown[0]),
            message("Known are {names}", names=", ".join(sorted(known))),
        )
    if not places and not template.strip():
        raise DataError("the file name is empty", message("The usual one is {template}", template=TEMPLATE))
    return template


def session_name(protocol: str, screen: str) -> Message:
    """What a session is called that nobody named."""
    return message("{protocol} on {screen}", protocol=protocol, screen=screen)


def file_name(
    folder: Path, template: str, protocol: str, screen: str, details: Mapping[str, str], now: datetime
) -> Path:
    """An unused path; empty fields leave no separators. Raises DataError."""
    values = {"date": f"{now:%Y-%m-%d}", "time": f"{now:%H%M%S}", "protocol": protocol, "screen": screen}
    values |= dict.fromkeys(STANDARD, "") | dict(details)
    plain = {key: re.sub(r"[^\w.-]+", "_", value).strip("._") for key, value in values.items()}
    stem = check_template(template, details).format(**plain)
    stem = re.sub(r"[^\w.-]+", "_", stem)  # a template that names folders would leave the one chosen
    stem = re.sub(r"([-_.])[-_.]+", r"\1", stem).strip("-_.")
    stem = stem.encode()[:_LONGEST].decode(errors="ignore") or "session"
    path, k = folder / f"{stem}.h5", 2
    while path.exists() or path.with_name(path.name + ".partial").exists():
        path, k = folder / f"{stem}-{k}.h5", k + 1
    return path

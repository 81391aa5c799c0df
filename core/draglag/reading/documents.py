"""JSON and TOML of limited depth and numbers."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from draglag.errors import DataError
from draglag.messages import message
from draglag.reading.limits import DEPTH, KEY_PARTS, WHOLE_MOST

_CORRECT, _CORRECT_LINE = message("Correct the file"), message("Correct the file at that line")
_HALF = re.compile("[\ud800-\udfff]")  # of a character beyond U+FFFF
# A part begins where no other character of a part stands before it, so that every stretch is looked at once.
_LONG_KEY = re.compile(
    r"(?<![\w\-\"'])(?:(?:\"[^\"\n]{0,99}\"|'[^'\n]{0,99}'|[\w-]{1,99})[ \t]*\.[ \t]*)" + f"{{{KEY_PARTS}}}"
)


def parse_json(text: str, where: Path | str, remedy: str = _CORRECT) -> Any:
    """The value of a JSON text. Raises DataError."""
    try:
        return checked(json.loads(text), where, remedy)
    except json.JSONDecodeError as error:
        problem = message(
            "{path}, line {line}, column {column}: is not JSON ({why})",
            path=where,
            line=error.lineno,
            column=error.colno,
            why=error.msg,
        )
        raise DataError(problem, remedy) from error
    except RecursionError as error:
        raise _too_deep(where, remedy) from error
    except ValueError as error:  # Python stops at 4300 digits
        raise _too_long(where, remedy) from error


def parse_toml(text: str, where: Path | str, remedy: str = _CORRECT_LINE) -> dict[str, Any]:
    """The table of a TOML text. Raises DataError."""
    if _LONG_KEY.search(text):
        raise DataError(message("{path}: a dotted key has more than {most} parts", path=where, most=KEY_PARTS), remedy)
    try:
        table: dict[str, Any] = checked(tomllib.loads(text), where, remedy)
    except tomllib.TOMLDecodeError as error:
        raise DataError(message("{path} is not valid TOML: {error}", path=where, error=error), remedy) from error
    except RecursionError as error:
        raise _too_deep(where, remedy) from error
    except ValueError as error:
        raise _too_long(where, remedy) from error
    return table


def checked(value: Any, where: Path | str, remedy: str = _CORRECT) -> Any:
    """The value itself. Raises DataError if nested too deep, or with too long a whole number or a lone surrogate."""
    waiting: list[tuple[Any, int, str]] = [(value, 0, "")]
    while waiting:
        item, depth, key = waiting.pop()
        if depth > DEPTH:
            raise _too_deep(where, remedy)
        if isinstance(item, dict):
            waiting.extend((name, depth, "") for name in item)
            waiting.extend((inner, depth + 1, str(name)) for name, inner in item.items())
        elif isinstance(item, list):
            waiting.extend((inner, depth + 1, key) for inner in item)
        elif isinstance(item, int) and not -WHOLE_MOST <= item <= WHOLE_MOST:
            raise DataError(message("{path}: {key}: holds a number that is too long", path=where, key=key[:40]), remedy)
        elif isinstance(item, str) and _HALF.search(item):
            raise DataError(
                message("{path}: holds half a character (an escape of D800 to DFFF alone)", path=where), remedy
            )
    return value


def _too_deep(where: Path | str, remedy: str) -> DataError:
    return DataError(message("{path}: is nested too deep (more than {most} levels)", path=where, most=DEPTH), remedy)


def _too_long(where: Path | str, remedy: str) -> DataError:
    return DataError(message("{path}: holds a number that is too long", path=where), remedy)

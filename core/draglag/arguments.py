"""What a caller gave to the library, checked: in its one type, or a DataError of one sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Integral, Real
from os import PathLike, fspath
from pathlib import Path
from reprlib import Repr

import numpy as np

from draglag.errors import DataError
from draglag.messages import Message, message

_SHORT = Repr()
_SHORT.maxother = _SHORT.maxstring = 60


def other(wanted: Message, found: object, remedy: Message) -> DataError:
    """That something of another kind was given."""
    return DataError(message("expected {wanted}, found {found}", wanted=wanted, found=type(found).__name__), remedy)


def refused(name: str, found: object, remedy: Message) -> DataError:
    """That an argument has a value that it cannot have."""
    return DataError(message("{name} is {found}", name=name, found=_SHORT.repr(found)), remedy)


def path_of(given: object) -> Path:
    """The path of a file."""
    text = fspath(given) if isinstance(given, str | PathLike) else None
    if not isinstance(text, str):
        raise other(message("the path of a file"), given, message("Give it as a text"))
    if "\0" in text:
        raise DataError(message("{path}: cannot be the name of a file", path=repr(text)), "Check the name")
    return Path(text)


def number_in(name: str, given: object, low: float, high: float, above: bool = False) -> float:
    """A number from ``low`` to ``high``; with ``above``, greater than ``low``."""
    if isinstance(given, Real) and not isinstance(given, bool):
        number = float(given)
        if low <= number <= high and math.isfinite(number) and not (above and number == low):
            return number
    between = message("Give a number from {low:g} to {high:g}", low=low, high=high)
    raise refused(
        name, given, message("Give a number above {low:g}, {high:g} at most", low=low, high=high) if above else between
    )


def whole_in(name: str, given: object, low: int, high: int) -> int:
    """A whole number from ``low`` to ``high``."""
    if isinstance(given, Integral) and not isinstance(given, bool) and low <= int(given) <= high:
        return int(given)
    raise refused(name, given, message("Give a whole number from {low} to {high}", low=low, high=high))


def truth_of(name: str, given: object) -> bool:
    """True or False."""
    if isinstance(given, bool | np.bool_):
        return bool(given)
    raise refused(name, given, message("Give True or False"))


def text_of(name: str, given: object) -> str:
    """A text."""
    if isinstance(given, str):
        return given
    raise refused(name, given, message("Give a text"))


def names_of(name: str, given: object) -> tuple[str, ...]:
    """Names, each once, in their order; a text is one name."""
    names = (given,) if isinstance(given, str) else tuple(given) if isinstance(given, Iterable) else (None,)
    if not all(isinstance(one, str) for one in names):
        raise refused(name, given, message('Give a list of texts, as in {name}=["a", "b"]', name=name))
    return tuple(dict.fromkeys(str(one) for one in names))

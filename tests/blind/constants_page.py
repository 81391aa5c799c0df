"""The table of every constant of the gap: python -m tests.blind.constants_page writes docs/gap-constants.md.

Meaning, unit and origin are read where a constant is defined: the docstring below it, the comment behind it, or the
comment above it and its neighbours. What another value changes is read from ablation.jsonl next to this file, which
the ablation wrote (``--out``), as long as the constant still has the value that it had then.
"""

import ast
import io
import json
import re
import tokenize
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "core" / "draglag" / "gap"
PAGE = ROOT / "docs" / "gap-constants.md"
ABLATION = Path(__file__).with_name("ablation.jsonl")
ORIGIN = re.compile(r"\b(physical|derived|judgement|calibrated)\b", re.IGNORECASE)
DIRECTIVE = re.compile(r"^(fmt|noqa|type)\b")
LONGEST = 90  # characters of a value that a cell shows
HEAD = """# Constants of the gap

Every number at the top of a module of `gap/`, as its module states it. Origins: *physical* = hands, screens and
sensors; *derived* = the model or numerics; *judgement* = a prior belief; *calibrated* = sized on sessions, as the entry
says.

The last column is what happens on four kept sessions of the realistic world (a sound one on a constant law, 974919205;
a clock's offset, 1116564621; a wrong scale, 108649107; a late return of the light, 785780066: the end of each name that
`draglag blind --keep` gives, with seed 281131 for the first and 291130) with a larger and a smaller value, three times
and a third where that can be (`python -m tests.blind.ablation`): answers that change, the last gap where it moves by
more than 2 %, sizes that move by more than a tenth of their half width. A dash: none of these. Empty: not varied since
the number has its present value, or no single number.

`python -m tests.blind.constants_page` writes this page; a test fails where a module says something else.

"""


@dataclass(frozen=True)
class Constant:
    """module: of the package, without it; names: of one assignment. value: as written, values: of single numbers."""

    module: str
    names: tuple[str, ...]
    value: str
    values: tuple[float | None, ...]
    meaning: str

    @property
    def origin(self) -> str:
        """The first origin that its meaning states, or nothing."""
        found = ORIGIN.search(self.meaning)
        return found.group().lower() if found else ""

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(f"{self.module}.{name}" for name in self.names)


def constants_in(package: Path = PACKAGE) -> list[Constant]:
    """Constants of all modules, those of ``constants`` first."""
    files = sorted(package.rglob("*.py"), key=lambda path: (path.name != "constants.py", str(path)))
    return [constant for path in files for constant in _of_module(path, package)]


def _of_module(path: Path, package: Path) -> Iterator[Constant]:
    source = path.read_text()
    behind, alone = _comments(source)
    body = ast.parse(source).body
    module = ".".join(path.relative_to(package).with_suffix("").parts)
    above, last = "", 0
    for node, below in zip(body, [*body[1:], None], strict=True):
        names = _names(node)
        if not names or not _is_numeric(node.value):
            continue
        begin, end = node.lineno, node.end_lineno or node.lineno
        over = _run_of(alone, begin - 1)
        above = over or (above if begin == last + 1 else "")
        trailing = " ".join(behind[line] for line in range(begin, end + 1) if line in behind)
        meaning = _docstring(below) or trailing or above
        value = " ".join(ast.unparse(node.value).split())
        yield Constant(module, names, value, _numbers(node.value, len(names)), " ".join(meaning.split()))
        last = end


def _comments(source: str) -> tuple[dict[int, str], dict[int, str]]:
    """Comments by line, without directives to tools: behind code, and alone at the left margin."""
    behind, alone = dict[int, str](), dict[int, str]()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            pieces = (piece.strip() for piece in token.string.split("#"))
            text = " ".join(piece for piece in pieces if piece and not DIRECTIVE.match(piece))
            line, column = token.start
            if text and token.line[:column].strip():
                behind[line] = text
            elif text and column == 0:
                alone[line] = text
    return behind, alone


def _run_of(alone: dict[int, str], line: int) -> str:
    """Comment that ends at a line."""
    lines: list[str] = []
    while line in alone:
        lines.insert(0, alone[line])
        line -= 1
    return " ".join(lines)


def _names(node: ast.stmt) -> tuple[str, ...]:
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return ()
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    each = target.elts if isinstance(target, ast.Tuple) else [target]
    names = tuple(one.id for one in each if isinstance(one, ast.Name))
    return names if names and all(name.strip("_").isupper() for name in names) else ()


def _is_numeric(value: ast.expr) -> bool:
    return any(_number(part) is not None for part in ast.walk(value))


def _number(node: ast.AST) -> float | None:
    value = node.value if isinstance(node, ast.Constant) else None
    return value if isinstance(value, int | float) and not isinstance(value, bool) else None


def _numbers(value: ast.expr, n: int) -> tuple[float | None, ...]:
    each = value.elts if n > 1 and isinstance(value, ast.Tuple) else [value] * n
    return tuple(_number(one) for one in each)


def _docstring(node: ast.stmt | None) -> str:
    text = node.value.value if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) else ""
    return text if isinstance(text, str) else ""


def page(constants: Iterable[Constant], ablation: Iterable[str]) -> str:
    """The page's text. ablation: lines of JSON."""
    found = [json.loads(line) for line in ablation]
    rows = ["| constant | value | meaning, unit, origin | larger; smaller value |", "|---|---|---|---|"]
    for one in constants:
        does = "; ".join(filter(None, (_effects(found, *each) for each in zip(one.keys, one.values, strict=True))))
        names = ", ".join(f"`{name}`" for name in one.names)
        value = one.value if len(one.value) < LONGEST else "a grid"
        rows.append("| " + " | ".join(map(_cell, (f"{one.module} {names}", value, one.meaning, does))) + " |")
    return HEAD + "\n".join(rows) + "\n"


def _effects(found: list[dict], key: str, value: float | None) -> str:
    """What the ablation found for a constant that still has the value it had then."""
    own = [one for one in found if one["constant"] == key and one["usual"] == value]
    return "; ".join(_words(one) for one in sorted(own, key=lambda one: -one["value"]))


def _words(found: dict) -> str:
    if found["failed"]:
        return f"{found['value']:g} cannot be"
    changed = len(found["answers_changed"])
    said = [f"{changed} other answer{'s' if changed > 1 else ''}"] if changed else []
    said += [f"gap × {found['gap_ratio']:.2f}"] if abs(found["gap_ratio"] - 1) > 0.02 else []
    said += [f"sizes by {found['sizes_moved']:.1f}"] if found["sizes_moved"] > 0.1 else []
    return ", ".join(said) or "–"


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


def written() -> str:
    """The page as it should be."""
    return page(constants_in(), ABLATION.read_text().splitlines() if ABLATION.exists() else ())


if __name__ == "__main__":
    PAGE.write_text(written())
    print(f"{PAGE}: {sum(len(one.names) for one in constants_in())} constants")

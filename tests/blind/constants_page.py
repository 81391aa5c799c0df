"""The table of every constant of the gap: python -m tests.blind.constants_page [ABLATION.jsonl …] writes it to docs.

Meaning, unit and origin are read where a constant is defined: the docstring below it, the comment behind it, or the
comment above it and its neighbours. What it is good for comes from files that the ablation wrote; without any, from
the page as it is.
"""

import ast
import json
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "core" / "draglag" / "gap"
PAGE = ROOT / "docs" / "gap-constants.md"
ORIGINS = ("physical", "derived", "judgement", "calibrated")
HEAD = """# Constants of the gap

Every number at the top of a module of `gap/`, as its module states it. Origins: *physical* = hands, screens and
sensors; *derived* = the model or numerics; *judgement* = a prior belief; *calibrated* = sized on sessions, which are
named.
`python -m tests.blind.constants_page` writes this page; a test fails where a module says something else.

"""


@dataclass(frozen=True)
class Constant:
    """module: of ``gap``, without it; names: of one assignment. value: as written."""

    module: str
    names: tuple[str, ...]
    value: str
    meaning: str

    @property
    def origin(self) -> str:
        """The first origin that its meaning states, or nothing."""
        found = re.search("|".join(ORIGINS), self.meaning.lower())
        return found.group() if found else ""

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(f"{self.module}.{name}" for name in self.names)


def constants_in(package: Path = PACKAGE) -> list[Constant]:
    """Constants of all modules, those of ``constants`` first."""
    files = sorted(package.rglob("*.py"), key=lambda path: (path.name != "constants.py", str(path)))
    return [constant for path in files for constant in _of_module(path, package)]


def _of_module(path: Path, package: Path) -> Iterable[Constant]:
    source = path.read_text()
    lines, body = source.splitlines(), ast.parse(source).body
    module = ".".join(path.relative_to(package).with_suffix("").parts)
    above, last = "", 0
    for k, node in enumerate(body):
        names = _names(node)
        if not names:
            continue
        value = " ".join(str(ast.get_source_segment(source, node.value)).split())  # type: ignore[attr-defined]
        if not _is_numeric(node.value):  # type: ignore[attr-defined]
            continue
        if node.lineno != last + 1:
            above = ""
        above = _comment_above(lines, node.lineno) or above
        last = node.end_lineno or node.lineno
        behind = " ".join(_behind(line) for line in lines[node.lineno - 1 : last])
        below = body[k + 1] if k + 1 < len(body) else None
        doc = ast.literal_eval(below.value) if _is_docstring(below) else ""  # type: ignore[union-attr]
        meaning = doc or behind.strip() or above
        yield Constant(module, names, value, " ".join(str(meaning).split()))


def _names(node: ast.stmt) -> tuple[str, ...]:
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return ()
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    each = target.elts if isinstance(target, ast.Tuple) else [target]
    names = tuple(one.id for one in each if isinstance(one, ast.Name))
    return names if names and all(name.strip("_").isupper() for name in names) else ()


def _is_numeric(value: ast.expr) -> bool:
    numbers = (part.value for part in ast.walk(value) if isinstance(part, ast.Constant))
    return any(isinstance(number, int | float) and not isinstance(number, bool) for number in numbers)


def _comment_above(lines: list[str], lineno: int) -> str:
    begin = lineno - 1
    while begin > 0 and lines[begin - 1].startswith("#"):
        begin -= 1
    return " ".join(line.removeprefix("#").strip() for line in lines[begin : lineno - 1])


def _behind(line: str) -> str:
    _, mark, comment = line.partition("  # ")
    return comment if mark and not comment.startswith("fmt:") else ""


def _is_docstring(node: ast.stmt | None) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def page(constants: list[Constant], effects: dict[str, str]) -> str:
    """The page's text. effects: module.NAME → what other values do."""
    rows = ["| constant | value | meaning, unit, origin | three times as large; a third |", "|---|---|---|---|"]
    for one in constants:
        does = "; ".join(dict.fromkeys(effects[key] for key in one.keys if key in effects))
        names = ", ".join(f"`{name}`" for name in one.names)
        value = one.value if len(one.value) < 90 else "a grid"
        rows.append(f"| {one.module.replace('.', '/')} {names} | {value} | {_cell(one.meaning)} | {does} |")
    return HEAD + "\n".join(rows) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


def effects_on(page_text: str, constants: list[Constant]) -> dict[str, str]:
    """What the page states already, by constant."""
    cells = {}
    for line in page_text.splitlines():
        parts = re.split(r"(?<!\\)\|", line)
        if len(parts) == 6:
            cells[parts[1].strip()] = parts[4].strip()
    out = {}
    for one in constants:
        shown = f"{one.module.replace('.', '/')} {', '.join(f'`{name}`' for name in one.names)}"
        if cells.get(shown):
            out |= dict.fromkeys(one.keys, cells[shown])
    return out


def effects_of(lines: Iterable[str]) -> dict[str, str]:
    """What the ablation found, by constant, the larger value first."""
    each: dict[str, list[tuple[float, str]]] = {}
    for line in lines:
        found = json.loads(line)
        each.setdefault(found["constant"], []).append((found["value"], _words(found)))
    return {name: "; ".join(text for _, text in sorted(values, reverse=True)) for name, values in each.items()}


def _words(found: dict) -> str:
    if found["failed"]:
        return "cannot be"
    changed = found["answers_changed"]
    if changed:
        return f"{len(changed)} other answer{'s' if len(changed) > 1 else ''}"
    moved = [f"gap × {found['gap_ratio']:.2f}"] if abs(found["gap_ratio"] - 1) > 0.02 else []
    moved += [f"sizes by {found['sizes_moved']:.1f} half widths"] if found["sizes_moved"] > 0.1 else []
    return ", ".join(moved) or "–"


def main(argv: list[str]) -> int:
    constants = constants_in()
    effects = effects_on(PAGE.read_text(), constants) if PAGE.exists() else {}
    for name in argv:
        effects |= effects_of(Path(name).read_text().splitlines())
    PAGE.write_text(page(constants, effects))
    print(f"{PAGE}: {sum(len(one.names) for one in constants)} constants")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

"""The tasks of the benchmark on this machine's cores, or on a cluster, by the program's own way to both."""

import sys
import tempfile
import zipfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from draglag_app.parallel import spread

from .conditions import Task
from .judge import Outcome, run_task


def run_all(
    tasks: list[Task], jobs: int, scheduler: str | None = None, keep: Path | None = None, engine: str | None = None
) -> Iterator[Outcome]:
    """Outcomes in order of completion. keep: folder of sessions, reused; engine: judged instead of this checkout's
    workflow. Ctrl+C ends the workers at once."""
    _package_on_path()
    work = partial(run_task, keep=keep, engine=engine)
    with tempfile.TemporaryDirectory() as folder:
        modules = [_packed(Path(folder))] if scheduler else []
        for _, outcome in spread(work, tasks, jobs, scheduler, modules):
            yield outcome


def _packed(folder: Path) -> Path:
    """This package as an archive that workers of a cluster import."""
    package = Path(__file__).parent
    archive = folder / "blind.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        for path in sorted(package.rglob("*.py")):
            packed.write(path, Path("blind") / path.relative_to(package))
    return archive


def _package_on_path() -> None:
    """Let workers import this package under the one name `blind`."""
    tests = str(Path(__file__).parent.parent)
    if tests not in sys.path:
        sys.path.insert(0, tests)

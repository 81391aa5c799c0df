"""Tasks on this machine's cores, or on a cluster through a Dask scheduler."""

import importlib.util
import os
import signal
import sys
import tempfile
import threading
import zipfile
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from pathlib import Path

from .conditions import Task
from .judge import Outcome, run_task

LOOK_S = 0.2  # Ctrl+C is looked for this often
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Unavailable(Exception):
    """Something the benchmark needs is not there: one sentence for people, and what to do."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem)
        self.remedy = remedy


def run_all(
    tasks: list[Task], jobs: int, scheduler: str | None = None, keep: Path | None = None, engine: str | None = None
) -> Iterator[Outcome]:
    """Outcomes as they come, in no order. One thread a worker: many small matrices, not a few large ones.

    keep: folder of sessions that stay, and are used again; engine: what is judged instead of this checkout's workflow.
    Ctrl+C ends the workers at once.
    """
    if scheduler:
        yield from _on_cluster(tasks, scheduler, keep, engine)
        return
    for name in THREADS:
        os.environ[name] = "1"
    before = set(active_children())
    with tempfile.TemporaryDirectory(prefix="draglag-blind-") as scratch, _noted_interrupt() as asked:
        # Fresh interpreters, so that the setting above is read before numpy is loaded.
        pool = ProcessPoolExecutor(max(1, jobs), get_context("spawn"), _begin_worker, (scratch,))
        try:
            pending = {pool.submit(run_task, task, keep, engine) for task in tasks}
            while pending:
                done, pending = wait(pending, LOOK_S, FIRST_COMPLETED)
                if asked.is_set():
                    raise KeyboardInterrupt
                for future in done:
                    yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in set(active_children()) - before:
                worker.terminate()
            raise
        finally:
            pool.shutdown()


@contextmanager
def _noted_interrupt() -> Iterator[threading.Event]:
    """Ctrl+C as an event: as an exception it may come in the pool's own book-keeping, where Python drops it."""
    asked = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    former = signal.signal(signal.SIGINT, lambda *_: asked.set())
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, former)


def _begin_worker(scratch: str) -> None:
    """The main process alone answers Ctrl+C, and clears away what an ended worker leaves."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = scratch


def _on_cluster(tasks: list[Task], address: str, keep: Path | None, engine: str | None) -> Iterator[Outcome]:
    if importlib.util.find_spec("distributed") is None:
        raise Unavailable(
            "Running on a cluster needs Dask, which is not installed", "Run: pip install 'draglag[cluster]'"
        )
    import distributed

    try:
        client = distributed.Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise Unavailable(
            f"No Dask scheduler answers at {address}", "Start one with `dask scheduler`, or leave --scheduler out"
        ) from error
    with client, tempfile.TemporaryDirectory() as folder:
        package = Path(__file__).parent
        archive = Path(folder) / "blind.zip"
        with zipfile.ZipFile(archive, "w") as packed:
            for path in sorted(package.rglob("*.py")):
                packed.write(path, Path("blind") / path.relative_to(package))
        client.upload_file(str(archive))
        futures = client.map(run_task, tasks, keep=keep, engine=engine, pure=False)
        for future in distributed.as_completed(futures):
            yield future.result()


def package_on_path() -> None:
    """Let workers import this package under the one name `blind`."""
    tests = str(Path(__file__).parent.parent)
    if tests not in sys.path:
        sys.path.insert(0, tests)

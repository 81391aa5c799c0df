"""Work on local cores or a Dask cluster."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from draglag.errors import DraglagError
from draglag.messages import message
from draglag.system.packages import need

Item = TypeVar("Item")
Result = TypeVar("Result")

ANSWERS_S = 10.0  # a scheduler that does not answer within this is taken for none
A_CORE = 8  # items a core of the cluster between two reports of progress: at most an eighth of its time is waited


class Unavailable(DraglagError):
    """The cluster is not available."""


def spread(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int | None = None,
    scheduler: str | None = None,
    modules: Sequence[Path] = (),
) -> Iterator[tuple[int, Result]]:
    """Place and result of every item, in order of completion. Raises Unavailable, DraglagError.

    Args:
        work: importable by workers; an exception ends all.
        jobs: processes; None: one per core; 1: this process.
        scheduler: a Dask scheduler's address.
        modules: files to upload there.
    """
    if scheduler is not None:
        return _on_cluster(work, items, scheduler, modules)
    return _on_cores(work, items, min(jobs or os.cpu_count() or 1, max(len(items), 1)))


def _placed(work: Callable[[Item], Result], place: int, item: Item) -> tuple[int, Result]:
    return place, work(item)


def _on_cores(work: Callable[[Item], Result], items: Sequence[Item], jobs: int) -> Iterator[tuple[int, Result]]:
    if jobs == 1:
        yield from ((place, work(item)) for place, item in enumerate(items))
        return
    from joblib import Parallel, delayed, parallel_config

    with _scratch(), parallel_config(backend="loky", n_jobs=jobs, inner_max_num_threads=1):
        # One at a time: a session takes seconds, and what is done is reported at once.
        parallel = Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")
        yield from parallel(delayed(_placed)(work, place, item) for place, item in enumerate(items))


@contextmanager
def _scratch() -> Iterator[None]:
    before = os.environ.get("TMPDIR")
    with tempfile.TemporaryDirectory(prefix="draglag-work-", ignore_cleanup_errors=True) as folder:
        os.environ["TMPDIR"] = folder
        try:
            yield
        finally:
            _end_workers()
            os.environ.pop("TMPDIR")
            if before is not None:
                os.environ["TMPDIR"] = before


def _end_workers() -> None:
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor().shutdown(wait=True, kill_workers=True)


def _on_cluster(
    work: Callable[[Item], Result], items: Sequence[Item], scheduler: str, modules: Sequence[Path]
) -> Iterator[tuple[int, Result]]:
    need("distributed")
    from joblib import Parallel, delayed, parallel_config

    with ExitStack() as stack:
        client = stack.enter_context(_client(scheduler))
        for module in modules:
            client.upload_file(str(module))
        cores = sum(client.nthreads().values())
        if not cores:
            raise Unavailable(
                message("the Dask scheduler at {scheduler} has no workers", scheduler=scheduler),
                "Start some with `dask worker`",
            )
        stack.enter_context(parallel_config(backend="dask", client=client))
        step = A_CORE * cores
        for first in range(0, len(items), step):
            part = range(first, min(first + step, len(items)))
            yield from Parallel(batch_size=1)(delayed(_placed)(work, place, items[place]) for place in part)


def _client(scheduler: str) -> Any:
    import distributed

    try:
        return distributed.Client(scheduler, timeout=ANSWERS_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise Unavailable(
            message("no Dask scheduler answers at {scheduler}", scheduler=scheduler),
            "Start one with `dask scheduler`, or leave --scheduler out",
        ) from error

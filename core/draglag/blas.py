"""One thread for linear algebra.

A run's matrices are small: on several threads BLAS waits for its own threads longer than it computes, and on a machine
that does anything else up to ten times as long.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")


def one_blas_thread(call: Callable[P, R]) -> Callable[P, R]:
    """Decorator: the call computes on one thread; what the process had set returns afterwards."""

    @wraps(call)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with threadpool_limits(limits=1, user_api="blas"):
            return call(*args, **kwargs)

    return limited

"""One thread for linear algebra: on small matrices several are slower."""

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import scipy.linalg  # noqa: F401  (loads its own BLAS, in addition to numpy's)
from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()


def one_blas_thread(call: Callable[P, R]) -> Callable[P, R]:
    """Decorator: the call computes on one thread."""

    @wraps(call)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with _libraries().limit(limits=1, user_api="blas"):
            return call(*args, **kwargs)

    return limited

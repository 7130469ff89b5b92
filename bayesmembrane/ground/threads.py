"""One thread for linear algebra: the matrices here are small, and threads that share them only wait for each other."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")
NAMES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread(work: Callable[P, R]) -> Callable[P, R]:
    """``work`` with BLAS held to one thread while it runs, in processes that it starts too unless they are told else.

    On two busy cores a diagnosis took over ten times the CPU time with two threads (28 s with one).
    """

    @wraps(work)
    def alone(*given: P.args, **named: P.kwargs) -> R:
        unset = [name for name in NAMES if name not in os.environ]
        os.environ.update(dict.fromkeys(unset, "1"))
        try:
            with threadpool_limits(limits=1, user_api="blas"):
                return work(*given, **named)
        finally:
            for name in unset:
                os.environ.pop(name, None)

    return alone

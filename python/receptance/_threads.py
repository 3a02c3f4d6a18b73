"""Threads of the linear algebra in NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread within the block, or within a function that has this as a decorator.

    The matrices of fits are small: threads of BLAS wait for each other longer than they compute, and they compete with
    the threads of the core. On two processors `receptance diagnose` takes up to twice as long with them. SciPy has a
    BLAS of its own, which fits do not use: it is not loaded for this.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:  # scripts that have NumPy and SciPy alone
        yield
        return
    with threadpool_limits(1, user_api="blas"):
        yield

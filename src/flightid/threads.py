"""Threads of the linear-algebra library: one, where a command owns its process.

Matrices here are small and many. OpenBLAS's threads wait for them by spinning: `flightid tune` of a
log of 22 MB on two cores takes 15 s of processor time and 17 s by the clock with one thread, 32 and
28 s with two. One thread also sums in one order: numbers do not hang on the cores of a machine.
"""

from __future__ import annotations

import os

LINEAR_ALGEBRA = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that linear-algebra libraries read when NumPy is loaded."""


def one_linear_algebra_thread() -> None:
    """Ask for one thread where the surroundings ask for no number; NumPy must not be loaded yet.

    Processes that are started later inherit it. The native half has threads of its own.
    """
    for name in LINEAR_ALGEBRA:
        os.environ.setdefault(name, "1")

"""Derivatives of a record's run, as the steps from hold to hold ask them: sums over samples.

Of short records derivatives stand for all samples (`FormedSlopes`), and where their colour is taken
out or equations are run. Of long ones runs are made again, and nothing but sums is kept
(`SummedSlopes`; native: `slope_sums.rs`): of 10⁶ samples and 8 parameters derivatives are 128 MB.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.output_error.distinct import run_with_slopes
from flightid.identification.output_error.equation_records import EquationRuns
from flightid.identification.records.setup import (
    NativeOwn,
    NativeRecord,
    OwnNumbers,
    RecordSet,
)
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]
LONG = 1 << 20
"""Derivatives of a record that leave the cache: a run makes them as fast as memory gives them."""


class RunSlopes(Protocol):
    """Derivatives of one record's outputs by shared parameters and by its own numbers."""

    def products(self, left: Array) -> Array:
        """Products of all columns with residuals as the last, by output, (n_outputs, k, k)."""

    def stepped(self, left: Array, step: Array) -> Array:
        """What a step leaves of residuals."""

    def columns(self) -> Array:
        """The derivatives, shape (n_outputs, n_samples, k - 1)."""

    @property
    def is_finite(self) -> bool:
        """Whether none of them exploded."""


@dataclass(frozen=True, eq=False)
class FormedSlopes:
    """Derivatives of all samples, shape (n_outputs, n_samples, k), the first `n_free` shared."""

    slopes: Array
    n_free: int

    @cached_property
    def is_finite(self) -> bool:
        """Whether none of them exploded."""
        return bool(np.isfinite(np.sum(self.slopes)))

    @cached_property
    def _squares(self) -> Array:
        """The same in steps that keep them."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.array([slope.T @ slope for slope in self.slopes])

    def products(self, left: Array) -> Array:
        """As `RunSlopes` says."""
        outputs, _, count = self.slopes.shape
        found = np.empty((outputs, count + 1, count + 1))
        found[:, :count, :count] = self._squares
        with np.errstate(over="ignore", invalid="ignore"):
            for each, slope, rest in zip(found, self.slopes, left, strict=True):
                each[:count, count] = each[count, :count] = slope.T @ rest
                each[count, count] = rest @ rest
        return found

    def stepped(self, left: Array, step: Array) -> Array:
        """As `RunSlopes` says."""
        return np.asarray(left - self.slopes @ step)

    def columns(self) -> Array:
        """As `RunSlopes` says."""
        return self.slopes


@dataclass(frozen=True, eq=False)
class SummedSlopes:
    """Derivatives at one model and own numbers, of which a run gives sums."""

    prepared: RecordSet
    place: int
    own: OwnNumbers
    is_finite: bool = True

    @property
    def _asked(self) -> tuple[Array, list[int], NativeRecord, NativeOwn, str]:
        model, record = self.prepared.model, self.prepared.arrays[self.place]
        values, free = model.parameters.independent_values(), model.parameters.free_indices
        return values, free, record, self.own.native, self.prepared.hold

    def begun(self) -> tuple[Array, Array]:
        """Residuals of the run itself, and their products."""
        return self.prepared.model.native.slope_products(*self._asked, None)

    def products(self, left: Array) -> Array:
        """As `RunSlopes` says."""
        return self.prepared.model.native.slope_products(*self._asked, left)[1]

    def stepped(self, left: Array, step: Array) -> Array:
        """As `RunSlopes` says."""
        return self.prepared.model.native.slope_step(*self._asked, left, step)

    def columns(self) -> Array:
        """As `RunSlopes` says."""
        return run_with_slopes(self.prepared.model, self.prepared, None, self.place, self.own)[1]


def whitened(values: Array, filters: Sequence[Array] | None) -> Array:
    """Values or slopes (n_outputs, n_samples, …), through a filter each along the samples."""
    if filters is None:
        return values
    return np.stack(
        [filtered(f, [1.0], row, axis=0) for f, row in zip(filters, values, strict=True)]
    )


def residuals_of(
    prepared: RecordSet, runs_of: EquationRuns | None, place: int, own: OwnNumbers
) -> Array:
    """Measured less modelled outputs of one record, shape (n_outputs, n_samples)."""
    run, _ = run_with_slopes(prepared.model, prepared, runs_of, place, own, sloped=False)
    return prepared.arrays[place][1] - run


def begun_with_slopes(
    prepared: RecordSet,
    runs_of: EquationRuns | None,
    place: int,
    own: OwnNumbers,
    filters: Sequence[Array] | None,
) -> tuple[Array, Array, RunSlopes]:
    """Residuals of a record before any filter, products of columns with them, and derivatives."""
    measured = prepared.arrays[place][1]
    count = measured.size * (len(prepared.model.parameters.free) + own.n_free)
    if filters is None and runs_of is None and count > LONG:
        summed = SummedSlopes(prepared, place, own)
        left, products = summed.begun()
        # Squares that overflow are no word on what is squared.
        if np.all(np.isfinite(products)):
            return left, products, summed
    run, slopes = run_with_slopes(prepared.model, prepared, runs_of, place, own)
    left = measured - run
    formed = FormedSlopes(whitened(slopes, filters), len(prepared.model.parameters.free))
    return left, formed.products(whitened(left, filters)), formed

"""What a fit takes of the noise of each output, as its periodogram lacks it.

With orthonormal directions Q a fit leaves w - Q Qᵀ w of a noise w, whose mean periodogram lies
below that of w by 2 Re F(Ω q) F(q)* - F(q) Qᵀ Ω Q F(q)*, F the transform over an output's samples.
Of white noise first lags and slowest bins are asked alone, which are sums over the directions
themselves: transforms of all sensitivities would be most of the time, and of the memory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid._native import lags_of_form
from flightid.uncertainty.fitted_directions import FittedDirections, slow_transforms
from flightid.uncertainty.own_directions import spread
from flightid.uncertainty.periodograms import twice
from flightid.uncertainty.transformed_columns import of_both, powers_of, squares_of, transforms

Array = NDArray[np.float64]
T = TypeVar("T", bound=np.generic)
Known = dict[tuple[int, int], NDArray[T]]
"""By record and output."""


class ModelledNoise(Protocol):
    """A model of an output's noise."""

    @property
    def lags(self) -> Array:
        """Autocovariance at the first lags."""

    @property
    def is_white(self) -> bool:
        """Whether no sample tells of another."""

    def spectrum(self) -> Array:
        """At the bins of a real transform."""


class TakenNoise:
    """Directions of some records, and what they take of noise of some models.

    Parameters
    ----------
    taken : sequence of FittedDirections
        By record.
    length : int
        Of the transforms.
    n_lags, n_bins : int
        First lags and slowest bins that are asked of white noise.
    """

    def __init__(
        self, taken: Sequence[FittedDirections], length: int, n_lags: int, n_bins: int
    ) -> None:
        self._taken, self._length = taken, length
        self._n_lags, self._n_bins = n_lags, n_bins
        self._squares: Known[np.float64] = {}
        self._slow: Known[np.complex128] = {}
        self._transforms: Known[np.float64] = {}

    def forms(self, models: Sequence[ModelledNoise]) -> list[Array]:
        """Qᵀ Ω Q by record: of its own numbers and, of all records together, the shared ones."""
        found = []
        for k, each in enumerate(self._taken):
            count = each.own.shape[2] + each.shared.shape[2]
            answers = [
                spread(self._answer(k, o, model), each.places(o), count)
                for o, model in enumerate(models)
            ]
            found.append(np.sum(answers, axis=0))
        n_own = [each.own.shape[2] for each in self._taken]
        shared = sum(each[m:, m:] for each, m in zip(found, n_own, strict=True))
        for each, m in zip(found, n_own, strict=True):
            each[m:, m:] = shared
        return found

    def of_white(self, output: int, level: float, forms: Sequence[Array]) -> tuple[Array, Array]:
        """Autocovariance and power that white noise lost, summed over all samples.

        Parameters
        ----------
        output : int
        level : float
            Variance of its noise.
        forms : sequence of ndarray
            Of all models.

        Returns
        -------
        tuple of ndarray, shapes (n_lags,) and (n_bins,)
        """
        lags, power = np.zeros(self._n_lags), np.zeros(self._n_bins)
        for k, each in enumerate(forms):
            form = 2.0 * level * np.eye(len(each)) - each
            form = self._reaching(form, k, output)
            slow = _kept(self._slow, (k, output), self._slowest)
            lags += lags_of_form(*self._apart(k, output), form, self._n_lags)
            power += np.sum((slow @ form) * slow.conj(), axis=1).real
        return lags, power

    def at_all_bins(self, output: int, model: ModelledNoise, forms: Sequence[Array]) -> Array:
        """Power that noise lost at every bin, summed over all samples."""
        spectrum = model.spectrum()
        lost = np.zeros(len(spectrum))
        for k, each in enumerate(forms):
            part, n = self._transformed(k, output), self._taken[k].shared.shape[1]
            form = self._reaching(each, k, output)
            if model.is_white:
                lost += powers_of(2.0 * spectrum[0] * np.eye(len(part)) - form, part)
                continue
            shaped = part * of_both(spectrum)  # which ends with the record
            ended = scipy.fft.irfft(shaped.view(np.complex128), self._length)[:, :n]
            turned = scipy.fft.rfft(ended, self._length).view(np.float64)
            met = np.einsum("kb,kb->b", turned, part)
            lost += 2.0 * (met[::2] + met[1::2]) - powers_of(form, part)
        return lost

    def _reaching(self, form: Array, record: int, output: int) -> Array:
        """Of a form in all directions, the part of those that reach an output."""
        places = self._taken[record].places(output)
        return form if len(places) == len(form) else form[np.ix_(places, places)]

    def _answer(self, record: int, output: int, model: ModelledNoise) -> Array:
        if model.is_white:
            squares = _kept(self._squares, (record, output), self._squared)
            return np.asarray(model.lags[0] * squares)
        weights = of_both(twice(self._length) * model.spectrum() / self._length)
        return squares_of(self._transformed(record, output), weights)

    def _transformed(self, record: int, output: int) -> Array:
        return _kept(self._transforms, (record, output), self._transform)

    def _transform(self, record: int, output: int) -> Array:
        return transforms(self._together(record, output), self._length)

    def _slowest(self, record: int, output: int) -> NDArray[np.complex128]:
        parts = [
            slow_transforms(each, self._length, self._n_bins)
            for each in self._apart(record, output)
            if each.shape[1]
        ]
        return (
            np.concatenate(parts, axis=1) if parts else np.zeros((self._n_bins, 0), np.complex128)
        )

    def _squared(self, record: int, output: int) -> Array:
        return self._taken[record].squares(output)

    def _apart(self, record: int, output: int) -> tuple[Array, Array]:
        """Own and shared directions that reach an output, (n, n_own) and (n, n_shared)."""
        taken = self._taken[record]
        return taken.reaching.columns[output], taken.shared[output]

    def _together(self, record: int, output: int) -> Array:
        """Own and shared directions that reach an output side by side."""
        own, shared = self._apart(record, output)
        return np.asarray(np.concatenate([own, shared], axis=1)) if own.shape[1] else shared


def _kept(
    known: Known[T], place: tuple[int, int], make: Callable[[int, int], NDArray[T]]
) -> NDArray[T]:
    if place not in known:
        known[place] = make(*place)
    return known[place]

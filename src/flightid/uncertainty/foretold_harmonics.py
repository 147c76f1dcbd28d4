"""Whether inputs foretell residuals of a fit at harmonics; see `fitted_correlation`.

Harmonics of a long record are independent, so their noise is a spectrum and asks for no
autocovariance: a score of missing lags is UᵀS⁻¹e, with U the transforms of lagged inputs and S the
spectrum of what these leave of the residuals. What the fit has taken out of them is known (P), so
the score has the covariance UᵀS⁻¹(I − P)S(I − P)S⁻¹U. S is estimated: the form is compared with
Fisher's distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.fitted_correlation import (
    FittedCorrelation,
    chance_of_lags,
    judged_correlation,
)
from flightid.uncertainty.triangle import orthonormal

Array = NDArray[np.float64]
TERMS = 4
"""Most cosines of a spectrum's logarithm."""
HARMONICS_A_TERM = 10
"""Of all records, for each of them."""
ROUNDS = 12
"""Most steps towards the likeliest spectrum."""
FARTHEST = 2.0
"""Largest step of a term in one round."""
FEWEST = 4.0
"""Degrees of freedom of the spectrum, below which nothing is told."""
SMALLEST = 1e-6
"""Share of the largest product of inputs, below which a direction tells nothing."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class FittedHarmonics:
    """One record at its harmonics, weighed as it was fitted: real parts, then imaginary parts.

    Attributes
    ----------
    residual, weight : ndarray, shape (n_outputs, n_rows)
    slopes : ndarray, shape (n_outputs, n_rows, n)
        By the parameters, the record's own numbers taken out.
    own : ndarray, shape (n_outputs, n_rows, n_own)
        Orthonormal directions of these.
    lagged : ndarray, shape (n_inputs, n_lags, n_rows)
        Transforms of the inputs, not weighed.
    omega : ndarray, shape (n_rows / 2,)
        Frequencies, rad/s.
    """

    residual: Array
    weight: Array
    slopes: Array
    own: Array
    lagged: Array
    omega: Array


@dataclass(frozen=True, eq=False)
class HarmonicResponse:
    """How residuals of a fit at harmonics answer to noise.

    Attributes
    ----------
    records : sequence of FittedHarmonics
    lags : ndarray of int, shape (n_lags,)
        Samples by which inputs lead.
    """

    records: Sequence[FittedHarmonics]
    lags: NDArray[np.int64]

    def correlations(self) -> tuple[FittedCorrelation, ...]:
        """Of every input with every output; those that do not change are left out.

        Assumes
        -------
        Inputs without feedback from the residuals; noise whose spectrum is smooth, and independent
        between outputs.

        Reference
        ---------
        Ljung, *System Identification*, 2nd ed., section 16.6; Bloomfield (1973), Biometrika 60(2)
        (spectra by their logarithm's cosines); Brockwell & Davis, *Time Series: Theory and
        Methods*, 2nd ed., section 10.3 (independence of harmonics).
        """
        n_inputs, n_outputs = len(self.records[0].lagged), len(self.records[0].residual)
        moving = [
            j for j in range(n_inputs) if any(np.any(each.lagged[j]) for each in self.records)
        ]
        if not moving:
            return ()
        spectra = [self._spectrum(output, moving) for output in range(n_outputs)]
        found: list[FittedCorrelation] = []
        for output, (_, freedom) in enumerate(spectra):
            if freedom < FEWEST:
                continue
            for j in moving:
                found += self._tested(output, j, [each for each, _ in spectra], freedom)
        return tuple(found)

    def _tested(
        self, output: int, j: int, spectra: Sequence[Array], freedom: float
    ) -> list[FittedCorrelation]:
        residual, weight = self._of("residual", output), self._of("weight", output)
        lagged = self._lagged(j)
        sharp = lagged * (weight / spectra[output])[:, None]
        blunt = lagged / weight[:, None]
        squares = np.sum(sharp**2 * spectra[output][:, None], axis=0)
        score, covariance = sharp.T @ residual, self._covariance(output, sharp, spectra)
        chance = chance_of_lags(score, covariance, squares, freedom)
        return judged_correlation(
            (output, j),
            (self.lags, chance),
            blunt.T @ residual,
            self._covariance(output, blunt, spectra),
            lagged.T @ lagged,
            float(np.sum((residual / weight) ** 2)),
        )

    def _covariance(self, output: int, columns: Array, spectra: Sequence[Array]) -> Array:
        """Of products of columns with the residual of one output."""
        own, shared = self._taken[output]
        on_own, on_shared = own.T @ columns, shared.T @ columns
        total = np.zeros((columns.shape[1], columns.shape[1]))
        for place, (basis, slopes) in enumerate(self._taken):
            left = -(basis @ on_own + slopes @ on_shared)
            if place == output:
                left += columns
            total += left.T @ (left * spectra[place][:, None])
        return total

    def _spectrum(self, output: int, moving: Sequence[int]) -> tuple[Array, float]:
        """Power of the weighed residual at each row without what inputs foretell, and freedom."""
        residual, weight = self._of("residual", output), self._of("weight", output)
        whole = np.concatenate([self._lagged(j) for j in moving], axis=1) * weight[:, None]
        own, shared = self._taken[output]
        whole -= own @ (own.T @ whole) + shared @ (shared.T @ whole)
        size = np.sqrt(np.maximum(np.sum(whole**2, axis=0), TINY))
        values, axes = np.linalg.eigh((whole / size).T @ (whole / size))
        kept = values > SMALLEST * max(float(values[-1]), TINY)
        # No more than a quarter of what is measured may explain it.
        kept[: max(len(values) - len(residual) // 4, 0)] = False
        along = (whole / size) @ (axes[:, kept] / np.sqrt(values[kept]))
        left = residual - along @ (along.T @ residual)
        leverage = np.sum(along**2, axis=1) + np.sum(own**2, axis=1) + np.sum(shared**2, axis=1)
        free = len(residual) - float(np.sum(leverage))
        power, places = self._powers(left**2 / np.maximum(1.0 - leverage, 0.1))
        level, terms = self._smooth(power, places)
        return level, free - terms

    def _powers(self, squares: Array) -> tuple[Array, Array]:
        """Mean of both parts of each harmonic, and its place from 0 to 1 in the band."""
        sizes = [2 * each.omega.size for each in self.records]
        parts = np.split(squares, np.cumsum(sizes)[:-1])
        omega = np.concatenate([each.omega for each in self.records])
        low, high = float(omega.min()), float(omega.max())
        power = np.concatenate([part.reshape(2, -1).mean(axis=0) for part in parts])
        return power, (omega - low) / max(high - low, TINY)

    def _smooth(self, power: Array, places: Array) -> tuple[Array, int]:
        """Spectrum at each row, of a level for each record, and how many numbers tell it."""
        terms = min(TERMS, power.size // HARMONICS_A_TERM)
        smooth = log_cosine_spectrum(power, places, terms)
        ends = np.cumsum([each.omega.size for each in self.records])[:-1]
        rows = []
        for part, whole in zip(np.split(smooth, ends), np.split(power, ends), strict=True):
            rows.append(np.tile(part * max(float(np.mean(whole / part)), TINY), 2))
        return np.concatenate(rows), terms + len(rows)

    def _of(self, name: str, output: int) -> Array:
        return np.concatenate([getattr(each, name)[output] for each in self.records])

    def _lagged(self, j: int) -> Array:
        return np.concatenate([each.lagged[j].T for each in self.records])

    @cached_property
    def _taken(self) -> list[tuple[Array, Array]]:
        """Of each output, what the fit has taken out: own numbers by record, then parameters."""
        n_own = [each.own.shape[2] for each in self.records]
        n_rows = [each.residual.shape[1] for each in self.records]
        n_outputs = len(self.records[0].residual)
        slopes = np.concatenate([each.slopes for each in self.records], axis=1)
        flat = slopes.reshape(slopes.shape[0] * slopes.shape[1], slopes.shape[2])
        shared = (orthonormal(flat)[0] if flat.size else flat).reshape(slopes.shape)
        own = np.zeros((n_outputs, sum(n_rows), sum(n_own)))
        row = column = 0
        for each, rows, columns in zip(self.records, n_rows, n_own, strict=True):
            own[:, row : row + rows, column : column + columns] = each.own
            row, column = row + rows, column + columns
        return [(own[output], shared[output]) for output in range(n_outputs)]


def log_cosine_spectrum(power: Array, places: Array, terms: int) -> Array:
    """Spectrum whose logarithm is a sum of cosines, by the likelihood of its periodogram.

    Parameters
    ----------
    power : ndarray, shape (n,)
        At independent harmonics, each about the spectrum by an exponential distribution.
    places : ndarray, shape (n,)
        0 to 1.
    terms : int
        Cosines beside the constant.

    Reference
    ---------
    Bloomfield (1973), Biometrika 60(2), 217-226.

    Example
    -------
    >>> place = np.linspace(0.0, 1.0, 4000)
    >>> steep = np.exp(3.0 * np.cos(np.pi * place))
    >>> power = steep * np.random.default_rng(0).exponential(size=4000)
    >>> bool(np.max(np.abs(log_cosine_spectrum(power, place, 2) / steep - 1.0)) < 0.15)
    True
    """
    basis = np.cos(np.pi * np.multiply.outer(places, np.arange(terms + 1)))
    floor = max(float(np.mean(power)), TINY) * 1e-12
    # The mean of the logarithm of an exponential variable lies Euler's constant below.
    logs = np.log(np.maximum(power, floor)) + np.euler_gamma
    found = np.linalg.lstsq(basis, logs)[0]
    for _ in range(ROUNDS):
        ratio = power / np.exp(basis @ found)
        step = np.linalg.lstsq(basis, ratio - 1.0)[0]
        found = found + np.clip(step, -FARTHEST, FARTHEST)
        if np.max(np.abs(step)) < 1e-3:
            break
    return np.asarray(np.maximum(np.exp(basis @ found), floor))

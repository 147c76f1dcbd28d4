"""Whether inputs foretell the residuals of a fit, which has taken out what its parameters could.

Least squares leave residuals that are orthogonal to the sensitivities, whatever the noise: their
correlations with an input lie below what independent series give, and coloured noise that the fit
follows comes back turned. With U the input at neighbouring lags, P the projection of the fit and Ω
the noise's covariance, the correlations Uᵀe have the covariance Uᵀ(I − P) Ω (I − P)ᵀU. Slow noise
hides what quick inputs foretell: it is told by Ω⁻¹U in place of U, the score of missing lags.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.blocks import RecordBlock, levels
from flightid.uncertainty.lagged_inputs import LaggedInputs
from flightid.uncertainty.residual_noise import Autoregression

Array = NDArray[np.float64]
LAGS = 25
"""Most lags of a test."""
FIRST, SHARE_OF_FIRST = 4, 0.5
"""Lags at which a short lag that a model lacks shows, and their part of the false alarms.

Among 26 lags it is lost: of 10 ms at 50 Hz beside a tenth of noise 10 of 400 flights went unseen,
and 2 do.
"""
SMALLEST = 1e-3
"""Directions of lags with a smaller share of the largest variance carry no evidence."""


@dataclass(frozen=True, eq=False)
class FittedCorrelation:
    """Correlations of one input with the residual of one output of a fit.

    Attributes
    ----------
    output, input : int
        Places.
    lags : ndarray of int, shape (n_lags,)
        Samples by which the input leads.
    values, errors : ndarray, shape (n_lags,)
        Normalised correlations, and their standard errors for a model that lacks nothing.
    statistic : float
        Quadratic form in the inverse of their covariance.
    degrees : int
    p_value : float
        Of that form, and of the one of the `FIRST` lags alone, together.
    share : float
        Of the residual's power that these lags foretell, less what chance gives; 0 to 1.
    """

    output: int
    input: int
    lags: NDArray[np.int64]
    values: Array
    errors: Array
    statistic: float
    degrees: int
    p_value: float
    share: float


@dataclass(frozen=True, eq=False)
class FitResponse:
    """How residuals of a fit answer to noise.

    Attributes
    ----------
    blocks : sequence of RecordBlock
    models : sequence of Autoregression
        Noise of each output.
    answers : sequence of ndarray, shape (m + n, m + n)
        XᵀΩX of each record, X its own numbers' basis and the projected sensitivities.
    gain : ndarray, shape (n, n)
        From scores to changes of the shared parameters.
    beside : ndarray, shape (n, n)
        Covariance of the scores that other data brought.
    """

    blocks: Sequence[RecordBlock]
    models: Sequence[Autoregression]
    answers: Sequence[Array]
    gain: Array
    beside: Array

    def correlations(self, inputs: Sequence[Array]) -> tuple[FittedCorrelation, ...]:
        """Of every input with every output; those that do not change are left out.

        Parameters
        ----------
        inputs : sequence of ndarray, shape (n_inputs, n_samples)
            By record.

        Assumes
        -------
        Inputs without feedback from the residuals.

        Reference
        ---------
        Ljung, *System Identification*, 2nd ed., section 16.6; Box & Pierce (1970), J. American
        Statistical Association 65, for what estimated parameters take out.
        """
        shortest = min(block.residual.shape[1] for block in self.blocks)
        lags = np.arange(min(LAGS, shortest // 4) + 1)
        moving = [j for j in range(len(inputs[0])) if any(np.ptp(each[j]) > 0.0 for each in inputs)]
        if not moving or lags.size < 2:
            return ()
        coloured = not all(noise.is_white for noise in self.models)
        lagged = [
            LaggedInputs(u[moving] - u[moving].mean(axis=1, keepdims=True), lags.size, coloured)
            for u in inputs
        ]
        squares = [u.squares for u in lagged]
        plain, found = np.asarray(sum(squares)), []
        everywhere = [
            [_heard(block, output) for output in range(len(self.models))] for block in self.blocks
        ]
        met_everywhere = [_met(*pair) for pair in zip(lagged, everywhere, strict=True)]
        for output, noise in enumerate(self.models):
            heard = [each[output] for each in everywhere]
            met = [
                _of_all(each[output], block, output)
                for block, each in zip(self.blocks, met_everywhere, strict=True)
            ]
            scale = np.diag(plain)
            if noise.is_white:
                raw, covariance = score = self._of_output(output, met, squares)
            else:
                columns = [u.columns for u in lagged]
                raw, covariance = self._of_output(output, met, squares, columns)
                sharp = [noise.unshaped(u) for u in columns]
                met = [
                    _of_all(np.concatenate([x.T @ u for x in parts]), block, output)
                    for block, parts, u in zip(self.blocks, heard, sharp, strict=True)
                ]
                own = [u.T @ u for u in sharp]
                score = self._of_output(output, met, own, sharp)
                scale = np.diag(np.asarray(sum(own)))
            power = sum(float(block.power[output]) for block in self.blocks)
            for place, j in enumerate(moving):
                span = slice(place * lags.size, (place + 1) * lags.size)
                chance = chance_of_lags(score[0][span], score[1][span, span], scale[span])
                found += judged_correlation(
                    (output, j),
                    (lags, chance),
                    raw[span],
                    covariance[span, span],
                    plain[span, span],
                    power,
                )
        return tuple(found)

    def _of_output(
        self,
        output: int,
        met: Sequence[Array],
        squares: Sequence[Array],
        columns: Sequence[Array] = (),
    ) -> tuple[Array, Array]:
        """Uᵀe and its covariance; by record `met` is [X, e]ᵀU, `squares` UᵀU, `columns` U.

        White noise does not ask for U itself.
        """
        n = len(self.gain)
        raw = sum(each[-1] for each in met)
        through = self.gain.T @ sum(each[len(each) - 1 - n : -1] for each in met)
        covariance = through.T @ self.beside @ through
        noise = self.models[output]
        level = levels(self.blocks)[:, output]
        for place, (own, square, answer) in enumerate(zip(met, squares, self.answers, strict=True)):
            taken = np.vstack([own[: len(own) - 1 - n], through])
            if not noise.is_white:
                u, parts = columns[place], self.blocks[place].of_output(output)
                whole = noise.squared(np.concatenate([u.T, *(x.T for x in parts)]).T)
                k = u.shape[1]
                reaching = self.blocks[place].own.within(output, n)
                heard, cross = whole[:k, :k], whole[:k, k:] @ taken[reaching]
            else:
                heard, cross = noise.lags[0] * square, noise.lags[0] * (own[:-1].T @ taken)
            around = level[place] * (heard - cross - cross.T)
            covariance = covariance + around + taken.T @ answer @ taken
        return np.asarray(raw), np.asarray(covariance)


def judged_correlation(
    places: tuple[int, int],
    tested: tuple[NDArray[np.int64], tuple[float, int, float] | None],
    raw: Array,
    covariance: Array,
    plain: Array,
    power: float,
) -> list[FittedCorrelation]:
    """One input with one output, from their products and these products' covariance.

    Parameters
    ----------
    places : tuple of int
        Of output and input.
    tested : tuple
        Lags, and what `chance_of_lags` says of them; none where that is None.
    raw : ndarray, shape (n_lags,)
        Products of the input at these lags with the residual.
    covariance, plain : ndarray, shape (n_lags, n_lags)
        Of these products by chance, and products of the lagged inputs with themselves.
    power : float
        Sum of squares of the residual.
    """
    lags, score = tested
    if score is None or not power > 0.0:
        return []
    statistic, degrees, p_value = score
    size = np.sqrt(np.maximum(np.diag(plain), np.finfo(float).tiny))
    sizes, turned = np.linalg.eigh(plain / np.outer(size, size))
    sound = sizes > SMALLEST * sizes[-1]
    seen = (turned[:, sound].T @ (raw / size)) ** 2
    by_chance = np.sum(
        turned[:, sound] * (covariance / np.outer(size, size) @ turned[:, sound]), axis=0
    )
    share = float(np.sum((seen - by_chance) / sizes[sound])) / power
    scale = size[0] * np.sqrt(power)
    return [
        FittedCorrelation(
            *places,
            lags,
            raw / scale,
            np.sqrt(np.maximum(np.diag(covariance), 0.0)) / scale,
            statistic,
            degrees,
            p_value,
            min(max(share, 0.0), 1.0),
        )
    ]


def _heard(block: RecordBlock, output: int) -> list[Array]:
    """Columns of one output: own numbers that reach it, sensitivities, residual."""
    return [x for x in (*block.of_output(output), block.residual[output][:, None]) if x.size]


def _of_all(met: Array, block: RecordBlock, output: int) -> Array:
    """[X, e]ᵀU with rows of zeros for own numbers that do not reach the output."""
    places = block.own.within(output, block.projected.shape[1], 1)
    whole = np.zeros((block.own.count + block.projected.shape[1] + 1, met.shape[1]))
    whole[places] = met
    return whole


def _met(inputs: LaggedInputs, everywhere: Sequence[Sequence[Array]]) -> list[Array]:
    """[X, e]ᵀU of each output: the lags of the inputs are laid out once for all."""
    found = iter(inputs.products([x for parts in everywhere for x in parts]))
    return [np.concatenate([next(found) for _ in parts]) for parts in everywhere]


def chance_of_lags(
    raw: Array, covariance: Array, squares: Array, freedom: float = np.inf
) -> tuple[float, int, float] | None:
    """Form and degrees of all lags, and the chance of these and of the first ones together.

    Bonferroni's rule with parts: chances over their parts are right together. `freedom` are
    degrees of freedom of a noise level that was estimated beside.
    """
    whole = _quadratic(raw, covariance, squares)
    if whole is None:
        return None
    first = _quadratic(raw[:FIRST], covariance[:FIRST, :FIRST], squares[:FIRST])
    chances = [_beyond(*whole, freedom) / (1.0 - SHARE_OF_FIRST)]
    if first is not None:
        chances.append(_beyond(*first, freedom) / SHARE_OF_FIRST)
    return (*whole, min(*chances, 1.0))


def _beyond(form: float, degrees: int, freedom: float) -> float:
    if np.isinf(freedom):
        return float(scipy.special.chdtrc(degrees, form))
    return float(scipy.special.fdtrc(degrees, freedom, form / degrees))


def _quadratic(raw: Array, covariance: Array, squares: Array) -> tuple[float, int] | None:
    """Form in the inverse of a covariance, and its degrees; None where nothing can be told."""
    size = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
    if not np.all(np.isfinite(covariance)):
        return None
    spread, axes = np.linalg.eigh(covariance / np.outer(size, size))
    kept = spread > SMALLEST * spread[-1]
    if not spread[-1] > 0.0:
        return None
    along = axes[:, kept].T @ (raw / size)
    return float(np.sum(along**2 / spread[kept])), int(np.count_nonzero(kept))

"""Covariance of least-squares estimates whose residuals are coloured: one for all methods.

The usual inverse information assumes white residuals. Residuals of flight data are not: sensors,
filters and what the model lacks colour them. The noise of each whitened output gets a model
(`residual_noise.py`), whose autocovariance R stands between the sensitivities s and the inverse D
of the information: ``D [sum_ij s_i R(i - j) s_j'] D``. Numbers that belong to one record (initial
states, biases) are taken out of the sensitivities by orthogonal projection, so that the parameters
that all records share meet in one small matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.frozen import dataclass
from flightid.uncertainty.agreement import Agreement, AgreementTest, compare_parts
from flightid.uncertainty.blocks import (
    JointResiduals,
    RecordBlock,
    directions_taken,
    flights_of,
    freedom_of,
    joined,
    noise_heard,
    rest_of,
)
from flightid.uncertainty.fitted_correlation import FitResponse, FittedCorrelation
from flightid.uncertainty.input_noise import InputNoise
from flightid.uncertainty.input_walks import gradients_of_walks, left_of_walks
from flightid.uncertainty.residual_colour import Colour
from flightid.uncertainty.residual_noise import (
    Autoregression,
    noise_models,
)
from flightid.uncertainty.restricted_drift import with_drifts
from flightid.uncertainty.triangle import triangle_of_rows
from flightid.uncertainty.unequal_noise import (
    Innovations,
    unequal_outputs,
    widened_by,
    with_excess,
)

Array = NDArray[np.float64]
ROUNDING = 1e-9
"""Share of the variance for white residuals below which there is rounding alone."""
BLIND = 1e-12
"""Effect of a combination of parameters over the largest, below which its bar is rounding."""


@dataclass(frozen=True, eq=False)
class ResidualCovariance:
    """What is known of estimates whose residuals are coloured.

    Attributes
    ----------
    covariance, white : ndarray, shape (n, n)
        Of the shared parameters, for residuals of the colour found, or the scatter between parts
        where they disagree; and for white residuals.
    freedom : ndarray, shape (n,)
        Degrees of freedom of each variance: noise models are themselves estimates.
    own, crossed : tuple of ndarray
        By record, shapes (n_own, n_own) and (n_own, n): of each record's own numbers, and between
        these and the parameters.
    orders : tuple of int
        Of the outputs' noise models.
    agreement : Agreement
        Of records, and of halves of each.
    correlations : tuple of FittedCorrelation
        Of inputs with residuals, where inputs were given.
    growth : ndarray, shape (n,), or None
        Standard errors over those of noise of one power throughout, where it grows with the signal.
    """

    covariance: Array
    white: Array
    freedom: Array
    own: tuple[Array, ...]
    crossed: tuple[Array, ...]
    orders: tuple[int, ...]
    agreement: Agreement
    correlations: tuple[FittedCorrelation, ...] = ()
    growth: Array | None = None

    @property
    def ratios(self) -> Array:
        """Standard errors by colour over those for white residuals, shape (n,)."""
        by_colour = self.agreement.by_noise / (1.0 if self.growth is None else self.growth)
        return np.asarray(by_colour / np.sqrt(np.diag(self.white)))

    @property
    def colour(self) -> Colour:
        """Smallest and largest of `ratios`, and the largest growth; one without parameters."""
        return self.colour_of(len(self.white))

    def colour_of(self, count: int) -> Colour:
        """The same of the first parameters alone."""
        if not count:
            return Colour()
        ratios = self.ratios[:count]
        growth = 1.0 if self.growth is None else float(np.max(self.growth[:count]))
        return Colour(float(np.min(ratios)), float(np.max(ratios)), growth)

    @property
    def assumed(self) -> str:
        """What the covariance assumes, in words."""
        orders = ", ".join(map(str, self.orders))
        return f"autoregressive noise of each whitened output, order {orders}"


def residual_covariance(
    blocks: Sequence[RecordBlock],
    beside: JointResiduals | None = None,
    noise: tuple[InputNoise, Array] | None = None,
    inputs: Sequence[Array] | None = None,
    *,
    coloured: bool = True,
    drifts: bool = True,
    overwrite: bool = False,
    triangle: Array | None = None,
    asked: int | None = None,
) -> ResidualCovariance:
    """Covariance of estimates by the colour of their residuals.

    Parameters
    ----------
    blocks : sequence of RecordBlock
        By record.
    beside : JointResiduals, optional
        Residuals beside the records.
    noise : tuple of InputNoise and ndarray (n_outputs,), optional
        Noise of the inputs, which reaches the outputs as random walks, and what whitens the
        outputs; of one record alone.
    inputs : sequence of ndarray, shape (n_inputs, n_samples), optional
        By record: tested for what they foretell of the residuals.
    coloured : bool
        False takes residuals for white, of the power that they have.
    drifts : bool
        Whether drift may be in the residuals that the fit has bent out of sight.
    overwrite : bool
        Whether the sensitivities of the blocks may be lost, which saves as much memory again.
    triangle : ndarray, shape (n, n), optional
        `triangle_of` these blocks and what is beside them, where it is known.
    asked : int, optional
        First parameters that the noise may grow with: variances of a filter move what they measure.

    Returns
    -------
    ResidualCovariance
        Positive and finite, whatever the residuals are.

    Assumes
    -------
    Noise of each whitened output that is of one colour in all records, though not of one level, and
    independent of the others'. Where its power goes with what tells the parameters, scores are
    summed with the power of each sample: see `flightid.uncertainty.unequal_noise`.

    Reference
    ---------
    Morelli & Klein (1997), Accuracy of aerodynamic model parameters estimated from flight test
    data, J. Guidance, Control and Dynamics 20(1), eqs. 19-25; Satterthwaite (1946), An approximate
    distribution of estimates of variance components, Biometrics Bulletin 2(6), eq. 17; the
    elimination: Golub & Pereyra (1973), SIAM J. Numerical Analysis 10.

    Example
    -------
    >>> residual = np.random.default_rng(1).standard_normal((1, 400))
    >>> block = RecordBlock.of(np.ones((1, 400, 1)), np.ones((1, 400, 0)), residual)
    >>> found = residual_covariance([block])
    >>> round(float(found.white[0, 0]), 4)
    0.0025
    """
    if triangle is None:
        triangle = triangle_of(blocks, None if beside is None else beside.slopes)
    root = _inverse_root(triangle)
    # In directions of unit information squares keep their digits, however nearly singular it is.
    alone = len(blocks) == 1 and beside is None
    whitened = [block.along(root, overwrite=overwrite, alone=alone) for block in blocks]
    slopes = None if beside is None else beside.along(root)
    inner = _gain(slopes, whitened)
    half = root @ inner
    turned = half @ root.T
    taken = directions_taken(whitened)
    walks = None if noise is None else left_of_walks(taken[0], *noise)
    errors = [block.residual for block in blocks]
    seen = noise_models(errors, taken, walks) if coloured else _white_models(errors)
    models = with_drifts(seen, errors, taken) if coloured and drifts and noise is None else seen
    apart = noise_heard(models, whitened)
    # Drift that a fit has bent out of sight is in estimates, not in residuals: these are asked as
    # they show.
    shown = apart if seen is models else noise_heard(seen, whitened)
    # Of random walks beside the noise, innovations have no one power to be held against.
    unequal = unequal_outputs(seen, whitened, half[:asked]) if coloured and noise is None else {}
    even = apart
    if unequal:
        apart, shown = (with_excess(each, seen, whitened, unequal) for each in (apart, shown))
    answers = [joined(each, block) for each, block in zip(apart, blocks, strict=True)]
    sizes = [block.basis.shape[1] for block in blocks]
    variances = half @ _of_shared(answers, sizes) @ half.T
    shared = np.asarray(variances.sum(axis=0))
    if slopes is not None:
        brought = slopes.slopes @ half.T
        shared = shared + brought.T @ brought
    if noise is not None:
        brought = gradients_of_walks(whitened[0], *noise) @ half.T
        shared = shared + brought.T @ brought
    growth = None
    if unequal:
        plainly = [joined(each, block) for each, block in zip(even, blocks, strict=True)]
        less = variances - half @ _of_shared(plainly, sizes) @ half.T
        shared, growth = widened_by(shared - less.sum(axis=0), shared)
    own, crossed = _own_numbers(blocks, answers, half, shared)
    white = np.asarray(root @ root.T) if blocks[0].answering is None else half @ half.T
    freedom = freedom_of(
        shared, variances, models, whitened, half, None if slopes is None else slopes.levels
    )
    if slopes is not None and slopes.levels is not None:
        shared = shared + half @ slopes.levels.added(np.eye(len(half))) @ half.T
    # Random walks from noise of inputs join whatever parts a record is cut into.
    compared = []
    if noise is None:
        compared = [flight.along(triangle) for flight in flights_of(apart, whitened)]
    rest = rest_of(compared, beside)
    tested = () if inputs is None else _tested(whitened, seen, shown, inner, slopes, inputs)
    agreed = compare_parts(compared, turned, _lifted(shared, white), freedom, rest)
    return ResidualCovariance(
        agreed.covariance,
        white,
        agreed.freedom,
        tuple(own),
        tuple(crossed),
        tuple(model.order for model in models),
        agreed.agreement,
        tested,
        growth,
    )


def _own_numbers(
    blocks: Sequence[RecordBlock], answers: Sequence[Array], half: Array, shared: Array
) -> tuple[list[Array], list[Array]]:
    """Covariances of each record's own numbers, and between these and the parameters."""
    own, crossed = [], []
    for block, each in zip(blocks, answers, strict=True):
        # Own numbers answer the record's own noise and, through the parameters, everybody's.
        m, heard_here = block.basis.shape[1], each.sum(axis=0)
        back = np.linalg.inv(block.triangle)
        through = back @ block.shared_on_own
        gain = np.vstack([np.zeros((m, len(half))), half.T])
        direct = np.vstack([back.T, -half.T @ through.T])
        others = shared - gain.T @ heard_here @ gain
        found = direct.T @ heard_here @ direct + through @ others @ through.T
        own.append(_lifted(found, back @ back.T))
        crossed.append(direct.T @ heard_here @ gain - through @ others)
    return own, crossed


def _of_shared(answers: Sequence[Array], sizes: Sequence[int]) -> Array:
    """By output, what the shared parameters hear of all records, shape (n_outputs, n, n)."""
    return np.asarray(sum(each[:, m:, m:] for each, m in zip(answers, sizes, strict=True)))


def _tested(
    blocks: Sequence[RecordBlock],
    models: Sequence[Autoregression],
    shown: Sequence[Array],
    gain: Array,
    beside: JointResiduals | None,
    inputs: Sequence[Array],
) -> tuple[FittedCorrelation, ...]:
    brought = np.zeros_like(gain) if beside is None else beside.slopes.T @ beside.slopes
    whole = [joined(each, block).sum(axis=0) for each, block in zip(shown, blocks, strict=True)]
    return FitResponse(blocks, models, whole, gain, brought).correlations(inputs)


def white_covariance(
    blocks: Sequence[RecordBlock], covariance: Array, freedom: float, *, grown: bool = False
) -> AgreementTest:
    """Covariance of estimates whose errors their own noise model whitens, parts compared.

    Parameters
    ----------
    blocks : sequence of RecordBlock
        By record.
    covariance : ndarray, shape (n, n)
        By white errors.
    freedom : float
        Degrees of freedom of their variance.
    grown : bool
        Whether errors that grow with the signal make it longer.

    Reference
    ---------
    See `flightid.uncertainty.agreement.compare_parts` and `flightid.uncertainty.unequal_noise`.
    """
    triangle = triangle_of(blocks)
    root = _inverse_root(triangle)
    degrees = np.full(len(covariance), freedom)
    models = _white_models([each.residual for each in blocks])
    unequal: dict[int, list[Innovations]] = {}
    if grown:
        whitened = [block.along(root) for block in blocks]
        unequal = unequal_outputs(models, whitened, root)
    if not unequal:
        flights = flights_of(noise_heard(models, blocks), blocks)
        return compare_parts(flights, root @ root.T, covariance, degrees)
    even = noise_heard(models, whitened)
    apart = with_excess(even, models, whitened, unequal)
    sizes = [block.basis.shape[1] for block in blocks]
    more = [joined(a - e, b) for a, e, b in zip(apart, even, whitened, strict=True)]
    beyond = root @ _of_shared(more, sizes).sum(axis=0) @ root.T
    wider, growth = widened_by(covariance, covariance + beyond)
    flights = [flight.along(triangle) for flight in flights_of(apart, whitened)]
    return replace(compare_parts(flights, root @ root.T, wider, degrees), growth=growth)


def _white_models(errors: Sequence[Array]) -> list[Autoregression]:
    """By output, the mean power of its residuals."""
    total = sum(each.shape[1] for each in errors)
    power = np.sum([np.sum(each**2, axis=1) for each in errors], axis=0) / total
    return [Autoregression(np.array([level]), np.empty(0), total, 0) for level in power]


def triangle_of(blocks: Sequence[RecordBlock], beside: Array | None = None) -> Array:
    """Triangle of the sensitivities of all records, and of what is fitted beside them."""
    parts = [triangle_of_rows(block.projected) for block in blocks]
    if beside is not None:
        parts.append(beside)
    return np.asarray(np.linalg.qr(np.vstack(parts), mode="r"))


def _inverse_root(triangle: Array) -> Array:
    """R⁻¹ of a triangle: R⁻¹R⁻ᵀ is the covariance for white residuals of unit variance."""
    size = np.linalg.norm(triangle, axis=0)
    if not np.all((size > 0.0) & (size < np.inf)):
        raise FitError(
            "the data do not see every parameter",
            found=f"{int(np.sum(~((size > 0.0) & (size < np.inf))))} without a finite effect",
            needed="residuals that answer to each",
            action="lower the orders, or look for outliers and unlike scales in the records",
        )
    sizes = np.linalg.svd(triangle / size, compute_uv=False)
    blind = int(np.sum(sizes <= BLIND * sizes.max(initial=0.0)))
    if blind:
        raise FitError(
            "the data cannot tell parameters apart",
            found=f"{blind} combinations without effect beyond rounding",
            needed="residuals that answer to each by itself",
            action="lower the orders, or leave out a channel that repeats another",
        )
    return np.asarray(np.linalg.inv(np.triu(triangle / size)) / size[:, None])


def _gain(beside: JointResiduals | None, blocks: Sequence[RecordBlock]) -> Array:
    """What turns a gradient into a change of the estimates, in directions of unit information.

    Where data follow the parameters, the equations that the estimates solve bend less than the
    cost does, and the gain is larger than the inverse of the information.
    """
    answering = [each.answering for each in blocks if each.answering is not None]
    if answering:
        pairs = zip(blocks, answering, strict=True)
        return np.linalg.inv(np.sum([each.projected.T @ slopes for each, slopes in pairs], axis=0))
    (count,) = {block.projected.shape[1] for block in blocks}
    if beside is None:
        return np.eye(count)
    follows = beside.slopes.T @ (beside.slopes - beside.total)
    return np.asarray(np.linalg.inv(np.eye(count) - follows), dtype=np.float64)


def _lifted(covariance: Array, plain: Array) -> Array:
    """Of data without noise, rounding alone is left, and that may be negative.

    Where data hardly tell parameters apart, rounding leaves the two triangles unlike.
    """
    lift = np.maximum(ROUNDING * np.diag(plain) - np.diag(covariance), 0.0)
    lifted = np.asarray(0.5 * (covariance + covariance.T) + np.diag(lift))
    size = np.sqrt(np.diag(lifted))
    if not size.size or not np.all(size > 0.0):
        return lifted
    own, axes = np.linalg.eigh(lifted / np.outer(size, size))
    least = len(size) * np.finfo(float).eps * own[-1]
    if own[0] >= least:
        return lifted
    root = size[:, None] * axes * np.sqrt(np.maximum(own, 2.0 * least))
    return np.asarray(root @ root.T)

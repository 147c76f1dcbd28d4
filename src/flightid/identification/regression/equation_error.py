"""Equation error: least squares on the equations of motion themselves, in time or frequency.

Every state is measured; both sides of ẋ = f(x, u, θ) are compared, through a local derivative with
its own mean, or as Fourier integrals over the record. Where parameters enter linearly one step
solves it, from any start.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import OptionError
from flightid.identification.fit import Fit
from flightid.identification.frequency_domain.estimates import APART
from flightid.identification.regression.attenuation import (
    attenuation,
    judge_attenuation,
    noise_energy,
)
from flightid.identification.regression.compared_equations import compared_costs, compared_records
from flightid.identification.regression.equation_operators import FourierRows, LocalMeans, Operator
from flightid.identification.regression.equation_regression import EquationRegression
from flightid.identification.regression.fit import (
    Inner,
    Knowledge,
    assemble,
    check_records,
    known_by_spectra,
    limits_of,
    require_seen,
)
from flightid.identification.regression.foretold_rows import (
    DrivenHarmonics,
    leading,
    of_centres,
)
from flightid.identification.regression.options import (
    EquationErrorOptions,
    FourierOptions,
    RegressionOptions,
)
from flightid.identification.regression.right_side import RightSide
from flightid.identification.regression.rounds import (
    SearchBounds,
    SettledRounds,
    settle,
    stack,
    stepped,
)
from flightid.identification.regression.sampled_equations import (
    Reconstruction,
    StateMeasurements,
)
from flightid.identification.regression.weights import (
    level_weights,
    spectral_weights,
)
from flightid.identification.rival_fits import judged
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.record import Record
from flightid.record.several import as_records
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import residual_covariance

Array = NDArray[np.float64]


def fit_equation_error(
    model: StateSpaceModel, data: Record | Sequence[Record], options: EquationErrorOptions
) -> Fit:
    """Fit by least squares on state derivatives; see `flightid.identify`."""

    def operator(motion: StateMeasurements) -> Operator:
        return LocalMeans(motion, options.half_width, options.output_bias)

    problem, start, limits = _problem(model, data, options, operator)
    count = len(problem.motions)
    settled = settle(problem, start, level_weights, limits, count)
    inner = Inner.of(model, settled.end.x)
    weighed = [
        (rows.residuals * weight, rows.slopes[:, :, inner.mask] * weight[:, :, None])
        for rows, weight in zip(settled.rows, settled.weights, strict=True)
    ]
    action = f"{APART}; output_bias=False where equations have constants of their own"
    require_seen(inner, stack([slopes for _, slopes in weighed]), action)
    constants = [_constants(each[0].shape, options.output_bias) for each in weighed]
    width, pairs = options.half_width, zip(problem.motions, weighed, strict=True)
    inputs = [leading(motion.inputs, width, each.shape[1]) for motion, (each, _) in pairs]
    coloured = residual_covariance(
        [_block(*each, basis) for each, basis in zip(weighed, constants, strict=True)],
        inputs=inputs if judged() else None,
    )
    jacobian = stack([slopes for _, slopes in weighed])
    known = Knowledge(
        jacobian,
        coloured.covariance,
        coloured.freedom,
        "coloured residuals",
        coloured.colour,
        coloured.agreement,
        of_centres(coloured.correlations, width),
    )
    return _finish("equation error", problem, data, options, settled, limits, inner, known)


def _block(residuals: Array, slopes: Array, constants: Array) -> RecordBlock:
    """One record whose constants are out of residuals and slopes; they follow `constants`."""
    n, k = slopes.shape[2], constants.shape[1]
    flat = np.ascontiguousarray(slopes.reshape(-1, n))
    return RecordBlock(flat, np.zeros((k, n)), constants, np.eye(k), residuals)


def fit_fourier_regression(
    model: StateSpaceModel, data: Record | Sequence[Record], options: FourierOptions
) -> Fit:
    """Fit by least squares on Fourier integrals of the equations; see `flightid.identify`."""

    def operator(motion: StateMeasurements) -> Operator:
        return FourierRows(motion, options.band_rad_s)

    problem, start, limits = _problem(model, data, options, operator)
    grids = [each.grid for each in problem.operators if isinstance(each, FourierRows)]
    omegas = [grid.omega_rad_s for grid in grids]
    count = len(problem.motions)
    settled = settle(problem, start, lambda rows: spectral_weights(rows, omegas), limits, count)
    inner = Inner.of(model, settled.end.x)
    action = f"{APART}; constants have no harmonic: method='equation_error', output_bias=False"
    driven = [
        DrivenHarmonics(grid, motion.inputs, ahead=1)
        for grid, motion in zip(grids, problem.motions, strict=True)
    ]
    known = known_by_spectra(inner, settled.rows, settled.weights, driven, action)
    return _finish("Fourier regression", problem, data, options, settled, limits, inner, known)


def equation_error_start(model: GreyBoxModel, data: Record | Sequence[Record]) -> GreyBoxModel:
    """Copy of a model with the values that equation error finds, as a start for output error.

    Raises
    ------
    OptionError
        The model has no equations of motion.
    FitError
        Some states are not measured.
    """
    if not isinstance(model, StateSpaceModel):
        raise OptionError(
            "start_from='equation_error' needs equations of motion",
            found=type(model).__name__,
            needed="a StateSpaceModel",
            action="start from the model, or raise starts",
        )
    problem, start, limits = _problem(
        model, data, EquationErrorOptions(), lambda motion: LocalMeans(motion, 2)
    )
    settled = settle(problem, start, level_weights, limits, len(problem.motions))
    fitted = Inner.of(model, settled.end.x).fitted
    return model.with_values({p.name: float(p.value or 0.0) for p in fitted.parameters.free})


def _problem(
    model: StateSpaceModel,
    data: Record | Sequence[Record],
    options: RegressionOptions,
    operator: Callable[[StateMeasurements], Operator],
) -> tuple[EquationRegression, Array, SearchBounds]:
    records = check_records(model, data)
    reconstruction = Reconstruction.of(model, records[0])
    motions = [reconstruction.measured(record) for record in records]
    start, limits = limits_of(model, options.maximum_iterations)
    right = RightSide(reconstruction, options.hold)
    operators = [operator(motion) for motion in motions]
    return EquationRegression.of(right, motions, operators, start), start, limits


def _finish(
    method: str,
    problem: EquationRegression,
    data: Record | Sequence[Record],
    options: RegressionOptions,
    settled: SettledRounds,
    limits: SearchBounds,
    inner: Inner,
    known: Knowledge,
) -> Fit:
    end = settled.end
    settled_at = problem.renewed(end.x)

    def on(motions: Sequence[StateMeasurements]) -> EquationRegression:
        operators = [
            each.with_motion(motion)
            for each, motion in zip(problem.operators, motions, strict=True)
        ]
        return replace(settled_at, motions=tuple(motions), operators=tuple(operators))

    def refit(motions: Sequence[StateMeasurements]) -> Array:
        return stepped(on(motions), end.x, settled.weights, limits)

    def residuals(motions: Sequence[StateMeasurements]) -> list[Array]:
        return [each.residuals for each in on(motions).rows(end.x, settled.weights)]

    if judged():
        moved = attenuation(problem.motions, refit, end.x)[inner.mask]
    else:
        moved = np.zeros(len(inner.names))
    bias = dict(zip(inner.names, map(float, moved), strict=True))
    records = as_records(data)
    left = np.sum([np.sum(each.residuals**2, axis=1) for each in settled.rows], axis=0)
    fit = assemble(
        method,
        inner,
        [[end]],
        known,
        compared_costs(problem, left),
        records,
        compared_records(problem, settled, records),
        options,
        extra={"attenuation": bias, "rounds": settled.rounds},
        noise=compared_costs(problem, noise_energy(problem.motions, residuals)),
    )
    return replace(fit, findings=(*fit.findings, *judge_attenuation(bias, fit.parameters)))


def _constants(shape: tuple[int, ...], output_bias: bool) -> Array:
    """Orthonormal directions of the equations' constants, (n_equations · n_rows, n_constants)."""
    n_equations, n_rows = shape
    if not output_bias:
        return np.zeros((n_equations * n_rows, 0))
    return np.kron(np.eye(n_equations), np.full((n_rows, 1), 1.0 / np.sqrt(n_rows)))

"""Searches of a polynomial model's coefficients (native side: `polynomial_fit.rs`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError, FitError
from flightid.findings import Finding
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.prediction_error.backcast import backcast
from flightid.identification.prediction_error.coefficient_covariance import (
    SearchResult,
)
from flightid.identification.prediction_error.coloured_errors import has_noise_model
from flightid.identification.prediction_error.denominators import preferred
from flightid.identification.prediction_error.excited_inputs import noise_free_inputs
from flightid.identification.prediction_error.findings import (
    CONVERGED,
)
from flightid.identification.prediction_error.information_criteria import Criteria, criteria
from flightid.identification.prediction_error.instrumental_variables import four_stage
from flightid.identification.prediction_error.kernel_regression import kernel_estimate
from flightid.identification.prediction_error.likelihoods import End, coloured_cost, likeliest
from flightid.identification.prediction_error.linear_regression import (
    inverse_square,
    regress_structure,
    require_errors,
    require_independent,
)
from flightid.identification.prediction_error.part_blocks import (
    BEFORE,
    about_levels,
    errors_at,
)
from flightid.identification.prediction_error.refined_instruments import refined_instruments
from flightid.identification.prediction_error.starts import polynomial_starts, whitened_start
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.structure import REFINED, PolynomialStructure
from flightid.models.sampled.channels import SampledChannels

Array = NDArray[np.float64]
BACKCASTS = 6
SETTLED = 1e-6
SAME_MINIMUM = 1e-6
SPARE_SAMPLES = 3


def search_polynomial(
    structure: PolynomialStructure, data: SampledChannels
) -> tuple[PolynomialModel, tuple[Criteria, Criteria], bool]:
    """Where a fit ends, and whether at a minimum: without intervals, roots or findings.

    For scans, which fit whole what they take. Criteria are those of its errors and, where it has no
    model of the noise, those of its errors with their colour taken out.
    """
    (taken, found), _ = optimum(structure, data)
    about = about_levels(taken, data, found.memory, found.theta)
    errors = errors_at(taken, about, found.memory, found.theta)
    counted = [errors[span][found.skip :] for span in about.spans]
    squares, n = sum(float(row @ row) for row in counted), sum(row.size for row in counted)
    model = PolynomialModel.from_theta(
        taken,
        found.theta,
        data.sample_time_s,
        units=data.units,
        operating_point=about.operating_point,
    )
    own = white = criteria(squares, n, taken.n_parameters)
    if not has_noise_model(taken):
        cost, rows = coloured_cost(taken, data, found.theta, found.memory, found.skip)
        white = criteria(rows * math.exp(cost / rows), rows, taken.n_parameters)
    return model, (own, white), found.minima[0].termination in CONVERGED


def optimum(
    structure: PolynomialStructure, data: SampledChannels
) -> tuple[tuple[PolynomialStructure, SearchResult], tuple[Finding, ...]]:
    """The best end of the searches of a structure's alternatives, and how it was preferred."""
    ends, problem = [], None
    for each in structure.alternatives:
        try:
            _require_samples(each, data)
            ends.append((each, _search(each, data)))
        except (DataError, FitError) as error:
            problem = error
    if problem is not None and not ends:
        raise problem
    return preferred(ends, data)


def _require_samples(structure: PolynomialStructure, data: SampledChannels) -> None:
    lag = structure.longest_lag
    counted = sum(max(0, n - lag) for n in data.lengths)
    least = structure.n_parameters + SPARE_SAMPLES
    if counted < least or min(data.lengths) <= lag:
        raise DataError(
            "too few samples for the orders",
            found=f"{counted} after the first {lag} of each record, the shortest record with "
            f"{min(data.lengths)}",
            needed=f"at least {least}, each record longer than {lag}",
            action="give longer records or lower orders",
        )


def _search(structure: PolynomialStructure, data: SampledChannels) -> SearchResult:
    if structure.is_regression and not structure.backcast:
        found = _regression(structure, data)
        unstable = np.max(np.abs(np.roots([1.0, *found.theta[: structure.na]])), initial=0.0) >= 1.0
        if not (structure.enforce_stability and unstable):
            return found
    if structure.method == REFINED:
        return _by_excitation(structure, data)
    if structure.backcast:
        return _backcast_rounds(structure, data)
    return _iterate(structure, data, polynomial_starts(structure, data), [])


def _regression(structure: PolynomialStructure, data: SampledChannels) -> SearchResult:
    """ARX: linear in the coefficients, so no iteration."""
    skip = 0 if structure.initial_state == "zero" else structure.longest_lag
    made = regress_structure(structure, data, skip)
    degrees = made.n_rows - made.theta.size
    if structure.kernel is not None:
        smooth = kernel_estimate(made, (structure.na, *structure.nb), structure.kernel)
        return _linear(structure, smooth.theta, smooth.covariance, degrees, "kernel", skip)
    require_independent(made, structure)
    if structure.method == "iv4":
        theta, known = four_stage(structure, data)
        found = _linear(structure, theta, known.covariance, degrees, "instruments", skip)
        return replace(found, freedom=known.freedom, colour=known.colour, agreement=known.agreement)
    require_errors(made.n_rows, made.theta.size)
    covariance = made.sum_of_squares / degrees * inverse_square(made.factor)
    return _linear(structure, made.theta, covariance, degrees, "regression", skip)


def _by_excitation(structure: PolynomialStructure, data: SampledChannels) -> SearchResult:
    """Output error by what the excitations move of the inputs, then by refined instruments."""
    moved = noise_free_inputs(data)
    clean = replace(data, inputs=moved, excitations=None)
    first = _iterate(structure, clean, polynomial_starts(structure, clean), [])
    made = refined_instruments(structure, data, moved, first.theta)
    rows = data.output.size - len(data.lengths) * (made.skip + data.levels)
    degrees = max(rows - made.theta.size, 1)
    found = _linear(structure, made.theta, made.known.covariance, degrees, "instruments", made.skip)
    known = made.known
    return replace(
        found, iterations=made.steps, freedom=known.freedom, colour=known.colour,
        agreement=known.agreement,
    )  # fmt: skip


def _linear(
    structure: PolynomialStructure,
    theta: Array,
    covariance: Array,
    degrees: int,
    ending: str,
    skip: int,
) -> SearchResult:
    minimum = LocalMinimum(0.0, 1, _named(structure, theta), ending)
    return SearchResult(theta, covariance, degrees, (minimum,), 0, [], skip)


def _iterate(
    structure: PolynomialStructure,
    data: SampledChannels,
    starts: Array,
    memory: list[list[float]],
) -> SearchResult:
    """Gauss-Newton with the damping of Levenberg and Marquardt from every start."""
    skip = structure.longest_lag if structure.is_regression and not memory else 0
    outcomes = _outcomes(structure, data, starts, memory, skip)
    minima = _grouped(outcomes)
    has_noise = has_noise_model(structure)
    if len(minima) != 1 and not has_noise and len(starts) < structure.starts:
        outcomes += _outcomes(structure, data, whitened_start(structure, data), memory, skip)
        minima = _grouped(outcomes)
    if not minima:
        raise FitError(
            "the fit diverged from every start",
            found="; ".join(sorted({each for each in outcomes if isinstance(each, str)})),
            action="lower the orders, or give more starts",
        )
    behind: tuple[float, ...] = ()
    if len(minima) > 1 and not has_noise:
        minima, behind = likeliest(structure, data, minima, memory, skip)
    theta, squares, flat, iterations, _ = minima[0][0]
    unknown = len(data.lengths) * data.levels
    if structure.past == "estimate":
        of_inputs, of_noise = _native.polynomial_memory(structure.native)
        unknown += len(data.lengths) * (sum(of_inputs) + of_noise)
    if structure.is_regression:
        unknown = len(data.lengths) * (skip + data.levels)
    degrees = max(data.output.size - unknown - theta.size, 1)
    factor = flat.reshape(theta.size, theta.size).T
    covariance = None
    if _is_determined(factor):
        covariance = squares / degrees * inverse_square(factor)
    told = tuple(
        LocalMinimum(each[0][1], len(each), _named(structure, each[0][0]), each[0][-1])
        for each in minima
    )
    return SearchResult(theta, covariance, degrees, told, iterations, memory, skip, behind=behind)


def _is_determined(factor: Array) -> bool:
    lengths = np.linalg.norm(factor, axis=0)
    return bool(np.all(np.abs(np.diag(factor)) > 1e-11 * np.maximum(lengths, 1e-300)))


def _outcomes(
    structure: PolynomialStructure,
    data: SampledChannels,
    starts: Array,
    memory: list[list[float]],
    skip: int,
) -> list[End | str]:
    """What each start came to: an end, or why there is none."""
    return _native.polynomial_fit(
        data.output,
        data.inputs,
        list(data.lengths),
        structure.native,
        starts,
        BEFORE[structure.past],
        memory,
        data.levels,
        skip,
        structure.enforce_stability,
        structure.maximum_iterations,
    )


def _grouped(outcomes: Sequence[End | str]) -> list[list[End]]:
    """Ends of each minimum, the smallest sum of squares first."""
    ends = [end for end in outcomes if not isinstance(end, str) and np.isfinite(end[1])]
    groups: list[list[End]] = []
    for end in sorted(ends, key=lambda each: each[1]):
        if groups and end[1] <= groups[-1][0][1] * (1 + SAME_MINIMUM):
            groups[-1].append(end)
        else:
            groups.append([end])
    return groups


def _named(structure: PolynomialStructure, theta: Array) -> dict[str, float]:
    return dict(zip(structure.names, theta.tolist(), strict=True))


def _backcast_rounds(structure: PolynomialStructure, data: SampledChannels) -> SearchResult:
    """The past follows from the model and the model from the past, until both rest."""
    of_inputs, of_noise = _native.polynomial_memory(structure.native)
    memory = [[0.0] * (sum(of_inputs) + of_noise) for _ in data.lengths]
    starts = polynomial_starts(structure, data)
    found = _iterate(structure, data, starts, memory)
    for _ in range(BACKCASTS):
        model = PolynomialModel.from_theta(structure, found.theta, data.sample_time_s)
        about = about_levels(structure, data, found.memory, found.theta)
        after = _iterate(structure, data, found.theta[None], backcast(model, about))
        moved = np.abs(after.theta - found.theta)
        found = replace(after, minima=(*after.minima[:1], *found.minima[1:]), behind=found.behind)
        if found.covariance is None or np.all(
            moved <= SETTLED * np.sqrt(np.diag(found.covariance))
        ):
            break
    return found

"""From settled regressions to a `Fit`: parameters with intervals, costs, records, findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import judge_correlation, judge_parameters, judge_search
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.frequency_domain.estimates import (
    APART,
    at_bound,
    fitted_parameters,
    require_identifiable,
)
from flightid.identification.multistart import DenseEnd, local_minima, require_free
from flightid.identification.records.findings import judge_fit
from flightid.identification.regression.foretold_rows import DrivenHarmonics, foretold_harmonics
from flightid.identification.regression.options import RegressionOptions
from flightid.identification.regression.rounds import Rows, SearchBounds, stack
from flightid.identification.regression.weights import compared_covariance
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.record import Record
from flightid.record.several import as_records
from flightid.uncertainty import correlation as correlation_of
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.cramer_rao import inverse_hessian
from flightid.uncertainty.fitted_correlation import FittedCorrelation
from flightid.uncertainty.residual_colour import Colour
from flightid.units import require_match
from flightid.version import VERSION

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Inner:
    """A model at its estimates, and which free parameters lie inside their bounds."""

    fitted: GreyBoxModel
    mask: NDArray[np.bool_]

    @classmethod
    def of(cls, model: GreyBoxModel, theta: Array) -> Inner:
        """Put estimates into a model."""
        names = (parameter.name for parameter in model.parameters.free)
        fitted = model.with_values(dict(zip(names, map(float, theta), strict=True)))
        free = fitted.parameters.free
        return cls(fitted, np.array([not at_bound(parameter) for parameter in free], dtype=bool))

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters that the data decide."""
        free = self.fitted.parameters.free
        return tuple(p.name for p, keep in zip(free, self.mask, strict=True) if keep)


@dataclass(frozen=True)
class Knowledge:
    """What a method says about its estimates.

    Attributes
    ----------
    jacobian : ndarray, shape (n_residuals, n_inner)
        Of residuals with unit variance.
    covariance : ndarray, shape (n_inner, n_inner)
    freedom : ndarray, shape (n_inner,)
        Degrees of freedom of the variances.
    source : str
        Where the intervals come from.
    colour : tuple of float
        Smallest and largest ratio of a standard error to that for white residuals.
    agreement : Agreement or None
        Of records and of their halves.
    correlations : tuple of FittedCorrelation
        Of inputs with residuals.
    """

    jacobian: Array
    covariance: Array
    freedom: Array
    source: str
    colour: Colour = Colour()
    agreement: Agreement | None = None
    correlations: tuple[FittedCorrelation, ...] = ()


def check_records(model: StateSpaceModel, data: Record | Sequence[Record]) -> tuple[Record, ...]:
    """Records as a tuple, with the model's channels in the model's units.

    Raises
    ------
    FitError
        No free parameter.
    DataError
        No record.
    UnitError
        Record and model disagree on a unit.
    """
    records = as_records(data)
    if not records:
        raise DataError("there is no record", needed="at least one")
    require_free(model)
    for record in records:
        for name in (*model.inputs, *model.outputs):
            require_match(name, record.unit(name), model.units[name], record=str(record.name))
    return records


def require_states(model: StateSpaceModel, method: str) -> None:
    """Refuse a model without states for a method that follows them.

    Raises
    ------
    FitError
        There is none.
    """
    if not model.states:
        raise FitError(
            f"{method} follows states, and the model has none",
            found=", ".join(model.outputs),
            needed="one state or more",
            action="use method='output_error', least squares on the outputs",
        )


def limits_of(model: GreyBoxModel, maximum_iterations: int) -> tuple[Array, SearchBounds]:
    """Start values and bounds of the free parameters."""
    free = model.parameters.free
    start = np.array([float(parameter.value or 0.0) for parameter in free])
    lower = np.array([parameter.minimum for parameter in free])
    upper = np.array([parameter.maximum for parameter in free])
    return start, SearchBounds(lower, upper, maximum_iterations)


def require_linear(model: StateSpaceModel, method: str) -> None:
    """Refuse a model that one linearisation does not describe.

    Raises
    ------
    FitError
        Its matrices change with states or inputs.
    """
    if model.is_linear:
        return
    raise FitError(
        f"{method} needs a linear model",
        found=f"equations of {model.name!r} whose matrices change with states or inputs",
        needed="equations that are linear in states and inputs",
        action="use method='output_error', which integrates them; where all states are measured "
        "'fourier_regression' or 'equation_error'; or write the equations linear about the trim",
    )


def require_seen(inner: Inner, jacobian: Array, action: str = APART) -> None:
    """Refuse parameters that the data cannot tell apart; `action` is what to do.

    Raises
    ------
    FitError
        Some combination of them leaves the residuals as they are.
    """
    require_identifiable(inner.names, jacobian, action)


def known_by_spectra(
    inner: Inner,
    rows: Sequence[Rows],
    weights: Sequence[Array],
    driven: Sequence[DrivenHarmonics],
    action: str = APART,
) -> Knowledge:
    """What harmonics with weights say of the parameters inside their bounds."""
    kept = [replace(each, slopes=each.slopes[:, :, inner.mask]) for each in rows]
    jacobian = stack([each.slopes * w[:, :, None] for each, w in zip(kept, weights, strict=True)])
    require_seen(inner, jacobian, action)
    agreed = compared_covariance(kept, weights, [each.grid.omega_rad_s for each in driven])
    return Knowledge(
        jacobian,
        agreed.covariance,
        agreed.freedom,
        "spectra of residuals",
        Colour(growth=agreed.most_growth),
        agreement=agreed.agreement,
        correlations=foretold_harmonics(kept, weights, driven),
    )


def assemble(
    method: str,
    inner: Inner,
    groups: Sequence[Sequence[DenseEnd]],
    known: Knowledge,
    costs: Mapping[str, float],
    records: Sequence[Record],
    fitted_records: Sequence[FittedRecord],
    options: RegressionOptions,
    *,
    findings: Sequence[Finding] = (),
    extra: Mapping[str, object] | None = None,
    noise_covariance: Array | None = None,
    residual_horizon: int | str = "free_run",
    noise: Mapping[str, float] | None = None,
) -> Fit:
    """The result of a regression method."""
    fitted, names = inner.fitted, inner.names
    weighted = known.jacobian / np.sqrt(2.0)
    parameters = fitted_parameters(fitted, names, known.covariance, weighted, known.freedom)
    # Orthogonal residuals of unit variance: the inverse Hessian of ½ Σ r².
    correlation = correlation_of(inverse_hessian(weighted, names)) if names else np.zeros((0, 0))
    best = groups[0][0]
    total = sum(costs.values())
    return Fit(
        model=fitted,
        parameters=parameters,
        cost=total,
        average_cost=total / len(costs),
        costs=dict(costs),
        names=names,
        covariance=known.covariance,
        correlation=correlation,
        responses=(),
        minima=local_minima(groups, [parameter.name for parameter in fitted.parameters.free]),
        objective=best.cost,
        termination=best.termination,
        iterations=best.iterations,
        intervals_from=known.source,
        findings=(
            *findings,
            *judge_search(groups),
            *judge_parameters(parameters),
            *judge_correlation(names, correlation, parameters),
            *judge_fit(costs, known.colour, lambda: noise or {}),
        ),
        provenance={**_provenance(method, records, options), **(extra or {})},
        records=tuple(fitted_records),
        noise_covariance=noise_covariance,
        residual_horizon=residual_horizon,
        agreement=known.agreement,
        input_correlations=known.correlations,
    )


def _provenance(
    method: str, records: Sequence[Record], options: RegressionOptions
) -> dict[str, object]:
    return {
        "method": method,
        "flightid": VERSION,
        "data_history": [[str(step) for step in record.history] for record in records],
        "options": options.to_dict(),
    }

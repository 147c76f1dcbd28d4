"""From the end of a search to estimates with errors, bounds and correlations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.frozen import dataclass
from flightid.identification.fit_findings import UNKNOWN
from flightid.identification.frequency_domain.error_model import ErrorModel
from flightid.identification.frequency_domain.model_curves import log_slopes_of
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.identification.multistart import DenseEnd
from flightid.models import GreyBoxModel, Parameter
from flightid.uncertainty import correlation as correlation_of
from flightid.uncertainty import (
    cramer_rao,
    estimator_gain,
    insensitivity,
    null_combination,
)
from flightid.uncertainty.agreement import Agreement, AgreementTest
from flightid.uncertainty.cramer_rao import inverse_hessian
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.response_errors import DECIBEL, DEGREE, Sensitivity
from flightid.uncertainty.triangle import triangle_of_rows

Array = NDArray[np.float64]
Compare = Callable[[Array, Array, NDArray[np.bool_], Array], AgreementTest]
"""By gain, its triangle, free parameters that count, and what adds to the covariance."""
_AT_BOUND = 1e-9
_SHARE = 0.1
UNSEEN = "no influence on what was fitted: its value is where it started"


@dataclass(frozen=True)
class Statistics:
    """What is known of the estimates.

    Attributes
    ----------
    parameters : mapping of str to Estimate
    names : tuple of str
        Order of `covariance` and `correlation`.
    covariance : ndarray or None
    correlation : ndarray
    source : str
        Where the intervals come from.
    outputs_apart : bool
        Whether errors of different outputs were taken as independent for want of knowledge.
    noise_taken_for_known : bool
        Whether nobody knows from how much noise the errors of points were estimated.
    withheld : str
        Why there are no intervals though errors are known; empty where there are.
    agreement : Agreement or None
        Of records and of their halves.
    bias : ndarray, shape (n,), or None
        Of the estimates in `names` for the bias of the points, which their bars hold.
    """

    parameters: Mapping[str, Estimate]
    names: tuple[str, ...]
    covariance: Array | None
    correlation: Array
    source: str
    outputs_apart: bool
    noise_taken_for_known: bool
    withheld: str = ""
    agreement: Agreement | None = None
    bias: Array | None = None


def statistics(
    fitted: GreyBoxModel,
    selected: Sequence[SelectedResponse],
    errors: ErrorModel,
    end: DenseEnd,
    *,
    sensitivity: Sensitivity | None,
    weighs_coherence: bool,
    weighs_errors: bool = False,
    withheld: str = "",
    compare: Compare | None = None,
    bias: Array | None = None,
) -> Statistics:
    """Standard errors, bounds and correlations at the end of a search.

    `weighs_coherence` tells that the Jacobian of the end is that of `coherence_jacobian`,
    `weighs_errors` that the fit weighs points by the errors that are known of them.

    `withheld` says why there shall be no intervals, though errors of the data are known; `compare`
    looks at parts of them. `bias` of the points, in the order of `ErrorModel.propagated`, moves the
    estimates; their covariance takes the square of that move, so that bars hold it.

    Raises
    ------
    FitError
        The data see no parameter, or not some combination of them.
    """
    free = fitted.parameters.free
    inner = np.array([not at_bound(parameter) for parameter in free], dtype=bool)
    weighted = end.jacobian if weighs_coherence else coherence_jacobian(fitted, selected)
    seen = np.any(end.jacobian != 0.0, axis=0) & np.any(weighted != 0.0, axis=0)
    # One that nothing answers to keeps its value and costs the others nothing.
    inner &= seen | ~np.any(inner & seen)
    names = tuple(p.name for p, keep in zip(free, inner, strict=True) if keep)
    basis, triangle = _factors(end.jacobian[:, inner])
    require_identifiable(names, triangle)
    covariance, freedom, agreement, moved = None, None, None, None
    if sensitivity is not None and names and not withheld:
        gain = estimator_gain(triangle, basis.T @ sensitivity)
        levels = errors.levels(gain) if weighs_errors else None
        added = np.zeros((len(gain), len(gain)))
        if levels is not None:
            added = levels.added(triangle.T @ triangle)
        if compare is None:
            covariance, freedom = errors.propagated(gain, len(gain))
            covariance = covariance + added
        else:
            agreed = compare(gain, triangle, inner, added)
            covariance, agreement, freedom = agreed.covariance, agreed.agreement, agreed.freedom
        if bias is not None:
            moved = -gain @ bias
            covariance = covariance + np.outer(moved, moved)
    # Bounds and correlations ask for products of columns alone, which the triangle keeps.
    weighted = triangle if weighs_coherence else triangle_of_rows(weighted[:, inner])
    correlation = correlation_of(inverse_hessian(weighted, names)) if names else np.zeros((0, 0))
    parameters = fitted_parameters(fitted, names, covariance, weighted, freedom, withheld=withheld)
    source = UNKNOWN if withheld else errors.source
    return Statistics(
        parameters,
        names,
        covariance,
        correlation,
        source,
        errors.outputs_apart,
        errors.noise_taken_for_known,
        withheld,
        agreement,
        moved,
    )


def _factors(jacobian: Array) -> tuple[Array, Array]:
    # SciPy's takes columns together: of 1,240 × 40 .6 ms, NumPy's 1.2.
    basis, triangle = scipy.linalg.qr(jacobian, mode="economic", check_finite=False)
    return np.asarray(basis, dtype=np.float64), np.asarray(triangle, dtype=np.float64)


def at_bound(parameter: Parameter) -> bool:
    """Whether a parameter's value lies at one of its bounds."""
    value = parameter.value or 0.0
    margin = _AT_BOUND * max(abs(value), 1e-300)
    return value - parameter.minimum <= margin or parameter.maximum - value <= margin


APART = "fix or tie one of them, widen the band, or excite them apart"


def require_identifiable(names: tuple[str, ...], jacobian: Array, action: str = APART) -> None:
    """Refuse parameters that the data cannot see; `action` is what to do.

    Raises
    ------
    FitError
        Some combination of them leaves the residuals as they are.
    """
    if not names:
        return
    share = null_combination(jacobian)
    if share is None:
        return
    guilty = [name for name, part in zip(names, share, strict=True) if part > _SHARE]
    raise FitError(
        "the data cannot tell these parameters apart"
        if len(guilty) > 1
        else "the data do not see a parameter",
        found=", ".join(guilty),
        needed="a different effect of each on the data",
        action=action,
    )


def coherence_jacobian(fitted: GreyBoxModel, selected: Sequence[SelectedResponse]) -> Array:
    """Derivatives of the weighted dB and degree residuals with respect to the free parameters."""
    slopes = log_slopes_of(fitted, [each.omega_rad_s for each in selected])
    rows = []
    for each, slope in zip(selected, slopes, strict=True):
        both = np.empty((2 * len(slope), slope.shape[1]))
        both[0::2] = DECIBEL * np.sqrt(each.weight_db)[:, None] * slope.real
        both[1::2] = DEGREE * np.sqrt(each.weight_deg)[:, None] * slope.imag
        rows.append(both)
    return np.vstack(rows)


def fitted_parameters(
    fitted: GreyBoxModel,
    names: tuple[str, ...],
    covariance: Array | None,
    weighted: Array,
    freedom: Array | None = None,
    *,
    withheld: str = "",
) -> dict[str, Estimate]:
    """Every parameter with what is known of it.

    Parameters
    ----------
    fitted : TransferFunctionModel or StateSpaceModel
        At the estimates.
    names : tuple of str
        Parameters of the arrays: free, not at a bound, and with influence.
    covariance : ndarray, shape (n, n), or None
        Of the estimates over repeated flights.
    weighted : ndarray, shape (n_residuals, n)
        Derivatives of residuals whose squares add up to the cost, for the bounds of CIFER.
    freedom : ndarray, shape (n,), optional
        Degrees of freedom of the variances.
    withheld : str
        Why there is no covariance, where it is not for want of errors.

    Returns
    -------
    dict of str to Estimate
    """
    bounds = dict(zip(names, cramer_rao(weighted, names).tolist(), strict=True)) if names else {}
    slack = dict(zip(names, insensitivity(weighted, names).tolist(), strict=True)) if names else {}
    return known_parameters(
        fitted, names, covariance, freedom, withheld=withheld, bounds=bounds, slack=slack
    )


def known_parameters(
    fitted: GreyBoxModel,
    names: tuple[str, ...],
    covariance: Array | None,
    freedom: Array | None = None,
    *,
    withheld: str = "",
    bounds: Mapping[str, float] = MappingProxyType({}),
    slack: Mapping[str, float] = MappingProxyType({}),
) -> dict[str, Estimate]:
    """Every parameter with its error by the covariance, or why it has none.

    Parameters
    ----------
    fitted, names, covariance, freedom, withheld
        As `fitted_parameters` takes them.
    bounds, slack : mapping of str to float
        Cramér–Rao bounds and insensitivities in units of the parameters, for the percentages.
    """
    errors = _standard_errors(fitted, names, covariance)
    degrees = {} if freedom is None else dict(zip(names, map(float, freedom), strict=True))
    result, told = {}, set(names)
    for name, parameter in fitted.parameters.items():
        value = float(parameter.value or 0.0)
        left = parameter.free and name not in told
        bound = left and at_bound(parameter)
        result[name] = Estimate(
            name,
            value,
            parameter.unit,
            errors.get(name),
            UNSEEN
            if left and not bound
            else _reason(parameter, bound, covariance is not None, value, withheld),
            degrees.get(name),
            status="at bound" if bound else "not seen" if left else parameter.status,
            cramer_rao_percent=_percent(bounds.get(name), value),
            insensitivity_percent=_percent(slack.get(name), value),
        )
    return result


def _percent(size: float | None, value: float) -> float | None:
    return None if size is None or value == 0.0 else float(100.0 * size / abs(value))


def _reason(parameter: Parameter, bound: bool, known: bool, value: float, withheld: str) -> str:
    if bound:
        return "at bound: the data would move it further"
    if parameter.status == "fixed":
        return "fixed"
    if withheld:
        return withheld
    if not known:
        return f"errors of the response: {UNKNOWN} known"
    if parameter.status == "tied":
        return "tied: bounds belong to the parameters in its tie"
    return "" if value != 0.0 else "percent of zero has no meaning"


def _standard_errors(
    fitted: GreyBoxModel, names: tuple[str, ...], covariance: Array | None
) -> dict[str, float]:
    """Of the estimated parameters and, through their ties, of the tied ones."""
    if covariance is None:
        return {}
    parameters = fitted.parameters
    result = dict(zip(names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    if parameters.tied:
        independent = [parameter.name for parameter in parameters.independent]
        directions = [independent.index(name) for name in names]
        tape = parameters.tape([parameter.name for parameter in parameters.tied])
        slope = tape.jacobian(parameters.independent_values(), directions)
        variance = np.einsum("ij,jk,ik->i", slope, covariance, slope)
        for parameter, each in zip(parameters.tied, variance, strict=True):
            if each > 0.0:
                result[parameter.name] = float(np.sqrt(each))
    return result

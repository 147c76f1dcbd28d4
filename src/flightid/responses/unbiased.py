"""A response with the bias of its estimator taken out, as far as a pilot model foretells it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.responses.errors.noise import AVERAGED, mean_spectrum
from flightid.responses.errors.pilot import Pilot
from flightid.responses.errors.pilot_search import BEYOND_BAND
from flightid.responses.errors.random_error import StoredCovariance
from flightid.responses.response import FrequencyResponse
from flightid.uncertainty.quantiles import LEVEL, half_width

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
WITHOUT_BIAS = "without leakage"
BENT = 0.02
"""Twice the share by which a straight line between neighbours may miss a pilot."""
HALVINGS = 4
MOST_POINTS = 250


def without_bias(source: FrequencyResponse) -> FrequencyResponse:
    """The response less what leakage and resolution add to it, with the errors of what remains.

    A pilot model (`flightid.responses.errors.pilot`) is put through the estimator's own weights on
    the measured inputs; what comes out less its own response is the bias. To first order the error
    of the difference has the covariance ``C − E P Eᵀ + G P Gᵀ``: C that of the estimate, P that of
    the pilot's coefficients, G the slopes of its response and E those of what the estimator makes
    of it.

    Parameters
    ----------
    source : FrequencyResponse

    Raises
    ------
    DataError
        The response is no longer linear in measured outputs (after arithmetic, from a file, given),
        has no errors, or its records hold too few bins.

    Assumes
    -------
    A pilot that comes near the vehicle: of what it misses, only what the estimator blurs remains,
    a bias of second order.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., sections
    2.6 (leakage), 6.7 (transients); the covariance: Rasmussen & Williams, *Gaussian Processes for
    Machine Learning* (2006), equation 2.41, for a prior without weight.

    Example
    -------
    >>> import flightid as fid
    >>> u = np.random.default_rng(0).standard_normal(4000)
    >>> record = fid.Record.from_arrays(np.arange(4000) / 100, inputs={"u": u},
    ...                                 outputs={"y": np.convolve(u, [0.5, 0.5])[:4000]})
    >>> without_bias(fid.estimate_response(record, band_rad_s=(2.0, 50.0), n_omega=20)).estimator
    'composite, without leakage'
    """
    found = unbiased(source)
    if found is None:
        raise DataError(
            "the bias of this response cannot be foretold",
            found=f"estimator {source.estimator!r}, {source.n_frequencies} frequencies",
            needed="a response as `estimate_response` gives it, with covariance=True",
            action="take the bias out before arithmetic, or read a model fitted to the response",
        )
    return found


def unbiased(response: FrequencyResponse, *, refined: bool = False) -> FrequencyResponse | None:
    """As `without_bias`, or None where that cannot be had.

    `refined` adds frequencies where the response turns too fast for straight lines between
    neighbours, as at a light mode: there the pilot is known, and what it leaves is interpolated.
    """
    linear = response.linear
    if linear is None or response.errors is None:
        return None
    pilots = linear.pilots_of_outputs()
    if pilots is None:
        return None
    before, columns = response.omega_rad_s, linear.places[1]
    omega = _refined(before, pilots, columns) if refined else before
    spread = _between(before, omega)
    # Linear in changes of the outputs alone: windows keep the shares that the measured ones gave.
    left = linear.functional()(_residuals(linear, pilots))
    own = np.stack([each.frequency_response(omega)[columns] for each in pilots])
    kept = {
        name: getattr(response, name) @ spread
        for name in ("coherence", "multiple_coherence", "random_error", "n_independent")
    }
    return replace(
        response,
        **kept,
        omega_rad_s=omega,
        response=own + left @ spread,
        input_spectrum=None,
        cross_spectrum=None,
        output_spectrum=None,
        errors=StoredCovariance(_errors(response, linear, pilots, omega, spread), len(omega)),
        linear=None,
        estimator=f"{response.estimator}, {WITHOUT_BIAS}",
    )


def _refined(omega: Real, pilots: Sequence[Pilot], columns: NDArray[np.intp]) -> Real:
    """With the middles of intervals, in log frequency, over which a pilot is no straight line."""
    found = omega
    for _ in range(HALVINGS):
        middles = np.sqrt(found[1:] * found[:-1])
        bent = np.zeros(len(middles), dtype=bool)
        for pilot in pilots:
            ends = pilot.frequency_response(found)[columns]
            own = pilot.frequency_response(middles)[columns]
            # Of a straight line in log gain and phase the middle is the geometric mean.
            ratio = own**2 / (ends[:, 1:] * ends[:, :-1])
            bent |= np.any(np.abs(ratio - 1.0) > BENT, axis=0)
        if not np.any(bent) or len(found) > MOST_POINTS:
            break
        found = np.sort(np.concatenate([found, middles[bent]]))
    return found


def _between(before: Real, omega: Real) -> Real:
    """Straight lines over log frequency from some points to others, shape (n_before, n)."""
    logs, wanted = np.log(before), np.log(omega)
    rows = [np.interp(wanted, logs, row) for row in np.eye(len(before))]
    return np.asarray(rows)


def _stacked(outputs: Sequence[tuple[Real, ...]]) -> list[Real]:
    """Of each record, all outputs."""
    return [np.stack(each) for each in zip(*outputs, strict=True)]


def _residuals(linear: LinearEstimate, pilots: Sequence[Pilot]) -> list[Real]:
    """Of each record, what the pilots leave of all outputs."""
    modelled = _stacked([each.outputs for each in pilots])
    return [y - model for y, model in zip(linear.output_records, modelled, strict=True)]


def _errors(
    response: FrequencyResponse,
    linear: LinearEstimate,
    pilots: Sequence[Pilot],
    omega: Real,
    spread: Real,
) -> Real:
    """Covariance of the difference, shaped as by `CovarianceSource.covariance`."""
    columns = linear.places[1]
    residuals = _residuals(linear, pilots)
    highest = BEYOND_BAND * linear.pilots.highest_rad_s
    spent = _stacked([each.spent for each in pilots])
    source = linear.errors_with(mean_spectrum(residuals, linear.sample_time_s, highest, spent))
    places = [np.arange(size) for size in response.response.shape]
    total = source.covariance(*places)
    onto = np.kron(np.eye(2 * len(columns)), spread)
    found = []
    for row, pilot in enumerate(pilots):
        own = _real(pilot.response_slopes(omega)[:, columns])
        made = _real(linear.of_pilot(row)[:, columns])
        left = _positive(total[row] - made.T @ pilot.covariance @ made)
        known = onto.T @ left @ onto + own.T @ pilot.covariance @ own
        found.append(_widened(pilot) * known)
    return np.stack(found)


def _widened(pilot: Pilot) -> float:
    """Student's distribution over the normal one at 95 %, squared: noise is known from few bins."""
    n_bins = sum(map(len, pilot.spent))
    groups = max(1, n_bins // AVERAGED)
    freedom = (2.0 * n_bins - len(pilot.covariance)) / groups
    return (half_width(LEVEL, max(freedom, 1.0)) / half_width(LEVEL)) ** 2


def _real(slopes: Complex) -> Real:
    """Rows of slopes as real parts and then imaginary parts, shape (n, 2 n_in n_f)."""
    flat = slopes.reshape(len(slopes), -1)
    return np.concatenate([flat.real, flat.imag], axis=1)


def _positive(matrix: Real) -> Real:
    """The nearest covariance: errors in the noise make small eigenvalues negative."""
    sizes, turned = np.linalg.eigh((matrix + matrix.T) / 2.0)
    return np.asarray((turned * np.maximum(sizes, 0.0)) @ turned.T)

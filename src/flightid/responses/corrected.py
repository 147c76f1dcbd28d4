"""An estimate with the bias of its estimator taken out, as numbers: what `unbiased` makes of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.bands import allowed_coherence
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.responses.errors.noise import NoiseSpectrum, mean_spectrum
from flightid.responses.errors.pilot import Pilot
from flightid.responses.errors.pilot_search import BEYOND_BAND
from flightid.responses.errors.random_error import Points, covariances
from flightid.uncertainty.quantiles import LEVEL, half_width

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
BENT = 0.02
"""Twice the share by which a straight line between neighbours may miss a pilot."""
HALVINGS = 4
MOST_POINTS = 250
MOST_RELATIVE = 1e6
LARGEST = float(np.log(np.finfo(float).max)) - 1.0
"""Logarithm of a variance that is as good as none told."""
SURER = 1.5
"""How many times as sure as the bins beside a frequency a pilot may be: windows are 1 to 1.2 times.

Beyond, it rests on what it assumes of the vehicle, where the input has no power of its own.
"""
EXTRAPOLATED = 0.2
"""Power of what bins tell less than half of them by which errors by way of an excitation grow.

Where excitations end, a pilot by instruments goes on by what it found inside, and errs by more
than slopes say: 1.2 times where bins tell a third, 2 times where they tell a fortieth.
"""


@dataclass(frozen=True, eq=False)
class CorrectedResponse:
    """A response less its foretold bias.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
    values : ndarray of complex, shape (n_out, n_in, n_f)
    errors : ndarray, shape (n_groups, n_out, 2 n_g n_f, 2 n_g n_f)
        Covariance of each group of n_g inputs, as `CovarianceSource.covariance` has it: of all
        inputs together, or of each by itself.
    spread : ndarray, shape (n_before, n_f)
        Straight lines over log frequency from the frequencies before to these.
    """

    omega_rad_s: Real
    values: Complex
    errors: Real
    spread: Real

    @property
    def relative(self) -> Real:
        """Standard error of a part over the size of the response, shape (n_out, n_in, n_f)."""
        groups, n_out = self.errors.shape[:2]
        variances = np.diagonal(self.errors, axis1=2, axis2=3)
        variances = variances.reshape(groups, n_out, 2, -1, self.values.shape[2]).mean(axis=2)
        variances = variances.transpose(1, 0, 2, 3).reshape(self.values.shape)
        size = np.maximum(np.abs(self.values), np.finfo(float).tiny)
        return np.asarray(np.minimum(np.sqrt(variances) / size, MOST_RELATIVE))

    def coherence(self, before: Real) -> Real:
        """Coherence γ² of the windows, and no more than these errors allow, (n_out, n_in, n_f).

        See `allowed_coherence`: a larger error is leakage that is coherent with leakage, or of
        windows too few to be used.

        Parameters
        ----------
        before : ndarray, shape (n_out, n_in, n_before)
        """
        return np.minimum(before @ self.spread, allowed_coherence(self.relative))


def corrected(
    linear: LinearEstimate, omega_rad_s: Real, *, refined: bool = False, by_input: bool = False
) -> CorrectedResponse | None:
    """Take the bias out of an estimate, or None where no pilot can foretell it.

    Parameters
    ----------
    linear : LinearEstimate
    omega_rad_s : ndarray, shape (n_before,)
        Its frequencies.
    refined : bool
        Add frequencies where a pilot is no straight line between neighbours.
    by_input : bool
        Errors of each input by itself, which are much sooner told than those of all together.
    """
    pilots = linear.pilots_of_outputs()
    if pilots is None:
        return None
    columns = linear.places[1]
    omega = _refined(omega_rad_s, pilots, columns) if refined else omega_rad_s
    spread = _between(omega_rad_s, omega)
    # Linear in changes of the outputs alone: windows keep the shares that the measured ones gave.
    left = linear.functional()(_residuals(linear, pilots))
    own = np.stack([each.frequency_response(omega)[columns] for each in pilots])
    every = np.arange(len(columns))
    groups = every[:, None] if by_input else every[None]
    errors = _errors(linear, pilots, omega, spread, groups)
    return CorrectedResponse(omega, own + left @ spread, errors, spread)


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
    """Of each record, what the pilots leave of all outputs, in the bins that they were fitted to.

    Bins beyond say nothing of the response in its band, and whatever rises there, of the inputs or
    of noise, windows leak into it: no covariance of the noise inside holds that.
    """
    modelled = _stacked([each.outputs for each in pilots])
    n_bins = map(len, pilots[0].spent)
    return [
        _inside(y, last) - model
        for y, model, last in zip(linear.output_records, modelled, n_bins, strict=True)
    ]


def _inside(outputs: Real, last: int) -> Real:
    """Samples, shape (n_out, n), of the first Fourier bins above zero alone."""
    bins = np.fft.rfft(outputs, axis=1)
    bins[:, 0] = 0.0
    bins[:, last + 1 :] = 0.0
    return np.fft.irfft(bins, outputs.shape[1], axis=1)


def _noise(linear: LinearEstimate, pilots: Sequence[Pilot]) -> NoiseSpectrum:
    """Noise of the outputs: what pilots leave."""
    residuals = _residuals(linear, pilots)
    highest = BEYOND_BAND * linear.pilots.highest_rad_s
    spent = _stacked([each.spent for each in pilots])
    return mean_spectrum(residuals, linear.sample_time_s, highest, spent)


def _errors(
    linear: LinearEstimate,
    pilots: Sequence[Pilot],
    omega: Real,
    spread: Real,
    groups: NDArray[np.intp],
) -> Real:
    """Covariance of the difference, of each group of inputs: see `CorrectedResponse`."""
    noise, points = _noise(linear, pilots), np.arange(len(linear.places[2]))
    wanted = [Points(row, group, points) for group in groups for row in range(len(pilots))]
    totals = iter(covariances(linear.errors_with(noise), wanted))
    least = _least_variances(linear, noise, omega, spread)
    beyond = _extrapolated(linear, spread)
    student = [
        np.tile(_widened(noise, row, omega), 2 * groups.shape[1]) for row in range(len(pilots))
    ]
    found = []
    for group in groups:
        columns = linear.places[1][group]
        for row, pilot in enumerate(pilots):
            own = _real(pilot.response_slopes(omega)[:, columns])
            made = _real(linear.of_pilot(row)[:, columns])
            left = _positive(next(totals) - made.T @ pilot.covariance @ made)
            moving = np.flatnonzero(np.any(own, axis=1))  # no response has transients
            slopes, covariance = own[moving], pilot.covariance[np.ix_(moving, moving)]
            known = _onto(left, spread) + slopes.T @ covariance @ slopes
            known *= np.outer(student[row], student[row])
            if least is not None:
                needed = np.tile(least[row, group].ravel(), 2)
                longer = _longer(needed, np.diag(known))
                known *= np.outer(longer, longer)
            if beyond is not None:
                longer = np.tile(beyond[group].ravel(), 2)
                known *= np.outer(longer, longer)
            found.append(known)
    return np.stack(found).reshape(len(groups), len(pilots), *found[0].shape)


def _onto(covariance: Real, spread: Real) -> Real:
    """Covariance of some rows of points, carried to other points of each row."""
    before, after = spread.shape
    n_rows = len(covariance) // before
    half = spread.T @ covariance.reshape(n_rows, before, n_rows * before)
    whole = half.reshape(n_rows * after, n_rows, before) @ spread
    return np.asarray(whole.reshape(n_rows * after, n_rows * after))


def _least_variances(
    linear: LinearEstimate, noise: NoiseSpectrum, omega: Real, spread: Real
) -> Real | None:
    """Of real and of imaginary parts, by what is told beside each frequency, (n_out, n_in, n_f)."""
    alone = linear.local_spread()
    if alone is None:
        return None
    # In logarithms: nothing told, times noise of an output that runs away, is beyond all numbers.
    ends = np.log(np.minimum(alone, np.finfo(float).max)) @ spread
    made = np.log(np.maximum(noise.at(omega), np.finfo(float).tiny))[:, None]
    return np.asarray(np.exp(np.minimum(made + ends + np.log(0.5 / SURER**2), LARGEST)))


def _extrapolated(linear: LinearEstimate, spread: Real) -> Real | None:
    """How many times as long errors by way of an excitation are, (n_in, n_f); see `EXTRAPOLATED`.

    One where bins tell nothing at all: what is needed there is beyond all numbers.
    """
    alone = linear.local_spread() if linear.pilots.excitations else None
    if alone is None:
        return None
    told = np.isfinite(alone)
    usual = [
        np.median(row[known]) if known.any() else 1.0
        for row, known in zip(alone, told, strict=True)
    ]
    less = np.divide(alone, np.array(usual)[:, None], out=np.ones_like(alone), where=told)
    less = np.maximum(less, 1.0)
    return np.asarray(less**EXTRAPOLATED @ spread)


def _longer(needed: Real, known: Real) -> Real:
    """How many times as long errors become where variances are to be as large as is needed."""
    most = np.minimum(needed, MOST_RELATIVE**2 * known)
    ratio = np.divide(most, known, out=np.ones_like(known), where=known > 0.0)
    return np.asarray(np.sqrt(np.maximum(ratio, 1.0)))


def _widened(noise: NoiseSpectrum, output: int, omega: Real) -> Real:
    """Student's distribution over the normal one at 95 %: noise is known from few bins."""
    levels = noise.levels_of(output)
    if levels is None:
        return np.ones(len(omega))
    freedom = np.maximum(np.interp(omega, levels.omega_rad_s, levels.freedom), 1.0)
    return np.array([half_width(LEVEL, float(each)) for each in freedom]) / half_width(LEVEL)


def _real(slopes: Complex) -> Real:
    """Rows of slopes as real parts and then imaginary parts, shape (n, 2 n_in n_f)."""
    flat = slopes.reshape(len(slopes), -1)
    return np.concatenate([flat.real, flat.imag], axis=1)


def _positive(matrix: Real) -> Real:
    """The nearest covariance: errors in the noise make small eigenvalues negative."""
    sizes, turned = np.linalg.eigh((matrix + matrix.T) / 2.0)
    return np.asarray((turned * np.maximum(sizes, 0.0)) @ turned.T)

"""Eigenvalues and poles as numbers with intervals: one place for frequency, damping and times."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Reading, first_order
from flightid.uncertainty.quantiles import half_width
from flightid.uncertainty.uneven import turned

Array = NDArray[np.float64]
UNSIGNED = "the interval of the real part holds zero: growth and decay are both possible"


@dataclass(frozen=True, eq=False)
class UncertainRoot:
    """One eigenvalue, or the upper one of a conjugate pair, with first-order errors.

    Attributes
    ----------
    s : complex or None
        In rad/s; None where `reason` says why.
    covariance : ndarray, shape (2, 2), or None
        Of real and imaginary part, (rad/s)²; None where `reason` says why.
    reason : str
    freedom : float or None
        Degrees of freedom behind the covariance.

    Example
    -------
    >>> root = UncertainRoot(-3.0 + 4.0j, np.diag([0.01, 0.04]))
    >>> root.natural_frequency(), round(root.damping_ratio().value, 3)
    (Estimate(natural frequency = 5 (4.665 to 5.335) rad/s), 0.6)
    """

    s: complex | None
    covariance: Array | None
    reason: str = ""
    freedom: float | None = None

    def _along(self, name: str, unit: str, value: float | None, slope: Array) -> Reading:
        """A number that moves with (real, imaginary) as `slope` says."""
        if value is None or self.covariance is None:
            return Estimate(name, value, unit, None, self.reason)
        variance = float(slope @ self.covariance @ slope)
        return first_order(name, value, unit, variance, self.freedom)

    def _outward(self) -> Array:
        """Derivative of |s| by (real, imaginary)."""
        assert self.s
        return np.array([self.s.real, self.s.imag]) / abs(self.s)

    def real(self) -> Reading:
        """Real part, rad/s."""
        value = None if self.s is None else self.s.real
        return self._along("real", "rad/s", value, np.array([1.0, 0.0]))

    def imaginary(self) -> Reading:
        """Imaginary part, rad/s."""
        if self.s is None:
            return Estimate("imaginary", None, "rad/s", None, self.reason)
        if not self.s.imag:
            return Estimate("imaginary", 0.0, "rad/s", None, "real eigenvalue")
        return self._along("imaginary", "rad/s", self.s.imag, np.array([0.0, 1.0]))

    def natural_frequency(self, name: str = "natural frequency") -> Reading:
        """Its size, rad/s; of a real one without interval where that holds zero."""
        if self.s is None:
            return Estimate(name, None, "rad/s", None, self.reason)
        size = abs(self.s)
        if self.covariance is None or size == 0.0:
            return Estimate(name, size, "rad/s", None, self.reason or "an integrator")
        found = self._along(name, "rad/s", size, self._outward())
        if not self.s.imag and half_width() * (found.stderr or 0.0) >= size:
            return Estimate(name, size, "rad/s", None, UNSIGNED)
        return found

    def damping_ratio(self, name: str = "damping ratio") -> Reading:
        """Minus the real part over the size."""
        if self.s is None or self.s == 0.0:
            reason = "an integrator has no damping" if self.s == 0.0 else self.reason
            return Estimate(name, None, "1", None, reason)
        size = abs(self.s)
        ratio = -self.s.real / size
        if not self.s.imag:
            return Estimate(name, ratio, "1", None, "real eigenvalue")
        slope = self.s.real * self._outward() / size**2 - np.array([1.0 / size, 0.0])
        return self._along(name, "1", ratio, slope)

    def period(self) -> Reading:
        """2π over the imaginary part, s."""
        return _time("period", self.imaginary(), 2.0 * math.pi, "no oscillation")

    def time_constant(self) -> Reading:
        """−1 over the real part, s; negative for growth."""
        return _time("time constant", self.real(), -1.0, "no decay")

    def halving(self) -> tuple[Reading, Reading]:
        """Time to half and to double, s: one of them."""
        rate = self.real()
        decays = rate.value is not None and rate.value < 0.0
        grows = rate.value is not None and rate.value > 0.0
        half = _time("time to half", rate, -math.log(2.0), "no decay")
        double = _time("time to double", rate, math.log(2.0), "no growth")
        return (
            half if decays else Estimate(half.name, None, "s", None, self.reason or "no decay"),
            double if grows else Estimate(double.name, None, "s", None, self.reason or "no growth"),
        )


def _time(name: str, rate: Reading, factor: float, without: str) -> Reading:
    """A time from a rate, and its interval from the rate's, turned over."""
    if not rate.value:
        return Estimate(name, None, "s", None, rate.reason if rate.value is None else without)
    return turned(name, "s", factor, rate, UNSIGNED)

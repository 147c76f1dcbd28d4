"""Poles, zeros, natural frequencies, dampings and gains with what the coefficients' errors make."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.sampled.discrete_modes import discrete_modes, zero_note
from flightid.responses.pair import quotient_unit
from flightid.uncertainty.estimate import Estimate, Reading, first_order
from flightid.uncertainty.quantiles import half_width
from flightid.uncertainty.roots import UncertainRoot

Array = NDArray[np.float64]
POLE, ZERO = "pole", "zero"
NO_FIRST_ORDER = "no error to first order"
NO_ERRORS = "the coefficients have no error bars"
DOUBLE = 1e-6
"""Roots closer than this share of their size have no first-order error."""


@dataclass(frozen=True, eq=False)
class Errors:
    """Covariance of the coefficients of a model with its degrees of freedom, and its sample time.

    Example
    -------
    >>> Errors(0.1, None, 100).covariance is None
    True
    """

    sample_time_s: float
    covariance: Array | None
    degrees: float


@dataclass(frozen=True, eq=False)
class FittedRoot:
    """One real pole or zero, or the upper one of a conjugate pair.

    Attributes
    ----------
    response : str
        ``"output/input"``.
    kind : str
        ``"pole"`` or ``"zero"``.
    z : complex
    covariance : ndarray, shape (2, 2), or None
        Of its real and imaginary part.
    natural_frequency, damping : Estimate or None
        Of a pole with a continuous counterpart, rad/s and 1.
    note : str
        What to know about it.
    gradient : ndarray of complex, shape (n_coefficients,), or None
        Derivative by the model's coefficients; None for a double root.

    Example
    -------
    >>> FittedRoot("y/u", "pole", 0.5 + 0j, None, None, None)
    FittedRoot(pole of y/u at 0.5)
    """

    response: str
    kind: str
    z: complex
    covariance: Array | None
    natural_frequency: Estimate | None
    damping: Estimate | None
    note: str = ""
    gradient: NDArray[np.complex128] | None = None

    @property
    def stderr(self) -> tuple[float, float] | None:
        """Standard errors of real and imaginary part."""
        if self.covariance is None:
            return None
        real, imaginary = np.sqrt(np.diag(self.covariance))
        return float(real), float(imaginary)

    def __repr__(self) -> str:
        """Kind and place on one line."""
        place = f"{self.z.real:.4g}" + (f" ± {self.z.imag:.4g}i" if self.z.imag else "")
        return f"FittedRoot({self.kind} of {self.response} at {place})"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        omega, zeta = self.natural_frequency, self.damping
        return {
            "response": self.response,
            "kind": self.kind,
            "z": [self.z.real, self.z.imag],
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "natural_frequency": None if omega is None else omega.to_dict(),
            "damping": None if zeta is None else zeta.to_dict(),
            "note": self.note,
        }


def fitted_roots(model: PolynomialModel, degrees: float) -> tuple[FittedRoot, ...]:
    """Poles and zeros of each response, the slowest poles first.

    Parameters
    ----------
    model : PolynomialModel
        With or without covariance.
    degrees : int
        Degrees of freedom behind the covariance.
    """
    found = []
    for name in model.inputs:
        roots = list(_roots(model, name))
        poles = [item for item in roots if item[0] == POLE]
        order = [mode.z for mode in discrete_modes([z for _, z, _ in poles], model.sample_time_s)]
        poles.sort(key=lambda item: order.index(item[1]))
        zeros = [item for item in roots if item[0] == ZERO]
        errors = Errors(model.sample_time_s, model.covariance, degrees)
        response = f"{model.output}/{name}"
        found += [fitted_root(response, errors, *item) for item in (*poles, *zeros)]
    return tuple(found)


def _places(model: PolynomialModel) -> dict[tuple[str, int], slice]:
    """Where the coefficients of each polynomial stand."""
    counts = {("a", 0): np.size(model.a) - 1}
    counts |= {("b", i): np.size(row) for i, row in enumerate(model.b)}
    counts |= {("c", 0): np.size(model.c) - 1, ("d", 0): np.size(model.d) - 1}
    counts |= {("f", i): row.size - 1 for i, row in enumerate(model.distinct_f)}
    ends = np.cumsum([0, *counts.values()])
    found = {key: slice(int(a), int(b)) for key, a, b in zip(counts, ends, ends[1:], strict=False)}
    return found | {
        ("f", i): found["f", 0] for i in range(len(model.distinct_f), len(model.inputs))
    }


def _roots(
    model: PolynomialModel, name: str
) -> Iterator[tuple[str, complex, NDArray[np.complex128] | None]]:
    i = model.inputs.index(name)
    places = _places(model)
    for kind, key, row, free in (
        (POLE, ("a", 0), model.a, 1),
        (POLE, ("f", i), model.f[i], 1),
        (ZERO, ("b", i), model.b[i], 0),
    ):
        polynomial = np.asarray(row, dtype=np.float64)
        if polynomial.size < 2 or polynomial[0] == 0.0:
            continue
        slope = np.asarray(np.polyder(polynomial), dtype=np.float64)
        curve = float(np.max(np.abs(polynomial)))
        for z in np.roots(polynomial):
            if z.imag < 0.0 or z == 0.0:
                continue
            gradient = np.zeros(model.theta.size, dtype=np.complex128)
            below = complex(np.polyval(slope, z))
            if abs(below) <= DOUBLE * curve * max(1.0, abs(z)) ** (polynomial.size - 2):
                yield kind, complex(z), None
                continue
            powers = z ** np.arange(polynomial.size - 1, -1, -1)
            gradient[places[key]] = (-powers / below)[free:]
            yield kind, complex(z), gradient


def fitted_root(
    response: str,
    errors: Errors,
    kind: str,
    z: complex,
    gradient: NDArray[np.complex128] | None,
) -> FittedRoot:
    """A pole or zero with the errors that its gradient by the coefficients makes.

    Parameters
    ----------
    response : str
        ``"output/input"``.
    errors : Errors
        Of the coefficients.
    kind : {"pole", "zero"}
    z : complex
    gradient : ndarray of complex, shape (n_coefficients,), or None
    """
    note = zero_note(z) if kind == ZERO else ""
    mode = discrete_modes([z], errors.sample_time_s)[0] if kind == POLE else None
    if mode is not None:
        note = "; ".join(filter(None, (mode.reason, "unstable" if abs(z) > 1.0 else "")))
    covariance = _covariance_of(gradient, 1.0, errors)
    omega = zeta = None
    if mode is not None and mode.s is not None and mode.s != 0.0 and mode.damping is not None:
        root = UncertainRoot(
            mode.s,
            _covariance_of(gradient, 1.0 / (z * errors.sample_time_s), errors),
            NO_FIRST_ORDER if gradient is None else NO_ERRORS,
            errors.degrees,
        )
        omega = derived(root.natural_frequency(f"natural frequency at z = {z:.4g}"))
        zeta = derived(root.damping_ratio(f"damping at z = {z:.4g}"))
    return FittedRoot(response, kind, z, covariance, omega, zeta, note, gradient)


def _covariance_of(
    gradient: NDArray[np.complex128] | None, factor: complex, errors: Errors
) -> Array | None:
    """Covariance of real and imaginary part of what moves as the gradient times a factor."""
    if gradient is None or errors.covariance is None:
        return None
    rows = np.array([(gradient * factor).real, (gradient * factor).imag])
    return np.asarray(rows @ errors.covariance @ rows.T)


def coefficients_of(model: PolynomialModel, responses: Collection[str]) -> set[int]:
    """Places of the coefficients of A, B and F behind responses ``"output/input"``."""
    places = _places(model)
    keys = [
        key
        for i, name in enumerate(model.inputs)
        if f"{model.output}/{name}" in responses
        for key in (("a", 0), ("b", i), ("f", i))
    ]
    return {place for key in keys for place in range(model.theta.size)[places[key]]}


def without_errors(
    roots: Sequence[FittedRoot],
    which: Sequence[FittedRoot],
    reason: str,
    *,
    noted: bool = True,
) -> tuple[FittedRoot, ...]:
    """The roots, some without error bars and with the reason, noted beside each or not."""

    def bare(estimate: Estimate | None) -> Estimate | None:
        return estimate and replace(estimate, stderr=None, ends=None, reason=reason)

    return tuple(
        replace(
            root,
            covariance=None,
            natural_frequency=bare(root.natural_frequency),
            damping=bare(root.damping),
            note="; ".join(filter(None, (root.note, reason if noted else ""))),
        )
        if any(root is each for each in which)
        else root
        for root in roots
    )


def derived(reading: Reading) -> Estimate:
    """A reading that has a value, marked as computed from what was fitted."""
    assert reading.value is not None
    return cast("Estimate", replace(reading, status="derived"))


def propagated(
    name: str, unit: str, value: float, gradient: Array | None, errors: Errors
) -> Estimate:
    """A function of the coefficients with its first-order interval.

    Reference: Ljung, *System Identification*, 2nd ed., eq. 9.56 (Gauss' approximation).
    """
    if gradient is None or errors.covariance is None:
        reason = NO_FIRST_ORDER if gradient is None else NO_ERRORS
        return Estimate(name, value, unit, None, reason, status="derived")
    variance = float(gradient @ errors.covariance @ gradient)
    return derived(first_order(name, value, unit, variance, errors.degrees))


def farthest(polynomial: Array, covariance: Array, errors: float | None = None) -> float:
    """Largest size of a real root, some standard errors further out; default: a 95 % half-width.

    The covariance is that of the coefficients after the first.

    Levels and starts that are eliminated pile estimates of such a root of C up at the unit circle,
    and next to it nothing has errors to first order.

    Reference: Sargan & Bhargava (1983), Econometrica 51 (a moving average's root at the circle).

    Example
    -------
    >>> round(farthest(np.array([1.0, -0.9]), np.array([[0.01**2]])), 4)
    0.9196
    """
    slope, reach = np.polyder(polynomial), 0.0
    errors = half_width() if errors is None else errors
    for z in np.roots(polynomial):
        if z.imag != 0.0:
            continue
        rate = -(z ** np.arange(polynomial.size - 2, -1, -1)) / (np.polyval(slope, z) or np.inf)
        outwards = np.real(np.conj(z) / (abs(z) or 1.0) * rate)
        spread = np.sqrt(max(float(outwards @ covariance @ outwards), 0.0))
        reach = max(reach, abs(z) + errors * spread)
    return float(reach)


def fitted_gains(model: PolynomialModel, degrees: float) -> dict[str, Estimate]:
    """Steady gains by ``"output/input"`` with intervals; an integrator has none."""
    places = _places(model)
    found = {}
    for i, name in enumerate(model.inputs):
        response = f"{model.output}/{name}"
        value = model.gains()[response]
        if value is None:
            continue
        a, f = float(np.sum(model.a)), float(np.sum(model.f[i]))
        gradient = np.zeros(model.theta.size)
        gradient[places["b", i]] = 1.0 / (a * f)
        gradient[places["a", 0]] = -value / a
        gradient[places["f", i]] = -value / f
        units = (model.units.get(model.output, "1"), model.units.get(name, "1"))
        unit = quotient_unit(*units)
        errors = Errors(model.sample_time_s, model.covariance, degrees)
        found[response] = propagated(f"gain {response}", unit, value, gradient, errors)
    return found

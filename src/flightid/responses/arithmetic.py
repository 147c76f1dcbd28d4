"""Arithmetic on measured responses: what is known is divided out, loops are closed and opened.

A response times a known factor keeps its relative error exactly. A nonlinear step (closing or
opening a loop, a quotient of two measurements) carries errors to first order. Two measured
responses are taken as independent; where they come from the same records that is not exact, and
the result says so. Coherence stays that of the measured response the result was made from.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Light
from flightid.errors import DataError, ShapeError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.record.hold import InputShape
from flightid.responses.errors.random_error import CovarianceSource
from flightid.responses.response import FrequencyResponse
from flightid.units import canonical

Known = Callable[[NDArray[np.complex128]], ArrayLike] | ArrayLike
"""A known response: values, shape (n_f,), or a function of s = jω; a number is a plain gain."""

INDEPENDENT = Finding(
    "taken-as-independent",
    Light.AMBER,
    "errors of two measured responses were taken as independent",
    "if both come from the same records the error band is not exact",
)


@dataclass(frozen=True)
class MappedErrors:
    """Errors after a map with a complex derivative at each frequency.

    Attributes
    ----------
    errors : CovarianceSource
    derivative : ndarray of complex, shape (n_out, n_in, n_f)
    """

    errors: CovarianceSource
    derivative: NDArray[np.complex128]

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """See `CovarianceSource`."""
        before = self.errors.covariance(outputs, inputs, frequencies)
        found = np.empty_like(before)
        for place, output in enumerate(outputs):
            turn = self.derivative[output][np.ix_(inputs, frequencies)].ravel()
            real, imaginary = np.diag(turn.real), np.diag(turn.imag)
            jacobian = np.block([[real, -imaginary], [imaginary, real]])
            found[place] = jacobian @ before[place] @ jacobian.T
        return found


@dataclass(frozen=True)
class SummedErrors:
    """Errors of independent origin that act on the same response."""

    first: CovarianceSource
    second: CovarianceSource

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """See `CovarianceSource`."""
        one = self.first.covariance(outputs, inputs, frequencies)
        return one + self.second.covariance(outputs, inputs, frequencies)


def apply_known(
    response: FrequencyResponse, factor: Known, *, invert: bool = False
) -> FrequencyResponse:
    """Multiply by a known response, or divide it out: an actuator, a sensor, a filter.

    Parameters
    ----------
    response : FrequencyResponse
    factor : callable of s, or array_like, shape (n_f,)
        What is known, without error.
    invert : bool
        Divide instead of multiply.

    Raises
    ------
    DataError
        The factor is zero or not finite at a frequency.
    ShapeError
        Values that are not as many as the frequencies.

    Example
    -------
    >>> response = FrequencyResponse.from_values([1.0, 10.0], [1.0, 0.1], inputs=["u"],
    ...                                          outputs=["p"])
    >>> lag = lambda s: 1 / (0.1 * s + 1)
    >>> bare = apply_known(apply_known(response, lag), lag, invert=True)
    >>> bool(np.allclose(bare.response, response.response))
    True
    """
    values = _values(factor, response.omega_rad_s)
    return _mapped(response, response.response * (1 / values if invert else values))


def add_delay(response: FrequencyResponse, tau_s: float) -> FrequencyResponse:
    """Delay the output by `tau_s` seconds more; a negative number takes a delay out.

    Example
    -------
    >>> response = FrequencyResponse.from_values([1.0], [1.0], inputs=["u"], outputs=["p"])
    >>> round(float(np.angle(add_delay(response, 0.1).response[0, 0, 0])), 3)
    -0.1
    """
    return apply_known(response, lambda s: np.exp(-s * tau_s))


def differentiate(response: FrequencyResponse, order: int = 1) -> FrequencyResponse:
    """Response of the outputs' derivative; a negative order integrates. Units follow.

    Example
    -------
    >>> rate = FrequencyResponse.from_values([2.0], [1.0], inputs=["u"], outputs=["p"],
    ...                                      units={"p": "rad/s"})
    >>> attitude = differentiate(rate, -1)
    >>> abs(attitude.response), attitude.units["p"]
    (array([[[0.5]]]), 'rad')
    """
    made = apply_known(response, lambda s: s**order)
    units = dict(response.units)
    for name in response.outputs:
        units[name] = canonical(f"({units.get(name, '1')}) * s**{-order}")
    return replace(made, units=units)


def divide(numerator: FrequencyResponse, denominator: FrequencyResponse) -> FrequencyResponse:
    """Quotient of two measured responses of one pair each, with a common input or output.

    ``(y/u) / (x/u) = y/x`` and ``(y/u) / (y/x) = x/u``.

    Raises
    ------
    DataError
        Frequencies differ, or no channel is common.
    ShapeError
        A response has more than one pair.

    Example
    -------
    >>> p = FrequencyResponse.from_values([1.0], [2.0], inputs=["u"], outputs=["p"])
    >>> a = FrequencyResponse.from_values([1.0], [4.0], inputs=["u"], outputs=["a"])
    >>> divide(p, a).pair("p", "a").response
    array([0.5+0.j])
    """
    _require_alike(numerator, denominator)
    if numerator.inputs == denominator.inputs:
        outputs, inputs = numerator.outputs, denominator.outputs
    elif numerator.outputs == denominator.outputs:
        outputs, inputs = denominator.inputs, numerator.inputs
    else:
        raise DataError(
            "the two responses share no channel",
            found=f"{numerator!r} and {denominator!r}",
            needed="a common input or a common output",
        )
    below = denominator.response
    value = numerator.response / below
    return _joined(numerator, denominator, value, (1 / below, -value / below), outputs, inputs)


def multiply(second: FrequencyResponse, first: FrequencyResponse) -> FrequencyResponse:
    """Two measured responses of one pair each in series: ``(y/x) · (x/u) = y/u``.

    Raises
    ------
    DataError
        Frequencies differ, or the output of the first is not the input of the second.
    ShapeError
        A response has more than one pair.

    Example
    -------
    >>> actuator = FrequencyResponse.from_values([1.0], [0.5], inputs=["u"], outputs=["x"])
    >>> body = FrequencyResponse.from_values([1.0], [4.0], inputs=["x"], outputs=["p"])
    >>> multiply(body, actuator).pair("p", "u").response
    array([2.+0.j])
    """
    _require_alike(second, first)
    if second.inputs != first.outputs:
        raise DataError(
            "the responses are not in series",
            found=f"{first.outputs[0]} into {second.inputs[0]}",
            needed="the output of the first as input of the second",
        )
    value = second.response * first.response
    slopes = (first.response, second.response)
    return _joined(second, first, value, slopes, second.outputs, first.inputs)


def add(first: FrequencyResponse, second: FrequencyResponse) -> FrequencyResponse:
    """Sum of two measured responses of the same pair: paths side by side.

    Raises
    ------
    DataError
        Frequencies or channels differ.
    ShapeError
        A response has more than one pair.

    Example
    -------
    >>> path = FrequencyResponse.from_values([1.0], [2.0], inputs=["u"], outputs=["p"])
    >>> add(path, path).response
    array([[[4.+0.j]]])
    """
    _require_alike(first, second)
    if (first.outputs, first.inputs) != (second.outputs, second.inputs):
        found = " and ".join(f"{h.outputs[0]}/{h.inputs[0]}" for h in (first, second))
        raise DataError("a sum takes responses of the same pair", found=found)
    value, one = first.response + second.response, np.ones_like(first.response)
    return _joined(first, second, value, (one, one), first.outputs, first.inputs)


def close_loop(response: FrequencyResponse, feedback: Known) -> FrequencyResponse:
    """Close a known negative feedback around a measured pair: ``H / (1 + H K)``.

    Example
    -------
    >>> open_ = FrequencyResponse.from_values([1.0], [3.0], inputs=["u"], outputs=["p"])
    >>> close_loop(open_, 1.0).response
    array([[[0.75+0.j]]])
    """
    _require_pair(response)
    h, k = response.response, _values(feedback, response.omega_rad_s)
    return _mapped(response, h / (1 + h * k), 1 / (1 + h * k) ** 2)


def open_loop(response: FrequencyResponse, feedback: Known) -> FrequencyResponse:
    """Take a known negative feedback out of a measured closed-loop pair: ``T / (1 − T K)``.

    Errors grow without bound where ``T K`` approaches one, that is where the loop gain is high.

    Example
    -------
    >>> closed = FrequencyResponse.from_values([1.0], [0.75], inputs=["u"], outputs=["p"])
    >>> open_loop(closed, 1.0).response
    array([[[3.+0.j]]])
    """
    _require_pair(response)
    t, k = response.response, _values(feedback, response.omega_rad_s)
    return _mapped(response, t / (1 - t * k), 1 / (1 - t * k) ** 2)


def loop_of_sensitivity(response: FrequencyResponse) -> FrequencyResponse:
    """Broken loop behind a measured sensitivity of one pair: ``L = 1/S − 1``.

    The sensitivity is error over reference, or the fed-back signal over a disturbance added to it.
    Errors grow without bound where S is small, that is where the loop gain is high.

    Example
    -------
    >>> seen = FrequencyResponse.from_values([1.0], [0.25], inputs=["r"], outputs=["e"])
    >>> loop_of_sensitivity(seen).response
    array([[[3.+0.j]]])
    """
    _require_pair(response)
    s = response.response
    if np.any((s == 0.0) | (s == 1.0)):
        raise DataError(
            "a sensitivity is zero or one at a frequency", needed="a loop with a finite gain"
        )
    return _mapped(response, (1.0 - s) / s, -1.0 / s**2)


def peel_loop(augmented: FrequencyResponse, actuator: Known, gyro: Known) -> FrequencyResponse:
    """Bare response behind an active rate gyro: ``H_aug / (H_act − H_aug H_act H_gyro)``.

    The gyro's signal is subtracted from the command: ``H_aug = H_act H / (1 + H_act H H_gyro)``.

    Parameters
    ----------
    augmented : FrequencyResponse
        From stick to rate with the loop closed, one pair.
    actuator, gyro : callable of s, or array_like, shape (n_f,)
        Known responses.

    Reference
    ---------
    Mettler, Tischler & Kanade, "System identification modeling of a small-scale unmanned
    rotorcraft for flight control design", *J. American Helicopter Society* 47 (2002), equation 19.

    Example
    -------
    >>> bare, servo, gyro = 2.0, 0.5, 3.0
    >>> seen = bare * servo / (1 + bare * servo * gyro)
    >>> flown = FrequencyResponse.from_values([1.0], [seen], inputs=["ped"], outputs=["r"])
    >>> peel_loop(flown, servo, gyro).response.round(12)
    array([[[2.+0.j]]])
    """
    return apply_known(open_loop(augmented, gyro), actuator, invert=True)


def _values(known: Known, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    s = np.asarray(1j * omega, dtype=np.complex128)
    found = np.asarray(known(s) if callable(known) else known, dtype=np.complex128)
    if found.ndim == 0:
        found = np.full(omega.shape, complex(found))
    if found.shape != omega.shape:
        raise ShapeError("a known response does not fit", found=found.shape, needed=omega.shape)
    if not np.all(np.isfinite(found)) or np.any(found == 0.0):
        raise DataError(
            "a known response is zero or not finite at a frequency", needed="values that divide"
        )
    return found


def _mapped(
    response: FrequencyResponse,
    values: NDArray[np.complex128],
    derivative: NDArray[np.complex128] | None = None,
) -> FrequencyResponse:
    """Exchange the values; the derivative defaults to that of a known factor."""
    if not np.all(np.isfinite(values)) or np.any(values == 0.0):
        raise DataError(
            "the result is zero or not finite at a frequency",
            needed="responses that do not cancel, loops that are not on the edge of stability",
        )
    slope = values / response.response if derivative is None else derivative
    growth = np.abs(slope * response.response / values)
    return replace(
        response,
        response=values,
        random_error=response.random_error * growth,
        input_spectrum=None,
        cross_spectrum=None,
        output_spectrum=None,
        errors=None if response.errors is None else MappedErrors(response.errors, slope),
        linear=None,
        estimator=response.estimator.removesuffix(", arithmetic") + ", arithmetic",
    )


def _joined(
    first: FrequencyResponse,
    second: FrequencyResponse,
    values: NDArray[np.complex128],
    slopes: tuple[NDArray[np.complex128], NDArray[np.complex128]],
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
) -> FrequencyResponse:
    made, other = _mapped(first, values, slopes[0]), _mapped(second, values, slopes[1])
    driven = (each.input_shape for each in (first, second) if each.inputs == inputs)
    return replace(
        made,
        outputs=outputs,
        inputs=inputs,
        units={**first.units, **second.units},
        coherence=np.minimum(first.coherence, second.coherence),
        multiple_coherence=np.minimum(first.multiple_coherence, second.multiple_coherence),
        random_error=np.hypot(made.random_error, other.random_error),
        n_independent=np.minimum(first.n_independent, second.n_independent),
        findings=tuple(dict.fromkeys((*first.findings, *second.findings, INDEPENDENT))),
        errors=made.errors and other.errors and SummedErrors(made.errors, other.errors),
        loop=None,
        input_shape=next(driven, InputShape()),
        digests=(*first.digests, *(each for each in second.digests if each not in first.digests)),
    )


def _require_pair(response: FrequencyResponse) -> None:
    if response.response.shape[:2] != (1, 1):
        raise ShapeError(
            "this takes a response of one pair",
            found=repr(response),
            needed="one output and one input: select them first",
        )


def _require_alike(first: FrequencyResponse, second: FrequencyResponse) -> None:
    _require_pair(first)
    _require_pair(second)
    same = first.omega_rad_s.shape == second.omega_rad_s.shape
    if not same or not np.allclose(first.omega_rad_s, second.omega_rad_s, rtol=1e-9, atol=0.0):
        raise DataError(
            "the two responses have different frequencies",
            needed="one grid",
            action="estimate both with the same omega_rad_s",
        )

"""A pilot model of the vehicle, good enough to say what an estimator makes of it.

The bias of an estimate (leakage, resolution, interpolation) follows from the response itself, and
more signal does not shrink it. A rational response with the transients of the records' ends, fitted
to the Fourier bins of whole records, has no such bias; what the estimator's weights make of that
model's outputs, less its own response, is the bias to expect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from hashlib import blake2b

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.frozen import dataclass
from flightid.responses.errors.instrumented_pilot import instrumented
from flightid.responses.errors.pilot_errors import acting
from flightid.responses.errors.pilot_orders import PilotFit, fitted
from flightid.responses.errors.pilot_search import SPARE, PilotBins, PilotInputs, turns

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Places = NDArray[np.intp]
KEPT = 16
"""Inputs whose excited part is kept, those used last: of the AH-64 four of 200 KB."""
_MOVED: dict[bytes, tuple[Real, ...]] = {}
"""By what was injected, and the input: see `_excited`."""


@dataclass(frozen=True)
class Pilot:
    """A rational response of one output to all inputs.

    Attributes
    ----------
    scale_rad_s : float
        Frequency at which the functions of the basis have turned by 90°.
    numerators : ndarray, shape (n_in, order + 1)
    denominator : ndarray, shape (order + 1,)
        First coefficient one.
    outputs : tuple of ndarray, each shape (n_samples,)
        What it says of the output without noise, of each record, from zero to the band's end.
    slopes : tuple of ndarray, each shape (n_acting, n_samples)
        Their derivatives by the coefficients that act in a record: numerators, the record's own
        transient, denominator but its first.
    covariance : ndarray, shape (n_coefficients, n_coefficients)
        Of the coefficients: numerators, transients of all records, denominator but its first.
    spent : tuple of ndarray, each shape (n_bins of the record,)
        Share of each bin's noise that the coefficients took: slow bins are few, and bend the most.
    """

    scale_rad_s: float
    numerators: Real
    denominator: Real
    outputs: tuple[Real, ...]
    slopes: tuple[Real, ...]
    covariance: Real
    spent: tuple[Real, ...]

    @property
    def order(self) -> int:
        """Number of poles."""
        return len(self.denominator) - 1

    def acting(self, record: int) -> Places:
        """Places of a record's slopes among the coefficients."""
        n_in, size = self.numerators.shape
        return acting(n_in * size, size + SPARE, len(self.outputs), size - 1, record)

    def frequency_response(self, omega_rad_s: ArrayLike) -> Complex:
        """Response at frequencies in rad/s, shape (n_in, n_f)."""
        basis = turns(np.asarray(omega_rad_s, dtype=float), self.scale_rad_s, self.order)
        return np.asarray((self.numerators @ basis) / (self.denominator @ basis))

    def response_slopes(self, omega_rad_s: ArrayLike) -> Complex:
        """Derivatives of the response by the coefficients, shape (n_coefficients, n_in, n_f)."""
        basis = turns(np.asarray(omega_rad_s, dtype=float), self.scale_rad_s, self.order)
        basis_over = basis / (self.denominator @ basis)
        response = self.frequency_response(omega_rad_s)
        n_in, size = self.numerators.shape
        found = np.zeros((len(self.covariance), n_in, basis.shape[1]), dtype=np.complex128)
        for column in range(n_in):
            found[column * size : (column + 1) * size, column] = basis_over
        found[len(found) - self.order :] = -basis_over[1:, None] * response
        return found


@dataclass(frozen=True, eq=False)
class Pilots:
    """Pilot models of some records, fitted when first asked for.

    Attributes
    ----------
    inputs, outputs : tuple of ndarray, shapes (n_in, n) and (n_out, n)
        Samples of each record.
    sample_time_s : float
    highest_rad_s : float
        Highest frequency of the response.
    excitations : tuple of ndarray, each shape (n_exc, n)
        Of a closed loop, where the estimate goes by way of them.
    seen : dict
        The estimate of a pilot's slopes, by output and frequencies: see `LinearEstimate`.
    told : list
        Once it was asked for, what bins tell beside each frequency: `LinearEstimate.local_spread`.
    """

    inputs: tuple[Real, ...]
    outputs: tuple[Real, ...]
    sample_time_s: float
    highest_rad_s: float
    excitations: tuple[Real, ...] = ()
    seen: dict[tuple[int, bytes], Complex] = field(default_factory=dict, repr=False)
    told: list[Real | None] = field(default_factory=list, repr=False)

    @cached_property
    def found(self) -> list[Pilot | None]:
        """One for each output."""
        limits = self.sample_time_s, self.highest_rad_s
        if not self.excitations:
            return fit_pilots(self.inputs, self.outputs, *limits)
        excited = _excited(self.excitations, self.inputs, *limits)
        if excited is None:
            return [None] * len(self.outputs[0])
        return fit_pilots(self.inputs, self.outputs, *limits, excited=excited)


def _excited(
    excitations: Sequence[Real], inputs: Sequence[Real], sample_time_s: float, highest_rad_s: float
) -> tuple[Real, ...] | None:
    """The inputs as excitations alone would have moved them, by record; None where it is not told.

    Models of some outputs each are fitted to the same flight in one study: what was injected moved
    their inputs in the same way, so that each input's part is kept.
    """
    limits = sample_time_s, highest_rad_s
    given = blake2b(repr((limits, [each.shape for each in excitations])).encode())
    for record in excitations:
        given.update(record.tobytes())
    names = []
    for row in range(len(inputs[0])):
        key = given.copy()
        for record in inputs:
            key.update(record[row].tobytes())
        names.append(key.digest())
    rows = [row for row, name in enumerate(names) if name not in _MOVED]
    made = fit_pilots(excitations, [each[rows] for each in inputs], *limits) if rows else []
    found = {name: _MOVED[name] for name in names if name in _MOVED}
    found |= {names[row]: each.outputs for row, each in zip(rows, made, strict=True) if each}
    for name, outputs in found.items():
        _MOVED.pop(name, None)
        _MOVED[name] = outputs
    for name in list(_MOVED)[:-KEPT]:
        _MOVED.pop(name, None)
    if len(found) < len(set(names)):
        return None
    return tuple(np.stack(each) for each in zip(*(found[each] for each in names), strict=True))


def fit_pilots(
    inputs: Sequence[Real],
    outputs: Sequence[Real],
    sample_time_s: float,
    highest_rad_s: float,
    excited: Sequence[Real] = (),
) -> list[Pilot | None]:
    """Pilot models of all outputs, by maximum likelihood over the bins of whole records.

    Parameters
    ----------
    inputs, outputs : sequence of ndarray, shapes (n_in, n) and (n_out, n)
        Samples of each record.
    sample_time_s : float
    highest_rad_s : float
        Highest frequency of the response.
    excited : sequence of ndarray, each shape (n_in, n), optional
        The inputs as excitations alone would have moved them: instruments of a closed loop.

    Returns
    -------
    list of Pilot or None
        None where the records hold too few bins.

    Assumes
    -------
    Noise at the outputs alone. Without instruments biased by feedback, as direct estimates are.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., sections
    6.7.1 (the transient as a polynomial over the same denominator), 9.8 and 9.12; order by
    Akaike's criterion for few data (Hurvich & Tsai, *Biometrika* 76, 1989): an order too low would
    be a bias that no covariance holds.
    """
    limits = sample_time_s, highest_rad_s
    measured = PilotInputs.of(inputs, *limits)
    instruments = PilotInputs.of(excited, *limits) if excited else measured
    found = []
    for row in range(len(outputs[0])):
        output = [each[row] for each in outputs]
        data = measured.with_output(output)
        fit = fitted(instruments.with_output(output) if excited else data, beyond=bool(excited))
        if fit is not None and excited:
            fit = instrumented(data, fit)
        found.append(None if fit is None else _pilot(data, fit))
    return found


def _pilot(data: PilotBins, fit: PilotFit) -> Pilot:
    state, covariance = fit.state, fit.basis.covariance()
    variance = state.cost * data.size / max(2.0 * data.size - len(covariance), 1.0)
    return Pilot(
        data.given.scale_rad_s,
        state.numerators,
        state.denominator,
        data.samples(data.by_record(state.modelled)),
        data.samples(fit.slopes),
        variance * covariance,
        tuple(data.by_record(fit.spent)),
    )

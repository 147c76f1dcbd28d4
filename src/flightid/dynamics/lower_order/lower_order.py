"""Equivalent systems of low order, as handling qualities are specified by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.dynamics.lower_order.result import LowerOrder
from flightid.dynamics.lower_order.start import best_starts
from flightid.dynamics.lower_order.structures import DELAY, GAIN, equivalent_model, structure_of
from flightid.errors import DataError, FitError, OptionError, UnknownNameError
from flightid.findings import Finding, told_apart
from flightid.frozen import dataclass
from flightid.identification import Fit, identify
from flightid.identification.uncertain_of import source_findings, uncertain_of
from flightid.models import GreyBoxModel, LinearSystem, StateSpaceModel, TransferFunctionModel
from flightid.models.model import linear_system
from flightid.responses import FrequencyResponse
from flightid.threads import on_one_thread
from flightid.uncertainty.uncertain import Uncertain, uncertain_numbers
from flightid.validation.verification.muad import Mismatch, mismatch

GAIN_WEIGHT, PHASE_WEIGHT = 1.0, 0.01745
GOOD_COST = 10.0
LOW_COHERENCE = 0.6
FEWEST = 8
UNKNOWN_ERRORS = "the errors of the response are not known"
Array = NDArray[np.float64]


@on_one_thread
def lower_order(
    source: object,
    inputs: str | None = None,
    outputs: str | None = None,
    *,
    kind: str,
    band_rad_s: tuple[float, float] = (0.1, 10.0),
    n_omega: int = 20,
    t_theta2_s: float | None = None,
    airspeed_m_s: float | None = None,
    n_alpha: float | None = None,
    fixed: Mapping[str, float] | None = None,
    correct_bias: bool = True,
) -> LowerOrder:
    """Fit an equivalent system of low order with delay to a response.

    Parameters
    ----------
    source : Fit, FrequencyResponse, model, LinearSystem, or a black-box fit
        High-order system. Intervals come from the covariance of a fit's parameters, each of which
        moves the equivalent system, or from the errors of a measured response.
    inputs, outputs : str, optional
        Pair; left out where the source has one.
    kind : str
        ``"short_period"`` (q), ``"pitch_attitude"`` (θ), ``"roll"`` (p), ``"roll_attitude"`` (φ),
        ``"roll_spiral"`` (φ), ``"roll_dutch_roll"`` (p), ``"dutch_roll"`` (β), ``"yaw"`` or
        ``"yaw_spiral"`` (r).
    band_rad_s : tuple of float
        Band of the fit, rad/s.
    n_omega : int
        Frequencies, evenly spaced in log.
    t_theta2_s : float, optional
        T_θ2, s, held fixed: from n/α, since pitch rate alone hardly tells it.
    airspeed_m_s, n_alpha : float, optional
        For the control anticipation parameter: n/α, g/rad, else U/(g T_θ2).
    fixed : mapping of str to float, optional
        Parameters held fixed, by name.
    correct_bias : bool
        Of a measured response: see `identify`.

    Raises
    ------
    DataError
        The source has no points in the band.
    FitError
        The structure cannot be fitted.
    OptionError
        An unknown kind, a band without meaning, or a source with several pairs and no choice.
    UnknownNameError
        There is no such channel or parameter.

    Assumes
    -------
    Linear phase of what the structure lacks: actuators, filters and rotors become delay. Biased
    where the band holds a mode that the structure has not; the mismatch says so.

    Reference
    ---------
    MIL-STD-1797A (1990), appendix A, §4.2.1.2 and 4.5.1.5; cost: Hodgkinson, *Aircraft Handling
    Qualities* (1999), chapter 4; Tischler & Remple, *Aircraft and Rotorcraft System
    Identification*, 2nd ed., equation 11.4.

    Example
    -------
    >>> import flightid as fid
    >>> vehicle = fid.load_model("rate_motor_lag").with_values({"Lp": -4.0})
    >>> found = lower_order(vehicle, kind="roll")
    >>> round(found.value("T_R"), 3), bool(found.value("tau") > vehicle.parameters["tau"].value)
    (0.269, True)
    """
    task = _Task(kind, _band(band_rad_s, n_omega), n_omega, _known(kind, fixed, t_theta2_s))
    if isinstance(source, FrequencyResponse):
        names = _choose(source.outputs, outputs), _choose(source.inputs, inputs)
        response = source.select(outputs=names[:1], inputs=names[1:])
        best = _first_fit(task, response, correct_bias=correct_bias)
        uncertain = uncertain_numbers(_values(best, best.names), best.covariance, UNKNOWN_ERRORS)
    else:
        carried = uncertain_of(source)
        system = _system(carried.value)
        names = _choose(system.outputs, outputs), _choose(system.inputs, inputs)
        response = _response(task, system, *names)
        best = _first_fit(task, response, correct_bias=False)
        uncertain = _carried(task, carried, best, *names)
    found = LowerOrder(
        kind,
        *names,
        best,
        best.names,
        uncertain,
        response,
        task.band,
        _cost(best),
        _envelopes(best, response, task.band),
        airspeed_m_s,
        n_alpha,
    )
    return replace(found, findings=(*_judge(found), *source_findings(source)))


@dataclass(frozen=True)
class _Task:
    """What to fit: structure, band, number of frequencies, and what is known."""

    kind: str
    band: tuple[float, float]
    n_omega: int
    known: Mapping[str, float]

    def model(self, response: FrequencyResponse) -> TransferFunctionModel:
        pair = response.outputs[0], response.inputs[0]
        model = equivalent_model(self.kind, *pair, response.units)
        return model.with_fixed(**self.known) if self.known else model


def _band(band: tuple[float, float], n_omega: int) -> tuple[float, float]:
    low, high = band
    if not (np.isfinite(high) and 0.0 < low < high):
        raise OptionError("band_rad_s has no meaning", found=band, needed="0 < low < high")
    if n_omega < FEWEST:
        raise OptionError("n_omega is too small", found=n_omega, needed=f"{FEWEST} or more")
    return low, high


def _known(
    kind: str, fixed: Mapping[str, float] | None, t_theta2_s: float | None
) -> dict[str, float]:
    known = dict(fixed or {})
    numbers = structure_of(kind).numbers
    if t_theta2_s is not None:
        if "inverse_T_theta2" not in numbers:
            raise OptionError("this kind has no T_θ2", found=kind, needed="a kind of pitch")
        if not t_theta2_s > 0.0:
            raise OptionError("T_θ2 has no meaning", found=t_theta2_s, needed="seconds above 0")
        known["inverse_T_theta2"] = 1.0 / t_theta2_s
    for name in known:
        if name not in (*numbers, GAIN, DELAY):
            raise UnknownNameError(
                "there is no such parameter", found=name, needed=", ".join((*numbers, GAIN, DELAY))
            )
    return known


def _choose(known: Sequence[str], given: str | None) -> str:
    if given is None:
        if len(known) != 1:
            raise OptionError(
                "the source has several channels", found=", ".join(known), needed="one of them"
            )
        return known[0]
    if given not in known:
        raise UnknownNameError("there is no such channel", found=given, needed=", ".join(known))
    return given


def _system(thing: object) -> GreyBoxModel | LinearSystem:
    return (
        thing
        if isinstance(thing, TransferFunctionModel | StateSpaceModel)
        else linear_system(thing)
    )


def _response(
    task: _Task, thing: GreyBoxModel | LinearSystem, output: str, control: str
) -> FrequencyResponse:
    """The pair's response at the frequencies of the fit."""
    omega = np.geomspace(*task.band, task.n_omega)
    row, column = list(thing.outputs).index(output), list(thing.inputs).index(control)
    values = thing.frequency_response(omega)[row, column]
    if not np.all(np.isfinite(values)) or np.any(values == 0.0):
        raise DataError(
            f"{output}/{control} is zero or infinite in the band",
            found=f"{task.band[0]:.3g} to {task.band[1]:.3g} rad/s",
            needed="a response at every frequency",
        )
    units = {name: thing.units.get(name, "1") for name in (output, control)}
    return FrequencyResponse.from_values(
        omega, values, inputs=[control], outputs=[output], units=units, estimator="model"
    )


def _first_fit(task: _Task, response: FrequencyResponse, *, correct_bias: bool) -> Fit:
    """Best of the fits from the best starts of a grid."""
    pair = response.pair(response.outputs[0], response.inputs[0])
    low, high = task.band
    inside = (pair.omega_rad_s >= low * (1 - 1e-9)) & (pair.omega_rad_s <= high * (1 + 1e-9))
    usable = inside & (pair.coherence >= LOW_COHERENCE) & (pair.response != 0.0)
    if np.count_nonzero(usable) < FEWEST:
        raise DataError(
            f"{pair.output}/{pair.input} has too few points for an equivalent system",
            found=f"{np.count_nonzero(usable)} with coherence {LOW_COHERENCE:g} between "
            f"{low:.3g} and {high:.3g} rad/s",
            needed=f"{FEWEST} or more",
        )
    places = np.flatnonzero(usable)
    few = places[np.unique(np.linspace(0, len(places) - 1, task.n_omega).round().astype(int))]
    starts = best_starts(task.model(response), pair.omega_rad_s[few], pair.response[few])
    band = float(pair.omega_rad_s[places[0]]), float(pair.omega_rad_s[places[-1]])
    found: list[Fit] = []
    trouble: FitError | None = None
    for start in starts:
        try:
            found.append(_fit(task, start, response, band, correct_bias=False))
        except FitError as error:
            trouble = error
    if not found:
        assert trouble is not None
        raise trouble
    best = min(found, key=lambda fit: fit.objective)
    if not correct_bias or response.linear is None:
        return best
    assert isinstance(best.model, TransferFunctionModel)
    return _fit(task, best.model, response, band, correct_bias=True)


def _fit(
    task: _Task,
    start: TransferFunctionModel,
    response: FrequencyResponse,
    band: tuple[float, float],
    *,
    correct_bias: bool,
) -> Fit:
    return identify(
        start,
        response,
        band_rad_s=band,
        n_omega=task.n_omega,
        minimum_coherence=LOW_COHERENCE,
        weight_gain=GAIN_WEIGHT,
        weight_phase=PHASE_WEIGHT,
        correct_bias=correct_bias,
    )


def _carried(
    task: _Task, carried: Uncertain[Any], best: Fit, output: str, control: str
) -> Uncertain[Array]:
    """The equivalent system fitted anew to the source one standard error up and down."""
    start = best.model
    assert isinstance(start, TransferFunctionModel)

    def numbers(thing: object) -> Array:
        response = _response(task, _system(thing), output, control)
        try:
            moved = _fit(task, start, response, task.band, correct_bias=False)
        except FitError:
            return np.full(len(best.names), np.nan)
        return _values(moved, best.names)

    return carried.carried(numbers)


def _values(fit: Fit, names: Sequence[str]) -> Array:
    return np.array([fit.parameters[name].value for name in names])


def _fitted(fit: Fit) -> tuple[Array, NDArray[np.complex128], NDArray[np.complex128]]:
    """Fitted frequencies, and the measured response and the equivalent system there."""
    shown = fit.responses[0]
    places = np.searchsorted(shown.measured.omega_rad_s, shown.omega_rad_s)
    return shown.omega_rad_s, shown.measured.response[places], shown.model[places]


def _cost(fit: Fit) -> float:
    _, measured, model = _fitted(fit)
    ratio = model / measured
    decibels, degrees = 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
    return float(20.0 * np.mean(GAIN_WEIGHT * decibels**2 + PHASE_WEIGHT * degrees**2))


def _envelopes(fit: Fit, response: FrequencyResponse, band: tuple[float, float]) -> Mismatch:
    return mismatch(fit.model, response.select(band_rad_s=(0.999 * band[0], 1.001 * band[1])))


def _judge(found: LowerOrder) -> tuple[Finding, ...]:
    made = []
    if found.mismatch_cost > GOOD_COST:
        made.append(
            Finding(
                "equivalent-system-mismatch",
                Light.AMBER,
                f"{found.name}: the mismatch cost is "
                f"{told_apart(found.mismatch_cost, GOOD_COST, decimals=1)}, above "
                f"{GOOD_COST:g}: the structure lacks something in the band",
                "narrow the band, or take a kind with another mode; do not rate its numbers",
            )
        )
    low, high = found.fit.responses[0].band_rad_s
    if low > 1.5 * found.band_rad_s[0] or high < found.band_rad_s[1] / 1.5:
        made.append(
            Finding(
                "equivalent-system-band",
                Light.AMBER,
                f"{found.name}: coherent from {low:.3g} to {high:.3g} rad/s alone, of "
                f"{found.band_rad_s[0]:.3g} to {found.band_rad_s[1]:.3g} rad/s",
                "excite the rest of the band; numbers from part of it may differ",
            )
        )
    for name, each in found.fit.parameters.items():
        if each.status == "at bound":
            made.append(
                Finding(
                    "equivalent-system-bound",
                    Light.AMBER,
                    f"{found.name}: {name} ended at its bound, {each.value:.3g} {each.unit}",
                    "the band hardly tells it: fix it to what is known, or take a simpler kind",
                )
            )
    return (*made, *found.mismatch.findings)

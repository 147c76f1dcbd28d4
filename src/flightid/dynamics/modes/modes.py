"""Modes of any model: eigenvalues with what they mean, and 95 % intervals on all of it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.dynamics.modes.names import NamedMode, name_by_outputs, name_by_states
from flightid.dynamics.modes.participation import UNINVOLVED, Eigenpair, eigenpairs
from flightid.dynamics.modes.result import Mode, Modes, Participation
from flightid.dynamics.modes.state_matrix import StateMatrix, read_states
from flightid.findings import Finding
from flightid.identification.uncertain_of import source_findings
from flightid.models.sampled.discrete_modes import AT_ORIGIN, NO_COUNTERPART
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.roots import UNSIGNED, UncertainRoot

Array = NDArray[np.float64]
UNFITTED = "does not depend on what was fitted"
ONE_SAMPLE = "delay of one sample"
SEEN = 1e-6
"""Size in an output, against the largest, below which the output does not show a mode."""


def modes(source: object, *, states: Mapping[str, str] | None = None) -> Modes:
    """Modes of a model with their meaning and their intervals.

    Parameters
    ----------
    source : Fit, or a model or LinearSystem
        A model alone has no intervals. Delays add no modes; noise models are left out.
    states : mapping of str to str, optional
        Conventional names (u, w, q, theta, …) of states that the model calls something else, for
        the words.

    Returns
    -------
    Modes
        Eigenvalue, damping ratio, natural frequency, period, time constant, time to half or to
        double, participation and description of each.

    Raises
    ------
    ModelError
        There is no linear system in the source.
    UnknownNameError
        There is no such state.

    Assumes
    -------
    Errors of the parameters small enough for first order. Where an eigenvalue departs from
    first order by more than half a standard error, as where two nearly meet, there is no interval
    and `Mode.reason` says why. Times have the interval of the real part turned over.

    Reference
    ---------
    Magnus, "On differentiating eigenvalues and eigenvectors", *Econometric Theory* 1 (1985): for a
    simple eigenvalue dλ = wᴴ dA v / wᴴ v. Participation factors: Pérez-Arriaga, Verghese &
    Schweppe, *IEEE Trans. Power Apparatus and Systems* 101 (1982), eq. 5.

    Example
    -------
    >>> import flightid as fid
    >>> found = modes(fid.load_model("fixed_wing_longitudinal"))
    >>> print(found.modes[0].description)
    phugoid, lightly damped oscillation: pitch attitude 49 %, forward speed 48 %
    >>> round(found.mode("short period").natural_frequency.value, 3)
    3.609
    """
    read = read_states(source, states or {})
    pairs = eigenpairs(np.asarray(read.system.a), read.directions)
    made = sorted((_mode(read, pair) for pair in pairs), key=_order)
    return Modes(
        read.name,
        tuple(made),
        read.system.sample_time_s,
        read.reason,
        (*_judge(made), *source_findings(source)),
    )


def _order(mode: Mode) -> tuple[float, float, str]:
    """Slowest first; equal to rounding by name, so that every machine lists them alike."""
    value = mode.eigenvalue
    if value is None:
        return math.inf, 0.0, mode.name
    return float(f"{abs(value):.9g}"), float(f"{value.real:.9g}"), mode.name


def _mode(read: StateMatrix, pair: Eigenpair) -> Mode:
    step = read.system.sample_time_s
    value, rate, lacking = _continuous(pair.value, step)
    moves = None if pair.value_moves is None or value is None else rate * pair.value_moves
    reason = lacking or read.reason or pair.reason
    if moves is not None and not np.any(np.abs(moves) > 0.0):
        moves, reason = None, UNFITTED
    rows = None if moves is None else np.array([moves.real, moves.imag])
    covariance = None if rows is None else np.asarray(rows @ rows.T)
    numbers = UncertainRoot(value, covariance, reason)
    parts = tuple(_participations(read, pair)) if read.physical else ()
    named = _named(read, pair, value)
    return Mode(
        value,
        pair.value,
        replace(named, character=ONE_SAMPLE) if lacking == AT_ORIGIN else named,
        numbers.real(),
        numbers.imaginary(),
        numbers.natural_frequency(),
        numbers.damping_ratio(),
        numbers.period(),
        numbers.time_constant(),
        *numbers.halving(),
        parts,
        covariance,
        lacking or pair.reason,
    )


def _continuous(root: complex, step: float | None) -> tuple[complex | None, complex, str]:
    """Eigenvalue in rad/s, its derivative by the root, and why there is none."""
    if step is None:
        return root, 1.0, ""
    if root == 0.0:
        return None, 0.0, AT_ORIGIN
    if not root.imag and root.real < 0.0:
        return None, 0.0, NO_COUNTERPART
    return cmath.log(root) / step, 1.0 / (root * step), ""


def _named(read: StateMatrix, pair: Eigenpair, value: complex | None) -> NamedMode:
    if read.physical:
        return name_by_states(value, pair, read.states, read.units)
    shown = np.abs(np.asarray(read.system.c) @ pair.vector)
    seen = [
        name
        for name, size in zip(read.system.outputs, shown, strict=True)
        if size > SEEN * np.max(shown, initial=0.0)
    ]
    return name_by_outputs(value, seen)


def _participations(read: StateMatrix, pair: Eigenpair) -> Iterator[Participation]:
    if pair.factors is None:
        return
    shares, share_errors = pair.shares, pair.share_errors
    lead = int(np.argmax(shares))
    shape, shape_errors = pair.shape(lead), pair.shape_errors(lead)
    reason = read.reason or pair.reason
    for place in np.argsort(-shares, kind="stable"):
        unit = read.system.units.get(read.system.states[place], "1")
        involved = abs(pair.factors[place]) > UNINVOLVED
        share = _plain("share", float(shares[place]), "1", share_errors, place, reason)
        size = _plain("size", float(abs(shape[place])), unit, shape_errors, place, reason)
        yield Participation(
            read.system.states[place],
            unit,
            complex(pair.factors[place]),
            share if involved else Estimate("share", share.value, "1", None, "takes no part"),
            size if place != lead else Estimate("size", 1.0, unit, None, "one by definition"),
            float(np.angle(shape[place])),
        )


def _plain(
    name: str, value: float, unit: str, errors: Array | None, place: int, reason: str
) -> Reading:
    if errors is None:
        return Estimate(name, value, unit, None, reason)
    stderr = float(errors[place])
    if stderr == 0.0:
        return Estimate(name, value, unit, None, UNFITTED)
    return Estimate(name, value, unit, stderr)


def _judge(found: list[Mode]) -> Iterator[Finding]:
    for mode in found:
        if mode.eigenvalue is None and mode.reason == NO_COUNTERPART:
            yield Finding(
                "no-continuous-counterpart",
                Light.AMBER,
                f"the pole z = {mode.root.real:.4g} is real and negative: {NO_COUNTERPART}",
                "lower the order, or take the model as it is, sampled",
            )
            continue
        growing = mode.time_to_double
        if growing.value is not None:
            yield Finding(
                "unstable-mode",
                Light.AMBER,
                f"{mode.name}: unstable, doubles in {growing.text}",
                "close a loop around it before anything else",
            )
        if mode.real.interval95 is not None and mode.time_constant.reason == UNSIGNED:
            yield Finding(
                "stability-not-determined",
                Light.AMBER,
                f"{mode.name}: {UNSIGNED} ({mode.real.text})",
                "longer records at low frequencies",
            )

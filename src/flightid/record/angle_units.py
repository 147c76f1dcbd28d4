"""Angles and angular rates that contradict each other by the factor between degrees and radians."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record.sample_faults import FEWEST, SampleFault
from flightid.units import is_convertible, si_base

Array = NDArray[np.float64]
STEPS = 200
"""Windows over which a rate is integrated and an angle differs."""
CORRELATION = 0.9
TOLERANCE = 0.1
DEGREES = 180.0 / np.pi


def ratio_of_increments(
    angle: tuple[Array, Array], rate: tuple[Array, Array], edges: Array
) -> tuple[float, float] | None:
    """How much an angle moves for each radian that a rate says, and their correlation.

    Increments of the angle and integrals of the rate between the edges, each set about its mean:
    a bias of the rate does nothing. The ratio is that of their spreads: the noise of either biases
    it by less than the correlation lacks of one.

    Parameters
    ----------
    angle, rate : (time_s, values)
        Stamps, s, and samples, each in its own unit.
    edges : ndarray, shape (n,)
        Increasing instants, s.

    Returns
    -------
    tuple of float, or None
        None where one of them does not move.
    """
    time_s, values = rate
    middle = 0.5 * (values[1:] + values[:-1]) * np.diff(time_s)
    turned = np.diff(np.interp(edges, time_s, np.concatenate([[0.0], np.cumsum(middle)])))
    return spread_ratio(np.diff(np.interp(edges, *angle)), turned)


def spread_ratio(moved: Array, turned: Array) -> tuple[float, float] | None:
    """Spread of the first over that of the second, and their correlation; None without motion."""
    moved, turned = moved - moved.mean(), turned - turned.mean()
    first, second = float(np.sqrt(turned @ turned)), float(np.sqrt(moved @ moved))
    if first == 0.0 or second == 0.0:
        return None
    return second / first, float(turned @ moved) / (first * second)


def angle_unit_faults(
    channels: Mapping[str, tuple[Array, Array]],
    units: Mapping[str, str],
    taken: Collection[str] | None = None,
) -> list[SampleFault]:
    """Pairs of an angle and a rate that is its derivative but for the factor 57.3.

    Parameters
    ----------
    channels : mapping of str to (time_s, values)
    units : mapping of str to str
        As declared.
    taken : collection of str, optional
        Channels that become a record; the others only bear witness. Default: all.

    Returns
    -------
    list of SampleFault
        Named by the rate, or by the angle where only that is taken; each channel once.

    Example
    -------
    >>> t = np.arange(2000) / 100
    >>> data = {"phi": (t, np.sin(t)), "p": (t, np.degrees(np.cos(t)))}
    >>> [fault] = angle_unit_faults(data, {"phi": "rad", "p": "rad/s"})
    >>> fault.finding.code
    'units-swapped'
    """
    angles = [name for name in channels if is_convertible(units[name], "rad")]
    rates = [name for name in channels if is_convertible(units[name], "rad/s")]
    if not (angles and rates):
        return []
    finite = {name: _finite(*channels[name]) for name in (*angles, *rates)}
    moving = {n: d for n, d in finite.items() if d[1].size >= FEWEST and np.ptp(d[1]) > 0.0}
    angles, rates = ([n for n in names if n in moving] for names in (angles, rates))
    found: dict[str, SampleFault] = {}
    known = set(channels) if taken is None else set(taken)
    for angle, rate in product(angles, rates):
        named = rate if rate in known else angle
        fault = _pair(angle, rate, moving, units) if named in known else None
        if fault is not None:
            found.setdefault(named, replace(fault, channel=named))
    return list(found.values())


def _finite(time_s: Array, values: Array) -> tuple[Array, Array]:
    good = np.isfinite(time_s) & np.isfinite(values)
    return time_s[good], values[good]


def _pair(
    angle: str, rate: str, data: Mapping[str, tuple[Array, Array]], units: Mapping[str, str]
) -> SampleFault | None:
    start = max(data[angle][0][0], data[rate][0][0])
    stop = min(data[angle][0][-1], data[rate][0][-1])
    step = max(float(np.median(np.diff(data[name][0]))) for name in (angle, rate))
    count = min(STEPS, int((stop - start) / (3.0 * step)))
    if count < FEWEST // 2:
        return None
    edges = np.linspace(start, stop, count)
    found = ratio_of_increments(data[angle], data[rate], edges)
    if found is None or found[1] < CORRELATION:
        return None
    ratio = found[0] * si_base(units[angle])[0] / si_base(units[rate])[0]
    if all(abs(ratio / factor - 1.0) > TOLERANCE for factor in (DEGREES, 1.0 / DEGREES)):
        return None
    said = (
        f"{angle} moves {ratio:.3g} times as far as {rate} turns it, as declared in "
        f"{units[angle]} and {units[rate]}: one of them is in degrees where the other is in radians"
    )
    action = "declare the true units where the file is read (units)"
    finding = Finding("units-swapped", Light.RED, said, action)
    return SampleFault(rate, float(start), float(stop), finding)

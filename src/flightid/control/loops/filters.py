"""Blocks with dynamics: filters by corner and damping, lead-lag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from flightid.control.loops.block import Block
from flightid.control.loops.rational import observer_form
from flightid.errors import OptionError

Units = Mapping[str, str] | None
BUTTERWORTH = float(np.sqrt(0.5))


def low_pass(
    inputs: str,
    outputs: str,
    corner_rad_s: float,
    order: Literal[1, 2] = 1,
    *,
    damping: float = BUTTERWORTH,
    units: Units = None,
) -> Block:
    """Low-pass of gain one: ω/(s + ω), or ω²/(s² + 2ζω s + ω²).

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    corner_rad_s : float
        ω, rad/s.
    order : {1, 2}
    damping : float
        ζ of the second order.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    OptionError
        A corner or damping that is not above zero, another order.

    Reference
    ---------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 7th ed., section 3.3.

    Example
    -------
    >>> low_pass("p", "p_slow", 20.0, 2).part.order
    2
    """
    below = _denominator(corner_rad_s, order, damping)
    return _filter("low-pass", (inputs,), outputs, [[below[-1]]], below, units)


def high_pass(
    inputs: str,
    outputs: str,
    corner_rad_s: float,
    order: Literal[1, 2] = 1,
    *,
    damping: float = BUTTERWORTH,
    units: Units = None,
) -> Block:
    """High-pass that ends at gain one: s/(s + ω), or s²/(s² + 2ζω s + ω²).

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    corner_rad_s : float
        ω, rad/s.
    order : {1, 2}
    damping : float
        ζ of the second order.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    OptionError
        A corner or damping that is not above zero, another order.

    Reference
    ---------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 7th ed., section 3.3.

    Example
    -------
    >>> high_pass("q", "q_fast", 0.5)
    Block(high-pass: [q] to [q_fast])
    """
    below = _denominator(corner_rad_s, order, damping)
    return _filter("high-pass", (inputs,), outputs, [[1.0, *[0.0] * order]], below, units)


def washout(
    inputs: str,
    outputs: str,
    corner_rad_s: float,
    *,
    units: Units = None,
) -> Block:
    """Washout s/(s + ω): passes what changes and forgets what stays.

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    corner_rad_s : float
        ω, rad/s: one over the washout time.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    OptionError
        A corner that is not above zero.

    Reference
    ---------
    Stevens, Lewis & Johnson, *Aircraft Control and Simulation*, 3rd ed., section 4.4 (yaw damper).

    Example
    -------
    >>> washout("r", "r_washed", 0.5)
    Block(washout: [r] to [r_washed])
    """
    return replace(high_pass(inputs, outputs, corner_rad_s, units=units), name="washout")


def notch(
    inputs: str,
    outputs: str,
    centre_rad_s: float,
    *,
    damping: float = 0.5,
    depth: float = 0.0,
    units: Units = None,
) -> Block:
    """Notch (s² + 2dζω s + ω²)/(s² + 2ζω s + ω²): gain d at the centre, one far away.

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    centre_rad_s : float
        ω, rad/s.
    damping : float
        ζ; the notch is 2ζω wide between its half-power points where the depth is zero.
    depth : float
        d, from 0 (nothing passes at the centre) to 1 (no notch).
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    OptionError
        A number outside its range.

    Reference
    ---------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 7th ed., section 5.4.3.

    Example
    -------
    >>> abs(notch("p", "q", 100.0, depth=0.1).part.frequency_response([100.0])).round(9).item()
    0.1
    """
    if not 0.0 <= depth < 1.0:
        raise OptionError("the depth of a notch", found=depth, needed="0 up to below 1")
    below = _denominator(centre_rad_s, 2, damping)
    above = [below[0], depth * below[1], below[2]]
    return _filter("notch", (inputs,), outputs, [above], below, units)


def complementary(
    slow: str,
    fast: str,
    outputs: str,
    corner_rad_s: float,
    order: Literal[1, 2] = 1,
    *,
    damping: float = 1.0,
    fast_is: Literal["same", "rate"] = "same",
    units: Units = None,
) -> Block:
    """Complementary filter: slow motion from one sensor, fast motion from another, sum one.

    F(s) slow + (1 − F(s)) fast with F = ω/(s + ω), or (2ζω s + ω²)/(s² + 2ζω s + ω²).

    Parameters
    ----------
    slow, fast, outputs : str
        Signals: for example the attitude of an accelerometer, the gyro's, and what comes out.
    corner_rad_s : float
        ω, rad/s.
    order : {1, 2}
    damping : float
        ζ of the second order.
    fast_is : {"same", "rate"}
        `fast` measures the same quantity, or its rate.
    units : mapping of str to str, optional
        Unit by signal.

    Raises
    ------
    OptionError
        A corner or damping that is not above zero, another order or kind.

    Reference
    ---------
    Higgins, *IEEE Trans. Aerospace and Electronic Systems* AES-11 (1975), 321–325.

    Example
    -------
    >>> complementary("phi_acc", "p", "phi", 0.5, fast_is="rate")
    Block(complementary: [phi_acc, p] to [phi])
    """
    if fast_is not in ("same", "rate"):
        raise OptionError("what the fast sensor measures", found=fast_is, needed="same or rate")
    below = _denominator(corner_rad_s, order, damping)
    passed = [0.0, *below[1:]]
    rest = [1.0, *[0.0] * order]
    if fast_is == "rate":
        rest = [0.0, *rest[:-1]]
    found = _filter("complementary", (slow, fast), outputs, [passed, rest], below, units)
    return replace(found, alike=fast_is == "same")


def lead_lag(
    inputs: str,
    outputs: str,
    lead_s: float,
    lag_s: float,
    *,
    units: Units = None,
) -> Block:
    """Lead-lag (T₁ s + 1)/(T₂ s + 1).

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    lead_s, lag_s : float
        T₁ from zero up, T₂ above zero, s.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    OptionError
        A time outside its range.

    Reference
    ---------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 7th ed., section 6.7.

    Example
    -------
    >>> abs(lead_lag("u", "v", 0.2, 0.1).part.frequency_response([1e6])).round(6).item()
    2.0
    """
    if not (np.isfinite(lead_s) and lead_s >= 0.0 and np.isfinite(lag_s) and lag_s > 0.0):
        raise OptionError("the times of a lead-lag", found=f"{lead_s} s and {lag_s} s",
                          needed="a lead from 0 s up and a lag above 0 s")  # fmt: skip
    return _filter("lead-lag", (inputs,), outputs, [[lead_s, 1.0]], [lag_s, 1.0], units)


def _denominator(corner: float, order: int, damping: float) -> list[float]:
    if not (np.isfinite(corner) and corner > 0.0):
        raise OptionError("the corner of a filter", found=corner, needed="rad/s above zero")
    if order == 1:
        return [1.0, corner]
    if order != 2:
        raise OptionError("the order of a filter", found=order, needed="1 or 2")
    if not (np.isfinite(damping) and damping > 0.0):
        raise OptionError("the damping of a filter", found=damping, needed="above zero")
    return [1.0, 2.0 * damping * corner, corner**2]


def _filter(
    name: str,
    inputs: tuple[str, ...],
    output: str,
    above: Sequence[Sequence[float]],
    below: Sequence[float],
    units: Units,
) -> Block:
    system = observer_form(inputs, output, [np.array(each) for each in above], np.array(below))
    return Block(name, inputs, (output,), system, units or {}, alike=True)

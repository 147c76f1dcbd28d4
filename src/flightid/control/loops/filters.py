"""Blocks with dynamics: filters by corner and damping, lead-lag, any transfer function."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.control.loops.block import Block
from flightid.errors import ModelError, OptionError
from flightid.models.linear_system import LinearSystem

Units = Mapping[str, str] | None
Array = NDArray[np.float64]
BUTTERWORTH = float(np.sqrt(0.5))


def low_pass(
    input: str,  # noqa: A002 — a block has an input and an output
    output: str,
    corner_rad_s: float,
    order: Literal[1, 2] = 1,
    *,
    damping: float = BUTTERWORTH,
    units: Units = None,
) -> Block:
    """Low-pass of gain one: ω/(s + ω), or ω²/(s² + 2ζω s + ω²).

    Parameters
    ----------
    input, output : str
        Signals.
    corner_rad_s : float
        ω, rad/s.
    order : {1, 2}
    damping : float
        ζ of the second order.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Returns
    -------
    Block

    Raises
    ------
    OptionError
        A corner or damping that is not above zero, another order.

    Example
    -------
    >>> low_pass("p", "p_slow", 20.0, 2).part.order
    2
    """
    below = _denominator(corner_rad_s, order, damping)
    return _filter("low-pass", (input,), output, [[below[-1]]], below, units)


def high_pass(
    input: str,  # noqa: A002
    output: str,
    corner_rad_s: float,
    order: Literal[1, 2] = 1,
    *,
    damping: float = BUTTERWORTH,
    units: Units = None,
) -> Block:
    """High-pass that ends at gain one: s/(s + ω), or s²/(s² + 2ζω s + ω²).

    Parameters
    ----------
    input, output : str
        Signals.
    corner_rad_s : float
        ω, rad/s.
    order : {1, 2}
    damping : float
        ζ of the second order.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Returns
    -------
    Block

    Raises
    ------
    OptionError
        A corner or damping that is not above zero, another order.

    Example
    -------
    >>> high_pass("q", "q_fast", 0.5)
    Block(high-pass: [q] to [q_fast])
    """
    below = _denominator(corner_rad_s, order, damping)
    return _filter("high-pass", (input,), output, [[1.0, *[0.0] * order]], below, units)


def washout(
    input: str,  # noqa: A002
    output: str,
    corner_rad_s: float,
    *,
    units: Units = None,
) -> Block:
    """Washout s/(s + ω): passes what changes and forgets what stays.

    Parameters
    ----------
    input, output : str
        Signals.
    corner_rad_s : float
        ω, rad/s: one over the washout time.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Returns
    -------
    Block

    Raises
    ------
    OptionError
        A corner that is not above zero.

    Example
    -------
    >>> washout("r", "r_washed", 0.5)
    Block(washout: [r] to [r_washed])
    """
    return replace(high_pass(input, output, corner_rad_s, units=units), name="washout")


def notch(
    input: str,  # noqa: A002
    output: str,
    centre_rad_s: float,
    *,
    damping: float = 0.5,
    depth: float = 0.0,
    units: Units = None,
) -> Block:
    """Notch (s² + 2dζω s + ω²)/(s² + 2ζω s + ω²): gain d at the centre, one far away.

    Parameters
    ----------
    input, output : str
        Signals.
    centre_rad_s : float
        ω, rad/s.
    damping : float
        ζ; the notch is 2ζω wide between its half-power points where the depth is zero.
    depth : float
        d, from 0 (nothing passes at the centre) to 1 (no notch).
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Returns
    -------
    Block

    Raises
    ------
    OptionError
        A number outside its range.

    Example
    -------
    >>> abs(notch("p", "q", 100.0, depth=0.1).part.frequency_response([100.0])).item()
    0.1
    """
    if not 0.0 <= depth < 1.0:
        raise OptionError("the depth of a notch", found=depth, needed="0 up to below 1")
    below = _denominator(centre_rad_s, 2, damping)
    above = [below[0], depth * below[1], below[2]]
    return _filter("notch", (input,), output, [above], below, units)


def complementary(
    slow: str,
    fast: str,
    output: str,
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
    slow, fast, output : str
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

    Returns
    -------
    Block

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
    found = _filter("complementary", (slow, fast), output, [passed, rest], below, units)
    return replace(found, alike=fast_is == "same")


def lead_lag(
    input: str,  # noqa: A002
    output: str,
    lead_s: float,
    lag_s: float,
    *,
    units: Units = None,
) -> Block:
    """Lead-lag (T₁ s + 1)/(T₂ s + 1).

    Parameters
    ----------
    input, output : str
        Signals.
    lead_s, lag_s : float
        T₁ from zero up, T₂ above zero, s.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Returns
    -------
    Block

    Raises
    ------
    OptionError
        A time outside its range.

    Example
    -------
    >>> abs(lead_lag("u", "v", 0.2, 0.1).part.frequency_response([1e6])).item().__round__(6)
    2.0
    """
    if not (np.isfinite(lead_s) and lead_s >= 0.0 and np.isfinite(lag_s) and lag_s > 0.0):
        raise OptionError("the times of a lead-lag", found=f"{lead_s} s and {lag_s} s",
                          needed="a lead from 0 s up and a lag above 0 s")  # fmt: skip
    return _filter("lead-lag", (input,), output, [[lead_s, 1.0]], [lag_s, 1.0], units)


def transfer(
    input: str,  # noqa: A002
    output: str,
    numerator: ArrayLike,
    denominator: ArrayLike,
    *,
    delay_s: float = 0.0,
    sample_time_s: float | None = None,
    units: Units = None,
) -> Block:
    """Transfer function by its coefficients, in s, or in z where it has a sample time.

    Parameters
    ----------
    input, output : str
        Signals.
    numerator, denominator : array_like, shapes (n,), (m,)
        Coefficients, highest power first.
    delay_s : float
        Delay, s; whole samples where there is a sample time.
    sample_time_s : float, optional
        T, s; continuous when left out.
    units : mapping of str to str, optional
        Unit by signal.

    Returns
    -------
    Block

    Raises
    ------
    ModelError
        More zeros than poles, or a denominator that is zero.

    Reference
    ---------
    Kailath, *Linear Systems* (1980), section 2.1: observer canonical form.

    Example
    -------
    >>> transfer("tau", "p", [40.0], [0.2, 1.0], delay_s=0.01).part.poles()
    array([-5.+0.j])
    """
    above = [np.atleast_1d(np.asarray(numerator, dtype=np.float64))]
    below = np.atleast_1d(np.asarray(denominator, dtype=np.float64))
    system = _observer_form((input,), output, above, below, delay_s, sample_time_s)
    return Block("transfer function", (input,), (output,), system, units or {})


def sampled(
    block: Block,
    sample_time_s: float,
    method: Literal["tustin", "zero", "first"] = "tustin",
    *,
    prewarp_rad_s: float | None = None,
) -> Block:
    """The recursion that stands for a continuous block in a digital controller.

    Parameters
    ----------
    block : Block
        Linear and continuous.
    sample_time_s : float
        T, s.
    method : {"tustin", "zero", "first"}
        Trapezoidal rule; or exact for inputs that are steps or straight lines between samples.
    prewarp_rad_s : float, optional
        Where the trapezoidal rule keeps the response exactly, rad/s.

    Returns
    -------
    Block

    Raises
    ------
    ModelError
        The block is not linear, or sampled already.
    OptionError
        An unknown method, or a frequency to keep that is not between zero and half the rate.

    Reference
    ---------
    Franklin, Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., section 6.1.

    Example
    -------
    >>> print(sampled(low_pass("p", "p_slow", 20.0), 0.01))
    1 state, every 0.01 s
    """
    part = block.part
    if not isinstance(part, LinearSystem) or part.is_discrete:
        raise ModelError("this block cannot be sampled", found=f"{block!r}: {block}",
                         needed="a linear continuous block")  # fmt: skip
    if method not in ("tustin", "zero", "first"):
        raise OptionError("the method is not known", found=method, needed="tustin, zero or first")
    if method != "tustin":
        return replace(block, part=part.sampled(sample_time_s, method))
    step = sample_time_s
    if prewarp_rad_s is not None:
        if not 0.0 < prewarp_rad_s < np.pi / sample_time_s:
            raise OptionError("the frequency to keep", found=f"{prewarp_rad_s} rad/s",
                              needed="between zero and half the sample rate")  # fmt: skip
        step = 2.0 * np.tan(prewarp_rad_s * sample_time_s / 2.0) / prewarp_rad_s
    a, b, c, d, delays = part.state_space()
    half = 0.5 * step * a
    left = np.linalg.inv(np.eye(part.order) - half)
    recursion = replace(
        part,
        a=left @ (np.eye(part.order) + half),
        b=step * left @ b,
        c=c @ left,
        d=d + 0.5 * step * c @ left @ b,
        delays_s=delays,
        sample_time_s=sample_time_s,
    )
    return replace(block, part=recursion)


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
    system = _observer_form(inputs, output, [np.array(each) for each in above], np.array(below))
    return Block(name, inputs, (output,), system, units or {}, alike=True)


def _observer_form(
    inputs: tuple[str, ...],
    output: str,
    above: Sequence[Array],
    below: Array,
    delay_s: float = 0.0,
    sample_time_s: float | None = None,
) -> LinearSystem:
    """One output of several inputs that share a denominator, with its order of states."""
    monic = np.trim_zeros(below, "f")
    if not len(monic):
        raise ModelError("a denominator is zero", needed="a coefficient that is not zero")
    order = len(monic) - 1
    direct, forced = np.zeros((1, len(inputs))), np.zeros((order, len(inputs)))
    for column, given in enumerate(above):
        trimmed = np.trim_zeros(given, "f")
        if len(trimmed) > order + 1:
            raise ModelError(
                "a transfer function has more zeros than poles",
                found=f"degree {len(trimmed) - 1} over {order}",
                needed="at least as many poles as zeros",
                action="add the lag of the sensor or filter to the denominator",
            )
        whole = np.concatenate([np.zeros(order + 1 - len(trimmed)), trimmed]) / monic[0]
        direct[0, column] = whole[0]
        forced[:, column] = whole[1:] - whole[0] * monic[1:] / monic[0]
    a = np.zeros((order, order))
    if order:
        a[:, 0] = -monic[1:] / monic[0]
        a[:-1, 1:] = np.eye(order - 1)
    c = np.eye(1, order) if order else np.zeros((1, 0))
    late = [delay_s] * len(inputs)
    return LinearSystem(a, forced, c, direct, inputs, (output,), late, sample_time_s=sample_time_s)

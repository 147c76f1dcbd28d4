"""Blocks without dynamics of their own, and those that no linear system describes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from flightid.control.loops.block import Block, Equations, Hold, OutputLimits, RateLimit
from flightid.errors import ModelError, OptionError
from flightid.models import StateSpaceModel
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import linear_system, model_of


def gain(
    inputs: str | Sequence[str],
    outputs: str | Sequence[str],
    value: ArrayLike,
    *,
    units: Mapping[str, str] | None = None,
) -> Block:
    """Block of constant gains: y = K u.

    Parameters
    ----------
    inputs, outputs : str or sequence of str
        Signals.
    value : array_like, scalar or shape (n_outputs, n_inputs)
        K, in output unit over input unit.
    units : mapping of str to str, optional
        Unit by signal.

    Raises
    ------
    ShapeError
        The gains are not as many as the signals.
    DataError
        A gain is not finite.

    Reference
    ---------
    Skogestad & Postlethwaite, *Multivariable Feedback Control*, 2nd ed., section 3.2.

    Example
    -------
    >>> gain("q", "lon_sas", -3.0, units={"q": "rad/s", "lon_sas": "in"})
    Block(gain: [q] to [lon_sas])
    """
    names_in, names_out = _names(inputs), _names(outputs)
    matrix = np.asarray(value, dtype=np.float64)
    if matrix.ndim == 0:
        matrix = matrix.reshape(1, 1)
    return static("gain", names_in, names_out, matrix, units=units)


def sum_of(outputs: str, *terms: str, units: Mapping[str, str] | None = None) -> Block:
    """Block that adds signals: ``sum_of("e", "r", "-y")`` is e = r − y.

    Parameters
    ----------
    outputs : str
        Signal.
    *terms : str
        Signals; one that is subtracted has a minus before its name.
    units : mapping of str to str, optional
        Unit of one signal or more; all have the same.

    Raises
    ------
    OptionError
        No term, or a term twice.

    Reference
    ---------
    Skogestad & Postlethwaite, *Multivariable Feedback Control*, 2nd ed., section 3.2.

    Example
    -------
    >>> sum_of("e", "r", "-y")
    Block(sum: [r, y] to [e])
    """
    names = tuple(term.lstrip("+-") for term in terms)
    if not names or len(set(names)) < len(names):
        raise OptionError(
            f"the terms of sum {outputs!r}", found=", ".join(terms) or "none",
            needed="one or more, each once",
        )  # fmt: skip
    signs = np.array([[-1.0 if term.startswith("-") else 1.0 for term in terms]])
    return static("sum", names, (outputs,), signs, units=units, alike=True)


def delay(
    inputs: str,
    outputs: str,
    delay_s: float,
    *,
    units: Mapping[str, str] | None = None,
) -> Block:
    """Block that passes a signal on later: y(t) = u(t − τ).

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    delay_s : float
        τ, s.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    DataError
        A negative delay.

    Reference
    ---------
    Franklin, Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., section 4.3.3.

    Example
    -------
    >>> print(delay("u", "u_late", 0.02))
    gain 1, delay 0.02 s
    """
    return static("delay", (inputs,), (outputs,), np.eye(1), (delay_s,), units=units, alike=True)


def limiter(
    inputs: str,
    outputs: str,
    high: float,
    low: float | None = None,
    *,
    units: Mapping[str, str] | None = None,
) -> Block:
    """Block that keeps a signal between two values; seen as linear it is a gain of one.

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    high : float
        Largest value, in the signal's unit.
    low : float, optional
        Smallest; minus `high` when left out.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    OptionError
        Limits that leave nothing between them.

    Reference
    ---------
    Khalil, *Nonlinear Systems*, 3rd ed., section 7.2 (saturation).

    Example
    -------
    >>> print(limiter("sas", "sas_limited", 0.5))
    limited to -0.5 … 0.5
    """
    bottom = -high if low is None else low
    if not (np.isfinite(high) and np.isfinite(bottom) and bottom < high):
        raise OptionError("the limits have no meaning", found=f"{bottom} to {high}",
                          needed="two numbers, the lower one first")  # fmt: skip
    return Block("limiter", (inputs,), (outputs,), OutputLimits(float(bottom), float(high)),
                 units or {}, alike=True)  # fmt: skip


def rate_limiter(
    inputs: str,
    outputs: str,
    rate_per_s: float,
    *,
    units: Mapping[str, str] | None = None,
) -> Block:
    """Block that follows a signal no faster than a rate; seen as linear it is a gain of one.

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    rate_per_s : float
        Largest rate either way, in the signal's unit per s.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    OptionError
        A rate that is not above zero.

    Reference
    ---------
    Duda, *Aerospace Science and Technology* 1 (1997), 37–47: rate limiting elements in flight
    control.

    Example
    -------
    >>> print(rate_limiter("u", "u_slow", 2.0))
    rate limited to 2 per s
    """
    if not (np.isfinite(rate_per_s) and rate_per_s > 0.0):
        raise OptionError("the rate limit has no meaning", found=rate_per_s, needed="above zero")
    return Block("rate limiter", (inputs,), (outputs,), RateLimit(float(rate_per_s)),
                 units or {}, alike=True)  # fmt: skip


def sample_and_hold(
    inputs: str,
    outputs: str,
    sample_time_s: float,
    computation_delay_s: float = 0.0,
    *,
    units: Mapping[str, str] | None = None,
) -> Block:
    """Block that samples a signal at every T and holds each sample until the next.

    It is the way from a sampled block to a continuous one, and a digital controller's output. Its
    frequency response is that of the fundamental, without the aliases of the samples:
    H(jω) = (1 − e^(−jωT))/(jωT) · e^(−jωT_c).

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    sample_time_s : float
        T, s.
    computation_delay_s : float
        T_c between a sample and its effect, s.
    units : mapping of str to str, optional
        Unit of a signal; both have the same.

    Raises
    ------
    OptionError
        A time without meaning.

    Reference
    ---------
    Franklin, Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., section 5.2.

    Example
    -------
    >>> print(sample_and_hold("u", "u_held", 0.02, 0.005))
    sampled and held every 0.02 s, 0.005 s late
    """
    if not (np.isfinite(sample_time_s) and sample_time_s > 0.0):
        raise OptionError("the sample time has no meaning", found=sample_time_s, needed="above 0 s")
    if not (np.isfinite(computation_delay_s) and computation_delay_s >= 0.0):
        raise OptionError("the computation delay has no meaning", found=computation_delay_s,
                          needed="0 s or more")  # fmt: skip
    held = Hold(float(sample_time_s), float(computation_delay_s))
    return Block("sample and hold", (inputs,), (outputs,), held, units or {}, alike=True)


def system(source: object, *, rename: Mapping[str, str] | None = None, name: str = "") -> Block:
    """Block of a model, a fit or a linear system, by the names and units of its channels.

    A nonlinear `StateSpaceModel` is simulated with its equations and seen through its
    linearisation everywhere else; its signals are departures from its trim.

    Parameters
    ----------
    source : fit, model or LinearSystem
        What `linear_system` takes. One with a sample time becomes a sampled block.
    rename : mapping of str to str, optional
        Signal by channel, where the two have different names.
    name : str
        What to call it in messages; the model's name when left out.

    Raises
    ------
    ModelError
        The source has no state space.
    OptionError
        `rename` names a channel that is not there.

    Reference
    ---------
    Stevens, Lewis & Johnson, *Aircraft Control and Simulation*, 3rd ed., section 3.7: linear
    models about a trim.

    Example
    -------
    >>> import flightid as fid
    >>> system(fid.load_model("rate_integrator"), rename={"tau_phi": "u"}).inputs
    ('u',)
    """
    model = model_of(source)
    linear = linear_system(source)
    names = dict(rename or {})
    for channel in names:
        if channel not in (*linear.inputs, *linear.outputs):
            raise OptionError("a channel to rename is not there", found=channel,
                              needed=", ".join((*linear.inputs, *linear.outputs)))  # fmt: skip
    part: LinearSystem | Equations = linear
    if isinstance(model, StateSpaceModel) and not model.is_linear:
        part = Equations(model, linear)
    channels = (*linear.inputs, *linear.outputs)
    ends = [{names.get(each, each) for each in side} for side in (linear.inputs, linear.outputs)]
    if ends[0] & ends[1]:
        raise ModelError("an input and an output of a block have one name",
                         found=", ".join(sorted(ends[0] & ends[1])), needed="different names",
                         action="rename one of them")  # fmt: skip
    called = name or str(getattr(model, "name", "") or "system")
    units = {each: unit for each, unit in linear.units.items() if each in channels}
    return Block(called, linear.inputs, linear.outputs, part, units).renamed(names)


def static(
    name: str,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    matrix: ArrayLike,
    delays_s: Sequence[float] = (),
    *,
    units: Mapping[str, str] | None = None,
    alike: bool = False,
) -> Block:
    """Block without states: y = D u(t − τ)."""
    n, m = len(outputs), len(inputs)
    part = LinearSystem(
        np.zeros((0, 0)), np.zeros((0, m)), np.zeros((n, 0)), matrix, inputs, outputs, delays_s
    )
    return Block(name, inputs, outputs, part, units or {}, alike)


def _names(given: str | Sequence[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)

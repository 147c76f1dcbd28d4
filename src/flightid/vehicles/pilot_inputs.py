"""Records that drive a model by hand: steps, pulses, doublets, 3-2-1-1, sines and sweeps."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.errors import OptionError, UnknownNameError
from flightid.excitation import sweep
from flightid.excitation.multistep import MULTISTEPS, Steps
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.record import Record

Array = NDArray[np.float64]
START_S = 1.0
"""Where a shape begins when it does not say so, s."""
MAXIMUM_SAMPLES = 50_000_000
SHAPES = {
    "step": "step:AMPLITUDE[:START]",
    **{name: f"{name}:AMPLITUDE:WIDTH[:START]" for name in ("pulse", *MULTISTEPS)},
    "sine": "sine:AMPLITUDE:RAD_PER_S[:START]",
    "sweep": "sweep:AMPLITUDE:LOW:HIGH, rad/s",
}
_PULSE = Steps((1.0,), (1.0,), 0.0, "pulse")


@dataclass(frozen=True)
class StickOptions(Options):
    """What moves a model by hand, and for how long.

    Example
    -------
    >>> StickOptions().duration_s
    10.0
    """

    inputs: Mapping[str, str] = option(
        default_factory=dict,
        doc=f"Shape by input, for example lat=step:0.1. Shapes: {'; '.join(SHAPES.values())}.",
    )
    duration_s: float = option(10.0, unit="s", above=0.0, doc="Length of the shapes' record.")
    sample_rate_hz: float = option(100.0, unit="Hz", above=0.0, doc="Of the shapes' record.")


def stick_record(
    units: Mapping[str, str],
    shapes: Mapping[str, str],
    *,
    duration_s: float,
    sample_rate_hz: float,
    trim: Mapping[str, float] | None = None,
) -> Record:
    """A record with a shape on some inputs and rest on the others.

    Parameters
    ----------
    units : mapping of str to str
        Unit by input; every input of the record.
    shapes : mapping of str to str
        By input, as in `SHAPES`; amplitudes in the input's unit, times in s.
    duration_s, sample_rate_hz : float
        Of the record.
    trim : mapping of str to float, optional
        Where the inputs rest, in their units.

    Raises
    ------
    UnknownNameError
        A shape for what is no input.
    OptionError
        A shape that cannot be read, or times without meaning.

    Reference
    ---------
    Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., section 2.3: multistep inputs.

    Example
    -------
    >>> made = stick_record({"lat": "1"}, {"lat": "doublet:0.1:0.5"}, duration_s=3.0,
    ...                     sample_rate_hz=4.0)
    >>> made["lat"]
    array([ 0. ,  0. ,  0. ,  0. ,  0.1,  0.1, -0.1, -0.1,  0. ,  0. ,  0. ,  0. ])
    """
    for name in shapes:
        if name not in units:
            raise UnknownNameError("a shape has no input", found=name, needed=", ".join(units))
    for subject, value in (("duration", duration_s), ("sample rate", sample_rate_hz)):
        if not (math.isfinite(value) and value > 0.0):
            raise OptionError(f"the {subject} has no meaning", found=value, needed="above 0")
    count = round(duration_s * sample_rate_hz)
    if not 2 <= count <= MAXIMUM_SAMPLES:
        raise OptionError(
            "the record has no usable length", found=f"{count} samples",
            needed=f"2 to {MAXIMUM_SAMPLES}",
        )  # fmt: skip
    time_s = np.arange(count) / sample_rate_hz
    inputs = {
        name: (trim or {}).get(name, 0.0)
        + (_shape(shapes[name], time_s, sample_rate_hz) if name in shapes else np.zeros(count))
        for name in units
    }
    return Record.from_arrays(time_s, inputs=inputs, units=dict(units), name="stick")


def _shape(text: str, time_s: Array, sample_rate_hz: float) -> Array:
    kind, *words = text.split(":")
    least = {"step": 1, "sweep": 3}.get(kind, 2)
    if kind not in SHAPES or not least <= len(words) <= (3 if kind == "sweep" else least + 1):
        raise OptionError(
            "an input shape cannot be read", found=text, needed="; ".join(SHAPES.values())
        )
    try:
        numbers = [float(word) for word in words]
    except ValueError as error:
        raise OptionError(
            "an input shape holds no numbers", found=text, needed=SHAPES[kind]
        ) from error
    if not all(map(math.isfinite, numbers)) or min(numbers[1:], default=1.0) < 0.0:
        raise OptionError("an input shape has no meaning", found=text, needed=SHAPES[kind])
    if kind == "sweep":
        made = sweep(
            band_rad_s=(numbers[1], numbers[2]), amplitude=numbers[0],
            duration_s=len(time_s) / sample_rate_hz, sample_rate_hz=sample_rate_hz,
        )  # fmt: skip
        samples = np.zeros(len(time_s))
        kept = min(len(time_s), made.n_samples)
        samples[:kept] = made.signals[0][:kept]
        return samples
    start = numbers[least] if len(numbers) > least else START_S
    # A stamp that rounding put just before an edge belongs to what begins there.
    since = time_s - start + 1e-9
    if kind == "sine":
        return np.where(since >= 0.0, numbers[0] * np.sin(numbers[1] * since), 0.0)
    if kind == "step":
        return np.where(since >= 0.0, numbers[0], 0.0)
    shape = MULTISTEPS.get(kind, _PULSE)
    if not numbers[1] > 0.0:
        raise OptionError("an input shape has no meaning", found=text, needed=SHAPES[kind])
    edges = numbers[1] * np.cumsum([0.0, *shape.widths])
    levels = np.array([0.0, *shape.levels, 0.0]) / max(map(abs, shape.levels))
    return np.asarray(numbers[0] * levels[np.searchsorted(edges, since, side="right")])

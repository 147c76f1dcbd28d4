"""Design: from a target band, a guess and limits to an excitation and its plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from flightid.errors import OptionError
from flightid.excitation.assess import assess
from flightid.excitation.excitation import Excitation
from flightid.excitation.multisine import multisine
from flightid.excitation.multistep import MULTISTEPS, Steps, multistep
from flightid.excitation.noise import noise
from flightid.excitation.options import DesignOptions
from flightid.excitation.plan import Limits, Plan
from flightid.excitation.prbs import HALF_POWER, HIGHEST_ORDER, LOWEST_ORDER, prbs
from flightid.excitation.sweep import ardupilot_chirp, sweep
from flightid.excitation.vehicle import RateAxis
from flightid.excitation.verdicts import MARGIN
from flightid.frozen import dataclass

CYCLES_AT_LOWEST = 5.0
LONGEST_RECORD_S = 600.0


@dataclass(frozen=True)
class DesignRequest:
    """What every kind of design is made from."""

    band_rad_s: tuple[float, float]
    amplitude: float
    duration_s: float
    sample_rate_hz: float
    names: tuple[str, ...]
    unit: str
    seed: int
    axis: int

    @property
    def one_name(self) -> str:
        """The only input.

        Raises
        ------
        OptionError
            More than one input for a design that excites one.
        """
        if len(self.names) != 1:
            raise OptionError(
                "this kind of design excites one input",
                found=f"{len(self.names)} inputs",
                needed="one, or kind multisine, noise or prbs",
            )
        return self.names[0]


def _sweep(request: DesignRequest) -> Excitation:
    return sweep(
        band_rad_s=request.band_rad_s,
        amplitude=request.amplitude,
        duration_s=request.duration_s,
        sample_rate_hz=request.sample_rate_hz,
        name=request.one_name,
        unit=request.unit,
        seed=request.seed,
    )


def _chirp(request: DesignRequest) -> Excitation:
    start_hz, stop_hz = (edge / (2 * math.pi) for edge in request.band_rad_s)
    return ardupilot_chirp(
        magnitude=request.amplitude,
        start_hz=start_hz,
        stop_hz=stop_hz,
        record_s=request.duration_s,
        fade_in_s=min(0.5 / start_hz, 20.0),
        fade_out_s=min(2.0 / stop_hz, 5.0),
        sample_rate_hz=request.sample_rate_hz,
        axis=request.axis,
        name=request.one_name,
    )


def _step_s(request: DesignRequest, peak: float) -> float:
    """Step that puts the most energy in the middle of the band, on the sample grid."""
    middle = math.sqrt(request.band_rad_s[0] * request.band_rad_s[1])
    samples = max(1, round(peak / middle * request.sample_rate_hz))
    return samples / request.sample_rate_hz


def _steps(shape: Steps) -> Callable[[DesignRequest], Excitation]:
    def made(request: DesignRequest) -> Excitation:
        steps = multistep(
            amplitude=request.amplitude,
            step_s=_step_s(request, shape.peak),
            sample_rate_hz=request.sample_rate_hz,
            widths=shape.widths,
            levels=shape.levels,
            name=request.one_name,
            unit=request.unit,
        )
        return replace(steps, kind=shape.label)

    return made


def _prbs(request: DesignRequest) -> Excitation:
    """The longest sequence that fits the duration, on a clock that is fast enough for the band."""
    wanted_hz = request.band_rad_s[1] / (2 * math.pi * HALF_POWER)
    slowest = max(1, math.floor(request.sample_rate_hz / wanted_hz))
    room = request.duration_s * request.sample_rate_hz * (1 + 1e-9)
    lengths = {order: 2**order - 1 for order in range(LOWEST_ORDER, HIGHEST_ORDER + 1)}
    fitting = {
        order: min(slowest, math.floor(room / length))
        for order, length in lengths.items()
        if length <= room
    } or {LOWEST_ORDER: 1}
    # Of sequences of one duration the one of fewer, longer levels has more power in the band.
    order = max(fitting, key=lambda each: (fitting[each] * lengths[each], fitting[each]))
    return prbs(
        order=order,
        clock_hz=request.sample_rate_hz / fitting[order],
        amplitude=request.amplitude,
        sample_rate_hz=request.sample_rate_hz,
        names=request.names,
        unit=request.unit,
    )


def _noise(request: DesignRequest) -> Excitation:
    return noise(
        band_rad_s=request.band_rad_s,
        amplitude=request.amplitude,
        duration_s=request.duration_s,
        sample_rate_hz=request.sample_rate_hz,
        names=request.names,
        unit=request.unit,
        seed=request.seed,
    )


def _multisine(request: DesignRequest) -> Excitation:
    return multisine(
        band_rad_s=request.band_rad_s,
        amplitude=request.amplitude,
        period_s=request.duration_s,
        sample_rate_hz=request.sample_rate_hz,
        names=request.names,
        unit=request.unit,
        seed=request.seed,
    )


KINDS: dict[str, Callable[[DesignRequest], Excitation]] = {
    "sweep": _sweep,
    "ardupilot_chirp": _chirp,
    **{name: _steps(shape) for name, shape in MULTISTEPS.items()},
    "prbs": _prbs,
    "noise": _noise,
    "multisine": _multisine,
}
"""Kinds of design by the name that `plan` takes."""


def plan(
    kind: str,
    vehicle: RateAxis | Mapping[str, RateAxis],
    *,
    band_rad_s: tuple[float, float],
    amplitude: float | None = None,
    duration_s: float | None = None,
    sample_rate_hz: float = 400.0,
    inputs: tuple[str, ...] = ("u",),
    unit: str = "1",
    limits: Limits | None = None,
    n_records: int = 2,
    seed: int = 0,
    axis: int = 10,
) -> Plan:
    """Design an excitation for a target band and say what flying it would give.

    Parameters
    ----------
    kind : str
        ``"sweep"``, ``"ardupilot_chirp"``, ``"doublet"``, ``"3211"``, ``"modified_3211"``,
        ``"prbs"``, ``"noise"`` or ``"multisine"``.
    vehicle : RateAxis or mapping of str to RateAxis
        Rough guess for every input, or by input name.
    band_rad_s : tuple of float
        Band in which a response is wanted, rad/s. For a rate loop: half its bandwidth to 2.5
        times the frequency at which its phase reaches -180°.
    amplitude : float, optional
        In `unit`; default: what takes the tightest of the limits to 80 %.
    duration_s : float, optional
        Length of one record, s; default: five cycles of the lowest frequency, seven for the
        chirp, whose dwell takes two. Doublets and 3-2-1-1 have the length of their steps.
    sample_rate_hz : float
        Samples per second, Hz.
    inputs : tuple of str
        Inputs to excite; more than one for multisine, noise and prbs only.
    unit : str
        Unit of the inputs.
    limits : Limits, optional
        What the vehicle may do.
    n_records : int
        Times it is flown.
    seed : int
        Seed of random parts.
    axis : int
        SID_AXIS of ArduPilot's chirp; it decides that input's unit.

    Raises
    ------
    OptionError
        A kind that is not known, options without meaning, or a default length beyond 600 s.
    ModelError
        The loop of a guess is unstable.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., section 5.

    Example
    -------
    >>> axis = RateAxis(gain=40.0, time_constant_s=0.2, delay_s=0.01, rate_feedback=0.1,
    ...                 attitude_feedback_per_s=4.0)
    >>> made = plan("multisine", axis, band_rad_s=(4.0, 9.0), inputs=("tau_phi", "tau_theta"))
    >>> made.is_go
    True
    """
    if kind not in KINDS:
        raise OptionError("no such kind of design", found=kind, needed=", ".join(KINDS))
    DesignOptions(
        band_rad_s,
        amplitude,
        duration_s,
        sample_rate_hz,
        tuple(inputs),
        unit,
        n_records,
        seed,
        axis,
    )
    rate_hz = float(sample_rate_hz)
    length = _default_length(kind, band_rad_s, rate_hz) if duration_s is None else duration_s

    def made(size: float) -> Plan:
        request = DesignRequest(band_rad_s, size, length, rate_hz, tuple(inputs), unit, seed, axis)
        return assess(
            KINDS[kind](request), vehicle, band_rad_s=band_rad_s, limits=limits, n_records=n_records
        )

    if amplitude is not None:
        return made(amplitude)
    # Everything predicted is proportional to the amplitude: one try tells the size.
    return made(_largest_amplitude(made(1.0)))


def designed(kind: str, asked: DesignOptions) -> Excitation:
    """The input alone, where nobody guesses the vehicle: what it would give is not judged.

    Parameters
    ----------
    kind : str
        As `plan` takes it.
    asked : DesignOptions

    Raises
    ------
    OptionError
        A kind that is not known, or no amplitude: limits of a vehicle give none here.

    Example
    -------
    >>> made = designed("prbs", DesignOptions((0.3, 6.0), amplitude=0.2, sample_rate_hz=10.0))
    >>> float(made.signals.max())
    0.2
    """
    if kind not in KINDS:
        raise OptionError("no such kind of design", found=kind, needed=", ".join(KINDS))
    if asked.amplitude is None:
        raise OptionError(
            "an input has no size where nobody guesses what it moves",
            needed="amplitude=…, or a guess of the vehicle: gain=… and time_constant_s=…",
        )
    rate_hz = float(asked.sample_rate_hz)
    length = asked.duration_s or _default_length(kind, asked.band_rad_s, rate_hz)
    return KINDS[kind](
        DesignRequest(
            asked.band_rad_s, asked.amplitude, length, rate_hz, tuple(asked.inputs), asked.unit,
            asked.seed, asked.axis,
        )
    )  # fmt: skip


def _default_length(kind: str, band_rad_s: tuple[float, float], sample_rate_hz: float) -> float:
    cycles = CYCLES_AT_LOWEST + (2.0 if kind == "ardupilot_chirp" else 0.0)
    length_s = cycles * 2 * math.pi / band_rad_s[0]
    if length_s > LONGEST_RECORD_S:
        raise OptionError(
            "the band asks for a very long record",
            found=f"{length_s:.4g} s",
            needed=f"at most {LONGEST_RECORD_S:g} s by default",
            action="raise the lowest frequency, or give duration_s",
        )
    # The lengths of sequences double: the longest that fits twice the time is no shorter.
    whole = math.ceil((2.0 if kind == "prbs" else 1.0) * length_s * sample_rate_hz)
    return whole / sample_rate_hz


def _largest_amplitude(unit_plan: Plan) -> float:
    limits = unit_plan.limits
    largest = math.inf
    for axis in unit_plan.axes:
        pairs = [
            (axis.peak_control, limits.control),
            (axis.peak_rate_rad_s, limits.rate_rad_s),
            (axis.peak_attitude_rad, limits.attitude_rad),
        ]
        if limits.control_rate_per_s is not None:
            pairs.append((axis.peak_control_rate, limits.control_rate_per_s))
        largest = min(largest, *(MARGIN * limit / found for found, limit in pairs))
    # Rounded down to three digits, so that the promise survives rounding.
    digits = 2 - math.floor(math.log10(largest))
    scale = 10.0**digits
    return math.floor(largest * scale) / scale

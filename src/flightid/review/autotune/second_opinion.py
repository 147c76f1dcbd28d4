"""A model from an autotune's own excitation, and the margins of its gains around it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop, axis_loop_of
from flightid.control.margins.margins import Margins, margins
from flightid.control.tuning.tune_pid import CHANNELS
from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.identification.withheld_intervals import without_intervals
from flightid.inspection.signals import Signal, Span, find, inside, records
from flightid.inspection.stamps import believable
from flightid.logs import Log
from flightid.models.transfer.description import transfer_from_table
from flightid.models.transfer.model import TransferFunctionModel
from flightid.review.autotune.possible_margins import possible
from flightid.review.autotune.twitch_fit import TwitchRecord, fit_stretches
from flightid.review.autotune.twitch_ticks import on_ticks

Complex = NDArray[np.complex128]
PID = {"roll": "PIDR", "pitch": "PIDP", "yaw": "PIDY"}
PID_TERMS = ("P", "I", "D", "FF", "DFF")
BUTTERWORTH = float(np.sqrt(0.5))
Stream = tuple[Signal, Signal]
"""Output and rate of an axis."""
LOWEST_RAD_S, BELOW_NYQUIST = 0.5, 0.95
"""Where margins are looked for: a sampled controller has no crossing above half of its rate."""
PAST_S = 0.08
"""Longer than the delays and most of the lag of a vehicle's motors."""
LONGEST_S = 0.5
"""Of a stretch: what is drawn of it (rate, slow gusts) is drawn once."""
SLOWEST_HZ = 40.0
"""Below it a twitch of a fifth of a second has too few samples."""
AT_LOOP = 0.75
"""Share of the loop's rate from which on samples tell what the output did between them: at half of
it crossovers came out 1.5 % too low, at a quarter 3.7 %, beside bars of 0.1 %."""
LEAST_SAMPLES, MOST_RECORDS = 24, 60


@dataclass(frozen=True, eq=False)
class SecondOpinion:
    """One axis of an autotune, identified again.

    Attributes
    ----------
    axis : str
    fit : Fit or None
        Model from the axis' output to its rate; None where `reason` says why.
    used_s, rate_hz : float
        Seconds and samples per second behind it.
    flown, tuned : Margins or None
        Of the rate loop with the gains before, and with autotune's; None without a model.
    reason : str
        Why there is no model.
    """

    axis: str
    fit: Fit | None = None
    used_s: float = 0.0
    rate_hz: float = 0.0
    flown: Margins | None = None
    tuned: Margins | None = None
    reason: str = ""

    @property
    def why(self) -> str:
        """Why the model has no intervals; empty where it has them."""
        if self.fit is None:
            return ""
        reasons = (p.reason for p in self.fit.parameters.values() if p.stderr is None)
        return next((each for each in reasons if each and each != "fixed"), "")

    @property
    def doubt(self) -> str:
        """The same with the axis, as a note."""
        return self.why and f"{self.axis}: no intervals, {self.why}"


def second_opinion(
    log: Log, axis: str, spans: Sequence[Span], gains: Mapping[str, float]
) -> SecondOpinion:
    """Fit output to rate over the twitches or steps of an axis, and judge gains around it.

    Parameters
    ----------
    log : Log
    axis : {"roll", "pitch", "yaw"}
    spans : sequence of tuple of float
        When the axis was excited.
    gains : mapping of str to float
        What autotune found.
    """
    try:
        found = _stretches(log, axis, spans)
        if isinstance(found, str):
            return SecondOpinion(axis, reason=found)
        loop = axis_loop_of(log, axis, at_s=spans[0][0])
        filter_hz = loop.gains.get(loop.names.get("gyro_filter", ""), 0.0)
        fit = fit_stretches(template(axis, filter_hz), found, filter_hz)
    except FlightidError as error:
        return SecondOpinion(axis, reason=str(error))
    used = sum(each.record.duration_s for each in found)
    rate = 1.0 / found[0].record.sample_time_s
    if fit.covariance is not None and rate < AT_LOOP * loop.loop_rate_hz:
        fit = without_intervals(
            fit,
            f"output and rate are logged at {rate:.3g} Hz: what the output does between samples, "
            f"at the loop's {loop.loop_rate_hz:.3g} Hz, is not known",
        )
    if fit.evidence.light is Light.RED:
        red = next(f for f in fit.evidence.findings if f.light is Light.RED)
        return SecondOpinion(axis, fit, used, rate, reason=red.message)
    try:
        known = {name: value for name, value in gains.items() if name in loop.gains}
        flown, tuned = (_margins(fit, each) for each in (loop, loop.with_gains(known)))
    except FlightidError as error:
        return SecondOpinion(axis, fit, used, rate, reason=str(error))
    return SecondOpinion(axis, fit, used, rate, flown, tuned)


def template(axis: str, gyro_filter_hz: float) -> TransferFunctionModel:
    """Rate damping, motor lag and delay behind the gyro's own two-pole filter, which is known.

    Parameters
    ----------
    axis : {"roll", "pitch", "yaw"}
    gyro_filter_hz : float
        Hz; 0 leaves it out.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., ch. 11 (low-order
    transfer functions with equivalent delay).
    """
    command, rate = CHANNELS[axis]
    parameters: dict[str, object] = {
        "K": {"value": 100.0, "min": 0.1, "max": 1e4, "unit": "rad/s^2"},
        "L": {"value": -3.0, "min": -15.0, "max": 5.0, "unit": "1/s"},
        "T_m": {"value": 0.05, "min": 0.002, "max": 0.2, "unit": "s"},
        "tau": {"value": 0.01, "min": 0.0, "max": 0.3, "unit": "s"},
    }
    below, gain = ["s - L", "T_m*s + 1"], "K"
    if gyro_filter_hz > 0.0:
        corner = 2.0 * np.pi * gyro_filter_hz
        parameters["omega_g"] = {"value": corner, "unit": "rad/s", "fixed": True}
        parameters["zeta_g"] = {"value": BUTTERWORTH, "unit": "1", "fixed": True}
        below.append("s^2 + 2*zeta_g*omega_g*s + omega_g^2")
        gain = "K*omega_g^2"
    response = {"gain": gain, "denominator": below, "delay": "tau"}
    return transfer_from_table(
        {
            "name": f"{axis} rate, motor lag, behind the gyro filter",
            "inputs": {command: "1"},
            "outputs": {rate: "rad/s"},
            "parameters": parameters,
            "responses": {f"{rate}/{command}": response},
        }
    )


def _margins(fit: Fit, loop: AxisLoop) -> Margins:
    """Of the rate loop around a model from output to filtered rate, which holds the hold."""
    band = (LOWEST_RAD_S, BELOW_NYQUIST * np.pi * loop.loop_rate_hz)
    return possible(margins(fit, controller=_controller(loop), band_rad_s=band))


def _controller(loop: AxisLoop) -> Callable[[Complex], Complex]:
    def response(s: Complex) -> Complex:
        omega = np.abs(np.atleast_1d(s).imag)
        return loop.feedback(omega, gyro="filtered", with_hold=False)

    return response


def _stretches(log: Log, axis: str, spans: Sequence[Span]) -> list[TwitchRecord] | str:
    """Stretches of the fastest stream of output and rate; in words why there are none."""
    pairs = [pair for pair in (_of_rate(log, axis), _of_pid(log, axis)) if pair is not None]
    if not pairs:
        return "the log does not hold the axis' output with its rate"
    speeds = [min(_rate_in(signal, spans) for signal in pair) for pair in pairs]
    fastest = int(np.argmax(speeds))
    if speeds[fastest] < SLOWEST_HZ:
        return (
            f"output and rate are logged at {speeds[fastest]:.3g} Hz while it twitches: "
            f"{SLOWEST_HZ:g} Hz are needed"
        )
    pair, spans = on_ticks(pairs[fastest], spans, PAST_S)
    step = 1.0 / min(_rate_in(signal, spans) for signal in pair)
    made = [
        stretch
        for span in spans
        for start, stop in _parts(*span)
        for stretch in _with_past(*pair, start, stop, step)
        if stretch.record.n_samples - stretch.lead >= LEAST_SAMPLES
    ]
    return made[-MOST_RECORDS:] or "no test is logged without gaps"


def _parts(start: float, stop: float) -> list[Span]:
    """A span in parts of one length, none longer than `LONGEST_S`."""
    edges = np.linspace(start, stop, max(1, int(np.ceil((stop - start) / LONGEST_S))) + 1)
    return [(float(a), float(b)) for a, b in itertools.pairwise(edges)]


def _with_past(
    command: Signal, rate: Signal, start: float, stop: float, step: float
) -> list[TwitchRecord]:
    """Stretches of one span with the output before it, which is still in motors and delays.

    ArduPilot logs its PIDs at full rate from the twitch on alone. It begins one when the vehicle is
    level and quiet: then the output is what holds it still, one number of all tests, which the fit
    finds: the integrator comes near it, on a side that the test before has. Elsewhere the past is
    in the log.
    """
    logged = inside(command.time_s, [(start - PAST_S, start - step)])
    if np.count_nonzero(logged) > 0.5 * PAST_S / step:
        earlier = (start - PAST_S, stop)
        about = float(np.mean(command.values[inside(command.time_s, [earlier])]))
        cut = [_cut(_less(command, about), earlier), _cut(rate, earlier)]
        return [
            TwitchRecord(record, int(np.count_nonzero(record.time_s < start - 0.5 * step)))
            for record in records(cut, {command.name}, [earlier], step)
        ]
    past = start - step * np.arange(round(PAST_S / step), 0, -1)
    whole = [
        replace(
            each,
            time_s=np.concatenate([past, each.time_s]),
            values=np.concatenate([np.zeros(past.size), each.values]),
        )
        for each in (_cut(command, (start, stop)), _cut(rate, (start, stop)))
    ]
    return [
        TwitchRecord(record, past.size, past.size)
        for record in records(whole, {command.name}, [(float(past[0]), stop)], step)
    ]


def _less(signal: Signal, level: float) -> Signal:
    return replace(signal, values=signal.values - level)


def _cut(signal: Signal, span: Span) -> Signal:
    """Samples of a span alone, whose rate is not that of the rest of the log."""
    kept = inside(signal.time_s, [span])
    return Signal(signal.name, signal.time_s[kept], signal.values[kept], signal.unit, signal.label)


def _rate_in(signal: Signal, spans: Sequence[Span]) -> float:
    stamps = signal.time_s[inside(signal.time_s, spans)]
    return 1.0 / float(np.median(np.diff(stamps))) if stamps.size > 2 else 0.0


def _of_rate(log: Log, axis: str) -> Stream | None:
    command, rate = (find(log, name) for name in CHANNELS[axis])
    if command is None or rate is None:
        return None
    return command, rate


def _of_pid(log: Log, axis: str) -> Stream | None:
    """ArduPilot logs its PIDs at the loop's rate while it twitches."""
    message = PID[axis]
    if log.kind != "ardupilot" or message not in log:
        return None
    table = log.table(message)
    good = believable(table.time_s)
    if np.count_nonzero(good) < 2:
        return None
    terms = [table[name] for name in PID_TERMS if name in table.columns]
    output = np.sum(terms, axis=0)[good]
    command, rate = CHANNELS[axis]
    stamps = table.time_s[good]
    return (
        Signal(command, stamps, output, "1", f"{message} terms"),
        Signal(rate, stamps, table["Act"][good], "rad/s", f"{message}.Act"),
    )

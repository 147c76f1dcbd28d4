"""Loops of a log: which channels close them, pieces of flight to use, and what each does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.make import told_loop_rate_hz
from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.inspection.advice import logging
from flightid.inspection.signals import Signal, Span, find, inside, places, records
from flightid.inspection.thresholds import RATE_LEAST
from flightid.logs import Log
from flightid.record import Record
from flightid.review.deconvolution import TOO_FEW, LoopDraws, closed_loop
from flightid.review.loop_response import LoopResponse
from flightid.review.loop_samples import LoopSamples, loop_samples
from flightid.review.proportional import (
    Excess,
    bounded_law,
    excess_of,
    expected_errors,
    is_proportional,
)
from flightid.review.step_features import (
    frequency_features,
    step_features,
    still_moves,
    window_features,
)
from flightid.review.sticks_to_fly import mode_to_fly, what_to_fly
from flightid.review.thresholds import (
    FASTEST_ATTITUDE,
    FASTEST_RATE,
    LEFT,
    LIVELY_ATTITUDE,
    LIVELY_RATE,
    OVERSHOOT,
    SAMPLES_IN_RISE,
    WIDEST_DELAY,
    WIDEST_LEVEL,
    WIDEST_TRACKING,
)
from flightid.review.told_band import told_by, told_hz
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.quantiles import LEVEL
from flightid.uncertainty.uneven import LogarithmicEnds

Array = NDArray[np.float64]
LIVELY = {"rate": LIVELY_RATE, "attitude": LIVELY_ATTITUDE}
FASTEST = {"rate": FASTEST_RATE, "attitude": FASTEST_ATTITUDE}
SHORTEST_PIECE_S = 2.0
WINDOW_S = {"rate": 0.5, "attitude": 1.5}
SLOWEST_HZ = {"rate": 2.0, "attitude": 0.5}
PACE = {"rate": 1.0, "attitude": 2.5}
STRETCHES = 10
HARDLY = 0.1
"""Of what counts as quick sticks: a set-point that moves less was not meant to move."""
TRACKING = "tracking error, rms"
FINER = 4.0
"""Times the usual samples, of a log that has them, where a step rises within too few."""
UNTOLD = 2.0
"""Half of an interval of a level, of the step, from which on its numbers tell nothing."""
TOO_SLOW = "too slowly for a step"
EVEN = 0.7
"""Least share of rows that may be there, of those that the median interval promises."""
CHANNELS = {
    ("roll", "rate"): ("p_ref", "p", "phi"),
    ("pitch", "rate"): ("q_ref", "q", "theta"),
    ("yaw", "rate"): ("r_ref", "r", "psi"),
    ("roll", "attitude"): ("phi_ref", "phi", None),
    ("pitch", "attitude"): ("theta_ref", "theta", None),
    ("yaw", "attitude"): ("psi_ref", "psi", None),
}
EMPTY = np.zeros(0)
IN_SWEEPS = "all of the time in the air is sweeps at the mixer, which disturb the loops"
ORDINARY = "hand in a log that holds ordinary flight"


@dataclass(frozen=True)
class _Pair:
    """A set-point with what was measured, as logged, and what forewarns of gusts."""

    set_point: Signal
    measured: Signal
    attitude: Signal | None


def loop_responses(log: Log, spans: tuple[Span, ...]) -> tuple[LoopResponse, ...]:
    """Every loop of every axis: its step, or why there is none; loops that are not logged go.

    Sweeps at the mixer are left out: they are disturbances to the loops, and larger than any gust.
    """
    ordinary = without(spans, [(r.start_s, r.stop_s) for r in log.sid_runs if r.point == "mixer"])
    airborne = bool(spans)
    made = (_loop(log, ordinary, axis, loop, airborne=airborne) for axis, loop in CHANNELS)
    return tuple(each for each in made if each is not None)


def without(spans: tuple[Span, ...], cuts: list[Span]) -> tuple[Span, ...]:
    """Spans less others.

    Example
    -------
    >>> without(((0.0, 10.0),), [(2.0, 3.0), (9.0, 12.0)])
    ((0.0, 2.0), (3.0, 9.0))
    """
    for begin, end in cuts:
        parts = [part for a, b in spans for part in ((a, min(b, begin)), (max(a, end), b))]
        spans = tuple((a, b) for a, b in parts if b > a)
    return spans


def _loop(
    log: Log, spans: tuple[Span, ...], axis: str, loop: str, *, airborne: bool
) -> LoopResponse | None:
    pair = _pair(log, axis, loop)
    if pair is None:
        return None
    labels = pair.set_point.label, pair.measured.label
    blank = LoopResponse(
        axis, loop, *labels, 0.0, 0.0, 0, None, None, EMPTY, EMPTY, EMPTY,
        fly_in=mode_to_fly(log, loop, spans),
    )  # fmt: skip
    if not spans:
        reason = IN_SWEEPS if airborne else "nothing was flown"
        return replace(blank, reason=reason, action=ORDINARY)
    pieces = _pieces(pair, spans)
    unfit = _uneven(pair, spans) or ("" if pieces else "no span in the air of 2 s holds both")
    if unfit:
        return replace(blank, reason=unfit, action=logging(log))
    tracking = tracking_error(pieces, "rad/s" if loop == "rate" else "rad")
    begun = replace(blank, tracking=tracking, asked=_spread(pieces))
    law = bounded_law(log, axis) if loop == "attitude" else None
    excess = None
    if law is not None:
        begun = replace(begun, proportional_rad=law.proportional_to_rad)
        excess = excess_of(law, axis, pieces)
    if law is None or excess is None:
        made = _read(log, begun, pieces)
    else:
        excess = excess_of(law, axis, pieces, expected_errors(pieces, PACE["attitude"])) or excess
        small = _pieces(pair, without(spans, list(excess.spans)))
        made = _in_proportion(log, begun, excess, pieces, small)
    return _unless_short(made, log, spans, pieces)


def _unless_short(
    made: LoopResponse, log: Log, spans: tuple[Span, ...], pieces: list[Record]
) -> LoopResponse:
    """A loop of too few samples, which lacks flight where the log holds all rows of what flew."""
    slow = pieces[0].sample_rate_hz < FASTEST[made.loop].value
    held_s = sum(piece.duration_s for piece in pieces)
    gaps = held_s < EVEN * sum(end - begin for begin, end in spans)
    if not made.reason.startswith(TOO_FEW) or slow or gaps:
        return made
    swept = any(run.point == "mixer" for run in log.sid_runs)
    few = f"too little flight{' outside sweeps' if swept else ''}"
    reason = made.reason.replace(TOO_FEW, few, 1)
    return replace(made, reason=reason, action=what_to_fly(made))


def _in_proportion(
    log: Log, begun: LoopResponse, excess: Excess, pieces: list[Record], small: list[Record]
) -> LoopResponse:
    """The step of small errors where the flight tells it, else that of all, which says so."""
    least = LEFT.value * (begun.asked or 0.0)
    made = _read(log, begun, small) if small and _spread(small) >= least else begun
    if made.is_told and is_proportional(excess.law, small):
        return replace(made, beyond=excess.words)
    made = _read(log, begun, pieces)
    if not made.is_told:
        return made
    return replace(made, beyond=excess.words, is_bent=True, action=excess.action)


def _read(log: Log, begun: LoopResponse, pieces: list[Record]) -> LoopResponse:
    """The step of pieces of a flight, of finer samples where it rises within too few."""
    known = replace(begun, pieces=len(pieces))
    fastest_hz, tick_s = FASTEST[begun.loop].value, 0.0
    if rate_hz := loop_rate_hz(log):
        tick_s = 1.0 / rate_hz
    made = _stepped(known, pieces, fastest_hz, tick_s, logging(log))
    unsure = not made.is_told and (made.moved or 0.0) > LIVELY[begun.loop].value
    if not (unsure or TOO_SLOW in made.reason) or made.rate_hz > 0.7 * pieces[0].sample_rate_hz:
        return made
    finer = _stepped(known, pieces, FINER * fastest_hz, tick_s, logging(log))
    if TOO_SLOW in made.reason or (finer.is_told and _is_quick(finer, made.rate_hz)):
        return finer
    return made


def _is_quick(loop: LoopResponse, rate_hz: float) -> bool:
    """Whether a step rises within so few samples of another rate that they could not show it."""
    rise = loop["rise time"].value
    return rise is not None and rise < 2.0 * SAMPLES_IN_RISE.value / rate_hz


def _stepped(
    begun: LoopResponse, pieces: list[Record], fastest_hz: float, tick_s: float, advised: str
) -> LoopResponse:
    """The step of samples no faster than that."""
    samples = loop_samples(pieces, fastest_hz)
    known = replace(
        begun,
        rate_hz=1.0 / samples.sample_time_s,
        used_s=samples.duration_s,
        moved=float(np.std(samples.set_point)),
    )
    return read_step(known, samples, tick_s, advised)


def loop_rate_hz(log: Log) -> float:
    """Rate of the controller by the log's parameters, Hz; 0 where they do not tell."""
    return told_loop_rate_hz(log.parameters) or 0.0


def _pair(log: Log, axis: str, loop: str) -> _Pair | None:
    wanted, measured, attitude = CHANNELS[axis, loop]
    set_point, streams = find(log, wanted), places(log, measured)
    if set_point is None or not streams:
        return None
    message = set_point.label.split(".")[0]
    same = [each for each in streams if each.label.split(".")[0] == message]
    return _Pair(
        replace(set_point, name="set_point"),
        replace((same or streams)[0], name="measured"),
        None if attitude is None else _named(find(log, attitude), "attitude"),
    )


def _named(signal: Signal | None, name: str) -> Signal | None:
    return None if signal is None else replace(signal, name=name)


def _uneven(pair: _Pair, spans: tuple[Span, ...]) -> str:
    """Why the rows of a stream are too uneven to be put on one time base; else empty."""
    for signal in (pair.set_point, pair.measured):
        times = signal.time_s[inside(signal.time_s, spans)]
        if times.size < 2:
            continue
        mean_hz = (times.size - 1) / sum(min(b, times[-1]) - max(a, times[0]) for a, b in spans)
        if mean_hz < EVEN * signal.rate_hz:
            return (
                f"{signal.label} is logged at {signal.rate_hz:.3g} Hz between neighbours but "
                f"{mean_hz:.3g} Hz on the whole: too unevenly"
            )
    return ""


def _pieces(pair: _Pair, spans: tuple[Span, ...]) -> list[Record]:
    signals = [pair.set_point, pair.measured]
    slowest = min(signal.rate_hz for signal in signals)
    if pair.attitude is not None and pair.attitude.rate_hz > 0.9 * slowest:
        signals.append(pair.attitude)
    made = records(signals, {"set_point"}, spans)
    return [record for record in made if record.duration_s >= SHORTEST_PIECE_S]


def _spread(pieces: Sequence[Record]) -> float:
    """Standard deviation of the set-point about its mean in each piece."""
    asked = [np.asarray(piece["set_point"]) for piece in pieces]
    return float(np.concatenate([each - each.mean() for each in asked]).std())


def tracking_error(pieces: Sequence[Record], unit: str) -> Reading:
    """Root mean square error, with an interval by the scatter between ten stretches; or no number.

    One stretch that differs from all others leaves none: its size is that of chance.
    """
    error = np.concatenate([np.asarray(p["measured"]) - np.asarray(p["set_point"]) for p in pieces])
    if unit == "rad":
        error = (error + np.pi) % (2.0 * np.pi) - np.pi
    squares = np.array([np.mean(part**2) for part in np.array_split(error, STRETCHES)])
    left_out = np.sqrt((squares.sum() - squares) / (STRETCHES - 1))
    spread = math.sqrt((STRETCHES - 1) * float(np.var(left_out)))
    value = math.sqrt(float(squares.mean()))
    ends = LogarithmicEnds(value, spread / value) if value > 0.0 else None
    if ends is not None and (high := ends(LEVEL)) and high[1] > WIDEST_TRACKING.value * value:
        return Estimate(TRACKING, None, unit, reason="its stretches differ too much to tell one")
    return Estimate(TRACKING, value, unit, ends=ends)


def read_step(
    begun: LoopResponse, samples: LoopSamples, tick_s: float, advised: str
) -> LoopResponse:
    """The step of samples whose set-point the controller takes at ticks of `tick_s`."""
    pace = PACE[begun.loop]
    try:
        draws = closed_loop(samples, pace_s=pace)
    except FlightidError as error:
        clauses = (error.problem, error.found, error.needed and f"needed {error.needed}")
        reason = ", ".join(str(clause) for clause in clauses if clause)
        # Pieces are short where rows are few: a pause in the log ends one, whatever was flown.
        slow = advised if error.problem == TOO_FEW else ""
        action = "; ".join(filter(None, (slow, what_to_fly(begun))))
        return replace(begun, reason=reason, action=action)
    steps, time_s = _longest(draws, WINDOW_S[begun.loop], tick_s)
    unfit = refused(begun, window_features(steps, time_s), samples.sample_time_s, advised)
    if unfit is not None:
        return unfit
    by_frequency = frequency_features(draws, SLOWEST_HZ[begun.loop])
    readings = told_by(
        (*step_features(steps, time_s), *by_frequency), told_hz(samples, pace_s=pace)
    )
    return replace(begun, time_s=time_s, step=steps[0], draws=steps[1:], readings=readings)


def _longest(draws: LoopDraws, usual_s: float, tick_s: float) -> tuple[Array, Array]:
    """Steps over the usual window, or up to four where they come late or have not settled in it.

    A longer window whose level the data do not tell is not taken for one that tells it.
    """
    window_s = usual_s
    steps, time_s = _steps(draws, window_s, tick_s)
    while window_s < 4.0 * usual_s:
        level, delay, *_ = window_features(steps, time_s)
        late = delay.value is None or delay.value > window_s / 3.0
        if not late and not still_moves(steps):
            break
        window_s *= 2.0
        longer = _steps(draws, window_s, tick_s)
        if not late and _is_told(level) and not _is_told(window_features(*longer)[0]):
            break
        steps, time_s = longer
    return steps, time_s


def _steps(draws: LoopDraws, window_s: float, tick_s: float) -> tuple[Array, Array]:
    """Steps at their instants."""
    count = max(4, round(window_s / draws.sample_time_s))
    return draws.step(count), draws.instants(count, tick_s)


def refused(
    begun: LoopResponse, readings: tuple[Reading, ...], sample_time_s: float, advised: str
) -> LoopResponse | None:
    """The loop without a step, where readings of it tell too little; None where they tell one."""
    level, rise = readings[0], readings[2]
    half = level.half_width95
    steep = rise.value is not None and rise.value < SAMPLES_IN_RISE.value * sample_time_s
    told = _is_told(level) and rise.value is not None and not _is_late_or_early(readings)
    if steep or (not told and begun.loop == "rate" and begun.rate_hz < RATE_LEAST.value):
        return replace(
            begun,
            reason=f"logged at {begun.rate_hz:.3g} Hz, {TOO_SLOW} that rises in less "
            f"than {SAMPLES_IN_RISE.value * sample_time_s:.2g} s",
            action=advised,
        )
    if told:
        return None
    why = "" if half is None else f": {_level_words(level)}"
    if half is not None and _is_late_or_early(readings):
        why += f", half way there after {readings[1].text}"
    if (begun.moved or 0.0) > LIVELY[begun.loop].value:
        reason = f"gusts, limits or the other axes move it more than the set-point does{why}"
        return replace(begun, reason=reason, action="see motors at limits; fly in calm air")
    is_still = begun.moved is not None and begun.moved < HARDLY * LIVELY[begun.loop].value
    reason = f"not enough motion{', the set-point hardly moved' if is_still else ''}{why}"
    return replace(begun, reason=reason, action=what_to_fly(begun))


def _level_words(level: Reading) -> str:
    """Where a step ends; an interval beyond all that loops do says nothing, and is no number."""
    half = level.half_width95
    if half is not None and half >= UNTOLD:
        return "where the step ends cannot be told"
    return f"the step ends at {level.text}"


def _is_late_or_early(readings: tuple[Reading, ...]) -> bool:
    """Whether half of the step may come at once or late, and its overshoot be none or large."""
    delay, over = (readings[at].interval95 for at in (1, 3))
    if delay is None or over is None or over[1] - over[0] <= OVERSHOOT.value:
        return False
    return delay[1] > WIDEST_DELAY.value * max(delay[0], 0.0)


def _is_told(level: Reading) -> bool:
    """Whether a level is known to half of the step, or of itself where it ends lower."""
    half, value = level.half_width95, level.value
    if half is None or value is None:
        return False
    return half <= WIDEST_LEVEL.value * min(1.0, abs(value))

"""Replay: a log's set-point and rate through our controller, beside the output that it logged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.ardupilot_loop import ArduPilotLoop
from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.from_log import axis_loop_of
from flightid.control.autopilots.loop_run import LoopFlags, LoopRun, LoopState
from flightid.control.autopilots.replay_findings import Circumstances, replay_findings
from flightid.control.autopilots.replay_result import Replay, compare
from flightid.control.autopilots.replay_signals import (
    I_SET,
    LEAST_ROWS,
    LIMIT,
    RESET,
    AxisSignals,
    LoggedSignal,
    every_loop,
    longest_undisturbed,
    read_signals,
)
from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.logs import Log

Samples = NDArray[np.float64]
LAGS_LOOPS = (0, 1, 2, 3)
"""Whole loops by which a logged set-point may act late."""
SEARCH_S = (-0.01, 0.03)
"""Delays of set-point and rate that are searched where rows are interpolated, s."""
COARSE = 7
FINE_S = 5e-5
MOVES = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
GAP_LOOPS = 1.5
HALF_STAMP_S = 5e-7
"""Stamps count microseconds; rounding must not move a row to the loop before its own."""
SMALLEST = float(np.finfo(np.float32).eps)
"""PX4 calls its allocation saturated from this unallocated torque on."""


@dataclass(frozen=True)
class _Rows:
    """Terms, replayed and logged, on common stamps."""

    time_s: Samples
    logged: dict[str, Samples]
    replayed: dict[str, Samples]
    setpoint_lag_s: float
    rate_lag_s: float


def replay(
    log: Log,
    axis: str,
    *,
    controller: AxisLoop | None = None,
    span_s: tuple[float, float] | None = None,
) -> Replay:
    """Run a controller on a log's own set-point and rate, and compare its output with the log's.

    Where every loop was logged, the recursion runs loop by loop in the firmware's arithmetic and
    starts anew wherever the autopilot set its integrator; the lag of the set-point is found among
    whole loops. Where the log is slower, set-point and rate are interpolated to the loop's rate,
    and (PX4) their delays are fitted to the output.

    Parameters
    ----------
    log : Log
        A log with the controller's set-point, rate and output or terms.
    axis : {"roll", "pitch", "yaw"}
        Axis.
    controller : AxisLoop, optional
        Controller; default: the one that the log was flown with (`axis_loop_of`).
    span_s : (float, float), optional
        First and last instant, on the autopilot's clock, s; default: all.

    Returns
    -------
    Replay
        Its findings tell whether the log is reproduced, and what stands in the way.

    Raises
    ------
    DataError
        The log lacks a signal, or parameters of the controller.

    Biased when
    -----------
    The firmware uses the measured time of each loop where ours uses the nominal one; limit flags
    between rows of a slow log are not known.

    Reference
    ---------
    As `axis_loop`.

    Example
    -------
    >>> import tempfile
    >>> import flightid as fid
    >>> from flightid.vehicles import PilotDoublet, fly, write_ardupilot_log
    >>> flight = fly(doublets=[PilotDoublet("roll", start_s=1.0, amplitude=0.2)], duration_s=4.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log = fid.read_log(write_ardupilot_log(flight, f"{folder}/sim.BIN"))
    ...     found = replay(log, "roll")
    >>> found.exact, found["output"].largest_error < 1e-6, found.setpoint_lag_s
    (True, True, 0.0025)
    """
    controller = controller or axis_loop_of(log, axis)
    signals = read_signals(log, controller, span_s)
    running = controller
    if signals.filtered_target and isinstance(controller, ArduPilotLoop):
        running = controller.without_target_filter()
    rate_hz = signals.terms["output"].rate_hz
    exact = signals.paired and every_loop(signals.setpoint.time_s, controller)
    whole = signals.flags
    if not exact and whole is not None and (span := longest_undisturbed(whole)) is not None:
        signals = replace(read_signals(log, controller, span), flags=whole)
    rows = _every_loop(running, signals) if exact else _interpolated(running, signals)
    terms = tuple(compare(name, rows.logged[name], rows.replayed[name]) for name in rows.logged)
    circumstances = Circumstances(
        log, controller, signals, rows.time_s, rows.logged, rows.replayed, exact, rate_hz,
        (rows.setpoint_lag_s, rows.rate_lag_s),
    )  # fmt: skip
    return Replay(
        log.path.name,
        controller,
        rows.time_s,
        rows.logged,
        rows.replayed,
        terms,
        rows.setpoint_lag_s,
        rows.rate_lag_s,
        rate_hz,
        exact,
        replay_findings(terms, circumstances),
    )


def _every_loop(loop: AxisLoop, signals: AxisSignals) -> _Rows:
    """Loop by loop; the set-point's lag is the one under which the log is reproduced best."""
    judge = "Tar" if "Tar" in signals.terms else "output"
    known = round(signals.setpoint_loops)
    tried = {lag: _segments(loop, signals, lag) for lag in LAGS_LOOPS}
    # The known lag goes first, so that a set-point at rest does not choose another.
    order = sorted(LAGS_LOOPS, key=lambda lag: (lag != known, lag))
    errors = {
        lag: float(np.sum((tried[lag].replayed[judge] - tried[lag].logged[judge]) ** 2))
        for lag in order
    }
    return tried[min(order, key=lambda lag: errors[lag])]


def _segments(loop: AxisLoop, signals: AxisSignals, lag: int) -> _Rows:
    time_s = signals.setpoint.time_s
    n = time_s.size
    delayed = np.concatenate([np.repeat(signals.setpoint.values[:1], lag), signals.setpoint.values])
    setpoint = delayed[:n]
    flags = np.zeros(n, dtype=int) if signals.flags is None else signals.flags.values.astype(int)
    broken = (flags & (RESET | I_SET)) > 0
    late = np.diff(time_s, prepend=time_s[0]) > GAP_LOOPS / loop.loop_rate_hz
    cuts = np.flatnonzero(broken | late)
    starts = np.unique(np.concatenate([[lag], cuts[cuts > lag]]))
    ends = np.concatenate([starts[1:], [n]])
    kept: list[NDArray[np.intp]] = []
    runs: list[LoopRun] = []
    for start, end in zip(starts, ends, strict=True):
        part = np.arange(start + 1, end)
        if part.size == 0:
            continue
        limited = (flags[part] & LIMIT) > 0
        given = LoopFlags(limited=limited, start=_state(loop, signals, start, setpoint[start]))
        runs.append(loop.run(setpoint[part], signals.rate.values[part], given))
        kept.append(part)
    rows = np.concatenate(kept) if kept else np.zeros(0, dtype=np.intp)
    if rows.size < LEAST_ROWS:
        raise DataError(
            "the autopilot set its integrator all the time",
            found=f"{rows.size} loops between resets",
            needed=f"{LEAST_ROWS} or more",
            action="choose a span in flight",
        )
    replayed = {name: np.concatenate([run.terms[name] for run in runs]) for name in runs[0].terms}
    replayed["output"] = np.concatenate([run.output for run in runs])
    logged = {n: signal.values[rows] for n, signal in signals.terms.items() if n in replayed}
    return _Rows(time_s[rows], logged, replayed, lag / loop.loop_rate_hz, 0.0)


def _state(loop: AxisLoop, signals: AxisSignals, row: int, setpoint: float) -> LoopState | None:
    terms = signals.terms
    if not isinstance(loop, ArduPilotLoop) or not {"I", "D"} <= set(terms):
        return None
    logged = {name: float(signal.values[row]) for name, signal in terms.items()}
    return loop.state(logged, setpoint)


def _interpolated(loop: AxisLoop, signals: AxisSignals) -> _Rows:
    grid_s = _grid(loop, signals)
    target = signals.terms["output"]
    inside = (target.time_s >= grid_s[0]) & (target.time_s <= grid_s[-1])
    stamps = target.time_s[inside]
    if stamps.size < LEAST_ROWS:
        raise DataError(
            "set-point, rate and output overlap too little",
            found=f"{stamps.size} common rows",
            needed=f"{LEAST_ROWS} or more",
        )
    wanted = target.values[inside]

    def run(lags: NDArray[np.float64]) -> LoopRun:
        setpoint = _sampled(signals.setpoint, grid_s - lags[0])
        rate = _sampled(signals.rate, grid_s - lags[1])
        return loop.run(setpoint, rate, _flags(loop, signals, grid_s, lags))

    def misfit(lags: NDArray[np.float64]) -> float:
        output = np.interp(stamps, grid_s, run(lags).output)
        return float(np.mean((output - wanted) ** 2))

    # Rows of one message need no search: the firmware's order of work tells their lags.
    known = np.array([signals.setpoint_loops / loop.loop_rate_hz, 0.0])
    lags = known if signals.paired else _searched(misfit)
    found = run(lags)
    replayed = {name: np.interp(stamps, grid_s, term) for name, term in found.terms.items()}
    replayed["output"] = np.interp(stamps, grid_s, found.output)
    logged = {n: _sampled(signal, stamps) for n, signal in signals.terms.items() if n in replayed}
    return _Rows(stamps, logged, replayed, float(lags[0]), float(lags[1]))


def _searched(misfit: Callable[[NDArray[np.float64]], float]) -> NDArray[np.float64]:
    places = np.linspace(*SEARCH_S, COARSE)
    pairs = [np.array([first, second]) for first in places for second in places]
    best: NDArray[np.float64] = pairs[int(np.argmin([misfit(pair) for pair in pairs]))]
    step_s = (places[1] - places[0]) / 2
    while step_s > FINE_S:
        around = [best + step_s * np.array(move) for move in MOVES]
        errors = [misfit(pair) for pair in around]
        nearest = int(np.argmin(errors))
        # The middle is the first of the moves: where it is best, look closer.
        step_s = step_s / 2 if nearest == 0 else step_s
        best = around[nearest]
    return np.asarray(best)


def _grid(loop: AxisLoop, signals: AxisSignals) -> Samples:
    spans = [signal.time_s for signal in (signals.setpoint, signals.rate)]
    first, last = max(t[0] for t in spans), min(t[-1] for t in spans)
    count = int((last - first) * loop.loop_rate_hz)
    if count < LEAST_ROWS:
        raise DataError("set-point and rate do not overlap", found=f"{last - first:.3g} s")
    return np.asarray(first + np.arange(count) / loop.loop_rate_hz)


def _sampled(signal: LoggedSignal, time_s: Samples) -> Samples:
    return np.asarray(np.interp(time_s, signal.time_s, signal.values))


def _held(signal: LoggedSignal, time_s: Samples) -> Samples:
    rows = np.searchsorted(signal.time_s, time_s + HALF_STAMP_S, side="right") - 1
    return np.asarray(signal.values[np.maximum(rows, 0)])


def _flags(
    loop: AxisLoop, signals: AxisSignals, grid_s: Samples, lags: NDArray[np.float64]
) -> LoopFlags:
    limited = None
    if signals.flags is not None:
        limited = (_held(signals.flags, grid_s).astype(int) & LIMIT) > 0
    elif signals.unallocated is not None:
        missing = _held(signals.unallocated, grid_s)
        limited = np.column_stack([missing > SMALLEST, missing < -SMALLEST])
    return LoopFlags(
        limited=limited,
        landed=None if signals.landed is None else _held(signals.landed, grid_s) > 0,
        thrust=None if signals.thrust is None else np.abs(_held(signals.thrust, grid_s)),
        acceleration=(
            None
            if signals.acceleration is None
            else _sampled(signals.acceleration, grid_s - lags[1])
        ),
        start=_first_state(loop, signals, grid_s[0]),
    )


def _first_state(loop: AxisLoop, signals: AxisSignals, time_s: float) -> LoopState | None:
    stamps = np.array([time_s])
    setpoint = float(_sampled(signals.setpoint, stamps)[0])
    logged: Mapping[str, float] = {
        name: float(_sampled(signal, stamps)[0]) for name, signal in signals.terms.items()
    }
    if isinstance(loop, ArduPilotLoop):
        return loop.state(logged, setpoint) if {"I", "D"} <= set(logged) else None
    rate = float(_sampled(signals.rate, stamps)[0])
    return LoopState(integrator=logged.get("I", 0.0), rate=rate)

"""Why a replayed controller agrees with its log, or does not."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.parameter_table import parameter_entries
from flightid.control.autopilots.replay_result import QUIET, TermReplay
from flightid.control.autopilots.replay_signals import I_SET, LIMIT, RESET, AxisSignals
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.logs import Log

Samples = NDArray[np.float64]
REPRODUCED, SIMILAR = 99.9, 80.0
"""Fit of the output, %, from which the controller counts as reproduced, and as the same kind."""
ROUNDING = 2e-6
"""Error that single precision alone explains, over the size of the output."""
LEAST_THRUST = 0.2


@dataclass(frozen=True)
class Circumstances:
    """What a verdict looks at."""

    log: Log
    loop: AxisLoop
    signals: AxisSignals
    time_s: Samples
    logged: Mapping[str, Samples]
    replayed: Mapping[str, Samples]
    exact: bool
    rate_hz: float
    lags_s: tuple[float, float]


def replay_findings(terms: tuple[TermReplay, ...], c: Circumstances) -> tuple[Finding, ...]:
    """Verdict first, then what stands in the way."""
    verdict = _verdict(terms[-1], c)
    found = [verdict, *_per_row(c), *_lags(c)]
    if verdict.light != Light.GREEN:
        found += [*_scales(c), *_rate(c), *_limits(c), *_changes(c), *_rest(c)]
        found += [
            Finding("unmodelled", Light.UNKNOWN, text)
            for text in c.loop.unmodelled + c.loop.unknown_notches
        ]
    found += _source(c)
    return tuple(found)


def _verdict(output: TermReplay, c: Circumstances) -> Finding:
    fit = output.fit_percent
    if fit is None:
        return Finding(
            "replay-at-rest",
            Light.UNKNOWN,
            "the logged output does not move: nothing is proven",
            "choose a span in flight",
        )
    how = "loop by loop" if c.exact else f"from rows at {c.rate_hz:.3g} Hz"
    what = f"{how}: output fit {fit:.5g} %, largest error {output.largest_error:.2g}"
    if fit >= REPRODUCED or output.largest_error <= ROUNDING * max(output.rms_logged, 1.0):
        return Finding("replay-reproduced", Light.GREEN, f"the controller is reproduced {what}")
    if fit >= SIMILAR:
        return Finding(
            "replay-similar", Light.AMBER, f"the controller is reproduced in the main {what}"
        )
    return Finding(
        "replay-failed",
        Light.RED,
        f"the log is not reproduced {what}",
        "do not design gains on this view of the controller before the reason is found",
    )


def _per_row(c: Circumstances) -> list[Finding]:
    """P from the logged error and FF from the logged target hold in each row of any log."""
    terms, values = c.signals.terms, c.loop.values
    if "Err" not in terms or c.loop.autopilot == "arduplane":
        return []
    checks = []
    for name, source, role in (("P", "Err", "p"), ("FF", "Tar", "ff")):
        if name not in terms:
            continue
        inputs = terms[source].values if source in terms else c.signals.setpoint.values
        error = np.abs(terms[name].values - values[role] * inputs)
        size = float(np.abs(terms[name].values).max())
        if size > QUIET:
            checks.append((c.loop.names[role], float(error.max()) / size))
    right = [name for name, error in checks if error < 1e-5]
    wrong = [f"{name} (by {error:.2g} of the largest)" for name, error in checks if error >= 1e-5]
    found = []
    if right:
        text = f"every row of the log confirms {' and '.join(right)} to rounding"
        found.append(Finding("gains-confirmed", Light.GREEN, text))
    if wrong:
        text = f"rows of the log contradict {' and '.join(wrong)}"
        action = "look for changes in flight, the slew limiter (Dmod) or throttle boost"
        found.append(Finding("gains-contradicted", Light.AMBER, text, action))
    return found


def _lags(c: Circumstances) -> list[Finding]:
    setpoint, rate = (1e3 * lag for lag in c.lags_s)
    known = 1e3 * c.signals.setpoint_loops / c.loop.loop_rate_hz
    if c.exact and abs(setpoint - known) > 1e-6:
        text = f"the set-point acts {setpoint:.3g} ms after it is logged, expected {known:.3g} ms"
        return [Finding("unexpected-lag", Light.AMBER, text, "the order of work differs")]
    if c.signals.paired:
        return []
    text = f"set-point and rate act {setpoint:.3g} and {rate:.3g} ms after their stamps (fitted)"
    return [Finding("fitted-lags", Light.GREEN, text)]


def _scales(c: Circumstances) -> list[Finding]:
    """By how much each replayed term would have to be multiplied to make the logged output."""
    names = [n for n in ("P", "I", "D", "FF", "DFF") if n in c.replayed]
    moving = [n for n in names if np.std(c.replayed[n]) > QUIET]
    if not moving:
        return []
    columns = np.column_stack([*(c.replayed[n] for n in moving), np.ones(c.time_s.size)])
    factors, _, rank, _ = np.linalg.lstsq(columns, c.logged["output"], rcond=None)
    if rank < columns.shape[1]:
        return []
    text = ", ".join(f"{n} x {factor:.3g}" for n, factor in zip(moving, factors, strict=False))
    rest = c.logged["output"] - columns @ factors
    fit = 100 * (1 - float(np.std(rest)) / float(np.std(c.logged["output"])))
    return [
        Finding(
            "terms-rescaled",
            Light.UNKNOWN,
            f"least squares would take {text} (output fit {fit:.4g} %)",
            "factors near 1 say that the gains are right and the inputs are not good enough",
        )
    ]


def _rate(c: Circumstances) -> list[Finding]:
    if c.exact:
        return []
    inputs = min(c.signals.setpoint.rate_hz, c.signals.rate.rate_hz)
    return [
        Finding(
            "log-rate",
            Light.AMBER,
            f"set-point and rate are logged at {inputs:.3g} Hz or more, the controller ran at "
            f"{c.loop.loop_rate_hz:.4g} Hz: what lies between rows is interpolated",
            "log the controller in every loop",
        )
    ]


def _limits(c: Circumstances) -> list[Finding]:
    found = []
    if c.signals.unallocated is not None:
        share = float(np.mean(c.signals.unallocated.values != 0))
        if share > 0:
            text = f"the allocation could not give the torque in {100.0 * share:.0f} % of its rows"
            found.append(Finding("limit-flag", Light.AMBER, text, "choose a span without limits"))
    if c.signals.flags is not None:
        bits = c.signals.flags.values.astype(int)
        limited = float(np.mean((bits & LIMIT) > 0))
        reset = float(np.mean((bits & (RESET | I_SET)) > 0))
        if limited > 0:
            rows = f"{100.0 * limited:.0f} % of the rows"
            text = f"the limit flag is set in {rows}: the integrator may not grow"
            found.append(Finding("limit-flag", Light.AMBER, text, "choose a span without limits"))
        if reset > 0:
            text = (
                f"the autopilot set or reset the integrator in {100.0 * reset:.0f} % of the rows; "
                f"{c.time_s[0]:.2f} to {c.time_s[-1]:.2f} s were replayed"
            )
            found.append(
                Finding("integrator-set", Light.AMBER, text, "choose a span in flight, not landed")
            )
    return found


def _changes(c: Circumstances) -> list[Finding]:
    first, last = c.time_s[0], c.time_s[-1]
    found = []
    modes = [
        event
        for event in c.log.events
        if event.kind == "mode" and event.time_s is not None and first < event.time_s < last
    ]
    if modes:
        text = f"the mode changes in the span ({len(modes)} times)"
        found.append(Finding("mode-change", Light.AMBER, text, "choose a span in one mode"))
    names = {entry.name for entry in parameter_entries(c.loop.autopilot, c.loop.axis)}
    changed = {
        change.name
        for change in c.log.parameter_changes
        if change.name in names and change.time_s is not None and first < change.time_s < last
    }
    if changed:
        text = f"parameters change in the span: {', '.join(sorted(changed))}"
        found.append(
            Finding("parameters-changed", Light.RED, text, "choose a span with one set of gains")
        )
    return found


def _rest(c: Circumstances) -> list[Finding]:
    thrust = c.signals.thrust
    if thrust is None or float(np.abs(thrust.values).max()) > LEAST_THRUST:
        return []
    text = "the thrust set-point stays at zero: the vehicle did not fly, and the integrator rests"
    return [Finding("no-thrust", Light.AMBER, text)]


def _source(c: Circumstances) -> list[Finding]:
    found = [
        Finding("inputs", Light.GREEN, f"{name} from {text}")
        for name, text in c.signals.extra.items()
    ]
    if c.signals.filtered_target:
        text = "the set-point ahead of its filter is not logged: the filtered target is taken"
        found.append(Finding("filtered-target", Light.GREEN, text, "log RATE too"))
    return found

"""Verdicts on a flight: what is out of the ordinary, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from flightid.conventions import Light
from flightid.findings import DIVERGES, Finding, worst_last
from flightid.inspection.advice import LOGGING
from flightid.logs.log_cut import LOG_CUT
from flightid.review.filter_findings import filter_findings
from flightid.review.loop_response import LoopResponse
from flightid.review.motors import LIMITS, MotorUse
from flightid.review.result import FlightReview
from flightid.review.step_features import FALLS, RISES
from flightid.review.sticks_to_fly import what_to_fly
from flightid.review.tables import cell
from flightid.review.thresholds import LEVEL_OFF, OVERSHOOT, SATURATED, UNBALANCED
from flightid.review.vibration import Vibration

FAST_GYRO = {
    "ardupilot": "set INS_LOG_BAT_MASK 1 for raw batches of the first gyroscope",
    "px4": "set SDLOG_PROFILE 25, with system identification and high rate",
    "betaflight": "set blackbox_sample_rate 1/1, and log the unfiltered gyroscope",
    "inav": "set blackbox_rate_num 1 and blackbox_rate_denom 1, and log the raw gyroscope",
    "mavlink": LOGGING["mavlink"],
}
SHAKEN = "balance propellers, damp the autopilot's mount, look for loose parts"


OF_SIZES = ("unit-assumed", "unit-of-counts", "settings-unknown")
"""Codes of findings of a log that say what its numbers, and so those of its flight, are worth."""


def judge_flight(review: FlightReview, of_log: Iterable[Finding] = ()) -> tuple[Finding, ...]:
    """All verdicts, the worst and then a fall last, where eyes are on a terminal.

    Parameters
    ----------
    review : FlightReview
    of_log : iterable of Finding
        What its log was found to be, its end judged (`end_judged`).
    """
    whole = (*OF_SIZES, LOG_CUT)
    own = (each for each in of_log if each.code in whole or each.code.startswith(DIVERGES))
    # Of equals the first stays ahead of the others: it leads to them.
    return worst_last((*own, *_all(review)))


def _all(review: FlightReview) -> Iterator[Finding]:
    yield from _flown(review)
    yield from _loops(review)
    yield from filter(None, (each.finding(review.name) for each in review.ranges))
    yield from _motors(review)
    for vibration in review.vibrations:
        yield from _vibration(vibration)
    if review.phases.airborne and not review.vibrations:
        yield Finding(
            "vibration-unknown", Light.UNKNOWN, "the log holds no measure of vibration in the air"
        )
    yield from _noise(review)
    fallen = review.phases.tipped_s is not None
    yield from filter_findings(review.filters, review.name, review.kind, fallen=fallen)


def loops_in_doubt(review: FlightReview) -> tuple[Finding, ...]:
    """Why loops of a flight are not what they were tuned to be, with the flight's name."""
    limits = (each for each in _motors(review) if each.code in LIMITS)
    return tuple(replace(each, message=f"{review.name}: {each.message}") for each in limits)


def _noise(review: FlightReview) -> Iterator[Finding]:
    if review.noise.is_told:
        tops = ", ".join(f"{peak.frequency_hz:.3g} Hz" for peak in review.noise.peaks)
        told = f"peaks at {tops}" if tops else "no peak stands out of it"
        yield Finding("gyro-noise", Light.GREEN, f"noise of the gyroscope: {told}")
    elif review.phases.airborne:
        action = FAST_GYRO.get(review.kind, "log the gyroscope faster")
        if any(loop.action.startswith(action.partition(",")[0]) for loop in review.loops):
            action = ""  # A loop asks for the same setting, and says what it is now.
        said = f"no spectrum of the gyroscope: {review.noise.reason}"
        yield Finding("no-noise-spectrum", Light.UNKNOWN, said, action)


def _flown(review: FlightReview) -> Iterator[Finding]:
    phases = review.phases
    if not phases.is_known:
        yield Finding("flight-unknown", Light.UNKNOWN, phases.evidence, phases.action)
    elif not phases.airborne:
        yield Finding(
            "no-flight",
            Light.RED,
            f"never airborne ({phases.evidence}): a log of the ground tells nothing of the vehicle "
            "in the air",
            "hand in a log of a flight",
        )
    if phases.tipped_s is not None:
        yield Finding(
            "tipped-over",
            Light.AMBER,
            f"{phases.fall}: what comes after is left out",
            "look for the cause of the fall first",
        )


def _loops(review: FlightReview) -> Iterator[Finding]:
    told = [loop for loop in review.loops if loop.is_told]
    for loop in told:
        said = _step_words(loop)
        if loop.is_bent:
            said += f" (of large moves: {loop.beyond})"
        judged = _level(review, loop, *_overshoot(review, loop, said))
        yield Finding(f"step-{loop.axis}-{loop.loop}", *judged)
    if not review.phases.airborne:
        return
    for loop in review.loops:
        if not loop.is_told:
            light, said = Light.AMBER, f"{loop.name}: no step, {loop.reason}"
            if loop.fly_in:
                # Nothing is amiss: nobody asked anything of this loop.
                light, said = Light.UNKNOWN, f"{said}; all sticks asked for was rates"
            yield Finding(f"no-step-{loop.axis}-{loop.loop}", light, said, loop.action)
    if not review.loops:
        yield Finding(
            "no-set-points",
            Light.AMBER,
            "the log holds no set-point with what was measured",
            LOGGING.get(review.kind, ""),
        )


def _step_words(loop: LoopResponse) -> str:
    """What a step does, and whether that is all of it."""
    half, over = cell(loop["delay to half"], 1e3), cell(loop["overshoot"])
    level, creeps = f"{cell(loop['level'])} of what is asked", loop.creeps
    late = f"half way after {half} ms" if half else f"half way {_untold(loop, 'delay to half')}"
    said = f"{loop.name}: {late}, "
    if not creeps:
        beyond = f"overshoots by {over} %" if over else f"overshoot {_untold(loop, 'overshoot')}"
        return f"{said}ends at {level}, {beyond}"
    beyond = f" after an overshoot of {over} %" if over else ""
    return (
        f"{said}reaches {level} in {loop.time_s[-1]:.2g} s{beyond} and {creeps} there: settling is "
        "not seen"
    )


def _untold(loop: LoopResponse, name: str) -> str:
    return f"not told ({loop[name].reason})"


LESS_FED = "feed less of the set-point's rate forward"
CALMER = {
    "rate": "lower I of this loop, then P; raise D, or take filters with less delay",
    "attitude": f"mend the rate loop first, then lower P of the angle, or {LESS_FED}",
}
UNFED_CALMER = {**CALMER, "attitude": CALMER["attitude"].removesuffix(f", or {LESS_FED}")}
"""The same where parameters feed nothing forward: there is nothing to be fed less."""


def _gains(review: FlightReview, sure: str) -> str:
    """What to do about gains: what sweeps of the log say, else what a step says that is sure.

    A step does not weigh P against I, as a model does: no gain is named where sweeps carry one.
    """
    if review.carried:
        return f"flightid tune {review.name} weighs the gains by the log's sweeps"
    return sure or f"which gain, sweeps tell: flightid plan {review.name}, then flightid tune"


def _overshoot(review: FlightReview, loop: LoopResponse, said: str) -> tuple[Light, str, str]:
    """Light, message and action: amber where it may be beyond the limit, unknown where all may."""
    over, limit = loop["overshoot"], OVERSHOOT.value
    if over.value is None and loop.creeps == RISES:
        return Light.GREEN, said, ""
    low, high = over.interval95 or (over.value or 0.0, over.value or 0.0)
    if over.value is None or (low < limit and high - low > limit):
        return Light.UNKNOWN, f"{said}: too uncertain to judge", what_to_fly(loop)
    if high <= limit:
        return Light.GREEN, said, ""
    sure, may = low > limit, "" if low > limit else "may be "
    said = f"{said}; {may}beyond {limit:g} %, where damping is poor"
    calmer = UNFED_CALMER if loop.name in review.identity.unfed else CALMER
    return Light.AMBER, said, _gains(review, calmer[loop.loop] if sure else "")


SHORT = {
    "rate": "look for motors at a limit, wind, and what the set-point is scaled by; what comes "
    "later than this step is read counts as missing too",
    "attitude": "look at the rate loop first, if it falls short too; then for a trim or wind that "
    "holds the angle off",
}
LONG = {
    "rate": "look for feed-forward that is too large, and for what the set-point is scaled by",
    "attitude": f"{LESS_FED}, and look for what scales the set-point",
}
UNFED_LONG = {
    "rate": "look for what the set-point is scaled by",
    "attitude": "look for what scales the set-point",
}


def _level(
    review: FlightReview, loop: LoopResponse, light: Light, said: str, action: str
) -> tuple[Light, str, str]:
    """The same, amber where the step ends far from one and its interval leaves one out.

    What still comes, as an integrator brings it, is no steady error, and asks for no gain.
    """
    level, off = loop["level"], LEVEL_OFF.value
    value = 1.0 if level.value is None else level.value
    ends = level.interval95 or (value, value)
    short, beyond = value < 1.0 - off and ends[1] < 1.0, value > 1.0 + off and ends[0] > 1.0
    if loop.creeps == (RISES if short else FALLS):
        unsure = light is Light.GREEN and (short or beyond)
        return (Light.UNKNOWN if unsure else light), said, action
    if short:
        what, do = "short of what is asked: sticks do not give the motion they stand for", SHORT
        if loop.loop == "rate":
            sure = "raise I of this loop" if ends[1] < 1.0 - off else ""
            action = action or _gains(review, sure)
    elif beyond:
        what, do = "beyond what is asked: sticks give more motion than they stand for", LONG
        do = UNFED_LONG if loop.name in review.identity.unfed else LONG
    elif light is Light.GREEN and (level.half_width95 or 0.0) > off:
        return Light.UNKNOWN, f"{said}: where it ends is too uncertain to judge", what_to_fly(loop)
    else:
        return light, said, action
    acts = "; ".join(filter(None, (do[loop.loop], action)))
    return Light.AMBER, f"{said}; it stays {what}", acts


def _motors(review: FlightReview) -> Iterator[Finding]:
    trim = review.yaw_trim
    ends = None if trim is None else trim.interval95
    twisted = ends is not None and (ends[0] > UNBALANCED.value or ends[1] < -UNBALANCED.value)
    if twisted and ends is not None:
        way = "counter-clockwise" if ends[0] > 0.0 else "clockwise"
        size = cell(trim, 100.0 if ends[0] > 0.0 else -100.0)
        yield Finding(
            "yaw-trimmed",
            Light.AMBER,
            f"the motors that turn {way} work {size} % of the mean harder than the others: they "
            "hold a steady yaw moment",
            "look for tilted motors and twisted arms or frame, then for a worn motor or propeller",
        )
    straight = "straighten motors and frame first: the steady yaw moment takes the room"
    for motor in review.motors:
        for share, limit, action in (
            (motor.at_upper, "upper", "less weight, larger propellers, or gentler flying"),
            (
                motor.at_lower,
                "lower",
                "lower MOT_SPIN_MIN (ArduPilot), lower gains, or more weight",
            ),
        ):
            if share > SATURATED.value:
                yield Finding(
                    f"motor-at-{limit}",
                    Light.AMBER,
                    f"{motor.name} is at its {limit} limit for {100 * share:.0f} % of the time in "
                    "the air: loops are not what they were tuned to be there",
                    straight if twisted else action,
                )
        if not twisted:
            yield from _balance(motor)


def _balance(motor: MotorUse) -> Iterator[Finding]:
    """A motor whose whole interval lies beyond what is usual in a hover."""
    ends = motor.difference.interval95
    if ends is None or (-UNBALANCED.value < ends[1] and ends[0] < UNBALANCED.value):
        return
    word, sign = ("more", 1.0) if ends[0] > 0.0 else ("less", -1.0)
    yield Finding(
        "motors-unbalanced",
        Light.AMBER,
        f"{motor.name} works {cell(motor.difference, 100.0 * sign)} % {word} than the mean of all",
        "balance the centre of gravity; look for a twisted motor mount, a worn motor or propeller",
    )


def _vibration(found: Vibration) -> Iterator[Finding]:
    light = Light.GREEN
    if found.median > found.bad.value:
        light = Light.RED
    elif found.median > found.good.value or found.high > found.bad.value:
        light = Light.AMBER
    if light is not Light.GREEN:
        yield Finding(
            "vibration",
            light,
            f"{found.name}: median {found.median:.3g}, 99th percentile {found.high:.3g} m/s^2, "
            f"where {found.good.value:g} is fine and {found.bad.value:g} is trouble",
            SHAKEN,
        )
    if found.clipped:
        yield Finding(
            "accelerometer-clips",
            Light.AMBER,
            f"{found.name}: the accelerometer was at its range {found.clipped} times",
            SHAKEN,
        )

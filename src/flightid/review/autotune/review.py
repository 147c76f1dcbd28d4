"""The verb: a log with an autotune in, a second opinion on its gains out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from flightid.control.autopilots import axis_loop_of
from flightid.control.margins.margins import Margins
from flightid.conventions import Light
from flightid.errors import DataError, FlightidError
from flightid.findings import Finding
from flightid.logs import Log, read_log
from flightid.progress import progress
from flightid.review.autotune.ardupilot import ardupilot_run
from flightid.review.autotune.px4 import px4_run
from flightid.review.autotune.result import AutotuneReview
from flightid.review.autotune.run import AutotuneRun
from flightid.review.autotune.second_opinion import SecondOpinion, second_opinion
from flightid.review.tables import cell

PHASE_GUIDE_DEG, GAIN_GUIDE_DB = 45.0, 6.0
"""SAE AS94900."""
WIDEST_DEG = 10.0
"""Of a phase margin's half interval: a guide that a wider one keeps is kept by next to nothing."""
ORDER = (Light.GREEN, Light.UNKNOWN, Light.AMBER, Light.RED)


def review_autotune(log: Log | str | Path) -> AutotuneReview:
    """Say what an autotune did, why it failed, and what margins its gains have.

    A model of each axis (rate damping, motor lag, delay) is fitted to the twitches of ArduCopter or
    the steps of PX4, beside the noise of the gyro and of the air, by the likelihood of what each
    sample adds to the past; autotune's gains and those before are closed around it with the
    autopilot's own filters, and their margins carry the covariance of the fit.

    Parameters
    ----------
    log : Log or path-like
        ArduCopter (ATUN, ATDE) or a PX4 multicopter (autotune_attitude_control_status).

    Raises
    ------
    DataError
        The log holds no autotune.
    LogFormatError
        The file is not a log that flightid reads.
    OSError
        The file cannot be read.

    Assumes
    -------
    Small signals, as everywhere in margins: a twitch that drives motors to their limits looks like
    a slower vehicle. Disturbances are Gaussian: gyro noise of a low order behind its filter, and
    accelerations that are white or steady for a twitch.

    Reference
    ---------
    ArduPilot, libraries/AC_AutoTune; PX4, src/modules/mc_autotune_attitude_control; Klein &
    Morelli, *Aircraft System Identification*, §5.4 (maximum likelihood); Ljung, *System
    Identification*, 2nd ed., §13.4 (closed loops); SAE AS94900 (margins).

    Example
    -------
    >>> import flightid as fid
    >>> print(fid.review_autotune("autotune.bin").to_text())          # doctest: +SKIP
    """
    opened = log if isinstance(log, Log) else read_log(log)
    run = px4_run(opened) if opened.kind == "px4" else ardupilot_run(opened)
    if run is None:
        raise DataError(
            "the log holds no autotune",
            found=f"{opened.path.name}, {opened.kind}",
            needed="ATUN messages (ArduCopter) or autotune_attitude_control_status (PX4)",
            action=f"flightid flight {opened.path.name} says what an ordinary flight tells",
        )
    opinions = []
    with progress(max(len(run.spans), 1), "second opinion") as advance:
        for axis, spans in run.spans.items():
            opinions.append(second_opinion(opened, axis, spans, run.gains.get(axis, {})))
            advance(1)
    found = AutotuneReview(
        opened.path.name, opened.firmware, run, _before(opened, run), tuple(opinions)
    )
    return replace(
        found, findings=tuple(sorted(_judged(found), key=lambda f: ORDER.index(f.light)))
    )


def _before(log: Log, run: AutotuneRun) -> dict[str, dict[str, float]]:
    """Gains as they stood when each axis' tests began."""
    found = {}
    for axis, gains in run.gains.items():
        spans = run.spans.get(axis)
        try:
            loop = axis_loop_of(log, axis, at_s=spans[0][0] if spans else None)
        except FlightidError:
            continue
        found[axis] = {name: loop.gains[name] for name in gains if name in loop.gains}
    return found


def _judged(review: AutotuneReview) -> Iterator[Finding]:
    yield from review.run.findings
    for opinion in review.opinions:
        yield from _of_opinion(opinion, review.name)


def _of_opinion(opinion: SecondOpinion, log: str) -> Iterator[Finding]:
    if opinion.tuned is None:
        yield Finding(
            f"no-second-opinion-{opinion.axis}",
            Light.UNKNOWN,
            f"{opinion.axis}: no margins, {opinion.reason}",
            "log the PIDs or rates at the loop's rate (ArduPilot: LOG_BITMASK with fast attitude "
            "and PID; PX4: SDLOG_PROFILE 25)",
        )
        return
    light, words = _words(opinion.tuned)
    if opinion.tuned.is_stable and opinion.tuned.phase_margin.interval95 is None:
        light = max(light, Light.AMBER, key=ORDER.index)
        words = f"{words}, without intervals{opinion.why and f' ({opinion.why})'}"
    half = opinion.tuned.phase_margin.half_width95 if opinion.tuned.is_stable else None
    if light is Light.GREEN and half is not None and half > WIDEST_DEG:
        light = Light.AMBER
        words = f"{words}, told to {half:.2g} deg alone"
    flown = "" if opinion.flown is None else f"; before: {_words(opinion.flown)[1]}"
    action = {
        Light.GREEN: "",
        Light.AMBER: f"look at the step in flight (flightid flight {log}); margins that are surer "
        f"take a sweep: flightid plan {log} --axes {opinion.axis}",
        Light.RED: f"do not fly these gains; sweep the axis, then tune it: flightid plan {log} "
        f"--axes {opinion.axis}",
    }[light]
    yield Finding(
        f"autotune-margins-{opinion.axis}",
        light,
        f"{opinion.axis}: autotune's gains have {words}{flown}",
        action,
    )


def _words(found: Margins) -> tuple[Light, str]:
    """Light and words of margins: green where they are above the guide for sure."""
    if not found.is_stable:
        return Light.RED, "no stable loop"
    phase, gain = found.phase_margin, found.gain_margin
    told = f"phase margin {cell(phase)} deg, gain margin {cell(gain)} dB"
    lights = [_light(phase.value, phase.interval95, PHASE_GUIDE_DEG)]
    lights.append(_light(gain.value, gain.interval95, GAIN_GUIDE_DB))
    return max(lights, key=ORDER.index), told


def _light(value: float | None, interval: tuple[float, float] | None, guide: float) -> Light:
    if value is None:
        return Light.GREEN
    low, high = interval or (value, value)
    if low >= guide:
        return Light.GREEN
    return Light.RED if high < 0.5 * guide else Light.AMBER

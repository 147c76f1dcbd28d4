"""The go/no-go list of a plan: each rule one function, with its source beside its number."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flightid.conventions import Light
from flightid.excitation.excitation import Excitation
from flightid.excitation.plan import Plan
from flightid.findings import Finding

SAMPLES_PER_CYCLE = 25.0
"""Sample rate over the highest frequency (Tischler & Remple, section 5.9)."""
CYCLES_IN_RECORD = (3.0, 5.0)
"""Cycles of the lowest frequency in a record: fewer is red, more is green."""
COVERAGE_PERCENT = (60.0, 90.0)
COHERENT_PERCENT = (50.0, 90.0)
LARGEST_CROSS_COHERENCE = 0.5
LARGEST_BOUND_PERCENT = 20.0
MARGIN = 0.8
"""Share of a limit beyond which a prediction from a guess is no longer safe."""
END_SHARE = 0.02
"""Largest end value over the peak that still counts as trim."""
LONGEST_DWELL_SHARE = 0.3
LEAST_FADE_FREQUENCY_SHARE = 0.8
LONGEST_TAIL_S = 20.0

AMC_TEMPLATE = {
    "magnitude": 0.15,
    "start_hz": 0.05,
    "stop_hz": 5.0,
    "fade_in_s": 5.0,
    "fade_out_s": 5.0,
    "record_s": 130.0,
}


def is_transient(excitation: Excitation) -> bool:
    """Whether the input is a handful of steps, too short for windows."""
    return excitation.kind == "doublet" or excitation.kind.startswith(("multistep", "modified"))


def go_no_go(plan: Plan) -> Iterator[Finding]:
    """Every rule of the list, in the order of a checklist."""
    yield _sample_rate(plan)
    if is_transient(plan.excitation):
        yield Finding(
            "design-transient",
            Light.AMBER,
            "a few steps give no averaged frequency response",
            "use the record to verify a model, or for a fit in the time domain",
        )
    else:
        yield _record_length(plan)
        yield _windows(plan)
    yield from _ends(plan.excitation)
    yield from _coverage(plan)
    yield from _cross_coherence(plan)
    yield from _safety(plan)
    yield from _information(plan)
    yield from chirp_findings(plan.excitation)


def _sample_rate(plan: Plan) -> Finding:
    rate_hz = 1 / plan.excitation.sample_time_s
    needed_hz = SAMPLES_PER_CYCLE * plan.band_rad_s[1] / (2 * math.pi)
    light = Light.GREEN if rate_hz >= needed_hz * (1 - 1e-9) else Light.AMBER
    if rate_hz < 0.4 * needed_hz:
        light = Light.RED
    return Finding(
        "design-sample-rate",
        light,
        f"{rate_hz:.4g} Hz for a band up to {plan.band_rad_s[1]:.4g} rad/s",
        "" if light is Light.GREEN else f"log and command at {needed_hz:.3g} Hz or lower the band",
    )


def _record_length(plan: Plan) -> Finding:
    cycles = plan.excitation.duration_s * plan.band_rad_s[0] / (2 * math.pi)
    few, enough = CYCLES_IN_RECORD
    light = Light.GREEN if cycles >= enough else Light.AMBER if cycles >= few else Light.RED
    needed_s = enough * 2 * math.pi / plan.band_rad_s[0]
    return Finding(
        "design-record-length",
        light,
        f"the record holds {cycles:.3g} cycles of the lowest frequency",
        "" if light is Light.GREEN else f"fly {needed_s:.3g} s or raise the lowest frequency",
    )


def _windows(plan: Plan) -> Finding:
    if plan.windows_s:
        return Finding(
            "design-windows",
            Light.GREEN,
            f"windows from {plan.windows_s[-1]:.3g} to {plan.windows_s[0]:.3g} s leave five "
            "independent averages",
        )
    return Finding(
        "design-windows",
        Light.RED,
        "no window holds two cycles of the lowest frequency and leaves five averages",
        "fly longer or more often, or raise the lowest frequency",
    )


def _ends(excitation: Excitation) -> Iterator[Finding]:
    ends = np.max(np.abs(excitation.signals[:, [0, -1]]), axis=1)
    # Random and two-level inputs end where they end: their estimate does not rest on trim.
    if excitation.kind in ("prbs", "noise", "uniform noise", "multisine"):
        return
    for name, end, peak in zip(excitation.names, ends, excitation.peak, strict=True):
        if end > END_SHARE * peak:
            yield Finding(
                "design-ends-out-of-trim",
                Light.AMBER,
                f"{name} starts or ends at {_with_unit(end, excitation.unit)}",
                "fade in and out, so that the record starts and ends in trim",
            )


def _coverage(plan: Plan) -> Iterator[Finding]:
    poor, good = COVERAGE_PERCENT
    for name, share in zip(
        plan.excitation.names, plan.excitation.coverage(plan.band_rad_s), strict=True
    ):
        light = Light.GREEN if share >= good else Light.AMBER if share >= poor else Light.RED
        yield Finding(
            "design-coverage",
            light,
            f"{name} has power within 20 dB of its peak in {share:.0f} % of the band",
            "" if light is Light.GREEN else _fuller(plan.excitation),
        )


def _fuller(excitation: Excitation) -> str:
    """How to put power where the band has none."""
    if excitation.kind in ("sweep", "ardupilot_chirp", "multisine"):
        return "lengthen the record, or narrow the band"
    return "choose a sweep or multisine over this very band"


def _cross_coherence(plan: Plan) -> Iterator[Finding]:
    names = plan.excitation.names
    if len(names) < 2:
        return
    coherence = plan.excitation.coherence(plan.band_rad_s)
    apart = ~np.eye(len(names), dtype=bool)
    largest = float(np.max(coherence[apart]))
    light = Light.GREEN if largest <= LARGEST_CROSS_COHERENCE else Light.RED
    yield Finding(
        "design-inputs-correlated",
        light,
        f"mean coherence between inputs is at most {largest:.2g}",
        "" if light is Light.GREEN else "use orthogonal multisines, or excite one axis at a time",
    )


def _safety(plan: Plan) -> Iterator[Finding]:
    limits, unit = plan.limits, plan.excitation.unit
    for axis in plan.axes:
        rules = [
            ("design-saturation", "control", axis.peak_control, limits.control, unit),
            ("design-rate", "rate", axis.peak_rate_rad_s, limits.rate_rad_s, "rad/s"),
            ("design-attitude", "attitude", axis.peak_attitude_rad, limits.attitude_rad, "rad"),
        ]
        if limits.control_rate_per_s is not None:
            found = axis.peak_control_rate
            slew = limits.control_rate_per_s
            rules.append(("design-rate-limit", "control rate", found, slew, f"{unit}/s"))
        for code, what, found, limit, part in rules:
            share = found / limit
            light = Light.GREEN if share <= MARGIN else Light.AMBER if share <= 1.0 else Light.RED
            yield Finding(
                code,
                light,
                f"{axis.name}: predicted peak {what} {_with_unit(found, part)}, "
                f"{100 * share:.0f} % of the limit",
                "" if light is Light.GREEN else f"reduce the amplitude by {_cut(share):.0f} %",
            )


def _with_unit(value: float, unit: str) -> str:
    bare = unit.removeprefix("1") if unit.startswith("1") else f" {unit}"
    return f"{value:.3g}{bare}"


def _cut(share: float) -> float:
    return math.ceil(100.0 * (1.0 - MARGIN / share))


def _information(plan: Plan) -> Iterator[Finding]:
    poor, good = COHERENT_PERCENT
    for axis in plan.axes:
        share = axis.coherent_percent
        light = Light.GREEN if share >= good else Light.AMBER if share >= poor else Light.RED
        yield Finding(
            "design-coherence",
            light,
            f"{axis.name}: predicted coherence reaches 0.6 in {share:.0f} % of the band",
            "" if light is Light.GREEN else "raise the amplitude, fly more records or less band",
        )
        yield _bound(plan, axis.name, axis.stderr)


def _bound(plan: Plan, name: str, stderr: tuple[float, float, float] | None) -> Finding:
    vehicle = plan.vehicles[name]
    if stderr is None:
        return Finding(
            "design-bound",
            Light.RED,
            f"{name}: the record cannot tell gain, time constant and delay apart",
            "excite frequencies on both sides of the break frequency of the lag",
        )
    values = {"gain": vehicle.gain, "time constant": vehicle.time_constant_s}
    if vehicle.delay_s > 0:
        values["delay"] = vehicle.delay_s
    percent = {
        key: 100 * error / abs(value)
        for (key, value), error in zip(values.items(), stderr, strict=False)
    }
    key = max(percent, key=lambda each: percent[each])
    light = Light.GREEN if percent[key] <= LARGEST_BOUND_PERCENT else Light.AMBER
    return Finding(
        "design-bound",
        light,
        f"{name}: the worst predicted bound is {percent[key]:.2g} % of the {key}",
        "" if light is Light.GREEN else "raise the amplitude, fly longer or more often",
    )


def chirp_findings(excitation: Excitation) -> Iterator[Finding]:
    """What ArduPilot's chirp does with its time: dwell, fades, and the silent end of a run."""
    if excitation.kind != "ardupilot_chirp":
        return
    settings = {key: float(excitation.options[key]) for key in AMC_TEMPLATE}  # type: ignore[arg-type]
    start, stop, record_s = settings["start_hz"], settings["stop_hz"], settings["record_s"]
    dwell_s = 2.0 / start
    sweep_s = record_s - dwell_s
    growth = math.log(stop / start)
    if dwell_s > LONGEST_DWELL_SHARE * record_s:
        same = all(math.isclose(settings[key], value) for key, value in AMC_TEMPLATE.items())
        whose = " (the settings of the Methodic Configurator's template)" if same else ""
        above = ""
        if growth > 0 and start < 1.0 < stop:
            above_s = sweep_s * (1 - math.log(1.0 / start) / growth)
            above = f", {above_s:.1f} s of it above 1 Hz"
        yield Finding(
            "chirp-dwell",
            Light.AMBER,
            f"{dwell_s:.3g} s of {record_s:.4g} s dwell at {start:g} Hz{whose}; the sweep takes "
            f"{sweep_s:.3g} s{above}",
            "raise SID_F_START_HZ to the lowest frequency that the model needs",
        )
    if growth > 0:
        fading_hz = start * math.exp(growth * (sweep_s - settings["fade_out_s"]) / sweep_s)
        if fading_hz < LEAST_FADE_FREQUENCY_SHARE * stop:
            yield Finding(
                "chirp-fade-out",
                Light.AMBER,
                f"the fade-out begins at {fading_hz:.2f} Hz of {stop:g} Hz",
                "shorten SID_T_FADE_OUT or raise SID_F_STOP_HZ",
            )
        if settings["fade_in_s"] > dwell_s:
            faded_s = settings["fade_in_s"] - dwell_s
            full_hz = start * math.exp(growth * min(faded_s / sweep_s, 1.0))
            yield Finding(
                "chirp-fade-in",
                Light.AMBER,
                f"the amplitude is still growing up to {full_hz:.2f} Hz",
                "shorten SID_T_FADE_IN to the dwell of two cycles",
            )
    tail_s = settings["fade_in_s"] + dwell_s + settings["fade_out_s"]
    if tail_s > LONGEST_TAIL_S:
        yield Finding(
            "chirp-silent-end",
            Light.AMBER,
            f"after the chirp the mode stays on for {tail_s:.3g} s without any excitation",
            "leave the mode, or cut the log where SIDD.Time exceeds SID_T_REC by a second",
        )

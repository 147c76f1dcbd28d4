"""From what was measured to verdicts with sentences: each bad case has its own code."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from flightid.conventions import Light
from flightid.findings import Finding, counted, in_order
from flightid.inspection import advice
from flightid.inspection.carried import carried_axes, is_swept
from flightid.inspection.divergence import divergence_findings
from flightid.inspection.gap_findings import gap_findings
from flightid.inspection.log_end import end_judged
from flightid.inspection.saturation import Saturation
from flightid.inspection.signals import map_of
from flightid.inspection.thresholds import (
    BAND_GOOD,
    BAND_LEAST,
    JITTER,
    RATE_GOOD,
    RATE_LEAST,
    SATURATED_SHARE,
    SKEW,
)
from flightid.inspection.usable_band import (
    NARROW,
    UNSWEPT,
    UNSWEPT_CODE,
    AxisBand,
    hertz_words,
    lowest_hz,
)
from flightid.logs import Log
from flightid.logs.scale_check import check_scales

MOST_NAMED = 6
"""Excitations that a finding names."""

if TYPE_CHECKING:
    from flightid.inspection.inspection import Inspection


def judge(log: Log, found: Inspection) -> tuple[Finding, ...]:
    """All verdicts on a log: what comes before all advice, then the worst."""
    # Sizes mean nothing until units do: what contradicts these comes first.
    scales = _scales(log, found)
    findings = [*scales, *end_judged(log, found.phases, log.findings), *_flight(log, found)]
    if found.phases.airborne:
        findings += divergence_findings(log, found.phases.airborne)
        findings += [*_length(found), *_bands(log, found), *_loop(log, found)]
    findings += [*_logging(log, found), *_excitation(log, found, scales)]
    findings += _quality(log, found)
    return in_order([*findings, *_without_model(log, found, findings)])


def _without_model(log: Log, found: Inspection, told: list[Finding]) -> list[Finding]:
    """That no axis carries a model, where nothing else has said so."""
    if any(each.light is Light.RED for each in told) or not found.phases.airborne:
        return []
    if carried_axes(found):
        return []
    swept = any(is_swept(found, band.axis) for band in found.bands)
    why = "none has a sweep in a band wide enough" if swept else "none was swept"
    what = f"no axis carries a model: {why}"
    return [Finding("no-model", Light.RED, what, _to_excite(log, found.bands))]


def _scales(log: Log, found: Inspection) -> list[Finding]:
    """Streams of one turning that disagree on how far, over the longest flight or the whole log."""
    span = max(found.phases.airborne, key=lambda span: span[1] - span[0], default=None)
    checks = check_scales(log, map_of(log), span)
    return [check.finding for check in checks if check.finding is not None]


def _flight(log: Log, found: Inspection) -> list[Finding]:
    phases = found.phases
    if not phases.airborne:
        return [_on_the_ground(log, found)]
    findings = [
        Finding(
            "airborne",
            Light.GREEN,
            f"airborne for {phases.airborne_s:.1f} s in {counted(len(phases.airborne), 'span')} "
            f"({phases.evidence})",
        )
    ]
    if phases.tipped_s is not None:
        findings.append(
            Finding(
                "tipped-over",
                Light.AMBER,
                f"{phases.fall} and stays tilted: everything after that is left out",
                "look for the cause of the fall before flying a manoeuvre",
            )
        )
    return findings


def _on_the_ground(log: Log, found: Inspection) -> Finding:
    if found.phases.motors_ran is False and found.excitations:
        return Finding(
            "motors-off",
            Light.RED,
            "the body rates move but the motors never ran: their outputs stayed at or below the "
            "lower limit for the whole log. What commands and rates share here is the controller "
            "answering to a vehicle that is moved by hand, the inverse of the controller and not "
            "the vehicle",
            "arm, fly, and hand in a log of the flight",
        )
    if not found.phases.is_known:
        return Finding(
            "flight-unknown",
            Light.UNKNOWN,
            f"whether it flew cannot be told: {found.phases.evidence}",
            found.phases.action,
        )
    return Finding(
        "not-airborne",
        Light.RED,
        f"never airborne ({found.phases.evidence}): there is no flight to identify",
        advice.excitation(log),
    )


def _length(found: Inspection) -> list[Finding]:
    needed = advice.shortest_flight_s()
    airborne = found.phases.airborne_s
    if airborne >= needed:
        return []
    return [
        Finding(
            "too-short",
            Light.RED,
            f"{airborne:.1f} s in the air: five independent windows of two cycles reach down to "
            f"{lowest_hz(airborne):.3g} Hz only",
            advice.record_length(),
        )
    ]


def _logging(log: Log, found: Inspection) -> list[Finding]:
    logged = [band for band in found.bands if band.rate_hz > 0]
    if not logged:
        return [
            Finding(
                "no-command-logged",
                Light.RED,
                "no axis has both its mixer command and its body rate in the log",
                advice.logging(log),
            )
        ]
    slowest = min(logged, key=lambda band: band.rate_hz)
    rate, what = slowest.rate_hz, slowest.logged
    reach = f"{rate / 10:.2g} Hz at ten samples a cycle ({rate / 5:.2g} Hz at the very most)"
    if rate < RATE_LEAST.value:
        return [
            Finding(
                "rate-too-low",
                Light.RED,
                f"{what}: no model above {reach}",
                advice.logging(log),
            )
        ]
    if rate < RATE_GOOD.value:
        return [
            Finding(
                "rate-limited",
                Light.AMBER,
                f"{what}: the model ends at {reach}",
                advice.logging(log),
            )
        ]
    return [Finding("rate-good", Light.GREEN, f"{what}: up to {reach}")]


def _excitation(log: Log, found: Inspection, scales: list[Finding]) -> list[Finding]:
    if not found.excitations:
        if scales:
            said = "what moved cannot be told: the streams disagree on how far the vehicle turns"
            return [Finding("motion-unknown", Light.UNKNOWN, said, scales[0].action)]
        if all(band.output == "" for band in found.bands):
            return [
                Finding(
                    "motion-unknown",
                    Light.UNKNOWN,
                    "what moved cannot be told: no axis has both command and body rate in the log",
                    advice.logging(log),
                )
            ]
        return [
            Finding(
                "nothing-excited",
                Light.RED,
                "no axis moves more than it does in a steady hover: nothing was excited",
                advice.excitation(log),
            )
        ]
    if not found.phases.airborne:
        return []
    made = [e for e in found.excitations if not e.is_plain]
    if made:
        text = "; ".join(f"{e.words} on {e.axis} ({e.detail})" for e in made[:MOST_NAMED])
        return [Finding("excitation-found", Light.GREEN, f"excitation found: {text}")]
    axes = ", ".join(dict.fromkeys(e.axis for e in found.excitations))
    who = ", ".join(dict.fromkeys(e.detail.split(", ", 1)[1] for e in found.excitations))
    return [
        Finding(
            "pilot-only",
            Light.AMBER,
            f"{who} is the only excitation ({axes}): it holds little power above 1 Hz and "
            "moves several axes at once",
            advice.excitation(log),
        )
    ]


def _bands(log: Log, found: Inspection) -> list[Finding]:
    findings = [_band(log, band) for band in found.bands if band.rate_hz > 0]
    if not any(finding.code.startswith(("band", UNSWEPT_CODE)) for finding in findings):
        seen = _largest(found.bands) or "none could be measured"
        findings.append(
            Finding(
                "no-usable-band",
                Light.RED,
                "no axis has a band that supports a model: half a decade with coherence of at "
                f"least 0.6 is needed ({seen})",
                _to_excite(log, found.bands),
            )
        )
    return findings


def _to_excite(log: Log, bands: Iterable[AxisBand]) -> str:
    """What to fly, or where what was injected was too weak, to do with more of it."""
    weak = any(band.injected_coherence is not None for band in bands)
    return advice.more_injected(log) if weak else advice.excitation(log)


def _largest(bands: Iterable[AxisBand]) -> str:
    """Of which coherence a band would need more: of what was injected, where that is too little."""
    injected, moved = [], []
    for band in bands:
        if band.injected_coherence is not None:
            injected.append(f"{band.axis} {band.injected_coherence:.2f}")
        elif band.largest_coherence is not None:
            moved.append(f"{band.axis} {band.largest_coherence:.2f}")
    of_rate = "largest found of the rate with what was injected: "
    both = (of_rate, injected), ("largest found: ", moved)
    return "; ".join(words + ", ".join(each) for words, each in both if each)


def _band(log: Log, band: AxisBand) -> Finding:
    coherent = band.coherent_rad_s or band.band_rad_s
    if coherent is None and band.reason == UNSWEPT:
        said = f"{band.axis}: no usable band: {band.reason}"
        return Finding(f"{UNSWEPT_CODE}-{band.axis}", Light.UNKNOWN, said)
    if coherent is None:
        return Finding(
            f"no-band-{band.axis}",
            Light.AMBER,
            f"{band.axis}: no usable band: {band.reason}",
            _to_excite(log, [band]),
        )
    width = coherent[1] / coherent[0]
    shown = band.told_rad_s or coherent
    word = "usable" if band.is_usable else "coherent"
    text = (
        f"{band.axis}: {word} from {hertz_words(shown)} ({shown[0]:.3g} to {shown[1]:.3g} rad/s), "
        f"mean coherence {band.coherence:.2f}"
    )
    if coherent[1] >= band.excited_to_rad_s:
        text += ", up to where the power of the sweep ends"
    if width < BAND_LEAST.value:
        return Finding(
            f"narrow-band-{band.axis}",
            Light.AMBER,
            f"{text}: {NARROW}",
            advice.excitation(log),
        )
    if width >= BAND_GOOD.value:
        return Finding(f"band-{band.axis}", Light.GREEN, text)
    narrow = f"{text}; gain, lag and delay are told apart by a whole decade"
    return Finding(f"band-{band.axis}", Light.AMBER, narrow, advice.excitation(log))


def _loop(log: Log, found: Inspection) -> list[Finding]:
    if any(e.is_injected for e in found.excitations):
        return []
    return [
        Finding(
            "closed-loop",
            Light.AMBER,
            "the loops are closed and no injected signal is logged: a direct estimate from command "
            "to rate is drawn to the inverse of the controller by gusts, however coherent",
            advice.excitation(log),
        )
    ]


def _room(found: Inspection, limit: str) -> str:
    """What keeps a signal off its limit; of an amplitude only where a manoeuvre had one."""
    centre = "straighten motors and frame, and trim the centre of gravity"
    flown = [each for each in found.excitations if each.kind in ("sid", "chirp", "sweep")]
    if flown:
        return f"lower the amplitude of the {flown[0].kind}; {centre}"
    more = {
        "lower": "lower MOT_SPIN_MIN (ArduPilot), lower gains, or more weight",
        "upper": "less weight, larger propellers, or gentler flying",
    }
    return f"{centre} first; then {more.get(limit.partition(' ')[0], 'gentler flying')}"


def _at_limit(command: Saturation) -> Finding:
    """A command that the mixer cut for long: its axis did not do what its loop asked."""
    first = "take out what holds a steady yaw moment first (tilted motors, twisted arms)"
    if command.axis != "yaw":
        first = "trim the centre of gravity and straighten motors first"
    return Finding(
        f"saturated-{command.axis}",
        Light.AMBER,
        f"the command of {command.axis}, {command.what}, is at its {command.limit} for "
        f"{100 * command.share:.0f} % of the flight",
        f"{first}; then gentler flying, or lower gains",
    )


def _quality(log: Log, found: Inspection) -> list[Finding]:
    findings = []
    long = [each for each in found.saturations if each.share > SATURATED_SHARE.value]
    findings += [_at_limit(each) for each in long if each.axis]
    worst = next((each for each in long if not each.axis), None)
    if worst is not None:
        findings.append(
            Finding(
                "saturated",
                Light.AMBER,
                f"{worst.what} is at its {worst.limit} for {100 * worst.share:.0f} % of the flight",
                _room(found, worst.limit),
            )
        )
    for message in found.messages_used:
        for rate in found.rates:
            if rate.message != message:
                continue
            findings += gap_findings(log, rate, found.phases)
            if rate.jitter > JITTER.value:
                findings.append(
                    Finding(
                        "jitter",
                        Light.AMBER,
                        f"{rate.label} is logged with {100 * rate.jitter:.0f} % jitter",
                        advice.logging(log),
                    )
                )
    findings += [
        Finding(
            "skew",
            Light.AMBER,
            f"{skew.second} shows the same motion {1e3 * skew.lag_s:.1f} ms "
            f"(± {1e3 * skew.half_width_s:.1f}) later than {skew.first}: "
            "clock skew, or the delay of a filter",
            "take command and rate from the same message",
        )
        for skew in found.skews
        if skew.exceeds(SKEW.value)
    ]
    return findings

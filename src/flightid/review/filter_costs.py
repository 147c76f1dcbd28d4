"""Verdicts on filters that are tried on a flight: phase that a loop loses, noise that passes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from flightid.control.margins.margins import PHASE_GUIDE_DEG
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.review.edited_filters import EditedAxis
from flightid.review.thresholds import OUTPUT_NOISE, PHASE_TO_WIN

NO_FILE = "raise cut-offs and notches again: no file is made of these"
SLOWER = "raise them again, or sweep with them and tune the gains anew (flightid plan)"
LOUDER = 1.005
"""Noise that grows by less is that of the flight."""


def filter_costs(
    axes: Iterable[EditedAxis],
    at_hz: float,
    margins_deg: Mapping[str, tuple[float, float]],
    *,
    measured: bool,
) -> Iterator[Finding]:
    """Say what filters cost each axis, beside the phase margin that the flown ones keep.

    Parameters
    ----------
    axes : iterable of EditedAxis
    at_hz : float
        Where phase counts.
    margins_deg : mapping of str to tuple of float
        By axis: phase margins of 95 % of the vehicles that would fly as this one did; an axis
        whose response the flight does not tell is left out.
    measured : bool
        Whether the flight tells `at_hz`.
    """
    where = f"{at_hz:.3g} Hz, " + (
        "about where the rate loops cross over"
        if measured
        else "where multirotors of middle size cross over"
    )
    for each in axes:
        cost = each.phase_flown_deg - each.phase_edited_deg
        if cost >= PHASE_TO_WIN.value:
            said = f"{each.axis}: these filters cost {cost:.3g} deg of phase at {where}"
            yield _cost(each.axis, said, cost, margins_deg.get(each.axis))
        noise = each.noise_edited
        if noise > max(OUTPUT_NOISE.value, LOUDER * each.noise_flown):
            yield Finding(
                f"edited-noise-{each.axis}",
                Light.AMBER,
                f"{each.axis}: noise of the gyroscope would move the output by {100 * noise:.2g} "
                f"% of full command, rms ({100 * each.noise_flown:.2g} as flown); "
                f"{100 * OUTPUT_NOISE.value:g} % is fine",
                "lower a cut-off, or balance propellers and damp the mount",
            )


def unseen_noise(
    low_passes: Mapping[str, float], values: Mapping[str, float], seen_hz: float
) -> Iterator[Finding]:
    """Say which low-passes that are opened pass noise of which the log shows nothing.

    Parameters
    ----------
    low_passes : mapping of str to float
        Cut-offs as flown, Hz, by parameter; 0: off.
    values : mapping of str to float
        As tried.
    seen_hz : float
        Up to where the log shows noise.
    """
    for name, flown in low_passes.items():
        cut = values.get(name, flown)
        if flown > 0.0 and cut != flown and (cut == 0.0 or cut > max(flown, seen_hz)):
            yield Finding(
                "edited-noise-unseen",
                Light.AMBER,
                f"{name} {cut:g}{' (off)' if cut == 0.0 else ' Hz'} passes noise above "
                f"{seen_hz:.4g} Hz, half of the log's rate: none of it is in these numbers",
                "log the gyro faster (raw batches in ArduPilot, the high rate in PX4) before "
                "flying this",
            )


def _cost(axis: str, said: str, cost: float, margin: tuple[float, float] | None) -> Finding:
    code, least = f"edited-phase-{axis}", PHASE_GUIDE_DEG
    if margin is None:
        if cost >= least:
            said += f", all of the {least:g} deg that a loop is designed to keep"
            return Finding(code, Light.RED, said, NO_FILE)
        return Finding(code, Light.AMBER, f"{said}; the flight does not tell what is left", SLOWER)
    low, high = margin
    said += f", where the flown ones leave {low:.3g} to {high:.3g} deg"
    if low <= cost:
        word = "would" if high <= cost else "may"
        return Finding(code, Light.RED, f"{said}: the loop {word} be unstable", NO_FILE)
    left = f"{low - cost:.3g} to {high - cost:.3g} deg are left"
    if low - cost < least:
        return Finding(code, Light.AMBER, f"{said}: {left}, {least:g} are asked for", SLOWER)
    return Finding(code, Light.GREEN, f"{said}: {left}")

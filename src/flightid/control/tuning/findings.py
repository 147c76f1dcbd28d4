"""Verdicts on tuned gains, with what to do about each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.gyro import Gyro
from flightid.control.margins.findings import COHERENCE
from flightid.control.margins.rigid_vehicle import RIGID
from flightid.control.tuning.axis_tuning import AxisResult
from flightid.control.tuning.band_findings import (
    asked_above,
    asked_below,
    at_one_below,
    by_modes_alone,
)
from flightid.control.tuning.gain_search import INTEGRAL, LOW_END
from flightid.control.tuning.gain_search_result import NO_GAINS, GainSearchResult
from flightid.control.tuning.gain_steps import Stage, TunedGain
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.order_statistics import ENOUGH, least_share
from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light
from flightid.findings import Finding, at_least
from flightid.responses.pair import PairResponse

Array = NDArray[np.float64]
NEAR = 2.0**0.5
"""Half an octave to either side."""
ABOUT = 21
"""Frequencies about a crossover at which coherence is read."""
GAINS = ("gains", NO_GAINS)
"""Codes of `verdict`."""
ADVICE = {
    "stability": "no gains in the ranges hold every plant: identify better, or widen the ranges",
    "identified band": "sweep to higher frequencies, or lower band_factor knowingly",
    "output noise": "lower the derivative filter, find the vibration, or allow more noise",
    "ratio of I": "take preset firm, or a larger integral_factor, knowingly",
    "target": "lower the target, or make actuators and filters faster",
    "low": "fly that gain once below its documented range, and tune again: there ranges reach a "
    "step below what flew",
    "margin": "identify the delay better or make it shorter (filters, loop rate, motors)",
}


def verdict(
    found: GainSearchResult,
    met: NDArray[np.bool_],
    drawn: int,
    worst_cases: Sequence[WorstCase] = (),
    band_rad_s: tuple[float, float] | None = None,
    wider: tuple[str, str] = ("", ""),
    rigid: bool = False,
) -> Finding:
    """Whether there are gains, and for how many plants: the one light of gains, wherever it shows.

    Parameters
    ----------
    found : GainSearchResult
        Of a search, or held by hand.
    met : ndarray of bool, shape (n_plants,)
        Which fresh plants meet every requirement.
    drawn : int
        How many were drawn, those that were left out among them; 0: none.
    worst_cases : sequence of WorstCase
        What is promised: plants speak of no frequency at which nothing was shown.
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.
    wider : tuple of str
        What brings its low end, and its high end, so far that all that was asked is promised.
    rigid : bool
        Whether the vehicle was declared to have no light mode outside it.
    """
    if not found.exists:
        return _no_gains(found)
    if not drawn and found.by_hand:
        said = f"gains set by hand, for the model alone; {_bound(found)}"
        return Finding("gains", Light.AMBER, said)
    if not drawn:
        said = f"gains found for the model alone; {_bound(found)}"
        return Finding("gains", Light.AMBER, said)
    good, share = int(met.sum()), least_share(int(met.sum()), drawn)
    high = asked_above(worst_cases)
    low = bool(at_one_below(worst_cases)) or asked_below(worst_cases)
    shown = ""
    if band_rad_s is not None:
        shown = f" in the band shown, {band_rad_s[0]:.3g} to {band_rad_s[1]:.3g} rad/s"
    shown += ", declared rigid" if rigid else ""
    if sides := " and ".join(["below"] * low + ["above"] * high):
        mode = f"a light mode {sides} it, which may take margins and stability"
        shown += f", and say nothing of {f'what lies {sides} it' if rigid else mode}"
    where = [text for text, taken in zip(wider, (low, high), strict=True) if taken and text]
    where += [RIGID] if where and not rigid and by_modes_alone(worst_cases) else []
    return Finding(
        "gains",
        Light.GREEN if share >= ENOUGH and not (low or high) else Light.AMBER,
        f"{good} of {drawn} fresh plants meet every requirement{shown}: at least "
        f"{at_least(100.0 * share, 1)} % of those that the data allow (95 % confidence); "
        f"{_bound(found)}",
        "draw more plants for the search" if share < ENOUGH else "; ".join(where),
    )


def _bound(found: GainSearchResult) -> str:
    """What binds; where nothing does, the requirement that has the least slack."""
    if found.binding:
        return f"binding: {', '.join(found.binding)}"
    nearest = min(found.slack, key=lambda name: found.slack[name], default="")
    return f"binding: nothing; nearest: {nearest}" if nearest else "binding: nothing"


def _no_gains(found: GainSearchResult) -> Finding:
    """Why these are no gains: what they miss, in shares of it, or that a loop is unstable."""
    unstable = found.slack.get("stability", 0.0) < 0.0
    short = [_short(name, slack) for name, slack in found.slack.items() if slack < 0.0]
    told = "some plant is unstable with them" if unstable else ", ".join(short)
    if found.by_hand:
        told = told if unstable or not found.missed else "; ".join(found.missed)
        said = "the gains set by hand do not meet all requirements for every plant: "
        action = "go back towards the gains of the search (leave out by_hand)"
        return Finding(NO_GAINS, Light.RED, said + told, action)
    said = "no gains were found that meet all requirements for every plant, on a grid over their "
    said += "ranges nor by search from it; nearest: "
    low = [name.removesuffix(LOW_END) for name in found.binding if name.endswith(LOW_END)]
    if low:
        told += f", at the low end of the {' and the '.join(low)}"
    return Finding(
        NO_GAINS, Light.RED, said + told, ADVICE["low"] if low else advice(found.binding)
    )


def _short(name: str, slack: float) -> str:
    """A requirement with the share of it that is missing, where less than all of it is."""
    return f"{name} {100.0 * slack:+.0f} %" if slack > -1.0 else name


def advice(binding: Sequence[str]) -> str:
    """What to do about what binds."""
    for name in binding:
        for key, text in ADVICE.items():
            if key in name:
                return text
    return ADVICE["margin"]


def remarks(
    result: AxisResult,
    flown: AxisLoop,
    changes: Sequence[TunedGain],
    stages: Sequence[Stage],
    couplings: Sequence[str],
    gyro: Gyro,
) -> Iterator[Finding]:
    """What else is to be known.

    Parameters
    ----------
    result : AxisResult
    flown : AxisLoop
        The axis as flown.
    changes, stages : sequence of TunedGain and of Stage
    couplings : sequence of str
        Other rates of the model that no loop of the design closes.
    gyro : {"raw", "filtered"}
        Which rate the plants end at; those of the filtered rate hold the notches that flew.
    """
    held = result.flown_stable
    if held is None:
        pass
    elif not bool(held[0]):
        yield Finding(
            "flown-unstable",
            Light.RED,
            "the model is unstable with the gains that flew",
            "the model, its sign, its delay or the gains are not those of the flight: check each",
        )
    elif not bool(held.all()):
        yield Finding(
            "flown-unstable",
            Light.AMBER,
            f"{np.count_nonzero(~held)} of {len(held)} plants are unstable with the flown gains",
            "the spread is wider than what flew: identify better",
        )
    tied = flown.names.get("i") if INTEGRAL in result.found.binding else None
    at_limits = [c.name for c in changes if c.at_limit or c.name == tied]
    if result.found.exists and len(at_limits) == len(changes):
        yield Finding(
            "gains-at-limits",
            Light.RED,
            f"every gain stands at an end of its range: {', '.join(at_limits)}",
            "the model knows nothing that limits them: look for the lag and the delay that it "
            "lacks, and identify up to higher frequencies",
        )
    if couplings:
        yield Finding(
            "couplings",
            Light.AMBER,
            f"the model couples this axis with {', '.join(couplings)}, whose loops are left open",
            "tune the axes together with flightid.tune",
        )
    outside = [c.name for c in changes if c.flown is not None and not c.low <= c.flown <= c.high]
    if outside:
        yield Finding(
            "outside-range",
            Light.GREEN,
            f"flown outside its range, which reaches what flew: {', '.join(outside)}",
        )
    shaky = [k for k, stage in enumerate(stages, 1) if not stage.stable]
    if shaky:
        yield Finding(
            "unstable-step",
            Light.RED,
            f"step {shaky[0]} on the way is not stable for every plant",
            "do not fly it: change the gains one after the other by hand",
        )
    elif len(stages) > 1:
        yield Finding(
            "steps",
            Light.GREEN,
            f"the new gains are further than one safe step: {len(stages)} steps",
            "fly each before the next, and identify again on the way",
        )
    if any(flown.values.get(role, 0.0) for role in ("ff", "d_ff")):
        yield Finding(
            "feed-forward",
            Light.AMBER,
            "feed-forward is kept as flown: it moves no margin, but it does move the step",
        )
    for text in flown.unmodelled + (flown.unknown_notches if gyro == "raw" else ()):
        yield Finding("unmodelled", Light.AMBER, text)


def low_coherence(result: AxisResult, measured: PairResponse | None) -> Iterator[Finding]:
    """Say where a loop would cross over at frequencies that the flight hardly excited.

    Parameters
    ----------
    result : AxisResult
    measured : PairResponse or None
        The response that was fitted.
    """
    if measured is None or not result.found.exists:
        return
    omega, coherence = measured.omega_rad_s, measured.coherence
    for each in result.worst_cases:
        if each.name != "crossover" or each.nominal is None:
            continue
        near = np.geomspace(each.nominal / NEAR, each.nominal * NEAR, ABOUT)
        points = np.interp(near, omega, coherence)
        known = float(np.mean(points))
        if each.loop == ANGLE:
            points = _behind_rate_loop(result, near, points)
        if float(np.mean(points)) < COHERENCE:
            yield Finding(
                "coherence-at-crossover",
                Light.RED,
                f"{each.loop}: coherence is {known:.2f} about the new crossover "
                f"of {each.nominal:.3g} rad/s",
                "sweep that band with more amplitude, or ask for a crossover where the response "
                "was measured",
            )


def _behind_rate_loop(result: AxisResult, omega: Array, coherence: Array) -> Array:
    """Coherence of the angle loop where the vehicle's own is known.

    The rate loop is closed inside it and makes up for an error of the vehicle: of a share ε of its
    response 1/|1 + L| is left, and so it is of what noise hides. Below the rate's crossover the
    angle loop is what the controller makes of it, and a sweep need not tell it.
    """
    problem = result.problem
    rate = problem.loops(result.found.gains[None], problem.plants.take([0])).rate.squeeze((0, 1))
    left = np.interp(omega, problem.plants.omega_rad_s, np.abs(1.0 + rate) ** -2)
    tiny = np.finfo(float).tiny
    return np.asarray(coherence / (coherence + np.minimum(left, 1.0) * (1.0 - coherence) + tiny))

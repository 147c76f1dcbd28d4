"""Bars of fits by way of an excitation whose points are so noisy that bars and errors go together.

A point of such an estimate is the output over the input, each by what it shares with what was
injected. By way of the loop noise is in both: what makes a response too large makes the input too
small or too large with it, and the error that is known of the point is of this very input. A bar is
then short where the estimate is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.frequency_domain.selection import BY_EXCITATION, SelectedResponse
from flightid.responses import FrequencyResponse
from flightid.responses.bands import COHERENT
from flightid.uncertainty.estimate import Estimate

NOISY = 0.06
"""Median random error of a response's points, as a share of it, from which bars know their errors:
gusts that a tight loop fights leave 0.07 to 0.16, light ones 0.045 to 0.1, calm air 0.02."""
VAGUE = 0.6
"""Standard error over the value above which such a bar does not hold: of 45 with more 69 % held, of
150 with less 99 %."""
INCOHERENT = 0.5
"""Share of points below a coherence of 0.6 from which on errors may not weigh them: with none to
0.45 of them 94 % of bars held, with 0.48 to all 72 %."""


def why_weighed_by_chance(
    data: FrequencyResponse, selected: Sequence[SelectedResponse], cost: str
) -> str:
    """Why a likelihood by way of an excitation has no intervals; empty where it has.

    Parameters
    ----------
    data : FrequencyResponse
    selected : sequence of SelectedResponse
        The points of the fit.
    cost : {"coherence", "likelihood"}
    """
    if cost != "likelihood" or not data.estimator.startswith(BY_EXCITATION):
        return ""
    coherence = np.concatenate([each.measured.coherence[each.places] for each in selected])
    share = float(np.mean(coherence < COHERENT))
    if share < INCOHERENT:
        return ""
    return (
        f"{100.0 * share:.0f} % of the points have a coherence below {COHERENT:g}: by way of an "
        "excitation their errors are known from the noise that moves them, and a likelihood takes "
        "those for sure that chance made so"
    )


def judge_weights(reason: str) -> list[Finding]:
    """The reason of `why_weighed_by_chance` as a finding; none without."""
    if not reason:
        return []
    action = f"use cost='coherence', or minimum_coherence={COHERENT:g} and a narrower band"
    return [Finding("weighed-by-chance", Light.AMBER, f"{reason}; no intervals are shown", action)]


def without_vague(fit: Fit, data: FrequencyResponse, selected: Sequence[SelectedResponse]) -> Fit:
    """The fit without intervals of parameters that noisy points tell vaguely.

    Its covariance stays, for it tells sums of parameters that are known better than each.

    Parameters
    ----------
    fit : Fit
    data : FrequencyResponse
    selected : sequence of SelectedResponse
        The points of the fit.
    """
    if not data.estimator.startswith(BY_EXCITATION):
        return fit
    error = max(float(np.median(each.measured.random_error[each.places])) for each in selected)
    vague = {name: each for name, each in fit.parameters.items() if error >= NOISY and _vague(each)}
    if not vague:
        return fit
    known = {
        name: f"{name} to {100.0 * abs((each.stderr or 0.0) / each.value):.0f} % of itself"
        if each.value
        else f"{name} not at all"
        for name, each in vague.items()
    }
    reason = (
        f"standard error above {100.0 * VAGUE:.0f} % of the value, of noisy points by way of an "
        "excitation: such bars are short where the estimate is wrong"
    )
    found = Finding(
        "known-vaguely",
        Light.AMBER,
        f"the noise of the points ({100.0 * error:.0f} %) leaves {', '.join(known.values())}; by "
        "way of an excitation such bars are short where the estimate is wrong (7 of 10 held), so "
        "none is shown, and those of modes that rest on it are as doubtful",
        "inject more, fly in calmer air, or give several records",
    )
    bare = {
        name: replace(each, stderr=None, ends=None, reason=reason) for name, each in vague.items()
    }
    return replace(fit, parameters={**fit.parameters, **bare}, findings=(*fit.findings, found))


def _vague(known: Estimate) -> bool:
    return known.stderr is not None and known.stderr > VAGUE * abs(known.value)

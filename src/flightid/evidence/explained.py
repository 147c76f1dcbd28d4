"""Bands in which a free run explains its records: what a short manoeuvre has in place of coherence.

Coherence asks for several windows, each longer than the slowest motion. A doublet or 3-2-1-1 of ten
seconds that moves one input has none to give, and needs none: a fit in time compares its run with
every sample. Where the run's power stands above what it leaves, there it was shown to hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.evidence.data_checks import UNKNOWN_ACTION, loop_check
from flightid.evidence.evidence import BAND, COHERENCE, LOOP, Check
from flightid.evidence.spans import Span
from flightid.frozen import dataclass
from flightid.inspection.thresholds import BAND_GOOD, MINIMUM_COHERENCE
from flightid.responses.bands import coherent_band, coherent_parts
from flightid.responses.windows.defaults import CYCLES_AT_LOWEST, HIGHEST_FRACTION
from flightid.uncertainty.feedback_result import FeedbackTest

Array = NDArray[np.float64]
BINS = 32
"""Log-spaced frequencies at which powers are added up."""
FEWEST = 64
"""Samples of a record that is looked at."""
HIDDEN = 1e-4
"""Share of an output's variance that a free run may leave of one in which no noise was seen."""
NOTHING = loop_check(FeedbackTest("open", "no noise"))


@dataclass(frozen=True, eq=False)
class ExplainedRun:
    """One record beside the run of a model through it.

    Attributes
    ----------
    measured, modelled : ndarray, shape (n_outputs, n_samples)
    sample_time_s : float
    """

    measured: Array
    modelled: Array
    sample_time_s: float


def explained_spans(
    outputs: Sequence[str], runs: Sequence[ExplainedRun]
) -> tuple[list[Span], Span]:
    """Band of each output in which its run explains it, and that of all together.

    Parameters
    ----------
    outputs : sequence of str
    runs : sequence of ExplainedRun

    Returns
    -------
    tuple of list of Span and Span
        Shares of power stand in place of coherence; that of all counts a frequency where any output
        is explained.

    Example
    -------
    >>> t = np.arange(1000) * 0.02
    >>> run = np.sum([np.sin(w * t) for w in np.geomspace(1.0, 20.0, 60)], axis=0)
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(1000)
    >>> _, whole = explained_spans(["p"], [ExplainedRun((run + noise)[None], run[None], 0.02)])
    >>> whole.ratio > 10.0
    True
    """
    kept = [each for each in runs if each.measured.shape[1] >= FEWEST]
    if not kept:
        return [], Span("the outputs", None, 0.0, 0.0)
    longest_s = max(each.measured.shape[1] * each.sample_time_s for each in kept)
    low = CYCLES_AT_LOWEST * np.pi / longest_s
    high = HIGHEST_FRACTION * 2.0 * np.pi / max(each.sample_time_s for each in kept)
    edges = np.geomspace(low, max(high, 2.0 * low), BINS + 1)
    powers = np.sum([_powers(each, edges) for each in kept], axis=0)
    held = np.all(powers.sum(axis=0) > 0.0, axis=0)
    omega = np.sqrt(edges[1:] * edges[:-1])[held]
    said, left = powers[:, :, held]
    share = said / (said + left)
    spans = [_span(name, omega, row) for name, row in zip(outputs, share, strict=True)]
    return spans, _span("the outputs", omega, share.max(axis=0))


def _powers(run: ExplainedRun, edges: Array) -> Array:
    """Of the run and of what it leaves, in each bin: shape (2, n_outputs, n_bins)."""
    n = run.measured.shape[1]
    window, middle = np.hanning(n), run.measured.mean(axis=1)
    omega = 2.0 * np.pi * np.fft.rfftfreq(n, run.sample_time_s)
    # Frequencies rise, so that those of a bin stand side by side.
    places = np.searchsorted(omega, edges)
    found = np.empty((2, len(middle), len(edges) - 1))
    for kind, output in np.ndindex(found.shape[:2]):
        measured, modelled = run.measured[output], run.modelled[output]
        row = measured - modelled if kind else modelled - middle[output]
        part = np.fft.rfft(row * window)[: places[-1]]
        power = np.append(np.square(part.real) + np.square(part.imag), 0.0)
        found[kind, output] = np.add.reduceat(power, places)[:-1]
    found[:, :, np.diff(places) == 0] = 0.0
    return found


def _span(name: str, omega: Array, share: Array) -> Span:
    if omega.size == 0:
        return Span(name, None, 0.0, 0.0)
    band, decades = coherent_band(omega, share)
    inside = share if band is None else share[(omega >= band[0]) & (omega <= band[1])]
    return Span(name, band, float(np.mean(inside)), decades, tuple(coherent_parts(omega, share)))


def by_free_runs(
    checks: Sequence[Check], outputs: Sequence[str], runs: Sequence[ExplainedRun]
) -> list[Check]:
    """Checks of band and coherence, green where the free runs of the fit say what was asked.

    Every output has to be explained somewhere, all together over a decade. Frequencies at which
    responses are known stay those that are coherent: gains are bounded by them.

    Parameters
    ----------
    checks : sequence of Check
        Of band and coherence, from a quick response.
    outputs : sequence of str
    runs : sequence of ExplainedRun
    """
    if all(each.light is Light.GREEN for each in checks) or not runs:
        return list(checks)
    spans, whole = explained_spans(outputs, runs)
    if not spans or any(each.band_rad_s is None for each in spans):
        return list(checks)
    poor = min(spans, key=lambda each: each.coherence)
    if whole.ratio < BAND_GOOD.value or poor.coherence < MINIMUM_COHERENCE.value:
        return list(checks)
    narrow = min(spans, key=lambda each: each.ratio)
    said = {
        BAND: f"the free run explains {whole} (narrowest: {narrow})",
        COHERENCE: "a fit of short manoeuvres in time asks no coherence: its free run explains "
        f"{100.0 * poor.coherence:.2g} % of {poor.name} in its band, least of all outputs",
    }
    return [
        each
        if each.light is Light.GREEN or each.name not in said
        else replace(each, light=Light.GREEN, what=said[each.name], action="")
        for each in checks
    ]


def unless_hidden(loop: Check, runs: Sequence[ExplainedRun]) -> Check:
    """The check of a loop, unknown where noise was not seen that the free run of the fit leaves.

    The test looks at what one sample adds. Filtered outputs, many times faster than the vehicle,
    are foretold by their own past to the last digits, whatever gusts have added up to over seconds.

    Parameters
    ----------
    loop : Check
    runs : sequence of ExplainedRun

    Example
    -------
    >>> run = np.sin(np.arange(400) * 0.1)[None]
    >>> unless_hidden(NOTHING, [ExplainedRun(run, 0.9 * run, 0.02)]).light.value
    'unknown'
    >>> unless_hidden(NOTHING, [ExplainedRun(run, run, 0.02)]).light.value
    'green'
    """
    shares = [
        float(np.max(np.var(each.measured - each.modelled, axis=1) / np.var(each.measured, axis=1)))
        for each in runs
        if np.all(np.ptp(each.measured, axis=1) > 0.0)
    ]
    left = max(shares, default=0.0)
    if loop.what != NOTHING.what or left < HIDDEN:
        return loop
    what = (
        "whether a loop is closed cannot be told: outputs are so smooth from sample to sample "
        f"that no noise is seen in them, but the free run leaves {100.0 * left:.2g} % of one"
    )
    return Check(LOOP, Light.UNKNOWN, what, UNKNOWN_ACTION)

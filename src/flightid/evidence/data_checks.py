"""What the data of a fit show of themselves: power, coherence, and whether a loop was closed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache

import numpy as np

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence.copied_samples import judge_copies
from flightid.evidence.evidence import BAND, COHERENCE, LOOP, SAMPLES, TIME, Check
from flightid.evidence.feedback import KEPT, loop_seen
from flightid.evidence.spans import judge_coherence, judge_span, spans_of
from flightid.findings import Finding, counted, worst
from flightid.record import Record
from flightid.record.checks import data_findings, record_findings
from flightid.record.time_question import time_question
from flightid.responses import FrequencyResponse, estimate_response
from flightid.responses.windows.defaults import CYCLES_AT_LOWEST, HIGHEST_FRACTION
from flightid.uncertainty.feedback_result import FeedbackTest

FREQUENCIES = 40
"""Of the quick response."""
LONGEST, SHORTEST = 1.0 / 3.0, 1.0 / 15.0
"""Windows of the quick response: shares of the longest record, if all together are as long."""
FITTING = 1.5
"""The longest window fits so often into all records together."""
CLOSED_ACTION = (
    "use the injected excitation as instrument (steps or a sweep that is added to the set-point or "
    "the input, recorded as a column), a method with a noise model, or fly with the loop open; "
    "loop='open' overrides where you know it"
)
UNKNOWN_ACTION = (
    "declare loop='open' where no controller moved the inputs; with one, loop='closed', and use "
    "the injected excitation as instrument (recorded as a column)"
)


def loop_check(test: FeedbackTest) -> Check:
    """The light of a feedback test.

    Example
    -------
    >>> loop_check(FeedbackTest("closed", "declared")).light.value
    'amber'
    """
    if test.is_closed:
        return Check(LOOP, Light.AMBER, str(test), CLOSED_ACTION)
    if test.is_function_of_outputs:
        return Check(LOOP, Light.RED, str(test), UNKNOWN_ACTION)
    if not test.is_known and not test.is_taken_care_of:
        return Check(LOOP, Light.UNKNOWN, str(test), UNKNOWN_ACTION)
    return Check(LOOP, Light.GREEN, str(test))


def not_turned_round(loop: Check, at_once: Sequence[str]) -> Check:
    """The check of a loop, red where the model may be the controller turned round.

    With a loop closed, what goes together within a sample is the controller's doing: an input is
    worked out from outputs of the same sample, a vehicle moves by the next one.

    Example
    -------
    >>> closed = loop_check(FeedbackTest("closed", "declared"))
    >>> not_turned_round(closed, ("u",)).light.value, not_turned_round(closed, ()).light.value
    ('red', 'amber')
    """
    if loop.light is not Light.AMBER or not at_once:
        return loop
    what = (
        f"{loop.what}, and the model answers {', '.join(at_once)} within the same sample, as "
        "the controller turned round does"
    )
    return Check(LOOP, Light.RED, what, "set nk to 1 or more, and " + loop.action)


def time_checks(records: Sequence[Record]) -> list[Check]:
    """The question that a record's stamps raise, if they raise one."""
    asked = next(filter(None, map(time_question, records)), None)
    return [] if asked is None else [Check(TIME, asked.light, asked.message, asked.action)]


def sample_findings(
    data: Sequence[Record | FrequencyResponse], channels: Collection[str]
) -> list[Finding]:
    """All that was found in the samples of some channels, of the records together, then of each."""
    apart = [
        finding
        for each in data
        for finding in (
            record_findings(each, channels)
            if isinstance(each, Record)
            else data_findings(each.history, channels)
        )
    ]
    return [*judge_copies(data, channels), *apart]


def sample_checks(
    data: Sequence[Record | FrequencyResponse], channels: Collection[str]
) -> list[Check]:
    """The worst that was found in the samples of the fitted channels, with what else there is."""
    found = sample_findings(data, channels)
    if not found:
        return []
    first = next(finding for finding in found if finding.light is worst(tuple(found)))
    others = len({finding.message for finding in found}) - 1
    more = f" (and {counted(others, 'other finding')} on the samples)" if others else ""
    return [Check(SAMPLES, first.light, first.message + more, first.action)]


def loop_of_responses(responses: Sequence[FrequencyResponse]) -> Check | None:
    """The worst of what responses know of their loop; None where one does not know."""
    tests = [each.loop for each in responses]
    known = [test for test in tests if test is not None]
    if not known or len(known) < len(tests):
        return None
    checks = [loop_check(test) for test in known]
    order = (Light.RED, Light.AMBER, Light.UNKNOWN, Light.GREEN)
    return min(checks, key=lambda check: order.index(check.light))


def loop_of_records(
    records: tuple[Record, ...], inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> Check | None:
    """What records know of their loop, else what the test says; None where it cannot be made."""
    try:
        return loop_check(loop_seen(records, inputs, outputs))
    except FlightidError:
        return None


def _windows(records: Sequence[Record]) -> tuple[float, float]:
    durations = [record.n_samples * record.sample_time_s for record in records]
    longest = min(max(durations), sum(durations) / FITTING)
    return LONGEST * longest, SHORTEST * longest


def _band(records: Sequence[Record]) -> tuple[float, float]:
    step = max(record.sample_time_s for record in records)
    low = CYCLES_AT_LOWEST * 2.0 * np.pi / _windows(records)[0]
    return low, max(HIGHEST_FRACTION * 2.0 * np.pi / step, 2.0 * low)


@lru_cache(maxsize=KEPT)
def power_of_records(
    records: tuple[Record, ...],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    *,
    predicted: bool = False,
) -> tuple[Check, ...]:
    """Band and coherence of each output with all inputs together, from a quick response.

    Its longest window is longer than that of an estimate that is to be fitted: coherence alone is
    asked, and low frequencies lie in the longest windows.
    """
    try:
        found = estimate_response(
            records,
            inputs=inputs,
            outputs=outputs,
            n_omega=FREQUENCIES,
            band_rad_s=_band(records),
            window_s=_windows(records),
            covariance=False,
            loop="open",
        )
    except FlightidError as error:
        said = f"the records give no response: {error}"
        return tuple(Check(name, Light.UNKNOWN, said) for name in (BAND, COHERENCE))
    return band_checks(found, predicted=predicted)


def band_checks(response: FrequencyResponse, *, predicted: bool = False) -> tuple[Check, Check]:
    """Band and coherence that a response of the fitted channels shows; see `judge_span`."""
    spans = spans_of(response)
    return judge_span(spans, predicted=predicted), judge_coherence(spans)

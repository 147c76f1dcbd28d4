"""Whether a frequency response and the records beside it come from different flights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record import Record
from flightid.responses import FrequencyResponse

_SAME = 1e-9


def judge_independence(
    response: FrequencyResponse, records: Sequence[Record], outputs: Sequence[str]
) -> list[Finding]:
    """Look for records from which the response was estimated too.

    Parameters
    ----------
    response : FrequencyResponse
    records : sequence of Record
    outputs : sequence of str
        Channels that are compared, sample by sample.

    Returns
    -------
    list of Finding
    """
    if response.linear is None:
        return [
            Finding(
                "joint-data-unknown",
                Light.UNKNOWN,
                "the response does not hold its records: whether they are others than those "
                "beside it was not checked, and the intervals take them to be",
                "estimate the response with covariance=True",
            )
        ]
    known = [_turned(row) for rows in response.linear.output_records for row in rows]
    twice = [
        record.name
        for record in records
        if any(_is_among(_turned(record[name]), known) for name in outputs)
    ]
    if not twice:
        return []
    return [
        Finding(
            "joint-data-twice",
            Light.RED,
            f"the response was estimated from {', '.join(map(repr, twice))} too: the same flight "
            "counts twice, and the intervals are too narrow",
            "give other flights as records, or estimate the response without these",
        )
    ]


def _turned(row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Without its line: an estimate takes the mean or the trend out."""
    steps = np.arange(len(row)) - (len(row) - 1) / 2.0
    level = row - np.mean(row)
    return np.asarray(level - steps * (steps @ level) / max(float(steps @ steps), 1.0))


def _is_among(row: NDArray[np.float64], known: Sequence[NDArray[np.float64]]) -> bool:
    size = _SAME * float(np.linalg.norm(row))
    return any(
        len(row) == len(each) and float(np.linalg.norm(row - each)) <= size for each in known
    )

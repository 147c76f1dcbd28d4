"""What is known of the errors of measured responses, gathered for the points that a fit uses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from flightid.errors import FitError
from flightid.identification.selection import SelectedResponse
from flightid.inference import decibel_phase_sensitivity, window_covariance
from flightid.responses import FrequencyResponse
from flightid.responses.uncertainty import Points, covariances

Array = NDArray[np.float64]

KNOWN = "response covariance"
APPROXIMATE = "random error"
UNKNOWN = "nothing"
_ROUNDING = 1e-10


@dataclass(frozen=True)
class Run:
    """Consecutive responses of one output, whose errors hang together.

    Attributes
    ----------
    first, count : int
        Places of the responses in the fit.
    covariance : ndarray, shape (2 m, 2 m)
        Of all real parts of the run's points, then all imaginary parts.
    """

    first: int
    count: int
    covariance: Array


@dataclass(frozen=True)
class ErrorModel:
    """Errors of all fitted points.

    Attributes
    ----------
    source : str
        ``"response covariance"``, ``"random error"`` or ``"nothing"``.
    runs : tuple of Run
        Empty where nothing is known.
    """

    source: str
    runs: tuple[Run, ...]

    @property
    def covariance(self) -> Array:
        """Of all runs together; errors of different outputs are taken as independent."""
        return np.asarray(block_diag(*(run.covariance for run in self.runs)))


def error_model(data: FrequencyResponse, selected: Sequence[SelectedResponse]) -> ErrorModel:
    """Gather the covariance of the fitted points, output by output."""
    if data.errors is None and all(np.all(s.measured.random_error == 0.0) for s in selected):
        return ErrorModel(UNKNOWN, ())
    groups = [list(group) for _, group in groupby(selected, lambda each: each.measured.output)]
    if data.errors is None:
        source, full = APPROXIMATE, [_approximate(data, group) for group in groups]
    else:
        source, full = KNOWN, _known(data, groups)
    starts = np.cumsum([0, *map(len, groups)])
    return ErrorModel(
        source,
        tuple(
            Run(int(first), len(group), matrix)
            for first, group, matrix in zip(starts, groups, full, strict=False)
        ),
    )


def _known(data: FrequencyResponse, groups: Sequence[Sequence[SelectedResponse]]) -> list[Array]:
    assert data.errors is not None
    wanted = [
        Points(
            data.outputs.index(group[0].measured.output),
            np.array([data.inputs.index(each.measured.input) for each in group]),
            np.unique(np.concatenate([each.places for each in group])),
        )
        for group in groups
    ]
    found = []
    for group, points, full in zip(groups, wanted, covariances(data.errors, wanted), strict=True):
        union = points.frequencies
        places = [
            k * len(union) + np.searchsorted(union, each.places) for k, each in enumerate(group)
        ]
        real = np.concatenate(places)
        keep = np.concatenate([real, real + len(group) * len(union)])
        found.append(np.asarray(full[np.ix_(keep, keep)]))
    return found


def _approximate(data: FrequencyResponse, group: Sequence[SelectedResponse]) -> Array:
    # The shortest window resolves least, so it shares errors most: the careful choice.
    window_s = min(data.window_s) if data.window_s else None
    blocks = []
    for each in group:
        error = each.measured.random_error[each.places]
        blocks.append(window_covariance(each.response, error, each.omega_rad_s, window_s))
    sizes = [len(block) // 2 for block in blocks]
    total = sum(sizes)
    result = np.zeros((2 * total, 2 * total))
    start = 0
    for block, size in zip(blocks, sizes, strict=True):
        span = np.arange(start, start + size)
        keep = np.concatenate([span, span + total])
        result[np.ix_(keep, keep)] = block
        start += size
    return result


def whitening(model: ErrorModel) -> list[tuple[int, int, Array]]:
    """Matrices that turn the errors of each run into independent ones of variance one.

    Raises
    ------
    FitError
        The errors are not known, or so correlated that points are copies of one another.
    """
    if model.source == UNKNOWN:
        raise FitError(
            "the likelihood needs the errors of the responses",
            found="a response without covariance or random error",
            needed="a response from estimate_response",
            action="estimate it with covariance=True, or use cost='coherence'",
        )
    result = []
    for run in model.runs:
        deviation = np.sqrt(np.diag(run.covariance))
        if not np.all(deviation > 0.0):
            raise FitError("some points have no random error", needed="errors above zero")
        scaled = run.covariance / np.outer(deviation, deviation)
        scaled[np.diag_indices_from(scaled)] += _ROUNDING
        try:
            lower = np.linalg.cholesky(scaled)
        except np.linalg.LinAlgError as error:
            raise FitError(
                "errors of neighbouring frequencies are too alike for a likelihood",
                needed="a covariance of full rank",
                action="lower n_omega, or use cost='coherence'",
            ) from error
        matrix = np.linalg.solve(lower, np.diag(1.0 / deviation))
        result.append((run.first, run.count, np.ascontiguousarray(matrix)))
    return result


def coherence_sensitivity(
    selected: Sequence[SelectedResponse],
    fitted: Sequence[NDArray[np.complex128]],
    model: ErrorModel,
) -> Array:
    """Derivatives of the weighted dB and degree residuals with respect to all runs' points."""
    blocks = []
    for run in model.runs:
        group = range(run.first, run.first + run.count)
        total = sum(len(selected[k].places) for k in group)
        block, start = np.zeros((2 * total, 2 * total)), 0
        for k in group:
            each = selected[k]
            size = len(each.places)
            span = np.arange(start, start + size)
            block[2 * start : 2 * (start + size), np.concatenate([span, span + total])] = (
                decibel_phase_sensitivity(
                    fitted[k], np.sqrt(each.weight_db), np.sqrt(each.weight_deg)
                )
            )
            start += size
        blocks.append(block)
    return np.asarray(block_diag(*blocks))

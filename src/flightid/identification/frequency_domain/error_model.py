"""What is known of the errors of measured responses, gathered for the points that a fit uses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.frozen import dataclass
from flightid.identification.fit_findings import APPROXIMATE, UNKNOWN
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.identification.shared_work import shared
from flightid.responses import FrequencyResponse
from flightid.responses.errors.random_error import (
    CovarianceSource,
    Points,
    by_level,
    combined_by_level,
    covariances,
    knows_between_outputs,
)
from flightid.uncertainty import decibel_phase_sensitivity, window_covariance
from flightid.uncertainty.estimated_levels import EstimatedLevels
from flightid.uncertainty.response_errors import PolarSensitivity

Array = NDArray[np.float64]

KNOWN = "response covariance"
_ROUNDING = 1e-10


@dataclass(frozen=True)
class Run:
    """Consecutive responses of one output.

    Attributes
    ----------
    first, count : int
        Places of the responses in the fit.
    points : Points
        The output, its inputs and all frequencies of its responses.
    kept : ndarray of int, shape (2 m,)
        Which real and imaginary parts of those points are fitted: all real parts of the run's
        points, then all imaginary parts.
    """

    first: int
    count: int
    points: Points
    kept: NDArray[np.intp]

    def widened(self, gain: Array) -> Array:
        """A gain on the fitted parts as one on all of `points`, zero on the others."""
        size = 2 * len(self.points.inputs) * len(self.points.frequencies)
        wide = np.zeros((len(gain), size))
        wide[:, self.kept] = gain
        return wide


@dataclass(frozen=True)
class ErrorModel:
    """Errors of all fitted points.

    Attributes
    ----------
    source : str
        ``"response covariance"``, ``"random error"`` or ``"nothing"``.
    runs : tuple of Run
        Empty where nothing is known.
    known : CovarianceSource or None
        Errors of the response.
    approximate : tuple of ndarray
        Covariance of the points of each run from their random errors, where nothing else is known.
    """

    source: str
    runs: tuple[Run, ...]
    known: CovarianceSource | None = None
    approximate: tuple[Array, ...] = ()

    @property
    def outputs_apart(self) -> bool:
        """Whether several outputs have known errors, but not what they share."""
        return (
            len(self.runs) > 1 and self.known is not None and not knows_between_outputs(self.known)
        )

    @property
    def noise_taken_for_known(self) -> bool:
        """Whether errors are known, but not from how much noise: of a file, or of arithmetic."""
        if self.known is None or not self.runs:
            return False
        points = self.runs[0].points
        size = 2 * len(points.inputs) * len(points.frequencies)
        return by_level(self.known, [points], [np.zeros((0, size))])[0] is None

    @cached_property
    def covariances(self) -> tuple[Array, ...]:
        """Of the points of each run, shape (2 m, 2 m): one output at a time."""
        if self.known is None:
            return self.approximate
        full = covariances(self.known, [run.points for run in self.runs])
        return tuple(
            np.asarray(matrix[np.ix_(run.kept, run.kept)])
            for run, matrix in zip(self.runs, full, strict=True)
        )

    def propagated(self, gain: Array, told: int = 0) -> tuple[Array, Array]:
        """Covariance of a gain times the errors of all points, across outputs.

        A gust moves all outputs at once: where the errors of the response know it, so does this.

        Parameters
        ----------
        gain : ndarray, shape (n_rows, n_points)
            Columns in the order of the runs, and within one of `Run.kept`.
        told : int
            First rows of which freedom is asked.

        Returns
        -------
        covariance : ndarray, shape (n_rows, n_rows)
        freedom : ndarray, shape (told,)
            Degrees of freedom of variances: noise is an estimate. Outputs count apart; infinite
            where nobody knows from how much noise errors are.

        Reference
        ---------
        Satterthwaite (1946), Biometrics Bulletin 2(6), eq. 17.
        """
        parts = self._parts(gain)
        known = np.full(told, np.inf)
        if self.known is None:
            blocks = zip(parts, self.approximate, strict=True)
            return np.asarray(sum(part @ block @ part.T for part, block in blocks)), known
        wide = [run.widened(part) for run, part in zip(self.runs, parts, strict=True)]
        points = [run.points for run in self.runs]
        found, levels = combined_by_level(self.known, points, wide, told)
        if told and levels:
            variances, freedom = (np.concatenate(part) for part in zip(*levels, strict=True))
            doubt = np.sum(variances**2 / freedom[:, None], axis=0)
            seen = doubt > 0.0
            known[seen] = (np.sum(variances, axis=0)[seen]) ** 2 / doubt[seen]
        return np.asarray(0.5 * (found + found.T)), known

    def levels(self, gain: Array) -> EstimatedLevels | None:
        """How scores hang on levels of noise that were estimated, where errors weigh points.

        Outputs are taken one by one. None where no errors know from how much noise they are.

        Parameters
        ----------
        gain : ndarray, shape (n_rows, n_points)
            As `propagated` takes it.
        """
        if self.known is None:
            return None
        parts = self._parts(gain)
        wide = [run.widened(part) for run, part in zip(self.runs, parts, strict=True)]
        every = by_level(self.known, [run.points for run in self.runs], wide)
        found = []
        for run, part, (*_, matrix), met in zip(
            self.runs, parts, whitening(self), every, strict=True
        ):
            if met is not None:
                products = met.products[:, run.kept]
                white = matrix @ products
                weighed = white.transpose(0, 2, 1) @ white
                found.append(EstimatedLevels(part @ products, weighed, met.freedom))
        return EstimatedLevels.joined(found)

    def _parts(self, gain: Array) -> list[Array]:
        sizes = [len(run.kept) for run in self.runs]
        return np.split(gain, np.cumsum(sizes)[:-1], axis=1)


def error_model(data: FrequencyResponse, selected: Sequence[SelectedResponse]) -> ErrorModel:
    """Gather what is known of the errors of the fitted points, output by output."""
    if data.errors is None and all(np.all(s.measured.random_error == 0.0) for s in selected):
        return ErrorModel(UNKNOWN, ())
    groups = [list(group) for _, group in groupby(selected, lambda each: each.measured.output)]
    starts = np.cumsum([0, *map(len, groups)])
    runs = shared(
        lambda: (data.inputs, data.outputs, *((s.name, s.places.tobytes()) for s in selected)),
        lambda: tuple(
            _run(data, int(first), group) for first, group in zip(starts, groups, strict=False)
        ),
    )
    if data.errors is None:
        return ErrorModel(APPROXIMATE, runs, None, tuple(_approximate(data, g) for g in groups))
    return ErrorModel(KNOWN, runs, data.errors)


def _run(data: FrequencyResponse, first: int, group: Sequence[SelectedResponse]) -> Run:
    points = Points(
        data.outputs.index(group[0].measured.output),
        np.array([data.inputs.index(each.measured.input) for each in group]),
        np.unique(np.concatenate([each.places for each in group])),
    )
    union = points.frequencies
    real = np.concatenate(
        [k * len(union) + np.searchsorted(union, each.places) for k, each in enumerate(group)]
    )
    return Run(first, len(group), points, np.concatenate([real, real + len(group) * len(union)]))


def _approximate(data: FrequencyResponse, group: Sequence[SelectedResponse]) -> Array:
    # The shortest window resolves least, so it shares errors most: the careful choice.
    window_s = min(data.window_s) if data.window_s else None
    blocks = []
    for each in group:
        error = each.measured.random_error[each.places]
        blocks.append(window_covariance(each.response, error, each.omega_rad_s, window_s))
    if len(blocks) == 1:
        return blocks[0]
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

    Outputs are weighted one by one, whatever they share: a covariance between outputs that is
    estimated from few flights is too rough to divide by, and the intervals know of it anyway.

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
    for run, covariance in zip(model.runs, model.covariances, strict=True):
        deviation = np.sqrt(np.diag(covariance))
        if not np.all(deviation > 0.0):
            raise FitError("some points have no random error", needed="errors above zero")
        scaled = covariance / np.outer(deviation, deviation)
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
) -> PolarSensitivity:
    """Derivatives of the weighted dB and degree residuals with respect to all runs' points."""
    weights = (
        np.sqrt(np.concatenate([getattr(each, name) for each in selected]))
        for name in ("weight_db", "weight_deg")
    )
    slopes = decibel_phase_sensitivity(np.concatenate(fitted), *weights)
    halves = [len(run.kept) // 2 for run in model.runs]
    starts = np.cumsum([0, *(2 * half for half in halves)])
    columns = [
        np.arange(start, start + half)[:, None] + [0, half]
        for start, half in zip(starts, halves, strict=False)
    ]
    return PolarSensitivity(slopes, np.concatenate(columns))

"""Output error by integration of the equations (native: `nonlinear_output_error.rs`).

For nonlinear models, and for unstable ones: there a record is run in segments that meet, with the
growing modes set at its end and the others at its beginning, so that nothing grows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid import _native
from flightid.conventions import Light
from flightid.errors import DataError, OptionError, SingularError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.records.setup import OwnNumbers, RecordSet
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.models.state_space.first_sample import measured_point
from flightid.models.state_space.integration_steps import steps_per_sample
from flightid.models.state_space.measured_states import state_outputs

Array = NDArray[np.float64]
Segments = tuple[list[int], Array, int, Array]
SINGLE_RUN = 3.0
"""Records over which no mode grows by more than exp of this are run whole."""
GROWING = 1.0
"""Modes that grow by more than exp of this over a segmented record are set at its end."""
SEGMENT = float(np.log(10.0))
"""Largest growth exponent over one segment."""
LINEAR_RADIUS = 0.1
"""Step times eigenvalue for linear models, which others discretise exactly: 0.1^4/120 = 1e-6."""


@dataclass(frozen=True, eq=False)
class EquationRuns:
    """How the records of a fit are integrated.

    Attributes
    ----------
    native : _native.EquationRecords
    segments : list of tuple
        Cuts (samples), conditions at the ends (n_states, n_states), how many of them at the end,
        and guesses of the states at beginning, cuts and end, of each record.
    e_folds : float
        Largest growth exponent of the model over a record.
    """

    native: _native.EquationRecords
    segments: list[Segments]
    e_folds: float

    @property
    def is_segmented(self) -> bool:
        """Whether any record is run in segments."""
        return any(n_growing for _, _, n_growing, _ in self.segments)

    @property
    def n_growing(self) -> list[int]:
        """Modes of each record that are set at its end."""
        return [n_growing for _, _, n_growing, _ in self.segments]

    def start(
        self, fitted: GreyBoxModel, prepared: RecordSet, place: int, own: OwnNumbers
    ) -> OwnNumbers:
        """The same numbers with the state at the first sample and its derivatives."""
        if not self.segments[place][2]:
            return own
        state, slopes = self.native.start_of_record(
            place,
            fitted.parameters.independent_values(),
            fitted.parameters.free_indices,
            prepared.arrays[place],
            own.native,
            prepared.hold,
        )
        return replace(own, start=(state, slopes))


def equation_runs(model: GreyBoxModel, prepared: RecordSet) -> EquationRuns | None:
    """The way to integrate a model's equations on records; None where it is linear and stable.

    Parameters
    ----------
    model : TransferFunctionModel or StateSpaceModel
        Its values decide which modes grow.
    prepared : RecordSet

    Returns
    -------
    EquationRuns or None
    """
    if not isinstance(model, StateSpaceModel):
        return None
    linear = model.is_linear
    at = measured_point(model, prepared.records)
    transition = _transition(model, at)
    durations = [(inputs.shape[1] - 1) * dt for inputs, _, dt in prepared.arrays]
    rate = _fastest_growth(transition)
    e_folds = rate * max(durations)
    if linear and e_folds <= SINGLE_RUN:
        return None
    radius = {"radius": LINEAR_RADIUS} if linear else {}
    substeps = [steps_per_sample(model, dt, None, at=at, **radius) for _, _, dt in prepared.arrays]
    segments = [
        _segments(model, transition, prepared, place, rate)
        if rate * duration > SINGLE_RUN
        else ([], np.zeros((0, 0)), 0, np.zeros((0, 0)))
        for place, duration in enumerate(durations)
    ]
    native = _native.EquationRecords(model.native, substeps, segments)
    return EquationRuns(native, segments, e_folds)


def segmented_starts(prepared: RecordSet, runs: EquationRuns) -> RecordSet:
    """Own numbers in which segmented records start: conditions at both ends, all of them free.

    Parameters
    ----------
    prepared : RecordSet
    runs : EquationRuns
    """
    pairs = zip(prepared.own, runs.segments, strict=True)
    return replace(prepared, own=[_placed(numbers, segments) for numbers, segments in pairs])


def _placed(numbers: OwnNumbers, segments: Segments) -> OwnNumbers:
    _, ends, n_growing, guesses = segments
    if not n_growing:
        return numbers
    n = len(ends)
    others = numbers.limits[len(numbers.free_initial) :]
    if np.any(np.isfinite(numbers.limits[: len(numbers.free_initial)])):
        raise OptionError(
            "initial states have bounds, which a fit of an unstable model does not hold",
            found="a record in which a mode grows too far to start from its first sample",
            needed="initial states without bounds: they follow from both ends of the record",
            action="leave min and max of initial states out of the model, or use a shorter record",
        )
    first, last = ends[: n - n_growing] @ guesses[0], ends[n - n_growing :] @ guesses[-1]
    return replace(
        numbers,
        initial=np.concatenate([first, last]),
        free_initial=list(range(n)),
        held=(),
        limits=[*((-np.inf, np.inf) for _ in range(n)), *others] if others else [],
    )


def judge_runs(runs: EquationRuns | None) -> list[Finding]:
    """Say how an unstable model was run."""
    if runs is None or not runs.is_segmented:
        return []
    cuts = max(len(cuts) for cuts, *_ in runs.segments)
    return [
        Finding(
            "unstable-model",
            Light.UNKNOWN,
            f"the model is unstable (a mode grows by a factor of e^{runs.e_folds:.2g} over a "
            f"record): records were run in up to {cuts + 1} segments that meet, growing modes set "
            "at the end; initial states were fitted",
        )
    ]


def _transition(model: StateSpaceModel, at: Mapping[str, float]) -> Array:
    try:
        return model.state_space(at=at)[0]
    except (DataError, SingularError):
        # A nonlinear model need not have a linearisation at its trim.
        return np.zeros((len(model.states), len(model.states)))


def _fastest_growth(transition: Array) -> float:
    return max(0.0, float(np.max(np.linalg.eigvals(transition).real, initial=0.0)))


def _segments(
    model: StateSpaceModel, transition: Array, prepared: RecordSet, place: int, rate: float
) -> Segments:
    inputs, outputs, sample_time_s = prepared.arrays[place]
    n_samples = inputs.shape[1]
    limit = GROWING / ((n_samples - 1) * sample_time_s)
    ends, n_growing = _conditions(transition, limit)
    length = max(2, int(SEGMENT / (rate * sample_time_s)))
    count = max(1, int(np.ceil(n_samples / length)))
    cuts = [round(k * n_samples / count) for k in range(1, count)]
    return cuts, ends, n_growing, _guesses(model, inputs, outputs, [0, *cuts, n_samples - 1])


def _conditions(transition: Array, limit: float) -> tuple[Array, int]:
    """Rows that see the modes which do not grow, then those which see the growing ones alone."""

    def rows(grows: bool) -> tuple[Array, int]:
        _, basis, n = scipy.linalg.schur(
            transition.T, output="real", sort=lambda re, _im: (re > limit) == grows
        )
        return np.asarray(basis[:, :n].T), n

    (still, _), (growing, n_growing) = rows(False), rows(True)
    return np.ascontiguousarray(np.vstack([still, growing])), n_growing


def _guesses(
    model: StateSpaceModel, inputs: Array, outputs: Array, samples: Sequence[int]
) -> Array:
    """States at some samples: measured where outputs tell them, else those of the trim."""
    seen = state_outputs(model, inputs, outputs)
    return np.ascontiguousarray(seen.states(outputs[:, list(samples)]).T)

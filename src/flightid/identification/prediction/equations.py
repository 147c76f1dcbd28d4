"""Free run of a nonlinear model through one record, with the shifts that fit it best.

The equations are integrated as for a fit of output error, with the parameters held: only initial
state, input shifts and output biases of the record are solved for, by Gauss-Newton.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.identification.multistart import DenseEnd
from flightid.identification.prediction.linear import Freedom, column_rank
from flightid.identification.prediction.result import Shifts
from flightid.identification.records.setup import OwnNumbers
from flightid.identification.records.slopes_at_start import require_slopes
from flightid.models import StateSpaceModel
from flightid.models.state_space.integration_steps import steps_per_sample

Array = NDArray[np.float64]
MOST_STEPS = 50


@dataclass(frozen=True, eq=False)
class NonlinearRun:
    """Runs of a model over the inputs of one record.

    Attributes
    ----------
    model : StateSpaceModel
    native : _native.EquationRecords
    inputs : ndarray, shape (n_inputs, n_samples)
        Whole, in the model's units.
    sample_time_s : float
    hold : {"first", "zero", "band_limited"}
    rows : list of int
        Places of the compared outputs.
    start : OwnNumbers
        Where the search begins, without shifts; its free places are solved for.
    """

    model: StateSpaceModel
    native: _native.EquationRecords
    inputs: Array
    sample_time_s: float
    hold: str
    rows: list[int]
    start: OwnNumbers

    @classmethod
    def of(
        cls,
        model: StateSpaceModel,
        inputs: Array,
        sample_time_s: float,
        rows: list[int],
        freedom: Freedom,
        hold: str,
    ) -> NonlinearRun:
        """Prepare the runs of one record."""
        n, m, p = len(model.states), len(model.inputs), len(model.outputs)
        cuts: list[int] = []
        whole = (cuts, np.zeros((0, 0)), 0, np.zeros((0, 0)))
        initial = np.array([float(model.trim.get(name, 0.0)) for name in model.states])
        for place, value in freedom.given.items():
            initial[place] = value
        values = map(float, (*initial, *inputs[:, 0]))
        flown = dict(zip((*model.states, *model.inputs), values, strict=True))
        steps = steps_per_sample(model, sample_time_s, None, at={} if model.trim else flown)
        start = OwnNumbers(
            initial,
            np.zeros(m),
            np.zeros(p),
            list(freedom.free_states(n)),
            list(range(m)) if freedom.state_bias else [],
            rows if freedom.output_bias else [],
        )
        native = _native.EquationRecords(model.native, [steps], [whole])
        return cls(model, native, inputs, sample_time_s, hold, rows, start)

    def outputs(self, own: OwnNumbers) -> tuple[Array, Array]:
        """Compared outputs (n_rows, n_samples), and their slopes by the free numbers."""
        blank = np.zeros((len(self.model.outputs), self.inputs.shape[1]))
        run, slopes = self.native.run_record(
            0,
            self.model.parameters.independent_values(),
            [],
            (self.inputs, blank, self.sample_time_s),
            own.native,
            self.hold,
            True,
        )
        return (run + own.bias[:, None])[self.rows], slopes[self.rows]


def predict_equations(
    model: StateSpaceModel,
    inputs: Array,
    measured: Array,
    sample_time_s: float,
    *,
    rows: list[int],
    freedom: Freedom,
    weights: Array,
    hold: str,
) -> tuple[Array, Shifts]:
    """Free run of a nonlinear model through one record with the best shifts.

    Parameters
    ----------
    model : StateSpaceModel
    inputs : ndarray, shape (n_inputs, n_samples)
    measured : ndarray, shape (n_compared, n_samples)
    sample_time_s : float
        Time between samples, s.
    rows : list of int
        Places of the compared outputs in the model.
    freedom : Freedom
        A free bias is a constant shift of every input.
    weights : ndarray, shape (n_compared,)
        What the square of one unit of error counts.
    hold : {"first", "zero"}

    Returns
    -------
    tuple of ndarray and Shifts
        Prediction, shape (n_compared, n_samples), and the shifts.

    Raises
    ------
    DataError
        The run from its start diverges, or a formula has no value.
    FitError
        An output has no finite slope at the start.
    """
    run = NonlinearRun.of(model, inputs, sample_time_s, rows, freedom, hold)
    told = slice(None, freedom.stretch)
    scale = np.sqrt(weights)[:, None]
    best, rank = run.start, 0
    n_free = run.start.n_free
    if n_free:
        names = [list(model.outputs)[row] for row in rows]
        require_slopes(run.outputs(run.start)[1], run.start, list(model.states), names)
        start, size = _places(run.start), measured[:, told].size

        def residuals(x: Array) -> Array:
            error = run.outputs(run.start.filled(x))[0] - measured
            return np.asarray((scale * error[:, told]).ravel())

        def jacobian(x: Array) -> Array:
            slopes = scale[..., None] * run.outputs(run.start.filled(x))[1][:, told]
            return np.asarray(slopes.reshape(size, n_free))

        open_ = np.full(n_free, np.inf)
        end = DenseEnd.searched(residuals, jacobian, start, -open_, open_, size, MOST_STEPS)
        best, rank = run.start.filled(end.x), column_rank(end.jacobian)
    predicted, slopes = run.outputs(best)
    shifts = Shifts(
        np.zeros(len(model.states)),
        best.bias[rows],
        best.initial,
        n_free,
        rank,
        input_bias=best.shift,
        told_s=None if freedom.stretch is None else freedom.stretch * sample_time_s,
        is_open=rank < n_free and rank < column_rank(slopes.reshape(-1, n_free)),
    )
    return predicted, shifts


def _places(own: OwnNumbers) -> Array:
    parts = (
        own.initial[own.free_initial],
        own.shift[own.free_shift],
        own.bias[own.free_bias],
    )
    return np.concatenate(parts)

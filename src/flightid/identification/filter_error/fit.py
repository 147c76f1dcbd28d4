"""Filter error: maximum likelihood of records in turbulence, by innovations of a Kalman filter.

Process noise drives chosen states; its densities and the deviations of the measurement noise are
estimated beside the parameters. Measurement variances are exponentials of what is estimated, so
they are positive and no constraint on the innovations' covariance is needed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.filter_error.extended_kalman import ExtendedProblem
from flightid.identification.filter_error.gust_severity import judge_gust
from flightid.identification.filter_error.gusts import GUST, GUST_UNKNOWNS, Gust
from flightid.identification.filter_error.innovation_covariance import (
    innovation_covariance,
    told_noises,
)
from flightid.identification.filter_error.innovations import InnovationsProblem, RecordInnovations
from flightid.identification.filter_error.noise_doubt import noise_doubt
from flightid.identification.filter_error.problem import innovations_problem
from flightid.identification.filter_error.search import (
    NEAR,
    across_jumps,
    anchored,
    minimise,
    with_gust,
)
from flightid.identification.fit import Fit
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.innovation_tests import innovation_tests
from flightid.identification.multistart import DenseEnd, cluster, collect, draw_starts
from flightid.identification.records.white_noise import explained_percent
from flightid.identification.regression.fit import (
    Inner,
    Knowledge,
    assemble,
    check_records,
    limits_of,
    require_seen,
    require_states,
)
from flightid.identification.regression.options import FilterErrorOptions
from flightid.identification.rival_fits import judged
from flightid.identification.withheld_intervals import without_intervals
from flightid.models import StateSpaceModel
from flightid.record import Record, Step
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
MISSING = (
    "name another state in process_noise, add the lag or delay that the model lacks, which "
    "process noise took for turbulence, or look for feedback"
)
"""What to do where inputs foretell innovations."""
CAUSE = "dynamics are missing, or gusts are others than the filter's"
"""Why they do: derivatives bend to do the work of a gust whose colour or state is another."""


@dataclass(frozen=True)
class _AbsoluteNoise:
    """Absolute noises at the estimate."""

    process: Mapping[str, float]
    measurement: Array
    innovation: Array
    gust: Mapping[str, Any] | None


def fit_filter_error(
    model: StateSpaceModel, data: Record | Sequence[Record], options: FilterErrorOptions
) -> Fit:
    """Fit in process noise; see `flightid.identify`.

    Raises
    ------
    FitError
        The data cannot tell parameters apart.
    """
    require_states(model, "filter error")
    records = check_records(model, data)
    problem = innovations_problem(model, records, options)
    tried = options.gust_states and not isinstance(problem, ExtendedProblem) and judged()
    # Ends of several starts are compared with each other: those are searched to the last.
    groups = cluster(_search(problem, options, NEAR if tried and options.starts == 1 else 0.0))
    limits = limits_of(model, options.maximum_iterations)[1]
    if tried:
        problem, groups = with_gust(problem, groups, limits)
    problem, groups = anchored(problem, groups, limits)
    groups = [across_jumps(problem, groups[0], limits, kinks=True), *groups[1:]]
    end = groups[0][0]
    inner = Inner.of(model, end.x[: problem.n_free])
    filtered = [found for found, _ in problem.records(end.x, with_slopes=False)]
    freedom = _freedom(problem, filtered)
    bounded = np.abs(end.x[problem.n_free :]) >= problem.reach - 1e-6
    columns = np.concatenate([inner.mask, ~bounded])
    # A noise that came out as none is at its bound wherever the search left its logarithm.
    columns[columns] = told_noises(end.jacobian[:, columns], len(inner.names))
    jacobian = end.jacobian[:, columns] / np.sqrt(end.cost / freedom)
    require_seen(inner, jacobian[:, : len(inner.names)])
    residuals = end.residuals / np.sqrt(end.cost / freedom)
    found = innovation_covariance(filtered, residuals, jacobian, inner.names)
    count = len(inner.names)
    covariance, degrees = found.covariance[:count, :count], found.freedom[:count]
    if judged():
        doubt = noise_doubt(problem, end, columns, found.covariance)
        covariance = covariance * np.outer(doubt.factor, doubt.factor)
        degrees = 2.0 / (2.0 / degrees + doubt.variance)
    known = Knowledge(
        jacobian[:, :count],
        covariance,
        degrees,
        "innovations",
        found.colour_of(count),
        found.agreement.of(count),
    )
    noise = _noises(problem, end, filtered)
    tests = innovation_tests(
        [each.innovations.T for each in filtered],
        [each.inputs for each in problem.data],
        [each.outputs for each in problem.data],
        (0, count),
    ).beside(known.agreement)
    tests = replace(tests, cause=CAUSE)
    fit = assemble(
        "filter error",
        inner,
        [[replace(each, x=each.x[: problem.n_free]) for each in group] for group in groups],
        known,
        _costs(records, filtered, model.outputs),
        records,
        _fitted_records(problem, records, filtered),
        options,
        findings=[
            *_judge(problem, bounded),
            *_gust_findings(model, noise.gust, records),
            *tests.findings(biased=False, action=MISSING),
        ],
        extra={
            "process_noise": dict(noise.process),
            "innovation_covariance": noise.innovation.tolist(),
            "gust": noise.gust,
        },
        noise_covariance=noise.measurement,
        residual_horizon=1,
        noise=explained_percent(records, model.outputs),
    )
    return fit if tests.is_independent else without_intervals(fit, tests.why_biased)


def _search(
    problem: InnovationsProblem, options: FilterErrorOptions, enough: float
) -> list[DenseEnd]:
    model = problem.model
    _, limits = limits_of(model, options.maximum_iterations)
    found: list[DenseEnd | str] = []
    for start in draw_starts(model.parameters.free, options.starts, options.seed):
        whole = np.concatenate([start, np.zeros(problem.n_all - problem.n_free)])
        if np.all(np.isfinite(problem.residuals(whole, with_slopes=False)[0])):
            found.append(minimise(problem, whole, limits, enough=enough))
        else:
            found.append("no steady filter at the start")
    return across_jumps(problem, collect(found), limits)


def _freedom(problem: InnovationsProblem, filtered: Sequence[RecordInnovations]) -> float:
    """Measured numbers less what was estimated."""
    own = sum(len(each.constants) for each in filtered)
    return float(sum(each.outputs.size for each in problem.data) - own - problem.n_free)


def _noises(
    problem: InnovationsProblem, end: DenseEnd, filtered: Sequence[RecordInnovations]
) -> _AbsoluteNoise:
    whitened = [
        np.linalg.solve(np.linalg.cholesky(each.filter.innovation), each.innovations.T)
        for each in filtered
    ]
    total = sum(float(np.sum(white**2)) for white in whitened)
    common = total / _freedom(problem, filtered)
    process, measured = problem.noise(end.x)
    states = list(problem.model.states)
    densities = {states[k]: float(np.sqrt(common * process[k])) for k in problem.noisy}
    return _AbsoluteNoise(
        densities,
        np.diag(common * measured),
        common * filtered[0].filter.innovation,
        None if problem.gust is None else _described(problem, problem.gust, end.x, common),
    )


def _described(
    problem: InnovationsProblem, gust: Gust, unknowns: Array, common: float
) -> dict[str, Any]:
    deviation, time_s = gust.size(unknowns[-GUST_UNKNOWNS:])
    names = list(problem.model.outputs)
    return {
        "state": list(problem.model.states)[gust.state],
        "deviation": float(np.sqrt(common)) * deviation,
        "time_s": time_s,
        "outputs": [names[row] for row in np.flatnonzero(gust.seen)],
    }


def _costs(
    records: Sequence[Record], filtered: Sequence[RecordInnovations], outputs: Sequence[str]
) -> dict[str, float]:
    """Percent of each output's variance that one-step predictions leave."""
    left = np.sum([np.sum(each.innovations**2, axis=0) for each in filtered], axis=0)
    whole = np.sum(
        [record.n_samples * np.var(record.matrix(outputs), axis=1) for record in records], axis=0
    )
    return dict(zip(outputs, map(float, 100.0 * left / whole), strict=True))


def _fitted_records(
    problem: InnovationsProblem,
    records: Sequence[Record],
    filtered: Sequence[RecordInnovations],
) -> list[FittedRecord]:
    model = problem.model
    m, p = len(model.inputs), len(model.outputs)
    states = [*model.states, *([] if problem.gust is None else [GUST])]
    found, n = [], len(states)
    for record, each in zip(records, filtered, strict=True):
        predicted = record.matrix(model.outputs) - each.innovations.T
        names = [*model.inputs, *model.outputs]
        step = Step("identify", {"method": "filter error, one-step predictions"})
        made = record.select(names).replace(
            dict(zip(model.outputs, predicted, strict=True)), step=step
        )
        constants = list(map(float, each.constants))
        bias = constants[n : n + p] if problem.output_bias else []
        shift = constants[len(constants) - m :] if problem.input_bias else []
        found.append(
            FittedRecord(
                record,
                made,
                model.outputs,
                _own(model.states, constants[: len(model.states)], model.states),
                _own(model.outputs, bias, model.units),
                _own(model.inputs, shift, model.units),
                dict(zip(states, each.states.T, strict=True)),
            )
        )
    return found


def _own(
    names: Sequence[str] | Mapping[str, str], values: Sequence[float], units: Mapping[str, str]
) -> dict[str, Estimate]:
    reason = "estimated beside the parameters, without an interval"
    return {
        name: Estimate(name, value, units[name], None, reason, status="free")
        for name, value in zip(names, values, strict=False)
    }


def _gust_findings(
    model: StateSpaceModel, gust: Mapping[str, Any] | None, records: Sequence[Record]
) -> list[Finding]:
    if gust is None:
        return []
    longest_s = max(record.duration_s for record in records)
    state = gust["state"]
    return judge_gust(state, model.states[state], gust["deviation"], gust["time_s"], longest_s)


def _judge(problem: InnovationsProblem, bounded: NDArray[np.bool_]) -> list[Finding]:
    states = list(problem.model.states)
    return [
        Finding(
            "no-process-noise",
            Light.AMBER,
            f"no process noise is seen on {states[place]}",
            "leave it out of process_noise; where no state has any, output error is the method",
        )
        for place, at_bound in zip(problem.noisy, bounded, strict=False)
        if at_bound and problem.gust is None
    ]

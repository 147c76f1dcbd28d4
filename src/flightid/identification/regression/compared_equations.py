"""Both sides of the fitted equations side by side, as records and as costs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Role
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.regression.equation_regression import EquationRegression
from flightid.identification.regression.rounds import SettledRounds
from flightid.models import StateSpaceModel
from flightid.record import Channel, Record
from flightid.units import canonical

Array = NDArray[np.float64]


def compared_costs(problem: EquationRegression, left: Array) -> dict[str, float]:
    """Percent of each equation's measured side that a sum of squares, such as residuals', makes."""
    names = problem.names()
    whole = np.zeros(len(names))
    for place, operator in enumerate(problem.operators):
        for row, equation in enumerate(problem.used):
            side = problem.left(place)[row]
            direction = operator.nuisance(is_state=bool(equation < problem.n_states))
            if direction is not None:
                side = side - direction * (direction @ side) / (direction @ direction)
            whole[row] += side @ side
    return {name: float(100.0 * a / b) for name, a, b in zip(names, left, whole, strict=True)}


def equation_unit(model: StateSpaceModel, name: str) -> str:
    """Unit of an equation: that of a state per second, or of an output."""
    if not name.endswith("'"):
        return model.measurements[name].unit
    unit = model.states[name[:-1]]
    return canonical("1/s" if unit == "1" else f"({unit})/s")


def compared_records(
    problem: EquationRegression, settled: SettledRounds, records: Sequence[Record]
) -> list[FittedRecord]:
    """Measured and computed sides of the equations in time; of Fourier rows, the band's content."""
    names = problem.names()
    units = {name: equation_unit(problem.right.model, name) for name in names}
    labels = [Channel(name, unit, Role.OUTPUT, "equation") for name, unit in units.items()]
    found = []
    for place, (operator, record) in enumerate(zip(problem.operators, records, strict=True)):
        measured = problem.left(place)
        sides = [operator.in_time(s) for s in (measured, measured - settled.rows[place].residuals)]
        cut = (record.n_samples - sides[0].shape[1]) // 2
        base = record.select(problem.right.model.inputs)
        if cut:
            base = base.segment(float(record.time_s[cut]), float(record.time_s[-cut]))
        channels = [*base.channels.values(), *labels]
        measured_side, computed_side = (
            base.replace(dict(zip(names, side, strict=True)), channels=channels) for side in sides
        )
        found.append(FittedRecord(measured_side, computed_side, names, {}, {}, {}))
    return found

"""Fit of output error in the frequency domain: starts, weights by spectra, intervals, records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FlightidError
from flightid.identification.fit import Fit
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.multistart import cluster, collect, draw_starts
from flightid.identification.regression.fit import (
    Inner,
    assemble,
    check_records,
    known_by_spectra,
    limits_of,
    require_linear,
    require_states,
)
from flightid.identification.regression.foretold_rows import DrivenHarmonics
from flightid.identification.regression.fourier_output_error import (
    FourierOutputError,
    TransformedRecord,
)
from flightid.identification.regression.options import FourierOutputErrorOptions
from flightid.identification.regression.rounds import Rows, SettledRounds, settle
from flightid.identification.regression.weights import spectral_weights
from flightid.models import StateSpaceModel
from flightid.record import Record, Step

Array = NDArray[np.float64]


def fit_fourier_output_error(
    model: StateSpaceModel, data: Record | Sequence[Record], options: FourierOutputErrorOptions
) -> Fit:
    """Fit outputs at the harmonics of the records; see `flightid.identify`.

    Raises
    ------
    FitError
        The model is not linear: it has no harmonics apart from each other.
    """
    require_linear(model, "Fourier output error")
    require_states(model, "Fourier output error")
    records = check_records(model, data)
    transformed = tuple(
        TransformedRecord.of(record, model, options.band_rad_s) for record in records
    )
    problem = FourierOutputError(model, transformed, options.hold)
    omegas = [each.grid.omega_rad_s for each in transformed]
    settled = _search(problem, omegas, options)
    groups = cluster(collect([each.end for each in settled]))
    best = next(each for each in settled if each.end is groups[0][0])
    inner = Inner.of(model, best.end.x)
    driven = [DrivenHarmonics(each.grid, each.inputs) for each in transformed]
    known = known_by_spectra(inner, best.rows, best.weights, driven)
    return assemble(
        "Fourier output error",
        inner,
        groups,
        known,
        _costs(problem, best.rows),
        records,
        _compared(problem, best.rows),
        options,
        extra={"rounds": best.rounds},
    )


def _search(
    problem: FourierOutputError, omegas: Sequence[Array], options: FourierOutputErrorOptions
) -> list[SettledRounds]:
    model, count = problem.model, len(problem.records)
    _, limits = limits_of(model, options.maximum_iterations)
    starts = draw_starts(model.parameters.free, options.starts, options.seed)
    found, refused = [], None
    for start in starts:
        try:
            found.append(
                settle(problem, start, lambda r: spectral_weights(r, omegas), limits, count)
            )
        except DataError as error:
            refused = error  # a start with a pole on a harmonic; the others may do
    if not found:
        raise refused if refused is not None else FlightidError("no start led anywhere")
    return found


def _costs(problem: FourierOutputError, rows: Sequence[Rows]) -> dict[str, float]:
    """Percent of each output's power in the band that is left in the residuals."""
    left = np.sum([np.sum(each.residuals**2, axis=1) for each in rows], axis=0)
    whole = np.sum([np.sum(problem.left(k) ** 2, axis=1) for k in range(len(rows))], axis=0)
    shares = 100.0 * left / whole
    return dict(zip(problem.model.outputs, map(float, shares), strict=True))


def _compared(problem: FourierOutputError, rows: Sequence[Rows]) -> list[FittedRecord]:
    """What the band holds of each record, back in time, with the model beside it."""
    found = []
    outputs = problem.model.outputs
    for place, (data, each) in enumerate(zip(problem.records, rows, strict=True)):
        measured = problem.left(place)
        sides = [problem.in_time(place, s) for s in (measured, measured - each.residuals)]
        names = [*problem.model.inputs, *outputs]
        base = data.record.select(names)
        step = Step("identify", {"method": "Fourier output error, content of the band"})
        pair = [base.replace(dict(zip(outputs, side, strict=True)), step=step) for side in sides]
        found.append(FittedRecord(pair[0], pair[1], outputs, {}, {}, {}))
    return found

"""The picture of each kind of result: what `result.plot()` draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from flightid.control.closed_loop.result import ClosedLoop
from flightid.control.tuning.result import Tuning
from flightid.dynamics.handling_qualities.handling_qualities import HandlingQualities
from flightid.errors import DataError
from flightid.identification import Advice, Fit
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.autopilots import controller, replay
from flightid.plot.compared_loops import compared_loops
from flightid.plot.consistency import consistency
from flightid.plot.excitation import excitation_history, plan_spectrum
from flightid.plot.field_plot import field_history, tried_noise
from flightid.plot.fit import fit_figure
from flightid.plot.fitted_record import record_figure
from flightid.plot.flight import compared_steps, flight_steps, gyro_spectrum, loop_steps
from flightid.plot.handling_qualities import (
    bandwidth_curves,
    cutoff_spectrum,
    level_chart,
    lower_order_curves,
)
from flightid.plot.loops import diagram
from flightid.plot.margins import disk_figure, disturbance_figure, loop_bode
from flightid.plot.modes import pole_map
from flightid.plot.polynomial import impulse_response, order_scan
from flightid.plot.record import Panel, Trace, time_histories
from flightid.plot.reduction import reduction_path
from flightid.plot.residuals import correlations, residual_spectra, spectrum_comparison
from flightid.plot.response import response_figure
from flightid.plot.subspace import singular_values
from flightid.plot.tuning import time_responses
from flightid.plot.verification import comparison, mismatch_envelopes, prediction
from flightid.record import Record
from flightid.simulation.realtime import FlownSession
from flightid.validation import ResidualSpectra, ResidualTests, Verification
from flightid.vehicles import GainFlight


def fit_picture(fit: Fit, *, name: str | None = None, record: int = 0) -> go.PlotFigure:
    """Draw a fit beside its data: a response, or a record where records were fitted.

    Parameters
    ----------
    fit : Fit
        Result of `flightid.identify`.
    name : str, optional
        Response ``"output/input"``; default: the first.
    record : int
        Which record, from 0.

    Returns
    -------
    PlotFigure

    Raises
    ------
    UnknownNameError
        The fit has no such response.
    DataError
        The fit keeps neither responses nor records.

    Example
    -------
    >>> fit = fid.identify(model, responses)                          # doctest: +SKIP
    >>> fit_picture(fit).show()                                       # doctest: +SKIP
    """
    if fit.responses:
        return fit_figure(fit, name)
    if fit.records:
        return record_figure(fit.records[record])
    if fit.prediction_errors:
        return record_history(fit.prediction_errors[record])
    raise DataError("the fit keeps no data to draw", action="draw fid.predict(fit, records)")


def record_history(record: Record) -> go.PlotFigure:
    """Draw every channel of a record over time, one panel each.

    Parameters
    ----------
    record : Record

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> units = {"p": "rad/s"}
    >>> made = Record.from_arrays([0.0, 0.1], outputs={"p": [0.0, 0.2]}, units=units)
    >>> record_history(made).layout.yaxis.title.text
    'p [rad/s]'
    """
    made = time_histories(
        [
            Panel(
                look.axis_title(name, record.unit(name)),
                (Trace(name, record.time_s, record[name]),),
            )
            for name in record.channels
        ]
    )
    # One line a panel, all of one colour: the axes name them, and a legend tells none apart.
    made.update_layout(showlegend=False)
    return made


def _flown_session(result: FlownSession) -> go.PlotFigure:
    return record_history(result.record)


def _verification(result: Verification, *, record: int = 0) -> go.PlotFigure:
    return prediction(result.predictions[record])


def _residual_tests(
    result: ResidualTests, *, output: str | None = None, input: str | None = None
) -> go.PlotFigure:
    first = result.inputs[0] if result.inputs else None
    return correlations(result, output or result.outputs[0], input or first)


def _residual_spectra(result: ResidualSpectra, *, output: str | None = None) -> go.PlotFigure:
    return residual_spectra(result, output or result.outputs[0])


def _closed_loop(result: ClosedLoop) -> go.PlotFigure:
    return diagram(result.loops)


def _tuning(result: Tuning, *, axis: str | None = None) -> go.PlotFigure:
    return time_responses(result.designs[0] if axis is None else result[axis])


def _gain_flight(result: GainFlight, *, name: str | None = None) -> go.PlotFigure:
    if not result.loops:
        raise DataError("the flight shows no loop to draw", found=", ".join(result.lost.values()))
    return loop_bode(result.loops[name or next(iter(result.loops))])


def _handling_qualities(result: HandlingQualities) -> go.PlotFigure:
    on_charts = [rating for rating in result.ratings if len(rating.chart.axes) == 2]
    if not on_charts:
        raise DataError("no requirement on two numbers was rated, and others have no chart")
    return level_chart(on_charts[0])


def _advice(result: Advice, *, name: str | None = None) -> go.PlotFigure:
    if result.response is None:
        raise DataError("the records carry no impulse response to draw")
    return impulse_response(result.response, name)


PICTURES: Mapping[str, Callable[..., Any]] = {
    "Advice": _advice,
    "AttitudeBandwidth": bandwidth_curves,
    "AxisLoop": controller,
    "ClosedLoop": _closed_loop,
    "FieldPlot": field_history,
    "FlownSession": _flown_session,
    "FlightComparison": compared_steps,
    "FlightReview": flight_steps,
    "GyroNoise": gyro_spectrum,
    "LoopResponse": loop_steps,
    "Comparison": comparison,
    "DiskMargin": disk_figure,
    "KinematicConsistency": consistency,
    "DisturbanceRejection": disturbance_figure,
    "Excitation": excitation_history,
    "Fit": fit_picture,
    "FrequencyResponse": response_figure,
    "GainFlight": _gain_flight,
    "HandlingQualities": _handling_qualities,
    "ImpulseResponse": impulse_response,
    "Interconnection": diagram,
    "LowerOrder": lower_order_curves,
    "MarginComparison": compared_loops,
    "Margins": loop_bode,
    "Mismatch": mismatch_envelopes,
    "Modes": pole_map,
    "OrderChoice": singular_values,
    "OrderScan": order_scan,
    "PidDesign": time_responses,
    "PilotCutoff": cutoff_spectrum,
    "Plan": plan_spectrum,
    "Prediction": prediction,
    "Record": record_history,
    "Reduction": reduction_path,
    "Replay": replay,
    "ResidualSpectra": _residual_spectra,
    "ResidualTests": _residual_tests,
    "SpectrumComparison": spectrum_comparison,
    "TriedFilters": tried_noise,
    "Tuning": _tuning,
    "Verification": _verification,
}
"""Kind of result by the name of its class -> function that draws it, result first."""

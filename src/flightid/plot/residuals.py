"""Residuals: correlation functions with their bands, spectra, and coherence with inputs."""

from __future__ import annotations

from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.validation import (
    CorrelationTest,
    ResidualSpectra,
    ResidualTests,
    SpectrumComparison,
    Verdict,
)
from flightid.wrapping import wrapped

PHONE = 42
"""Letters of a line that a panel on a phone holds."""


def correlations(tests: ResidualTests, output: str, input: str | None = None) -> go.PlotFigure:
    """Draw the correlation functions of one output and one input, below each other.

    The shaded band holds one lag in 95 % of cases; the dashed lines hold all of them.

    Parameters
    ----------
    tests : ResidualTests
        Result of `flightid.residual_tests`.
    output : str
        Output whose residual is drawn.
    input : str, optional
        Input it is tested against; without it whiteness alone is drawn.

    Returns
    -------
    PlotFigure
    """
    shown = [test for test in tests.tests if test.output == output and test.input in (None, input)]
    made = look.figure(len(shown), shared_x=False)
    for row, test in enumerate(shown, start=1):
        if test.verdict is Verdict.NOT_TESTABLE:
            made.add_annotation(
                text="<br>".join(wrapped(f"not testable: {test.reason}", PHONE)),
                x=0.0,
                y=0.0,
                showarrow=False,
                row=row,
                col=1,
            )
            # Axes without a trace have no place, and paths on them no numbers.
            unseen = go.Scatter(
                x=[-1.0, 1.0], y=[-1.0, 1.0], mode="markers", showlegend=False, hoverinfo="skip",
                name="not testable", marker={"opacity": 0.0},
            )  # fmt: skip
            made.add_trace(unseen, row=row, col=1)
            made.update_xaxes(showticklabels=False, row=row, col=1)
            made.update_yaxes(showticklabels=False, row=row, col=1)
        else:
            _draw(made, test, row)
    look.label_axes(made, x="lag [samples]", y=[str(test.kind) for test in shown])
    return made


def _draw(made: go.PlotFigure, test: CorrelationTest, row: int) -> None:
    ends = [int(test.lags[0]), int(test.lags[-1])]
    colour = look.RIVAL if test.verdict is Verdict.FAIL else look.MODEL
    band, whole = test.pointwise_band or 0.0, test.simultaneous_band or 0.0
    for edge in look.band("95 % of lags", ends, [-band] * 2, [band] * 2, colour=look.TRUTH):
        made.add_trace(edge, row=row, col=1)
    for sign in (-1.0, 1.0):
        made.add_trace(
            look.line(
                "all lags in 95 %",
                ends,
                [sign * whole] * 2,
                colour=look.TRUTH,
                dash="dash",
                legend=row == 1 and sign > 0,
            ),
            row=row,
            col=1,
        )
    bars = go.Bar(
        x=test.lags,
        y=test.values,
        name=str(test.verdict),
        showlegend=False,
        marker={"color": colour, "opacity": [1.0 if used else 0.35 for used in test.judged]},
        width=0.5,
    )
    made.add_trace(bars, row=row, col=1)


def residual_spectra(item: ResidualSpectra, output: str) -> go.PlotFigure:
    """Draw the spectrum of a residual with its bounds, and its coherence with each input.

    Parameters
    ----------
    item : ResidualSpectra
        Result of `flightid.validation.residual_spectra`.
    output : str
        Output whose residual is drawn.

    Returns
    -------
    PlotFigure
    """
    place = item.outputs.index(output)
    made = look.figure(2)
    for edge in look.band(
        "residual", item.omega_rad_s, item.low[place], item.high[place], colour=look.RIVAL
    ):
        made.add_trace(edge, row=1, col=1)
    made.add_trace(
        look.line("residual", item.omega_rad_s, item.density[place], colour=look.RIVAL),
        row=1,
        col=1,
    )
    for index, name in enumerate(item.inputs):
        curve = look.line(
            name,
            item.omega_rad_s,
            item.coherence[place, index],
            colour=look.SERIES[index % len(look.SERIES)],
            dash=look.DASHES[index % len(look.DASHES)],
        )
        made.add_trace(curve, row=2, col=1)
    limit = item.coherence_limit[place, 0]
    made.add_trace(
        look.line("chance, 95 %", item.omega_rad_s, limit, colour=look.TRUTH, dash="dash"),
        row=2,
        col=1,
    )
    titles = [_density_title(f"{output} error", item.units[output]), "coherence with input"]
    look.label_axes(made, x="frequency [rad/s]", y=titles, log_x=True)
    made.update_yaxes(type="log", row=1, col=1)
    return made


def spectrum_comparison(item: SpectrumComparison) -> go.PlotFigure:
    """Draw measured and predicted spectra of each output, with their peaks marked.

    Parameters
    ----------
    item : SpectrumComparison
        Result of `flightid.validation.compare_spectra`.

    Returns
    -------
    PlotFigure
    """
    made = look.figure(len(item.outputs))
    for row, name in enumerate(item.outputs, start=1):
        place, first = row - 1, row == 1
        omega = item.omega_rad_s
        for edge in look.band(
            "measured", omega, item.low[place], item.high[place], colour=look.MEASURED
        ):
            made.add_trace(edge, row=row, col=1)
        for series, values, colour, dash in (
            ("measured", item.measured[place], look.MEASURED, "solid"),
            ("model", item.predicted[place], look.MODEL, "dash"),
        ):
            made.add_trace(
                look.line(series, omega, values, colour=colour, dash=dash, legend=first),
                row=row,
                col=1,
            )
        peaks = [peak for peak in item.peaks if peak.output == name and peak.omega_rad_s]
        marks = go.Scatter(
            x=[peak.omega_rad_s for peak in peaks],
            y=[peak.density for peak in peaks],
            name="measured peak",
            showlegend=first,
            mode="markers",
            marker={"color": look.MEASURED, "symbol": "triangle-up", "size": 9},
        )
        made.add_trace(marks, row=row, col=1)
    titles = [_density_title(name, item.units[name]) for name in item.outputs]
    look.label_axes(made, x="frequency [rad/s]", y=titles, log_x=True)
    made.update_yaxes(type="log")
    look.hertz_above(made)
    return made


def _density_title(quantity: str, unit: str) -> str:
    return f"{quantity} [{f'({unit})²' if unit not in ('', '1') else '1'}/Hz]"

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import plotly.graph_objects
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.fit import EstimateBar, parameter_intervals
from flightid.plot.frequency_response import Curve, bode, bode_page
from flightid.plot.pictures import record_history
from flightid.plot.record import Panel, Trace, thinned, time_histories
from flightid.responses.response_band import TAKEN_OUT, ResponseIntervals
from tests.closeness import assert_close

OMEGA = np.geomspace(0.5, 50, 40)


def _curve(name: str, response: np.ndarray, **options: object) -> Curve:
    return Curve(name, OMEGA, response, **options)  # type: ignore[arg-type]


def test_bode_shows_gain_in_db_and_phase_in_degrees_with_bands() -> None:
    response = 10.0 / (1j * OMEGA + 5.0)
    error = np.full(OMEGA.size, 0.05)
    made = bode([_curve("measured", response, coherence=1 - error, random_error=error)], unit="x")
    gain = next(trace for trace in made.data if trace.yaxis == "y" and trace.line.width)
    phase = next(trace for trace in made.data if trace.yaxis == "y2" and trace.line.width)
    assert_close(gain.y, 20 * np.log10(np.abs(response)), rtol=1e-12, why="same arithmetic")
    assert_close(phase.y, np.degrees(np.angle(response)), rtol=1e-12, why="no wrap here")
    low, high = (trace for trace in made.data if trace.yaxis == "y2" and not trace.line.width)
    assert_close(
        np.asarray(high.y) - np.asarray(low.y),
        2 * np.degrees(1.959963984540054 * error),
        rtol=1e-9,
        why="a 95 % band is 2 x 1.96 sigma wide",
    )
    assert made.layout.yaxis3.title.text == "coherence"
    assert made.layout.yaxis.title.text == "gain [dB re x]"


def test_phases_of_one_plot_lie_on_one_turn() -> None:
    response = np.exp(-0.3j * OMEGA) / (1j * OMEGA)
    made = bode([_curve("a", response), _curve("b", response * np.exp(2j * np.pi) * 1.1)])
    shifted = bode([_curve("a", response), _curve("b", np.conj(np.conj(response)) * -1)])
    first, second = (np.asarray(trace.y) for trace in made.data if trace.yaxis == "y2")
    assert_close(first, second, atol=1e-9, why="one turn more is the same phase")
    first, second = (np.asarray(trace.y) for trace in shifted.data if trace.yaxis == "y2")
    assert np.all(np.abs(first - second) < 181)


def test_a_random_error_above_one_draws_a_finite_band() -> None:
    made = bode([_curve("weak", np.ones(OMEGA.size) + 0j, random_error=np.full(OMEGA.size, 3.0))])
    for trace in made.data:
        assert np.all(np.isfinite(np.asarray(trace.y)))


@given(
    st.integers(min_value=1, max_value=5000),
    st.integers(min_value=4, max_value=600),
    st.integers(min_value=0, max_value=2**32 - 1),
)
def test_thinning_keeps_every_extreme(n: int, maximum: int, seed: int) -> None:
    samples = np.random.default_rng(seed).normal(size=n)
    time_s = np.arange(n) / 100
    kept_time, kept = thinned(time_s, samples, maximum)
    assert kept.size <= max(maximum, 1) or n <= maximum
    assert kept.min() == samples.min()
    assert kept.max() == samples.max()
    assert np.all(np.diff(kept_time) > 0)


def test_time_histories_name_each_series_once() -> None:
    time_s = np.arange(10) / 10
    panels = [
        Panel(
            f"{name} [rad/s]", (Trace("measured", time_s, time_s), Trace("model", time_s, time_s))
        )
        for name in ("p", "q")
    ]
    made = time_histories(panels)
    assert [trace.name for trace in made.data if trace.showlegend] == ["measured", "model"]
    assert made.layout.xaxis2.title.text == "time [s]"


def test_a_record_alone_has_no_legend_of_lines_that_look_alike() -> None:
    record = fid.Record.from_arrays([0.0, 0.1], inputs={"u": [0, 1]}, outputs={"y": [0, 2]})
    made = record_history(record)
    assert made.layout.showlegend is False
    assert [axis.title.text for axis in made.select_yaxes()] == ["u", "y"]


def test_parameter_intervals_are_relative_and_mark_the_truth() -> None:
    made = parameter_intervals(
        [EstimateBar("K", -9.0, -11.0, -8.0, truth=-10.0), EstimateBar("tau", 0.02, 0.01, 0.03)]
    )
    estimates, truth = made.data
    assert_close(estimates.x, [-10.0, 0.0], atol=1e-9, why="percent of the reference")
    assert_close(estimates.error_x.array, [20.0, 50.0], atol=1e-9, why="to the far edge")
    assert_close(estimates.error_x.arrayminus, [10.0, 50.0], atol=1e-9, why="to the near edge")
    assert list(truth.y) == ["K"]


def test_intervals_are_drawn_on_the_turn_of_their_response() -> None:
    response = np.full(OMEGA.size, 2.0 + 0.0j)
    wide = np.stack([np.full(OMEGA.size, 1.0), np.full(OMEGA.size, 5.0)])
    turned = np.full(OMEGA.size, 2.0 * np.pi)
    intervals = ResponseIntervals(
        OMEGA, response, wide, np.stack([turned - 0.1, turned + 0.1]), TAKEN_OUT
    )
    made = bode([_curve("measured", response, intervals=intervals)])
    gains = [each for each in made.data if each.yaxis == "y"]
    phases = [each for each in made.data if each.yaxis == "y2"]
    assert len(gains) == len(phases) == 3, "a line, and a band of two edges"
    assert_close(
        max(each.y.max() for each in gains), 20 * np.log10(5.0), rtol=1e-12, why="same arithmetic"
    )
    assert_close(
        max(each.y.max() for each in phases),
        np.degrees(0.1),
        rtol=1e-9,
        why="a whole turn is taken off",
    )


def test_figures_are_what_plotly_takes(tmp_path: Path) -> None:
    made = go.PlotFigure(2, 2, row_heights=(2, 1), column_titles=("a", "b"), shared_x=True)
    made.add_traces([go.Bar(x=[1, 2], y=[3, np.nan])], rows=1, cols=2)
    made.add_trace(go.Heatmap(z=np.eye(2), x=["p", "q"]), row=2, col=1)
    made.add_trace(go.Contour(z=np.eye(3, dtype=np.int64)), row=2, col=2)
    made.add_hline(1.0, row=1, col=2, annotation_text="here", annotation_position="top left")
    made.add_vline(2.0, row=2, col=1, line={"dash": "dot"})
    made.add_vrect(0.0, 1.0, row=2, fillcolor="red", line_width=0)
    made.update_xaxes(title_text="x", type="log", row=2, col=1)
    theirs = plotly.graph_objects.Figure(json.loads(made.to_json()))
    assert (theirs.data[1].xaxis, theirs.data[1].yaxis) == ("x3", "y3")
    assert theirs.layout.xaxis3.title.text == "x"
    assert (theirs.layout.xaxis2.matches, theirs.layout.yaxis.domain) == ("x4", (0.38, 1.0))
    here, left, right = (each for each in theirs.layout.shapes if each.type != "line" or each.y0)
    assert (here.xref, here.yref, here.y0) == ("x2 domain", "y2", 1.0)
    assert [(each.xref, each.yref, each.line.width) for each in (left, right)] == [
        ("x3", "y3 domain", 0),
        ("x4", "y4 domain", 0),
    ]
    note = theirs.layout.annotations[-1]
    assert (note.x, note.xref, note.yanchor) == (0.0, "x2 domain", "bottom")
    assert made.to_dict()["data"][0]["y"] == [3, None]
    page = made.write_html(tmp_path / "a.html").read_text()
    assert "plotly.js (cartesian - minified) v4.1.1" in page


def test_bode_greys_what_lies_beyond_the_band_and_shows_hertz() -> None:
    whole = _curve("measured", 1.0 / (1j * OMEGA), coherence=np.ones(OMEGA.size))
    made = bode([whole, _curve("model", 1.0 / (1j * OMEGA))], band_rad_s=(2.0, 20.0))
    grey = [(each.x0, each.x1) for each in made.layout.shapes if each.type == "rect"]
    assert grey == [(OMEGA[0], 2.0)] * 3 + [(20.0, OMEGA[-1])] * 3
    hertz = made.layout["xaxis99"]
    place = hertz.ticktext.index("2")
    assert_close(hertz.tickvals[place], 4.0 * np.pi, rtol=1e-12, why="2 Hz in rad/s")
    assert [each.name for each in made.data if each.xaxis == "x99"] == ["model"]


@pytest.mark.parametrize("height_px", [300, 580, 900])
def test_a_legend_begins_above_the_axis_in_hertz(height_px: int) -> None:
    """Its place is a share of the plots' height: in a low picture it lay on that axis' title."""
    made = look.figure(height_px=height_px)
    made.add_trace(look.line("measured", [1.0, 2.0], [1.0, 2.0], colour=look.BLACK))
    look.hertz_above(made)
    inner_px = height_px - made.layout.margin["t"] - made.layout.margin["b"]
    above_px = (made.layout.legend["y"] - 1.0) * inner_px
    assert_close(above_px, 42.0, rtol=1e-9, why="ticks, numbers and title of 11 px")
    assert made.layout.margin["t"] > above_px + 20.0


def test_many_responses_share_a_page_of_small_plots() -> None:
    curve = _curve("measured", 1.0 / (1j * OMEGA), coherence=np.ones(OMEGA.size))
    names = ["p/lat", "q/lon", "r/ped", "w/col"]
    made = bode_page({name: [curve] for name in names}, bands_rad_s={"w/col": (2.0, 60.0)})
    assert [each.text for each in made.layout.annotations] == [f"<b>{name}</b>" for name in names]
    assert made.layout.annotations[3].xref == "x10 domain"
    assert {each.xref for each in made.layout.shapes if each.type == "rect"} == {
        "x10",
        "x13",
        "x16",
    }
    assert [bool(each.visible) for each in made.select_yaxes(row=4)] == [True, False, False]
    assert sum(bool(each.showlegend) for each in made.data) == 1


def test_rows_with_axes_of_their_own_have_room_for_numbers() -> None:
    made = look.figure(5, shared_x=False, height_px=1060)
    ends = [axis.domain for axis in made.select_yaxes()]
    inner = 1060 - 90
    for above, below in pairwise(ends):
        assert_close(inner * (above[0] - below[1]), 36.0, rtol=0.03, why="px for the numbers")

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from flightid.plot.fit import EstimateBar, parameter_intervals
from flightid.plot.frequency_response import Curve, bode
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


def test_parameter_intervals_are_relative_and_mark_the_truth() -> None:
    made = parameter_intervals(
        [EstimateBar("K", -9.0, -11.0, -8.0, truth=-10.0), EstimateBar("tau", 0.02, 0.01, 0.03)]
    )
    estimates, truth = made.data
    assert_close(estimates.x, [-10.0, 0.0], atol=1e-9, why="percent of the reference")
    assert_close(estimates.error_x.array, [20.0, 50.0], atol=1e-9, why="to the far edge")
    assert_close(estimates.error_x.arrayminus, [10.0, 50.0], atol=1e-9, why="to the near edge")
    assert list(truth.y) == ["K"]


def test_intervals_are_drawn_about_their_own_centre() -> None:
    response = np.full(OMEGA.size, 2.0 + 0.0j)
    wide = np.stack([np.full(OMEGA.size, 3.0), np.full(OMEGA.size, 5.0)])
    turned = np.full(OMEGA.size, 2.0 * np.pi)
    intervals = ResponseIntervals(
        OMEGA, 2.0 * response, wide, np.stack([turned - 0.1, turned + 0.1]), TAKEN_OUT
    )
    made = bode([_curve("measured", response, intervals=intervals)])
    gains = [each for each in made.data if each.yaxis == "y"]
    phases = [each for each in made.data if each.yaxis == "y2"]
    centre = [each.y for each in gains if each.name == "measured, leakage taken out"]
    assert_close(
        np.array(centre),
        np.full((1, OMEGA.size), 20 * np.log10(4.0)),
        rtol=1e-12,
        why="same arithmetic",
    )
    assert_close(
        max(each.y.max() for each in gains), 20 * np.log10(5.0), rtol=1e-12, why="same arithmetic"
    )
    assert_close(
        max(each.y.max() for each in phases),
        np.degrees(0.1),
        rtol=1e-9,
        why="a whole turn is taken off",
    )

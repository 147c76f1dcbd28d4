"""Responses of a closed loop end where their sweep does, although coherence goes on; NumPy's."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flightid as fid
from flightid.plot.response import response_figure
from flightid.responses.excited_band import excited_to

STEP_S, HIGHEST_HZ = 0.005, 4.0


def _flown(gain: float) -> fid.Record:
    """A damped rate that a controller of high gain feeds back, swept to 4 Hz, gusts above it."""
    random, time_s = np.random.default_rng(0), np.arange(12_000) * STEP_S
    sweep = np.sin(2.0 * np.pi * (0.1 + 0.5 * (HIGHEST_HZ - 0.1) * time_s / time_s[-1]) * time_s)
    rate, rows = 0.0, np.zeros((2, time_s.size))
    for k in range(time_s.size):
        seen = rate + 0.02 * random.standard_normal()
        rows[:, k] = sweep[k] - gain * seen, seen
        rate += STEP_S * (-2.0 * rate + 20.0 * rows[0, k])
    return fid.Record.from_arrays(time_s, inputs={"u": rows[0]}, outputs={"p": rows[1]})


@pytest.mark.parametrize("loop", ["closed", "open", None])
def test_the_usable_band_of_a_closed_loop_ends_with_its_sweep(loop: str | None) -> None:
    response = fid.estimate_response(_flown(1.0), loop=loop, band_rad_s=(1.0, 250.0))
    pair = response.pair("p", "u")
    beyond = response.omega_rad_s > 2.0 * math.tau * HIGHEST_HZ
    assert np.median(pair.coherence[0:][beyond]) > 0.9
    said = [each for each in response.findings if each.code == "excitation-ends"]
    (row,) = response.summary().rows
    greyed = response_figure(response, [("p", "u")]).layout["shapes"] or ()
    boxes = [each for each in greyed if each["type"] == "rect"]
    if loop == "open":
        assert math.isinf(excited_to(response, "u"))
        assert not said
        assert not boxes
        assert row[4] > 200.0
        return
    end = excited_to(response, "u") / math.tau
    assert 0.8 * HIGHEST_HZ < end < 1.6 * HIGHEST_HZ
    assert row[4] == excited_to(response, "u")
    told = response.summary().notes
    if loop is None:
        assert response.loop is not None
        assert response.loop.loop == "unknown"
        assert "which no test could rule out" in said[0].message
        assert any("bends this direct estimate" in each for each in told)
    else:
        assert "a closed loop feeds back" in said[0].message
        assert not any("bends this direct estimate" in each for each in told)
    assert {each["x0"] for each in boxes} == {excited_to(response, "u")}


def test_a_pair_that_holds_nothing_is_said_so_in_words() -> None:
    """Coherences of a millionth made "1.124e+06 %" of a table: no number, and the reason below."""
    omega = np.geomspace(1.0, 20.0, 40)
    error = np.full((2, 1, 40), 0.03)
    error[1, 0, 10:] = 1e4
    response = fid.FrequencyResponse.from_values(
        omega, np.ones((2, 1, 40), complex), inputs=["u"], outputs=["p", "q"], random_error=error
    )
    table = response.summary()
    assert [row[-1] for row in table.rows] == [pytest.approx(3.0), None]
    (note,) = (each for each in table.notes if "median random error" in each)
    assert "q/u" in note
    assert "p/u" not in note
    assert "as large as the response" in note

"""Spectra and amplitudes of inputs as they are drawn."""

from __future__ import annotations

import numpy as np

import flightid as fid
from tests.closeness import assert_close


def test_power_and_shares_are_those_of_the_input() -> None:
    """A PRBS stands at its two levels; all power of what moves is under its spectrum."""
    prbs = fid.excitation.prbs(
        order=8, clock_hz=10.0, amplitude=0.2, sample_rate_hz=100.0, unit="deg", names=("da",)
    )
    record = fid.Record.from_excitation(prbs)
    assert (record.unit("da"), record.hold) == ("deg", "zero")
    spectrum, bars = fid.plot.input_figure(record).data
    shares = np.array(bars.y)
    assert_close(shares.sum(), 100.0, rtol=1e-12, why="every sample is counted once")
    assert np.count_nonzero(shares) <= 3
    hz, density = np.array(spectrum.x) / (2 * np.pi), np.array(spectrum.y)
    power = np.sum(0.5 * (density[1:] + density[:-1]) * np.diff(hz))
    assert_close(power, np.var(record["da"]), rtol=0.05, why="Parseval, smoothed by third octaves")
    named = {axis.title.text for axis in fid.plot.input_figure(record).select_xaxes()}
    assert {"da [deg]", "frequency [rad/s]"} <= named
    ticks = next(iter(fid.plot.input_figure(record).select_xaxes(col=1))).ticktext
    assert "10<br>1.6 Hz" in ticks


def test_inputs_that_rest_are_left_out() -> None:
    time_s = np.arange(400) / 20.0
    record = fid.Record.from_arrays(time_s, inputs={"u": np.sin(time_s), "v": 0 * time_s})
    assert [trace.name for trace in fid.plot.input_figure(record).data] == ["u", "u"]

"""Behaviour of designed inputs: promises that hold for every option, and refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid import excitation
from flightid.errors import DataError, OptionError, ShapeError
from flightid.excitation import Excitation
from tests.closeness import assert_close
from tests.examples import examples


@examples(40)
@given(
    low=st.floats(0.3, 3.0),
    ratio=st.floats(2.0, 20.0),
    amplitude=st.floats(0.01, 10.0),
    noise=st.floats(0.0, 0.5),
    hold=st.floats(0.0, 3.0),
)
def test_a_sweep_keeps_its_amplitude_and_begins_and_ends_in_trim(
    low: float, ratio: float, amplitude: float, noise: float, hold: float
) -> None:
    made = excitation.sweep(
        band_rad_s=(low, low * ratio),
        amplitude=amplitude,
        duration_s=120.0,
        sample_rate_hz=40.0,
        noise_fraction=noise,
        hold_cycles=hold,
    )
    assert made.peak[0] <= amplitude * (1 + 1e-12)
    assert made.signals[0, 0] == 0.0
    assert abs(made.signals[0, -1]) <= 1e-12 * amplitude


@examples(15)
@given(
    n_inputs=st.integers(1, 4),
    low=st.floats(1.0, 3.0),
    width=st.floats(9.0, 15.0),
    seed=st.integers(0, 5),
)
def test_multisines_are_orthogonal_start_at_zero_and_keep_their_amplitude(
    n_inputs: int, low: float, width: float, seed: int
) -> None:
    made = excitation.multisine(
        band_rad_s=(low, low + width),
        amplitude=0.2,
        period_s=8.0,
        sample_rate_hz=50.0,
        names=tuple(f"u{index}" for index in range(n_inputs)),
        starts=1,
        seed=seed,
    )
    apart = ~np.eye(n_inputs, dtype=bool)
    assert np.all(np.abs(made.correlation()[apart]) < 1e-12)
    assert np.all(np.abs(made.signals[:, 0]) < 1e-12)
    assert_close(made.peak, np.full(n_inputs, 0.2), rtol=1e-12, why="the amplitude is the peak")


@examples(20)
@given(amplitude=st.floats(0.01, 5.0), seed=st.integers(0, 99), low=st.floats(0.5, 2.0))
def test_noise_stays_in_its_band_and_below_its_amplitude(
    amplitude: float, seed: int, low: float
) -> None:
    made = excitation.noise(
        band_rad_s=(low, 12.0),
        amplitude=amplitude,
        duration_s=40.0,
        sample_rate_hz=25.0,
        seed=seed,
    )
    assert made.peak[0] <= amplitude * (1 + 1e-12)
    spectrum = made.spectrum()
    outside = (spectrum.omega_rad_s < low) | (spectrum.omega_rad_s > 12.0)
    assert np.max(spectrum.density[0, outside]) < 1e-25 * amplitude**2 + 1e-20
    again = excitation.noise(
        band_rad_s=(low, 12.0), amplitude=amplitude, duration_s=40.0, sample_rate_hz=25.0, seed=seed
    )
    assert np.array_equal(made.signals, again.signals)


@examples(20)
@given(
    widths=st.lists(st.integers(1, 4), min_size=1, max_size=6),
    amplitude=st.floats(0.01, 5.0),
)
def test_a_multistep_peaks_at_its_amplitude(widths: list[int], amplitude: float) -> None:
    made = excitation.multistep(amplitude=amplitude, step_s=0.1, sample_rate_hz=50.0, widths=widths)
    assert_close(made.peak[0], amplitude, rtol=1e-12, why="the largest level is the amplitude")
    assert np.count_nonzero(made.signals[0]) == 5 * sum(widths)


def test_uniform_noise_holds_its_levels() -> None:
    made = excitation.uniform_noise(
        clock_hz=5.0, amplitude=2.0, duration_s=10.1, sample_rate_hz=50.0, seed=0, names=("a", "b")
    )
    levels = made.signals[:, :500].reshape(2, 50, 10)
    assert np.all(levels == levels[:, :, :1])
    assert made.n_samples == 505
    assert np.max(made.peak) <= 2.0


def test_whole_run_of_the_chirp_waits_a_second_and_ends_in_silence() -> None:
    chirp = excitation.ardupilot_chirp(
        magnitude=0.15,
        start_hz=0.05,
        stop_hz=5.0,
        record_s=130.0,
        fade_in_s=5.0,
        fade_out_s=5.0,
        whole_run=True,
    )
    assert_close(chirp.time_s[-1], 181.0, atol=1e-9, why="1 + 130 + 5 + 40 + 5 s")
    assert not np.any(chirp.signals[0, : 400 + 1])
    assert not np.any(chirp.signals[0, 131 * 400 + 1 :])
    assert chirp.unit == "1"


@pytest.mark.parametrize(
    ("axis", "unit"), [(1, "deg"), (3, "deg/s"), (7, "deg/s"), (13, "1"), (14, "m"), (18, "m/s")]
)
def test_chirp_unit_follows_its_axis(axis: int, unit: str) -> None:
    made = excitation.ardupilot_chirp(
        magnitude=1.0, start_hz=1.0, stop_hz=5.0, record_s=5.0, fade_in_s=1.0, fade_out_s=1.0,
        axis=axis, sample_rate_hz=50.0,
    )  # fmt: skip
    assert made.unit == unit


def test_coverage_finds_a_hole_and_a_roof() -> None:
    low = excitation.noise(
        band_rad_s=(1.0, 10.0), amplitude=1.0, duration_s=200.0, sample_rate_hz=50.0, seed=1
    )
    assert low.coverage()[0] > 97.0
    share = low.coverage((1.0, 100.0))[0]
    assert_close(share, 50.0, atol=6.0, why="one decade of two, smoothed by a third of an octave")


def test_coherence_between_inputs_tells_copies_from_orthogonal_inputs() -> None:
    apart = excitation.multisine(
        band_rad_s=(1.0, 12.0), amplitude=1.0, period_s=20.0, sample_rate_hz=50.0,
        names=("a", "b"), optimise=False,
    )  # fmt: skip
    assert apart.coherence()[0, 1] < 0.05
    same = Excitation(
        np.vstack([apart.signals[0], 2 * apart.signals[0]]), 0.02, ("a", "b"), "1", "copy", (1, 12)
    )
    assert_close(same.coherence()[0, 1], 1.0, rtol=1e-9, why="one signal twice")
    assert_close(same.correlation()[0, 1], 1.0, rtol=1e-12, why="one signal twice")


def test_result_shows_itself() -> None:
    made = excitation.multisine(
        band_rad_s=(0.2, 12.0), amplitude=0.1, period_s=20.0, sample_rate_hz=50.0,
        names=("a", "b"), optimise=False, periods=2,
    )  # fmt: skip
    text = str(made.summary())
    assert "relative peak factor" in text
    assert "Between inputs" in text
    assert "one-cycle-in-a-period" not in text
    assert made.findings[0].code == "one-cycle-in-a-period"
    plain = json.loads(json.dumps(made.to_dict(), allow_nan=False))
    assert plain["schema"] == "flightid.excitation/1"
    assert "<table>" in made._repr_html_()
    assert set(made.by_name) == {"a", "b"}
    with pytest.raises(ValueError, match="read-only"):
        made.signals[0, 0] = 1.0


def _sweep(**changes: object) -> Excitation:
    options: dict[str, object] = {
        "band_rad_s": (1.0, 20.0), "amplitude": 1.0, "duration_s": 60.0, "sample_rate_hz": 50.0,
    }  # fmt: skip
    return excitation.sweep(**{**options, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"band_rad_s": (2.0, 1.0)}, "band does not fit the sample rate"),
        ({"band_rad_s": (2.0, 200.0)}, "band does not fit the sample rate"),
        ({"amplitude": 0.0}, "amplitude must be positive"),
        ({"amplitude": float("nan")}, "amplitude must be positive"),
        ({"noise_fraction": -0.1}, "noise_fraction must not be negative"),
        ({"duration_s": 60.003}, "duration is not a whole number of samples"),
        ({"duration_s": 10.0}, "the record is too short for the dwell and the fades"),
    ],
)
def test_sweep_refuses(changes: dict[str, object], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        _sweep(**changes)


def test_designs_refuse_what_has_no_meaning() -> None:
    with pytest.raises(OptionError, match="no such sequence"):
        excitation.prbs(order=1, clock_hz=1.0, amplitude=1.0, sample_rate_hz=10.0)
    with pytest.raises(OptionError, match="one level at this clock is not a whole number"):
        excitation.prbs(order=5, clock_hz=3.0, amplitude=1.0, sample_rate_hz=10.0)
    with pytest.raises(OptionError, match="too few harmonics of the period"):
        excitation.multisine(
            band_rad_s=(1.0, 2.0), amplitude=1.0, period_s=5.0, sample_rate_hz=10.0
        )
    with pytest.raises(ShapeError, match="power does not fit the harmonics"):
        excitation.multisine(
            band_rad_s=(1.0, 9.0), amplitude=1.0, period_s=5.0, sample_rate_hz=10.0,
            power=lambda omega: 1.0,
        )  # fmt: skip
    with pytest.raises(OptionError, match="relative power must be positive"):
        excitation.multisine(
            band_rad_s=(1.0, 9.0), amplitude=1.0, period_s=5.0, sample_rate_hz=10.0,
            power=lambda omega: 0 * omega,
        )  # fmt: skip
    with pytest.raises(OptionError, match="no harmonic of the record"):
        excitation.noise(
            band_rad_s=(1.0, 1.1), amplitude=1.0, duration_s=2.0, sample_rate_hz=10.0, seed=0
        )
    with pytest.raises(ShapeError, match="levels do not fit widths"):
        excitation.multistep(amplitude=1.0, step_s=1.0, sample_rate_hz=10.0, levels=[1.0])
    with pytest.raises(ShapeError, match="levels do not fit widths"):
        excitation.multistep_energy(1.0, widths=[1, 1], levels=[1.0], step_s=1.0)
    with pytest.raises(OptionError, match="SID_AXIS has no such value"):
        excitation.ardupilot_chirp(
            magnitude=1.0, start_hz=1.0, stop_hz=5.0, record_s=5.0, fade_in_s=1.0, fade_out_s=1.0,
            axis=20,
        )  # fmt: skip
    with pytest.raises(OptionError, match="chirp record length"):
        excitation.ardupilot_chirp(
            magnitude=1.0, start_hz=0.1, stop_hz=5.0, record_s=5.0, fade_in_s=1.0, fade_out_s=1.0
        )


def test_excitation_refuses_signals_that_mean_nothing() -> None:
    good = np.array([[0.0, 1.0]])
    with pytest.raises(ShapeError, match="signals do not fit the names"):
        Excitation(good, 0.1, ("a", "b"), "1", "x", (1.0, 2.0))
    with pytest.raises(DataError, match="not finite"):
        Excitation(good * np.nan, 0.1, ("a",), "1", "x", (1.0, 2.0))
    with pytest.raises(OptionError, match="sample time or band has no meaning"):
        Excitation(good, 0.0, ("a",), "1", "x", (1.0, 2.0))
    silent = Excitation(good * 0, 0.1, ("a",), "1", "x", (1.0, 2.0))
    with pytest.raises(DataError, match="no peak factor"):
        _ = silent.peak_factor
    with pytest.raises(DataError, match="constant has no correlation"):
        silent.correlation()
    assert "no power" in repr(silent)
    with pytest.raises(OptionError, match="band does not fit the excitation"):
        silent.coverage((1.0, 1000.0))

"""Resampling keeps amplitude and phase, rejects aliases, and never mends unasked."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid.errors import DataError, OptionError, ShapeError, UnknownNameError
from flightid.record import GapPolicy, StampPolicy, to_uniform
from flightid.record.interpolation import HALF_LENGTH, KAISER_BETA, windowed_sinc
from tests.closeness import assert_close
from tests.examples import examples


def _phasor(time_s: np.ndarray, values: np.ndarray, frequency_hz: float) -> complex:
    """Amplitude and phase of a sine by least squares."""
    angle = 2 * np.pi * frequency_hz * time_s
    basis = np.column_stack([np.cos(angle), np.sin(angle), np.ones_like(time_s)])
    cosine, sine, _ = np.linalg.lstsq(basis, values, rcond=None)[0]
    return complex(sine, cosine)


@pytest.mark.parametrize("rate_hz", [100.0, 73.0, 37.3, 250.0, 1000.0])
@pytest.mark.parametrize("frequency_hz", [0.5, 5.0, 14.0])
def test_sine_keeps_amplitude_and_phase(rate_hz: float, frequency_hz: float) -> None:
    stamps = 3.0 + np.arange(4000) / 400
    sine = np.sin(2 * np.pi * frequency_hz * stamps + 0.3)
    span = to_uniform({"y": (stamps, sine)}, sample_time_s=1 / rate_hz).only
    middle = (span.time_s > 5) & (span.time_s < 11)
    found = _phasor(span.time_s[middle], span.samples["y"][middle], frequency_hz)
    assert_close(found, np.exp(0.3j), atol=3e-5, why="100 dB kernel ripple")


@pytest.mark.parametrize("frequency_hz", [26.0, 49.0, 75.0, 110.0, 199.0])
def test_aliases_are_rejected_by_60_db(frequency_hz: float) -> None:
    stamps = np.arange(8000) / 400
    sine = np.sin(2 * np.pi * frequency_hz * stamps)
    span = to_uniform({"y": (stamps, sine)}, sample_time_s=1 / 50).only
    middle = span.samples["y"][50:-50]
    assert np.max(np.abs(middle)) < 1e-3, "-60 dB"


def test_jittered_stamps_are_honoured() -> None:
    random = np.random.default_rng(1)
    stamps = np.arange(6000) / 300 + random.uniform(-0.4, 0.4, 6000) / 300
    stamps.sort()
    sine = np.sin(2 * np.pi * 7 * stamps + 0.3)
    span = to_uniform({"y": (stamps, sine)}, sample_time_s=0.01).only
    truth = np.sin(2 * np.pi * 7 * span.time_s + 0.3)
    assert_close(span.samples["y"][50:-50], truth[50:-50], atol=3e-4, why="spline at 43 per period")


@pytest.mark.parametrize("method", ["linear", "cubic", "band-limited"])
def test_interpolation_choices_pass_through_a_line(method: str) -> None:
    stamps = np.arange(50) / 10
    span = to_uniform(
        {"y": (stamps, 3 * stamps + 1)}, sample_time_s=0.03, interpolation=method
    ).only
    assert_close(span.samples["y"], 3 * span.time_s + 1, atol=2e-4, why="a line, ends included")


def test_previous_value_holds_and_is_never_filtered() -> None:
    stamps = np.arange(101) / 100
    mode = np.where(stamps < 0.5, 3.0, 7.0)
    span = to_uniform(
        {"mode": (stamps, mode)}, sample_time_s=0.1, interpolation={"mode": "previous"}
    ).only
    assert set(span.samples["mode"]) == {3.0, 7.0}
    assert span.samples["mode"].tolist() == [3.0] * 5 + [7.0] * 6


@given(
    values=st.lists(st.floats(-1e300, 1e300), min_size=2, max_size=60),
    step=st.floats(1e-4, 10.0),
    start=st.floats(-1e3, 1e3),
)
@examples(50)
def test_a_channel_on_the_grid_is_copied_bit_for_bit(
    values: list[float], step: float, start: float
) -> None:
    stamps = start + step * np.arange(len(values))
    base = to_uniform({"y": (stamps, values)}, sample_time_s=step)
    assert base.channels[0].done == "copied"
    assert base.only.samples["y"].tolist() == values


def test_a_constant_stays_exact_at_any_rate() -> None:
    stamps = np.arange(500) / 100
    for step in (0.004, 0.0123, 0.077):
        span = to_uniform({"y": (stamps, np.full(500, 9.81))}, sample_time_s=step).only
        assert_close(span.samples["y"], 9.81, rtol=1e-13, why="weights sum to one")


def test_reference_channel_names_the_sample_time() -> None:
    fast, slow = np.arange(1000) / 200, np.arange(250) / 50
    base = to_uniform({"a": (fast, fast), "b": (slow, slow)}, reference="b")
    assert_close(base.sample_time_s, 0.02, rtol=1e-9, why="median spacing of b")
    assert base.options["reference"] == "b"
    assert [c.done[:8] for c in base.channels] == ["low-pass", "copied"]
    assert "low-pass" in base.summary().to_text()
    assert base.to_dict()["schema"] == "flightid.uniform_base/1"
    assert base._repr_html_().startswith("<table>")


def _with_hole() -> tuple[np.ndarray, np.ndarray]:
    stamps = np.arange(1000) / 100
    keep = (stamps < 4) | (stamps > 4.5)
    return stamps[keep], np.sin(stamps[keep])


def test_gap_is_refused_by_default() -> None:
    with pytest.raises(DataError, match=r"'y' has a gap: found 1 gaps .* longest 0\.52") as caught:
        to_uniform({"y": _with_hole()}, sample_time_s=0.01)
    # The piece that it names can be taken, ends and all.
    assert "(5.48 s: span_s=[4.51, 9.99])" in str(caught.value)
    taken = to_uniform({"y": _with_hole()}, sample_time_s=0.01, span_s=(4.51, 9.99))
    assert taken.only.samples["y"].size == 549


def test_gap_splits_on_one_grid() -> None:
    whole = np.arange(1000) / 100
    base = to_uniform(
        {"y": _with_hole(), "x": (whole, np.cos(whole))}, sample_time_s=0.02, gaps="split"
    )
    assert len(base.spans) == 2
    first, second = base.spans
    assert first.time_s[-1] <= 3.99 + 1e-9
    assert second.time_s[0] >= 4.51 - 1e-9
    assert_close(second.time_s[0] / 0.02 % 1, 0, atol=1e-6, why="one grid")
    # Not truncated at the other channel's gap: the filter sees x on both sides of it.
    assert_close(first.samples["x"][-1], np.cos(first.time_s[-1]), atol=1e-5, why="neighbours")
    assert [f.code for f in base.findings] == ["gaps"]
    with pytest.raises(DataError, match="fall into several spans: found 2"):
        _ = base.only


def test_gap_is_bridged_by_a_line_up_to_the_limit() -> None:
    options = {"sample_time_s": 0.01, "gaps": GapPolicy.INTERPOLATE, "interpolation": "linear"}
    span = to_uniform({"y": _with_hole()}, max_gap_s=0.6, **options).only
    hole = (span.time_s > 4.0) & (span.time_s < 4.5)
    line = np.interp(span.time_s[hole], [3.99, 4.51], np.sin([3.99, 4.51]))
    assert_close(span.samples["y"][hole], line, atol=1e-12, why="straight line")
    with pytest.raises(DataError, match=r"needed spacings of at most 0\.3 s"):
        to_uniform({"y": _with_hole()}, max_gap_s=0.3, **options)
    with pytest.raises(OptionError, match="needs a limit"):
        to_uniform({"y": _with_hole()}, **options)


def test_samples_that_are_not_finite_are_a_hole() -> None:
    stamps = np.arange(100) / 10
    values = np.sin(stamps)
    values[40:50] = np.nan
    with pytest.raises(DataError, match="has a gap"):
        to_uniform({"y": (stamps, values)}, sample_time_s=0.1)
    base = to_uniform({"y": (stamps, values)}, sample_time_s=0.1, gaps="split")
    assert base.channels[0].n_missing == 10
    assert {f.code for f in base.findings} == {"samples-missing", "gaps"}


def test_disordered_stamps_need_a_policy() -> None:
    stamps = np.arange(100) / 10
    stamps[50], stamps[51] = stamps[51], stamps[50]
    values = 2 * stamps
    with pytest.raises(DataError, match=r"do not increase: found 1 .* index 51"):
        to_uniform({"y": (stamps, values)}, sample_time_s=0.1)
    dropped = to_uniform({"y": (stamps, values)}, sample_time_s=0.1, stamps="drop")
    assert dropped.channels[0].n_disordered == 1
    sorted_ = to_uniform({"y": (stamps, values)}, sample_time_s=0.1, stamps=StampPolicy.SORT)
    assert sorted_.only.samples["y"].tolist() == sorted(values.tolist())
    assert "stamps-disordered" in {f.code for f in sorted_.findings}


def test_heavy_jitter_and_short_spans_are_reported() -> None:
    random = np.random.default_rng(2)
    stamps = np.cumsum(random.uniform(0.5, 1.5, 200)) / 100
    base = to_uniform({"y": (stamps, stamps)}, sample_time_s=0.01, gaps="split")
    assert "jitter" in {f.code for f in base.findings}
    holed = np.concatenate([np.arange(100), [150, 151], np.arange(200, 300)]) / 100
    base = to_uniform({"y": (holed, holed)}, sample_time_s=0.02, gaps="split")
    assert "spans-dropped" in {f.code for f in base.findings}


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({}, OptionError, "found neither"),
        ({"sample_time_s": 0.1, "reference": "y"}, OptionError, "found both"),
        ({"sample_time_s": 0.0}, OptionError, "sample time is not positive"),
        ({"reference": "z"}, UnknownNameError, "the reference is no channel: found z"),
        ({"sample_time_s": 0.1, "gaps": "mend"}, OptionError, "gap policy is not known"),
        ({"sample_time_s": 0.1, "stamps": "mend"}, OptionError, "stamp policy is not known"),
        ({"sample_time_s": 0.1, "interpolation": "magic"}, OptionError, "found 'magic'"),
        (
            {"sample_time_s": 0.1, "interpolation": {"z": "linear"}},
            UnknownNameError,
            "interpolation names no channel: found z",
        ),
        ({"sample_time_s": 0.1, "span_s": (-1.0, 2.0)}, DataError, "do not cover the span"),
        ({"sample_time_s": 50.0}, DataError, "no span holds two samples"),
    ],
)
def test_refusals(options: dict, error: type[Exception], message: str) -> None:
    stamps = np.arange(100) / 10
    with pytest.raises(error, match=re.escape(message)):
        to_uniform({"y": (stamps, stamps)}, **options)


def test_refused_channels() -> None:
    with pytest.raises(ShapeError, match=r"do not have one length: found \(3,\) and \(2,\)"):
        to_uniform({"y": ([0.0, 1.0, 2.0], [0.0, 1.0])}, sample_time_s=0.1)
    with pytest.raises(DataError, match="stamps of channel 'y' are not finite"):
        to_uniform({"y": ([0.0, np.inf], [0.0, 1.0])}, sample_time_s=0.1)
    with pytest.raises(DataError, match="too few samples: found 1"):
        to_uniform({"y": ([0.0, 1.0], [0.0, np.nan])}, sample_time_s=0.1)
    with pytest.raises(OptionError, match="no channel to resample"):
        to_uniform({}, sample_time_s=0.1)


@pytest.mark.parametrize(("cutoff", "rate"), [(0.5, 1.0), (0.2, 0.45)])
@pytest.mark.parametrize("count", [1, 2, 20, 500])
def test_windowed_sinc_is_its_formula(cutoff: float, rate: float, count: int) -> None:
    random = np.random.default_rng(3)
    values = random.standard_normal(count)
    irregular = random.uniform(-3.0, count + 2.0, 300)
    half = int(np.ceil(HALF_LENGTH / rate))
    long = np.pad(values, half + 1, mode="reflect", reflect_type="odd")
    for position in (irregular, np.arange(0.0, count, 0.25)):
        nearest = np.floor(position)
        # Phases count to 1e-9 of a sample.
        distance = np.arange(-half, half + 2) - np.round(position - nearest, 9)[:, None]
        bell = np.i0(KAISER_BETA * np.sqrt(np.clip(1 - (distance / (half + 1)) ** 2, 0, None)))
        bell *= np.abs(distance) < half + 1
        weights = np.sinc(2 * cutoff * distance) * bell
        weights /= weights.sum(1, keepdims=True)
        # A line stays: the tilted window takes out what the weights' mean is off.
        tilted = bell * (distance - ((bell * distance).sum(1) / bell.sum(1))[:, None])
        late = np.sum(weights * distance, axis=1) / np.sum(tilted * distance, axis=1)
        weights -= late[:, None] * tilted
        place = nearest.astype(int)[:, None] + np.arange(2 * half + 2) + 1
        truth = np.sum(weights * long[np.clip(place, 0, long.size - 1)], axis=1)
        made = windowed_sinc(values, position, cutoff, rate)
        assert_close(made, truth, atol=1e-13, why="sums of some hundred products")

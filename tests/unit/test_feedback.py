"""One feedback test: what it says of open and closed loops, and who carries its answer."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.evidence.data_checks import _band, _windows, loop_check, loop_of_responses
from flightid.evidence.feedback import feedback_test
from flightid.responses.store import read_response, write_response
from flightid.responses.windows.defaults import CYCLES_AT_LOWEST, HIGHEST_FRACTION
from flightid.uncertainty import feedback
from flightid.uncertainty.feedback import _Pasts, _shares, _shares_at_once, find_feedback
from flightid.uncertainty.feedback_result import LEVEL, FeedbackTest, _percent
from tests.closeness import assert_close
from tests.feedback_flights import DT, flight, reference


def _test(kind: str, **options: float) -> FeedbackTest:
    u, y = flight(kind, **options)  # type: ignore[arg-type]
    return find_feedback([(u - u.mean())[None]], [(y - y.mean())[None]], ["u"])


def _record(kind: str, **options: float) -> fid.Record:
    u, y = flight(kind, n=1500, seed=3, **options)  # type: ignore[arg-type]
    return fid.Record.from_arrays(np.arange(u.size) * DT, inputs={"u": u}, outputs={"y": y})


@pytest.mark.parametrize("kind", ["white", "held", "repeating prbs", "multistep"])
def test_open_loops_with_light_damping_are_called_closed_no_more_than_stated(kind: str) -> None:
    alarms = [
        _test(kind, n=800, seed=seed, zeta=0.02, pole=0.98 * (seed % 2)).is_closed
        for seed in range(14)
    ]
    # At 1 % nominal, three of 14 has a chance of 3e-4.
    assert sum(alarms) < 3


@pytest.mark.parametrize("kind", ["white", "prbs", "sweep", "held", "multistep"])
def test_closed_loops_are_found(kind: str) -> None:
    for seed in range(5):
        found = _test(kind, n=2000, seed=seed, size=0.3, gain=1.0, integral=1.0, pole=0.9)
        assert found.is_closed
        assert found.p_value is not None
        assert found.p_value < LEVEL


def test_noise_free_smooth_and_short_records_are_not_called_closed() -> None:
    assert _test("sweep", n=1200, seed=0, size=0.0).source == "no noise"
    # What least squares with a ridge leave of so slow a sweep is as smooth as noise is long.
    u = np.sin(0.06 * (0.01 * np.arange(20_000)) ** 1.7)
    noise = 0.1 * np.random.default_rng(0).standard_normal(u.size)
    y = signal.lfilter([0.0, 0.04], [1.0, -0.96], u) + noise
    slow = find_feedback([(u - u.mean())[None]], [(y - y.mean())[None]], ["u"])
    assert (slow.loop, slow.p_value) == ("open", 1.0)
    short = _test("white", n=40, seed=0)
    assert (short.loop, short.source) == ("unknown", "too short")


def test_inputs_that_repeat_exactly_are_open_whatever_else_is_seen() -> None:
    response = fid.estimate_response(_record("repeating prbs", zeta=0.02), window_s=20.0)
    assert response.loop is not None
    assert (response.loop.loop, response.loop.source) == ("open", "repeats")


def test_the_input_that_feedback_moves_is_named() -> None:
    u, y = flight("white", n=3000, seed=1, size=0.3, gain=1.0, integral=1.0, pole=0.9)
    free = np.random.default_rng(0).standard_normal(u.size)
    found = find_feedback([np.vstack([free, u])], [np.vstack([y, free])], ["free", "fed"])
    assert (found.loop, found.input) == ("closed", "fed")


def test_several_records_count_as_one_sample() -> None:
    parts = [flight("white", n=500, seed=s, size=0.5, gain=1.0, pole=0.9) for s in range(8)]
    one = find_feedback([parts[0][0][None]], [parts[0][1][None]], ["u"])
    all_of_them = find_feedback([u[None] for u, _ in parts], [y[None] for _, y in parts], ["u"])
    assert all_of_them.p_value is not None
    assert one.p_value is not None
    assert all_of_them.p_value < 0.01 * one.p_value


def test_a_response_carries_the_answer_and_a_file_keeps_it(tmp_path: Path) -> None:
    response = fid.estimate_response(_record("white", size=0.5, gain=1.0, pole=0.9), window_s=10.0)
    assert response.loop is not None
    assert response.loop.is_closed
    assert "loop-closed" in {finding.code for finding in response.findings}
    again = read_response(write_response(response, tmp_path / "a.nc"))
    assert (again.loop, again.input_shape) == (response.loop, response.input_shape)


def test_an_open_loop_is_said_without_the_share_of_chance() -> None:
    response = fid.estimate_response(_record("white"), window_s=10.0)
    said = "no loop seen: past noise of the outputs explains no more of the inputs than chance may"
    power = r"; one that makes [\d.]+ % of input u would be, and .* [\d.]+ standard errors"
    assert re.fullmatch(rf"{said} \(p = [\d.]+\){power}", str(response.loop))


def test_a_declared_loop_overrides_the_test() -> None:
    record = _record("white", size=0.5, gain=1.0, pole=0.9)
    for response in (
        fid.estimate_response(record, window_s=10.0, loop="open"),
        fid.estimate_response(record.declare(loop="open"), window_s=10.0),
    ):
        assert str(response.loop) == "loop open, as declared"
        assert "loop-closed" not in {finding.code for finding in response.findings}
    closed = fid.estimate_response(_record("white").declare(loop="closed"), window_s=10.0)
    assert "a loop was closed, as declared" in str(closed.findings[-1])
    with pytest.raises(OptionError, match="loop is not known"):
        fid.estimate_response(record, window_s=10.0, loop="half")  # type: ignore[arg-type]


def test_an_instrument_needs_no_open_loop() -> None:
    u, y = flight("white", n=1500, seed=3, size=0.5, gain=1.0, pole=0.9)
    r = u + 1.0 * np.concatenate([[0.0], y[:-1]])
    record = fid.Record.from_arrays(
        np.arange(u.size) * DT, inputs={"u": u}, outputs={"y": y}, excitations={"r": r}
    )
    response = fid.estimate_response(record, estimator="instrument", window_s=10.0)
    assert response.loop is not None
    assert response.loop.source == "instrument"
    assert not response.loop.is_closed


def test_residuals_of_a_direct_path_do_not_call_a_loop_within_the_sample_open() -> None:
    """y = 0.5 u + 0.3 u(t-1) + v and u = r - y: the path that is fitted takes v out of u."""
    r, v = np.random.default_rng(0).standard_normal((2, 800))
    v *= 0.5
    u, y = np.zeros(800), np.zeros(800)
    for t in range(800):
        past = 0.3 * u[t - 1] if t else 0.0
        u[t] = (r[t] - past - v[t]) / 1.5
        y[t] = past + 0.5 * u[t] + v[t]
    record = fid.Record.from_arrays(np.arange(800) * DT, inputs={"u": u}, outputs={"y": y})
    fit = fid.identify(fid.PolynomialModel.arx("u", "y", na=0, nb=2, nk=0), record)
    found = fid.residual_tests(fit)
    assert (found.feedback.loop, found.feedback.source) == ("unknown", "same sample")
    assert "cannot be told" in str(found.summary().notes)


@pytest.mark.parametrize("seed", [0, 5, 21])
def test_what_a_model_misses_is_no_noise_that_is_fed_back(seed: int) -> None:
    """Two light modes that stiffen, swept: one autoregression leaves some of a sweep as new.

    Of 300 such records 182 were called closed, and 1 is.
    """
    rng = np.random.default_rng([seed, 11])
    modes = zip([rng.uniform(0.3, 0.45), rng.uniform(0.7, 0.95)], rng.uniform(0.003, 0.02, 2),
                strict=True)  # fmt: skip
    turned = 2 * np.pi * np.cumsum(np.linspace(0.01, 0.16, 512))
    u = np.tile(np.sin(turned + rng.uniform(0, 6.28)), 3) + 1e-3 * rng.standard_normal(1536)
    y = np.zeros(u.size)
    for omega, zeta in modes:
        b, a, _ = signal.cont2discrete(([omega**2], [1, 2 * zeta * omega, omega**2]), 1.0)
        y += rng.uniform(0.3, 1) * signal.lfilter(b.ravel(), a, u)
    y += 0.01 * y.std() * (y / y.std()) ** 3
    y += 1e-3 * y.std() * rng.standard_normal(y.size)
    part = slice(512, 1024)
    record = fid.Record.from_arrays(
        np.arange(512.0), inputs={"u": u[part]}, outputs={"y": y[part]}, hold="zero"
    )
    fit = fid.identify(fid.PolynomialModel.oe("u", "y", nb=5, nf=4), record)
    left = fit.records[0].residual("y")[None]
    rows = record.matrix(["u"])
    centred = [each - each.mean() for each in (rows, left)]
    assert find_feedback([centred[0]], [centred[1]], ["u"]).loop == "open"
    assert fid.residual_tests(fit).feedback.loop == "open"
    assert fid.feedback_test(record).loop == "open"


def _noisily_measured(kind: str, seed: int) -> fid.Record:
    """A lag of two samples, noise of 5 % on its input and of 0.5 % behind it."""
    rng = np.random.default_rng([seed, 9])
    u = reference(kind, 1500, rng)
    y = signal.lfilter([0.0, 0.4], [1.0, -0.6], u)
    y += 0.005 * y.std() * rng.standard_normal(u.size)
    seen = u + 0.05 * u.std() * rng.standard_normal(u.size)
    return fid.Record.from_arrays(np.arange(1500) * DT, inputs={"u": seen}, outputs={"y": y})


def test_a_noisy_sensor_of_the_input_is_no_loop() -> None:
    """Cleaner outputs tell the input's past better than it does: all were called closed."""
    for kind in ("prbs", "sweep", "multisine"):
        record = _noisily_measured(kind, 2)
        found = fid.feedback_test(record)
        assert (found.loop, found.source) == ("unknown", "noisy input")
        assert found.p_value is not None
        assert found.p_value < LEVEL
        assert_close(found.input_noise, 0.05, rtol=0.4, why="5 % of noise, from 1,500 samples")
        assert loop_check(found).light is Light.UNKNOWN
    assert re.search(r"or [\d.]+ % of noise \(rms\) in what measured that input", str(found))
    assert "feedback-unknown" in {each.code for each in fid.advise(record).findings}
    fit = fid.identify(fid.PolynomialModel.oe("u", "y", nb=1, nf=1), record)
    assert fid.residual_tests(fit).feedback.loop != "closed"


def test_a_controller_that_answers_within_the_sample_is_not_called_open() -> None:
    noise = signal.lfilter([1.0], [1.0, -0.8], np.random.default_rng(0).standard_normal(1000))
    u, y = np.zeros(1000), np.zeros(1000)
    for k in range(2, 1000):
        y[k] = 1.6 * y[k - 1] - 0.7 * y[k - 2] + 0.06 * u[k - 1] + 0.04 * u[k - 2] + noise[k]
        u[k] = -0.8 * y[k] - 0.5 * (y[k] - y[k - 1])
    record = fid.Record.from_arrays(np.arange(1000) * DT, inputs={"u": u}, outputs={"y": y})
    found = fid.feedback_test(record)
    assert (found.loop, found.source, found.is_function_of_outputs) == (
        "unknown", "same sample", True,
    )  # fmt: skip
    fit = fid.identify(fid.PolynomialModel.arx(("u",), "y", na=2, nb=1, nk=0), record)
    loop = fit.evidence.check("loop")
    assert loop is not None
    assert loop.light is Light.RED
    # The vehicle's own feedthrough looks alike, but leaves more that moves the input.
    rng = np.random.default_rng(1)
    u = rng.standard_normal(1000)
    y = np.convolve(u, [0.5, 0.3])[:1000] + 0.3 * rng.standard_normal(1000)
    at_once = find_feedback([u[None]], [y[None]], ["u"])
    assert (at_once.loop, at_once.is_function_of_outputs) == ("unknown", False)
    assert loop_check(at_once).light is Light.UNKNOWN


def test_a_constant_input_holds_no_noise() -> None:
    u, y = flight("white", n=1000, seed=3)
    still = np.full(1000, 283.194)
    record = fid.Record.from_arrays(
        np.arange(1000) * DT, inputs={"u": u, "T": still}, outputs={"y": y}
    )
    found = fid.feedback_test(record)
    assert (found.loop, found.input) == ("open", "u")


def test_a_moved_band_asks_the_same_samples_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def counted(*arguments: Any, **options: Any) -> FeedbackTest:
        asked.append(1)
        return find_feedback(*arguments, **options)

    monkeypatch.setattr("flightid.responses.feedback.find_feedback", counted)
    u, e = np.random.default_rng(0).standard_normal((2, 4000))
    y = np.convolve(u, [0.0, 0.5, 0.3])[:4000] + e
    record = fid.Record.from_arrays(np.arange(4000) / 100, inputs={"u": u}, outputs={"y": y + 1.0})
    found = [
        fid.estimate_response(record, band_rad_s=(2.0, high), n_omega=10).loop
        for high in (40.0, 42.0)
    ]
    assert found[0] == found[1]
    assert len(asked) == 1
    fid.estimate_response(record, band_rad_s=(2.0, 10.0), n_omega=10)  # thinned otherwise
    fid.estimate_response(record, band_rad_s=(2.0, 42.0), n_omega=10, detrend="none")
    assert len(asked) == 3


def test_no_chance_is_none() -> None:
    """The sentence beside a table of advice said "(p = 0)"."""
    assert "(p < 1e-300)" in str(FeedbackTest("closed", "test", 0.0, "u", 0.4))
    assert "(p = 0.002)" in str(FeedbackTest("closed", "test", 0.002, "u", 0.4))


def test_responses_say_the_worst_of_their_loops_where_all_know() -> None:
    opened, closed = FeedbackTest("open", "declared"), FeedbackTest("closed", "declared")
    some = [cast("fid.FrequencyResponse", SimpleNamespace(loop=t)) for t in (opened, closed, None)]
    assert loop_of_responses(some[:2]) == loop_check(closed)
    assert loop_of_responses(some[:1]) == loop_check(opened)
    assert loop_of_responses(some) is None


def test_the_quick_response_spans_from_cycles_in_its_window_to_the_samples() -> None:
    record = fid.Record.from_arrays(np.arange(3000) * 0.01, outputs={"y": np.zeros(3000)})
    for records, longest_s in (([record], 20.0), ([record] * 2, 30.0)):
        found = np.array([*_windows(records), *_band(records)])
        low = CYCLES_AT_LOWEST * 2.0 * np.pi / (longest_s / 3.0)
        wanted = [longest_s / 3.0, longest_s / 15.0, low, HIGHEST_FRACTION * 200.0 * np.pi]
        assert_close(found, np.array(wanted), rtol=1e-12, why="30 s at 100 Hz")


def test_an_input_that_moves_at_its_end_is_tested() -> None:
    random = np.random.default_rng(3)
    u, e = np.zeros(400), random.standard_normal(400)
    u[-3:] = random.standard_normal((2, 3))[0]
    assert find_feedback([u[None] - u.mean()], [e[None]], ["u"]).loop == "open"


def test_past_noise_and_none_of_the_same_sample_explains_an_input(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    random = np.random.default_rng(0)
    noise = random.standard_normal((1, 2000))
    own = 0.3 * random.standard_normal((1, 2000))
    for late, share, sure in ((0, 0.0, False), (1, 1.0 / 1.09, True), (3, 1.0 / 1.09, True)):
        pair = np.roll(noise, late, axis=1) + own, noise
        ((found, chance),) = _shares([pair], [noise[:, 6:]], 6)
        assert found == pytest.approx(share, abs=0.02)
        assert (chance < LEVEL) is sure
    # Rounding explains less than nothing, or more than all: it is neither news nor an error.
    for explains, told in ((-1e-15, (0.0, 1.0)), (-1.0, (0.0, 1.0)), (1e9, (1.0, 0.0))):
        monkeypatch.setattr(feedback, "explained", lambda *_, size=explains: np.array([size]))
        assert _shares([pair], [noise[:, 6:]], 6) == [told]


def test_shares_are_cut_and_only_all_is_all() -> None:
    table = {None: "0", 0.0: "0", 0.00019: "0.01", 0.1239: "12.39", 0.99995: "99.99", 1.0: "100"}
    assert {share: _percent(share) for share in table} == table


def test_feedback_without_inputs_is_refused() -> None:
    record = fid.Record.from_arrays(np.arange(50) / 10.0, outputs={"y": np.zeros(50)})
    for inputs in (None, ()):
        with pytest.raises(DataError, match=r"needs an input and an output.*found y"):
            feedback_test(record, inputs=inputs)


def test_outputs_of_the_same_sample_explain_the_input_that_they_move() -> None:
    random = np.random.default_rng(1)
    free, own, *outputs = random.standard_normal((4, 2000))
    records = [np.array([free, 0.9 * outputs[1] + 0.3 * own, *outputs])]
    (of_free, chance), (of_moved, sure) = _shares_at_once(_Pasts(records, 3, 2))
    assert (of_free, of_moved) == pytest.approx((0.0, 0.9), abs=0.02)
    assert chance > LEVEL > sure

"""One flight given twice counts once: every method says so, and shows no bars.

Whole or in part, rounded, thinned, moved, in another unit or taken between its samples.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.evidence.copied_samples import COPIED, judge_copies
from flightid.evidence.shared_noise import RecordSeries, _met, _scaled_throughout, _transforms
from tests.strangers import noises
from tests.strangers.output_error import flight, model

METHODS = (
    "output_error",
    "equation_error",
    "fourier_regression",
    "fourier_output_error",
    "filter_error",
)


def _flown(seed: int = 1) -> fid.Record:
    return flight(seed, noises.white, duration_s=10.0)


def _said(fit: fid.Fit) -> None:
    (told,) = [each for each in fit.evidence.checks if "count twice" in each.what]
    assert str(told.light) == "red"
    assert str(fit.evidence.light) == "red"
    assert fit.covariance is None
    free = [each for each in fit.parameters.values() if each.status == "free"]
    assert all("count twice" in (each.reason or "") for each in free)
    assert "inputs-in-errors" not in [each.code for each in fit.findings]


@pytest.mark.parametrize("method", METHODS)
def test_every_method_of_equations_says_that_a_record_is_given_twice(method: str) -> None:
    record = _flown()
    _said(fid.identify(model(), [record, record], method=method))


@pytest.mark.parametrize("structure", ["arx", "oe"])
def test_black_boxes_say_it_too(structure: str) -> None:
    record, orders = _flown(), {"arx": {"na": 1, "nb": 1}, "oe": {"nb": 1, "nf": 1}}
    make = getattr(fid.PolynomialModel, structure)
    _said(fid.identify(make("da", "p", **orders[structure]), [record, record], loop="open"))


@pytest.mark.parametrize("estimator", ["composite", "local_polynomial"])
def test_so_do_fits_of_their_responses(estimator: str) -> None:
    record = _flown()
    data = fid.estimate_response(
        [record, record], band_rad_s=(1.0, 12.0), estimator=estimator, loop="open"
    )
    _said(fid.identify(model(), data))


def test_cuts_that_overlap_are_copies_in_part() -> None:
    record = _flown()
    (said,) = judge_copies([record.segment(0.0, 6.0), record.segment(4.0, 10.0)], ["p"])
    assert said.code == COPIED
    assert "records 1 and 2 hold the same 10" in said.message


def test_flights_that_are_others_are_not() -> None:
    record = _flown()
    cuts = [record.segment(0.0, 4.99), record.segment(5.0, 10.0)]
    assert not judge_copies([*cuts, _flown(2), _flown(3)], ["p"])
    # Outputs that one record lacks are not compared.
    time_s, rows = np.arange(300) * STEP_S, np.random.default_rng(6).standard_normal((3, 2, 300))
    rows[:, 1] = rows[0, 1]
    flights = [fid.Record.from_arrays(time_s, outputs={"p": p, "q": q}) for p, q in rows]
    assert judge_copies(flights, ["q"])
    for place in range(3):
        bare = fid.Record.from_arrays(time_s, outputs={"p": rows[place, 0]})
        told = [*flights[:place], bare, *flights[place + 1 :]]
        assert not judge_copies(told, ["p", "q"])


def test_rest_is_no_copy() -> None:
    time_s = np.arange(400) * 0.02
    still = np.round(np.where(time_s > 4.0, np.sin(3.0 * time_s**2), 0.0), 1)
    other = np.round(np.where(time_s > 4.0, np.cos(5.0 * time_s), 0.0), 1)
    records = [
        fid.Record.from_arrays(time_s, outputs={"p": row}, units={"p": "rad/s"})
        for row in (still, other)
    ]
    assert not judge_copies(records, ["p"])


def test_records_behind_a_response_lose_their_line_and_are_known() -> None:
    record = _flown()
    whole = fid.estimate_response(record, band_rad_s=(1.0, 12.0), loop="open")
    (said,) = judge_copies([whole, record.segment(2.0, 8.0)], ["p"])
    assert "records 1 and 2 hold the same 3" in said.message


Array = np.ndarray
STEP_S = 0.02


def _record(inputs: Array, outputs: Array, step_s: float = STEP_S) -> fid.Record:
    return fid.Record.from_arrays(
        np.arange(outputs.size) * step_s,
        inputs={"da": inputs},
        outputs={"p": outputs},
        units={"da": "rad", "p": "rad/s"},
        hold="zero",
    )


def _between(ratio: float, begin: float, step_s: float) -> Callable[[Array, Array], fid.Record]:
    """By straight lines on another grid."""

    def made(u: Array, p: Array) -> fid.Record:
        grid, places = np.arange(p.size), np.arange(begin, p.size - 1, ratio)
        return _record(np.interp(places, grid, u), np.interp(places, grid, p), step_s)

    return made


COPIES = {
    "float32": lambda u, p: _record(u, p.astype(np.float32).astype(float)),
    "four digits": lambda u, p: _record(u, np.round(p, 4)),
    "degrees": lambda u, p: _record(u, np.degrees(p)),
    "levelled": lambda u, p: _record(u, np.round(p - p.mean(), 4)),
    "later": lambda u, p: _record(u[7:], np.round(p[7:], 4)),
    "a part": lambda u, p: _record(u[100:240], np.round(p[100:240], 4)),
    "thinned": lambda u, p: _record(u[1::2], np.round(p[1::2], 4), 2.0 * STEP_S),
    "upsampled": _between(0.5, 0.0, 0.5 * STEP_S),
    "resampled": _between(1.25, 0.0, 1.25 * STEP_S),
    "between samples": _between(1.0, 0.5, STEP_S),
}


def test_where_two_errors_meet_is_where_they_go_together_most() -> None:
    """Every shift written out: samples in common of both, from the first to the last."""
    random = np.random.default_rng(3)
    noise = random.standard_normal(200)
    spike = np.r_[4.0, noise[1:-1], 4.0]
    for first, last, second in ((0, 140, 0), (0, 140, 60), (60, 200, 0), (0, 200, 70)):
        for rows in (noise, spike):
            one = rows[None, first:last] + 0.3 * random.standard_normal(last - first)
            other = rows[None, second : second + 130] + 0.3 * random.standard_normal(130)
            n, m = one.size, other.size
            met = _met(one, other, *_transforms([one, other]), 1.0)
            best = (0.0, 0, 0.0, 0)
            for shift in range(-(m - 48), n - 48 + 1):
                start, stop = max(shift, 0), min(n, m + shift)
                a, b = one[0, start:stop], other[0, start - shift : stop - shift]
                alike = abs(float(a @ b)) / float(np.sqrt((a @ a) * (b @ b)))
                score = alike * float(np.sqrt(stop - start))
                best = max(best, (score, shift, alike, stop - start + 6))
            assert met is not None
            assert (met[0], met[2]) == (best[1], best[3])
            assert met[1] == pytest.approx(best[2], rel=1e-9)


@pytest.mark.parametrize("kind", COPIES)
def test_copies_that_were_changed_share_their_noise(kind: str) -> None:
    for seed in (1, 2, 3):
        record = _flown(seed)
        copy = COPIES[kind](record.matrix(["da"])[0], record.matrix(["p"])[0])
        (said,) = judge_copies([_flown(seed + 10), record, copy], ["da", "p"])
        assert (said.code, said.light.value) == (COPIED, "red")
        assert said.message.startswith("records 2 and 3 ")
        # Of float32 some stretches stay the same to six digits of their second differences.
        scaled = ", scaled by 57.3" if kind == "degrees" else ""
        assert kind == "float32" or f"share their noise in p{scaled} (r = " in said.message


@pytest.mark.parametrize(
    ("of_inputs", "of_outputs"),
    [(1.0, 1.005), (1.0, 0.995), (1.0, 1.001), (-1.0, -1.0), (1.2, 1.2), (1000.0, 1000.0)],
)
def test_copies_in_another_scale_are_told_with_it(of_inputs: float, of_outputs: float) -> None:
    for seed in (1, 2, 3):
        record = _flown(seed)
        u, p = record.matrix(["da", "p"])
        copy = _record(of_inputs * u, of_outputs * p)
        (said,) = judge_copies([_flown(seed + 10), record, copy], ["da", "p"])
        assert (said.code, said.light.value) == (COPIED, "red")
        words = f"records 2 and 3 share their noise in p, scaled by {of_outputs:.4g} (r = 1.000"
        assert said.message.startswith(words)


def test_the_shift_is_told() -> None:
    record = _flown()
    u, p = record.matrix(["da", "p"])
    (said,) = judge_copies([_record(u[7:], np.round(p[7:], 4)), record], ["da", "p"])
    assert "at a shift of -7 samples, over 493 samples)" in said.message


@pytest.mark.parametrize("method", ["output_error", "fourier_regression"])
def test_fits_of_rounded_copies_show_no_bars(method: str) -> None:
    record = _flown()
    u, p = record.matrix(["da", "p"])
    _said(fid.identify(model(), [record, _record(u, np.round(p, 4))], method=method))


def test_nor_do_fits_of_responses_and_black_boxes() -> None:
    record = _flown()
    u, p = record.matrix(["da", "p"])
    both = [record, _record(u, p.astype(np.float32).astype(float))]
    response = fid.estimate_response(both, band_rad_s=(1.0, 12.0), loop="open")
    _said(fid.identify(model(), response))
    _said(fid.identify(fid.PolynomialModel.arx("da", "p", na=1, nb=1), both, loop="open"))


def _noise(random: np.random.Generator, kind: str, n: int) -> Array:
    white = random.standard_normal(n)
    return 0.3 * lfilter([1.0], [1.0, -0.95], white) if kind == "slow" else white


@pytest.mark.parametrize("kind", ["white", "slow", "quantised", "lacking", "quiet"])
def test_flights_of_one_sweep_are_no_copies(kind: str) -> None:
    """The same stick, and what a model lacks of the vehicle, eight times as large as the noise."""
    time_s = np.arange(400) * STEP_S
    stick = np.sin(2.0 * time_s + 0.6 * time_s**2)
    clean = lfilter([0.0, 0.06], [1.0, -0.94], stick)
    level = {"quiet": 0.001, "lacking": 0.01}.get(kind, 0.08) * clean.std()
    if kind == "lacking":
        clean = clean + 0.2 * np.abs(clean) * clean / clean.std()
    random = np.random.default_rng(3)
    for _ in range(12):
        flights = []
        for _ in range(2):
            start = random.standard_normal() * 0.94 ** np.arange(400.0)
            p = clean + level * (_noise(random, kind, 400) + start + random.standard_normal())
            flights.append(_record(stick, np.round(p, 1) if kind == "quantised" else p))
        assert not judge_copies(flights, ["da", "p"])


def test_runs_of_a_model_without_noise_are_no_copies() -> None:
    """Twice the input is twice the output: there is no noise that both could share."""
    time_s = np.arange(400) * STEP_S
    stick = np.sin(2.0 * time_s + 0.6 * time_s**2)
    clean = np.tanh(lfilter([0.0, 0.06], [1.0, -0.94], np.interp(time_s - 0.013, time_s, stick)))
    assert not judge_copies([_record(stick, clean), _record(2.0 * stick, 2.0 * clean)], ["da", "p"])


@pytest.mark.parametrize("factor", [1.0, -1.0, 1.2, 2.0])
def test_flights_and_runs_of_a_scaled_stick_are_no_copies(factor: float) -> None:
    """With noise of their own, and as runs of a linear model, which leave digits or nothing."""
    time_s = np.arange(400) * STEP_S
    stick = np.sin(2.0 * time_s + 0.6 * time_s**2)
    clean = lfilter([0.0, 0.06], [1.0, -0.94], stick)
    random = np.random.default_rng(5)
    runs = [_record(stick, clean), _record(factor * stick, factor * clean)]
    said = judge_copies(runs, ["da", "p"])
    assert bool(said) == (factor == 1.0)
    assert all("hold the same 400 samples" in each.message for each in said)
    for level in (0.001, 0.05):
        one, other = clean + level * random.standard_normal((2, 400))
        flown = [_record(stick, one), _record(factor * stick, factor * other)]
        assert not judge_copies(flown, ["da", "p"])


@pytest.mark.parametrize("level", [0.0, 2.0])
def test_records_that_hold_nothing_but_a_level_are_judged(level: float) -> None:
    still = np.full(400, level)
    assert not judge_copies([_record(still, still), _record(still, 2.0 * still)], ["da", "p"])
    # No input, or inputs of other channels, tell nothing of a factor.
    rows, others = np.random.default_rng(2).standard_normal((2, 1, 400))
    moved, rest = np.full((1, 400), 2.0), np.zeros((1, 400))
    for inputs, outputs, its, are_scaled in (
        (moved, 2.0 * rows, 2.0 * moved, True),
        (moved, 2.0 * rows, moved, False),
        (moved, 2.0 * rows, np.concatenate([2.0 * moved, rest]), False),
        (rest, others, rest, False),
    ):
        one, other = (
            RecordSeries(("p",), *pair, STEP_S) for pair in ((rows, inputs), (outputs, its))
        )
        assert _scaled_throughout(one, other) == are_scaled


def test_wind_that_two_vehicles_share_in_part_is_no_copy() -> None:
    random = np.random.default_rng(4)
    wind = random.standard_normal(400)
    flights = [
        _record(random.standard_normal(400), lfilter([1.0], [1.0, -0.9], wind + own))
        for own in 0.5 * random.standard_normal((2, 400))
    ]
    assert not judge_copies(flights, ["da", "p"])


@pytest.mark.parametrize("factor", [1.0, -1.0])
def test_fits_of_runs_without_noise_end(factor: float) -> None:
    u, p = flight(1, lambda random, n: np.zeros(n), duration_s=5.0).matrix(["da", "p"])
    runs = [_record(u, p), _record(factor * u, factor * p)]
    fit = fid.identify(model(), runs, method="equation_error")
    told = any("count twice" in each.what for each in fit.evidence.checks)
    assert told == (factor == 1.0)

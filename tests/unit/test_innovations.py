"""Innovations models and their subspace fits: recovery, prediction, choices and refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError, ModelError, OptionError
from flightid.identification.subspace.roots import may_reach_circle
from flightid.models.sampled.recursion import run_recursion
from flightid.plot.subspace import singular_values
from flightid.uncertainty.quantiles import half_width
from tests.closeness import assert_close
from tests.innovations_records import PAIR, SINGLE, flown

M = fid.InnovationsModel
OPEN = ("moesp", "n4sid", "cva")


@pytest.fixture(scope="module")
def noisy():
    structure = M.subspace(("u", "v"), ("y", "z"), offsets="none", maximum_order=6)
    records = [flown(PAIR, 1, n=600, noise=0.5), flown(PAIR, 2, n=300, noise=0.5)]
    return fid.identify(structure, records)


def test_recursion_by_doubling_is_the_recursion():
    drawn = np.random.default_rng(3)
    for radius in (0.9, 1.02):
        a = radius * np.linalg.qr(drawn.standard_normal((3, 3)))[0]
        w, x = drawn.standard_normal((3, 70)), drawn.standard_normal(3)
        expected = [x]
        for t in range(69):
            expected.append(a @ expected[-1] + w[:, t])
        assert_close(
            run_recursion(a, w, x), np.array(expected).T, rtol=1e-12, atol=1e-12, why="sum"
        )


def test_a_recursion_that_runs_away_is_told_as_far_as_it_is_finite():
    found = run_recursion(np.array([[1e150]]), np.ones((1, 5)), np.array([1.0]))
    assert np.isfinite(found[0]).tolist() == [True, True, True, False, False]


@pytest.mark.parametrize("method", OPEN)
@pytest.mark.parametrize("direct", [False, True])
def test_noise_free_records_give_the_model_back(method, direct):
    d = np.array([[0.3, -0.2], [0.1, 0.4]]) if direct else None
    a, b, c, _, k = PAIR.matrices
    truth = M(PAIR.inputs, PAIR.outputs, 0.1, a, b, c, d, k, units=PAIR.units)
    structure = M.subspace(("u", "v"), ("y", "z"), method=method, direct=direct, offsets="none")
    fit = fid.identify(structure, [flown(truth, 1, n=300), flown(truth, 2, n=200)])
    assert fit.model.order == 4
    pulses = truth.pulse_response(30)
    assert_close(fit.model.pulse_response(30), pulses, atol=1e-11, why="rounding through one SVD")
    found, wanted = (np.sort_complex(each.poles()) for each in (fit.model, truth))
    assert_close(found, wanted, rtol=1e-11, why="rounding through one SVD")
    assert fit.details.criteria.bic is None
    assert fit.covariance is None


def test_unstable_models_are_found_too():
    a, b, c, _, k = SINGLE.matrices
    truth = M(("u",), ("y",), 0.1, a * 1.1, b, c, None, k)
    fit = fid.identify(
        M.subspace("u", "y", 2, offsets="none", horizon=8),
        [flown(truth, seed, n=80, noise=0.1, warm_up=0) for seed in range(4)],
    )
    assert_close(
        np.sort_complex(fit.model.poles()), np.sort_complex(truth.poles()), rtol=1e-3, why="noise"
    )
    assert "unstable-model" in [finding.code for finding in fit.findings]


def test_order_is_found_and_refinement_lowers_the_loss(noisy):
    assert (
        noisy.details.order.chosen
        == noisy.details.order.gap
        == noisy.details.order.smallest_bic
        == 4
    )
    rough = fid.identify(
        M.subspace(("u", "v"), ("y", "z"), 4, offsets="none", refine=False, maximum_order=6),
        [item.measured for item in noisy.records],
    )
    assert noisy.details.criteria.loss < rough.details.criteria.loss
    assert "not-refined" in [finding.code for finding in rough.findings]
    assert_close(
        noisy.model.pulse_response(20), PAIR.pulse_response(20), atol=0.15, why="noise of 0.5"
    )
    assert "4 states chosen" in repr(noisy.details.order)
    assert len(noisy.details.order.summary().rows) == 6


def test_all_methods_end_in_the_same_optimum(noisy):
    for method in ("n4sid", "pbsid"):
        structure = M.subspace(("u", "v"), ("y", "z"), 4, method=method, offsets="none")
        fit = fid.identify(structure, [item.measured for item in noisy.records])
        assert_close(
            fit.details.criteria.loss, noisy.details.criteria.loss, rtol=1e-6, why="one minimum"
        )


def test_predictor_based_estimate_is_unbiased_under_feedback():
    record = flown(SINGLE, 5, n=3000, noise=1.5, feedback=0.25)
    options = {"offsets": "none", "refine": False}
    error = {
        method: np.abs(
            fid.identify(
                M.subspace("u", "y", 2, method=method, **options), record
            ).model.pulse_response(15)
            - SINGLE.pulse_response(15)
        ).max()
        for method in ("moesp", "pbsid")
    }
    assert error["pbsid"] < 0.1
    assert error["pbsid"] < 0.5 * error["moesp"]


def assert_near(item, truth):
    """Within four standard errors: the coverage itself is a matter of many runs."""
    assert item.interval95[0] < item.value < item.interval95[1]
    assert 0.0 < abs(item.value - truth) < 4.0 * item.stderr < 0.2 * abs(truth)


def test_intervals_hold_the_truth_here(noisy):
    for root, mode in zip(noisy.details.modes, PAIR.modes(), strict=True):
        assert_near(root.natural_frequency, mode.natural_frequency_rad_s)
        assert_near(root.damping, mode.damping)
    for name, gain in PAIR.gains().items():
        assert_near(noisy.details.gains[name], gain)
    assert noisy.details.gains["y/u"].unit == "rad/V"


def test_units_scale_gains_and_their_errors_alike():
    record = flown(SINGLE, 1, n=400, noise=0.5)
    other = record.replace({"y": 1000.0 * record["y"]})
    fits = [fid.identify(M.subspace("u", "y", 2), each) for each in (record, other)]
    one, many = (fit.details.gains["y/u"] for fit in fits)
    assert_close(many.value, 1000.0 * one.value, rtol=1e-6, why="same optimum")
    assert_close(many.stderr, 1000.0 * one.stderr, rtol=1e-4, why="same optimum")


def test_prediction_horizons_meet_their_limits(noisy):
    record = noisy.records[0].measured
    one = fid.predict(noisy.model, record, 1)
    assert_close(
        np.array([one.residual("y"), one.residual("z")]),
        noisy.residuals[0].matrix(["y", "z"]),
        atol=1e-7,
        why="same predictor",
    )
    far = fid.predict(noisy.model, record, 400, initial_state="zero")
    free = fid.predict(noisy.model, record, initial_state="zero")
    for name in ("y", "z"):
        early = far.predicted[name][:300], free.predicted[name][:300]
        assert_close(*early, atol=1e-6, why="noise unseen")
    rms = [fid.predict(noisy.model, record, k).rms_error["y"] for k in (1, 3, 10)]
    assert rms == sorted(rms)
    assert free.fit_percent["z"] < one.fit_percent["z"]
    assert "1 ahead from the measured past" in repr(one)


def test_forms_of_one_model_agree(noisy):
    model = noisy.model
    omega = np.geomspace(0.1, 30.0, 7)
    above, below = model.transfer("z", "u")
    later = np.exp(-1j * omega * 0.1)
    ratio = np.polyval(above[::-1], later) / np.polyval(below[::-1], later)
    assert_close(model.frequency_response(omega)[1, 0], ratio, rtol=1e-9, why="same response")
    turned = model.transformed(np.random.default_rng(0).standard_normal((4, 4)))
    assert_close(turned.pulse_response(9), model.pulse_response(9), atol=1e-9, why="similar")
    zeros = model.zeros()["z/u"]
    assert_close(np.polyval(np.trim_zeros(above, "f"), zeros), 0.0 * zeros, atol=1e-8, why="zeros")
    again = M.from_dict(json.loads(json.dumps(model.to_dict())))
    assert_close(again.pulse_response(9), model.pulse_response(9), rtol=1e-15, why="kept")
    assert_close(
        model.frequency_response([1e-9])[0, 0].real, model.gains()["y/u"], rtol=1e-6, why="dc"
    )


def test_delayed_responses_have_no_zeros_at_infinity():
    poly = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]], nk=(4,))
    a, b, c, d, k = poly.state_space()
    model = M(("u",), ("y",), 0.1, a, b, c, d, k)
    zeros = model.zeros()["y/u"]
    assert_close(zeros[np.abs(zeros) > 1e-3], [-0.5], rtol=1e-9, why="one zero of B")


def test_views_are_complete(noisy):
    assert noisy.details.words in repr(noisy)
    assert "free run from an estimated state" in noisy.summary().to_text()
    assert len(noisy.details.roots_table().rows) == len(noisy.details.roots)
    assert json.loads(json.dumps(noisy.to_dict()))["details"]["order"]["chosen"] == 4
    assert "pole" in noisy.model.summary().to_text()
    assert "<table" in noisy._repr_html_() + noisy.model._repr_html_()
    figure = singular_values(noisy.details.order)
    assert len(figure.data) >= 3
    tests = fid.residual_tests(noisy)
    assert tests.fitted_noise == 8
    assert len({row[0] for row in tests.summary().rows}) > 0


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"order": 0}, "order is too small"),
        ({"method": "era"}, "method is not known"),
        ({"offsets": "median"}, "offsets is not known"),
        ({"initial_state": "rest"}, "initial_state is not known"),
        ({"horizon": 4, "order": 6}, "the horizon is too short"),
        ({"maximum_iterations": 0}, "maximum_iterations is too small"),
    ],
)
def test_options_outside_their_range_are_refused(change, problem):
    with pytest.raises(OptionError, match=problem):
        M.subspace("u", "y", **change)


def test_channels_are_checked():
    with pytest.raises(OptionError, match="named twice"):
        M.subspace("y", "y")
    with pytest.raises(OptionError, match="no outputs or no inputs"):
        M.subspace((), "y")


def test_records_that_cannot_do_are_refused():
    record = flown(SINGLE, 1, n=300, noise=0.1)
    structure = M.subspace("u", "y")
    with pytest.raises(DataError, match="too short for the horizon"):
        fid.identify(M.subspace("u", "y", horizon=60), record)
    with pytest.raises(DataError, match="too short for the horizon"):
        fid.identify(M.subspace("u", "y", horizon=110, method="pbsid"), record)
    sine = record.replace({"u": np.sin(record.time_s)})
    with pytest.raises(DataError, match="fit an output-error model"):
        fid.identify(structure, sine)
    tones = np.sum([np.sin(k * record.time_s) for k in (2.0, 9.0, 20.0)], axis=0)
    told = "horizon=3, maximum_order=2"
    with pytest.raises(DataError, match=told):
        fid.identify(structure, record.replace({"u": tones}))
    few = M.subspace("u", "y", horizon=3, maximum_order=2)
    assert fid.identify(few, record.replace({"u": tones})).model.order <= 2
    with pytest.raises(DataError, match="constant"):
        fid.identify(structure, record.replace({"u": np.full(300, 2.0)}))
    clean = flown(SINGLE, 1, n=300)
    with pytest.raises(DataError, match="order is larger than the records support"):
        fid.identify(M.subspace("u", "y", 5, offsets="none"), clean)
    with pytest.raises(DataError, match="not independent"):
        fid.identify(M.subspace("u", "y", 2, method="pbsid", offsets="none"), clean)


def test_models_that_contradict_themselves_are_refused():
    with pytest.raises(ModelError, match="matrix B"):
        M(("u",), ("y",), 0.1, [[0.5]], [[1.0, 2.0]], [[1.0]])
    with pytest.raises(ModelError, match="matrix A"):
        M(("u",), ("y",), 0.1, [[np.nan]], [[1.0]], [[1.0]])
    with pytest.raises(ModelError, match="sample time"):
        M(("u",), ("y",), 0.0, [[0.5]], [[1.0]], [[1.0]])
    with pytest.raises(ModelError, match="noise covariance"):
        M(("u",), ("y",), 0.1, [[0.5]], [[1.0]], [[1.0]], noise_covariance=np.eye(2))
    with pytest.raises(ModelError, match="has no outputs"):
        M.from_dict({"a": []})
    with pytest.raises(ModelError, match="must be a list"):
        M.from_dict({"outputs": ["y"], "inputs": ["u"], "a": "text"})


def test_predictions_refuse_what_they_do_not_know():
    record = flown(SINGLE, 1, n=50)
    with pytest.raises(OptionError, match="horizon is"):
        fid.predict(SINGLE, record, 0)
    with pytest.raises(OptionError, match=r"initial.state"):
        fid.predict(SINGLE, record, initial_state="backcast")
    with pytest.raises(DataError, match="another sample time"):
        fid.predict(M(("u",), ("y",), 0.2, [[0.5]], [[1.0]], [[1.0]]), record)


def test_a_run_that_leaves_the_numbers_is_held():
    record = flown(SINGLE, 1, n=400)
    run = fid.predict(
        M(("u",), ("y",), 0.1, [[3.0]], [[1.0]], [[1.0]]), record, initial_state="zero"
    )
    assert run.diverged_at is not None
    assert np.all(np.isfinite(run.predicted["y"]))


def _driven(seed: int, numerator: list[float], noise: float = 0.05) -> fid.Record:
    """A lightly damped pair and a slow pole, in SciPy."""
    random, n = np.random.default_rng(seed), 1500
    u = random.standard_normal(n)
    below = np.convolve([1.0, -2 * 0.98 * np.cos(0.5), 0.98**2], [1.0, -0.7])
    y = lfilter(numerator, below, u)
    y += noise * y.std() * random.standard_normal(n)
    return fid.Record.from_arrays(np.arange(n) / 20, inputs={"u": u}, outputs={"y": y})


@pytest.mark.parametrize(
    ("numerator", "at_once"), [([0.0, 1.0, 0.5], False), ([1.0, 0.3, 0.2], True)]
)
def test_data_decide_on_feedthrough_and_order(numerator: list[float], at_once: bool) -> None:
    fit = fid.identify(M.subspace("u", "y", refine=False), _driven(0, numerator))
    assert bool(np.any(fit.model.d)) is at_once
    assert fit.model.order == 3
    assert "kept third" in fit.details.order.summary().to_text()


def _resonant(seed: int, n: int, noise_pole: float = 0.0) -> fid.Record:
    """A pair of poles with noise of one pole in the output, in SciPy."""
    random = np.random.default_rng(seed)
    u = random.standard_normal(n)
    y = lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.8], u)
    drive = np.sqrt(1.0 - noise_pole**2) * random.standard_normal(n)
    y += 0.3 * y.std() * lfilter([1.0], [1.0, -noise_pole], drive)
    return fid.Record.from_arrays(np.arange(n) * 0.1, inputs={"u": u}, outputs={"y": y})


@pytest.mark.parametrize(("seed", "n"), [(1, 2_000), (4, 10_000), (7, 10_000), (9, 10_000)])
def test_chance_in_the_kept_third_adds_no_states(seed: int, n: int) -> None:
    """Where one standard error would: better by less than Student's 5 % is not better."""
    structure = M.subspace("u", "y", refine=False)
    assert fid.identify(structure, _resonant(seed, n)).model.order == 2


def test_refined_predictions_ask_for_the_pole_of_the_noise() -> None:
    record = _resonant(0, 2_000, 0.9)
    assert fid.identify(M.subspace("u", "y", refine=False), record).model.order == 2
    fit = fid.identify(M.subspace("u", "y"), record)
    assert fit.model.order == fit.details.order.chosen == 3
    assert fit.covariance is not None
    poles = [each.z for each in fit.details.roots if each.kind == "pole"]
    assert min(abs(pole - 0.9) for pole in poles) < 0.05


def test_a_stable_estimate_is_asked_for() -> None:
    random, n = np.random.default_rng(1), 300
    u = random.standard_normal(n)
    y = np.cumsum(np.cumsum(0.01 * u)) + 0.1 * random.standard_normal(n)
    y += 1e-3 * np.exp(0.03 * np.arange(n))
    record = fid.Record.from_arrays(np.arange(n) / 20, inputs={"u": u}, outputs={"y": y})
    for enforce in (False, True):
        asked = M.subspace("u", "y", 3, offsets="none", enforce_stability=enforce)
        radius = np.max(np.abs(np.linalg.eigvals(fid.identify(asked, record).model.a)))
        assert bool(radius < 1.0) is enforce


@pytest.mark.parametrize("method", [*OPEN, "pbsid"])
def test_a_mean_is_no_trim_where_a_record_begins_away_from_its_working_point(method):
    random = np.random.default_rng(0)
    u = 5.0 + np.repeat(random.standard_normal(40), 10)
    y = 20.0 + lfilter([0.0, 0.4], [1.0, -0.9], u) + 1e-3 * random.standard_normal(400)
    record = fid.Record.from_arrays(
        np.arange(400) * 0.1, inputs={"u": u}, outputs={"y": y}, hold="zero"
    )
    fit = fid.identify(M.subspace("u", "y", order=1, method=method), record)
    assert_close(fit.details.gains["y/u"].value, 4.0, rtol=1e-3, why="hardly any noise")
    point = fit.model.operating_point
    assert_close(point["y"], 20.0 + 4.0 * point["u"], rtol=1e-3, why="on the steady line")


def test_a_predictor_reaches_the_circle_by_its_determinant_not_by_clustered_eigenvalues():
    b, k = np.ones((1, 1)), np.array([[0.4]])
    single = M(("u",), ("y",), 0.1, [[0.9]], b, [[1.0]], None, k)
    # Of one state a - k c = 0.5: at the circle where 1.96 of its errors reach 0.5.
    for stderr, reaches in ((0.254, False), (0.256, True)):
        covariance = np.diag([stderr**2, 0.0, 0.0, 0.0])
        assert may_reach_circle(single, covariance, direct=False) is reaches
    # A delay of three samples: its eigenvalues are 0, 0 and 0, and move by the cube root.
    shift = np.eye(3, k=1) + 1e-6 * np.eye(3)[[2, 0, 1]]
    late = M(("u",), ("y",), 0.1, shift, np.eye(3)[:, 2:], np.eye(3)[:1], None, np.zeros((3, 1)))
    covariance = np.diag(np.r_[np.full(9, 0.01**2), np.zeros(9)])
    assert not may_reach_circle(late, covariance, direct=False)
    drawn = np.random.default_rng(1).normal(0.0, 0.01, (2000, 3, 3)) + shift
    assert np.abs(np.linalg.eigvals(drawn)).max() < 0.5
    edge = M(("u",), ("y",), 0.1, -b, b, b, None, np.zeros((1, 1)))
    assert may_reach_circle(edge, np.zeros((4, 4)), direct=False)


@pytest.mark.parametrize("direct", [False, True])
def test_the_determinant_moves_as_the_entries_of_all_matrices_move_it(direct):
    r = np.random.default_rng(5)
    made = [0.3 * r.standard_normal(s) for s in ((3, 3), (3, 2), (2, 3), (2, 2), (3, 2))]
    way = [r.standard_normal(each.shape) for each in made]

    def log_determinants(by):
        a, _, c, _, k = (one + by * other for one, other in zip(made, way, strict=True))
        return np.log([abs(np.linalg.det(end * np.eye(3) - a + k @ c)) for end in (1.0, -1.0)])

    slope = np.abs(log_determinants(1e-6) - log_determinants(-1e-6)).max() / 2e-6
    free = [each.ravel() for n, each in enumerate(way) if direct or n != 3]
    model = M(("u", "v"), ("y", "z"), 0.1, *made)
    for size, reaches in ((0.999, False), (1.001, True)):
        line = np.concatenate(free) * size / (half_width() * slope)
        assert may_reach_circle(model, np.outer(line, line), direct=direct) is reaches

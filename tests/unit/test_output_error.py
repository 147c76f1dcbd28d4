"""Output error through the verb: recovery, options, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, FitError, OptionError, UnitError, UnknownNameError
from flightid.models import Parameter, Parameters
from flightid.plot.fitted_record import record_figure
from tests.closeness import assert_close

UNITS = {"alpha": "rad", "q": "rad/s", "nz": "1"}
TRUTH = {"Zalpha": -120.0, "Malpha": -12.0, "Mq": -3.0, "Melevator": -15.0, "tau": 0.033}


def _model() -> fid.StateSpaceModel:
    model = fid.load_model("short_period").with_fixed(Malphadot=-0.9)
    assert isinstance(model, fid.StateSpaceModel)
    return model


def _input(n: int = 1200, dt: float = 0.02, phase: float = 0.0) -> fid.Record:
    time_s = np.arange(n) * dt
    elevator = 0.05 * np.sign(np.sin(1.3 * time_s + phase)) + 0.02 * np.sin(0.3 * time_s**1.5)
    return fid.Record.from_arrays(
        time_s, inputs={"elevator": elevator}, units={"elevator": "rad"}, name=f"phase {phase}"
    )


def _flown(phase: float = 0.0, **options: object) -> fid.Record:
    truth = _model().with_values(TRUTH)
    return fid.simulate(truth, _input(phase=phase), units=UNITS, **options)  # type: ignore[arg-type]


def _noisy(record: fid.Record, seed: int, scale: float = 1.0) -> fid.Record:
    random = np.random.default_rng(seed)
    size = {"alpha": 0.002, "q": 0.005, "nz": 0.02}
    return record.replace(
        {
            name: record[name] + scale * deviation * random.standard_normal(record.n_samples)
            for name, deviation in size.items()
        }
    )


def _errors(fit: fid.Fit) -> list[float]:
    return [abs(fit.parameters[name].value / value - 1) for name, value in TRUTH.items()]


@pytest.mark.parametrize("hold", ["first", "zero"])
def test_noise_free_records_give_the_truth_with_its_delay(hold: str) -> None:
    fit = fid.identify(_model(), _flown(hold=hold), hold=hold)
    assert max(_errors(fit)) < 1e-9
    assert fit.intervals_from == "coloured residuals"
    assert fit.responses == ()
    assert fit.records[0].outputs == ("alpha", "q", "nz")


def test_each_record_has_its_own_initial_state_bias_and_shift() -> None:
    starts = ([0.01, -0.05], [-0.02, 0.0])
    shifts = ({"elevator": 0.004}, {"elevator": -0.01})
    biases = ({"alpha": 0.02}, {"alpha": -0.01, "q": 0.03})
    flown = [
        _flown(phase, initial_state=start, input_bias=shift, output_bias=bias)
        for phase, start, shift, bias in zip((0.0, 1.0), starts, shifts, biases, strict=True)
    ]
    fit = fid.identify(_model(), flown, output_bias=["alpha", "q"], input_bias=True)
    assert max(_errors(fit)) < 1e-8
    for item, start, shift, bias in zip(fit.records, starts, shifts, biases, strict=True):
        found = [item.initial_state[name].value for name in ("alpha", "q")]
        assert_close(found, start, atol=1e-8, why="noise-free")
        assert_close(
            item.reference_shift["elevator"].value,
            shift["elevator"],
            atol=1e-9,
            why="noise-free",
        )
        assert_close(item.bias["alpha"].value, bias["alpha"], atol=1e-9, why="noise-free")
        assert item.bias["nz"].status == "fixed"


def test_a_bias_that_is_an_initial_state_is_left_to_it() -> None:
    model = fid.StateSpaceModel(
        states={"phi": "rad", "p": "rad/s"},
        input_units={"lat": "1"},
        measurements={"phi": fid.Output("phi", "rad")},
        equations={"phi'": "p", "p'": "Lp*p + Llat*lat"},
        parameters=Parameters([Parameter("Lp", -4.0, "1/s"), Parameter("Llat", 20.0, "rad/s^2")]),
    )
    time_s = np.arange(600) * 0.02
    driven = fid.Record.from_arrays(time_s, inputs={"lat": 0.1 * np.sin(time_s**1.4)})
    flown = fid.simulate(model, driven, units={"phi": "rad"}, output_bias={"phi": 0.2})
    fit = fid.identify(model.with_values({"Lp": -2.0, "Llat": 12.0}), flown)
    assert_close(fit.parameters["Lp"].value, -4.0, rtol=1e-7, why="noise-free")
    assert fit.records[0].bias["phi"].stderr is None
    assert "does not tell it apart" in fit.records[0].bias["phi"].reason
    assert_close(fit.records[0].initial_state["phi"].value, 0.2, atol=1e-8, why="noise-free")


def test_transfer_functions_are_fitted_to_records_each_with_its_delay() -> None:
    text = ["y/u", "z/u"]
    responses = (
        fid.TransferFunction("y", "u", "K", denominator=("T*s + 1",), delay="tau_y"),
        fid.TransferFunction("z", "u", "K*w^2", ("a*s + 1",), ("s^2 + 0.8*w*s + w^2",), "tau_z"),
    )
    values = {"K": 2.0, "T": 0.3, "tau_y": 0.05, "w": 4.0, "a": 0.2, "tau_z": 0.113}
    units = {"K": "1", "T": "s", "tau_y": "s", "w": "1/s", "a": "s", "tau_z": "s"}
    parameters = Parameters([Parameter(n, v, units[n], minimum=0.0) for n, v in values.items()])
    truth = fid.TransferFunctionModel(responses, parameters)
    time_s = np.arange(800) * 0.025
    driven = fid.Record.from_arrays(time_s, inputs={"u": np.sin(0.4 * time_s**1.6)})
    single = [
        fid.TransferFunctionModel(
            (response,), Parameters([p for p in parameters.values() if p.name in names])
        )
        for response, names in zip(
            responses, ({"K", "T", "tau_y"}, {"K", "w", "a", "tau_z"}), strict=True
        )
    ]
    outputs = {
        name: fid.simulate(model, driven)[name] for name, model in zip("yz", single, strict=True)
    }
    flown = fid.Record.from_arrays(time_s, inputs={"u": driven["u"]}, outputs=outputs)
    start = truth.with_values({"K": 1.5, "T": 0.4, "tau_y": 0.0, "w": 3.3, "a": 0.1, "tau_z": 0.06})
    fit = fid.identify(start, flown)
    for name, value in values.items():
        assert_close(fit.parameters[name].value, value, rtol=1e-7, why="noise-free")
    assert text == list(fit.model.response_names)


def test_outliers_hardly_move_the_robust_fit() -> None:
    record = _noisy(_flown(), 1)
    q = record["q"].copy()
    q[::50] += 0.5
    spoiled = record.replace({"q": q})
    clean = fid.identify(_model(), record)
    plain = fid.identify(_model(), spoiled)
    robust = fid.identify(_model(), spoiled, loss="huber")

    def distance(fit: fid.Fit) -> float:
        return max(
            abs(fit.parameters[n].value - clean.parameters[n].value)
            / (clean.parameters[n].stderr or 0)
            for n in TRUTH
        )

    assert distance(robust) < 0.5 * distance(plain)
    assert robust.noise_covariance is not None
    assert plain.noise_covariance is not None
    assert robust.noise_covariance[1, 1] < 0.1 * plain.noise_covariance[1, 1]


def test_several_starts_are_clustered_and_seeded() -> None:
    record = _noisy(_flown(), 2)
    model = _model()
    narrow = model
    for name, value in TRUTH.items():
        low, high = sorted((0.5 * value, 1.5 * value))
        parameter = model.parameters[name]
        narrow = narrow._with_parameters(
            narrow.parameters.with_parameter(
                Parameter(name, value * 1.2, parameter.unit, minimum=low, maximum=high)
            )
        )
    fit = fid.identify(narrow, record, starts=6, seed=3)
    assert sum(minimum.count for minimum in fit.minima) == 6
    assert fit.minima[0].count >= 5
    again = fid.identify(narrow, record, starts=6, seed=3)
    assert again.objective == fit.objective


def test_correlated_noise_is_weighed_as_a_whole() -> None:
    flown = _flown()
    shared = np.random.default_rng(5).standard_normal((2, flown.n_samples))
    spoiled = flown.replace(
        {
            "alpha": flown["alpha"] + 0.002 * shared[0],
            "q": flown["q"] + 0.01 * shared[0] + 0.001 * shared[1],
            "nz": flown["nz"] + 0.1 * np.random.default_rng(6).standard_normal(flown.n_samples),
        }
    )
    fit = fid.identify(_model(), spoiled, noise_covariance="full")
    assert fit.noise_covariance is not None
    r = fit.noise_covariance
    assert r[0, 1] / np.sqrt(r[0, 0] * r[1, 1]) > 0.98
    diagonal = fid.identify(_model(), spoiled)
    assert (fit.parameters["Malpha"].stderr or 1) < (diagonal.parameters["Malpha"].stderr or 0)


def test_residuals_and_costs_say_what_is_left() -> None:
    record = _noisy(_flown(), 4)
    fit = fid.identify(_model(), record)
    item = fit.records[0]
    residual = record["q"] - item.modelled["q"]
    assert np.array_equal(item.residual("q"), residual)
    share = 100 * np.sum(residual**2) / np.sum((record["q"] - record["q"].mean()) ** 2)
    assert_close(fit.costs["q"], share, rtol=1e-12, why="the same sums")
    assert_close(item.rms["q"], 0.005, rtol=0.1, why="1200 samples of noise")
    assert "rms of residuals" in repr(item)
    assert fit.to_dict()["records"][0]["name"] == "phase 0.0"  # type: ignore[index]
    assert "1 record" in repr(fit)


REFUSED = [
    ({"noise_covariance": "banded"}, OptionError, "noise_covariance is not known"),
    ({"loss": "l1"}, OptionError, "loss is not known"),
    ({"hold": "second"}, OptionError, "hold is not known"),
    ({"start_from": "nowhere"}, OptionError, "start_from is not known"),
    ({"initial_state": "rest"}, OptionError, "initial_state is not known"),
    ({"initial_state": {"q": "loose"}}, OptionError, "initial_state of q is not known"),
    ({"initial_state": {"u": 1.0}}, UnknownNameError, "names an unknown state"),
    ({"output_bias": ["beta"]}, UnknownNameError, "output_bias names an unknown channel"),
    ({"maximum_iterations": 0}, OptionError, "maximum_iterations is too small"),
    ({"loss_limit": 0.0}, OptionError, "loss_limit is too small"),
    ({"method": "guess"}, OptionError, "method is not known"),
    ({"n_omega": 20}, OptionError, "no such option: found n_omega"),
]


@pytest.mark.parametrize(("options", "error", "words"), REFUSED, ids=lambda x: str(x)[:30])
def test_options_without_a_meaning_are_refused(
    options: dict[str, object], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        fid.identify(_model(), _flown(), **options)  # type: ignore[call-overload]


def test_records_that_cannot_serve_are_refused() -> None:
    flown = _flown()
    still = flown.replace({"alpha": np.zeros(flown.n_samples)})
    with pytest.raises(DataError, match="an output does not change"):
        fid.identify(_model(), still)
    with pytest.raises(DataError, match="no input changes"):
        fid.identify(_model(), flown.replace({"elevator": np.full(flown.n_samples, 0.1)}))
    with pytest.raises(DataError, match="too short for its own numbers"):
        fid.identify(_model(), flown.segment(0.0, 0.04))
    with pytest.raises(DataError, match="too short for the parameters"):
        fid.identify(_model(), flown.segment(0.0, 0.14))
    with pytest.raises(UnitError, match="channel 'q'"):
        fid.identify(_model(), flown.to_units(q="deg/s"))
    every = {name: parameter.value for name, parameter in _model().parameters.items()}
    with pytest.raises(FitError, match="no free parameter"):
        fid.identify(
            _model().with_fixed(**{k: v for k, v in every.items() if v is not None}), flown
        )


def test_parameters_that_the_records_cannot_tell_apart_are_named() -> None:
    model = fid.load_model("short_period").with_fixed(Zelevator=0.0, Zalpha=-120.0, U0=1e9)
    assert isinstance(model, fid.StateSpaceModel)
    flown = fid.simulate(model, _input(), units=UNITS)
    with pytest.raises(FitError, match=r"do not see|cannot tell"):
        fid.identify(model, flown)


def test_a_record_may_have_no_numbers_of_its_own() -> None:
    fit = fid.identify(_model(), _noisy(_flown(), 7), initial_state="trim", output_bias=False)
    item = fit.records[0]
    assert {p.status for p in (*item.initial_state.values(), *item.bias.values())} == {"fixed"}
    assert max(_errors(fit)) < 0.1


def test_residual_tests_and_verification_take_the_fit() -> None:
    fit = fid.identify(_model(), _noisy(_flown(), 8))
    tests = fid.residual_tests(fit)
    assert tests.n_records == 1
    assert tests.outputs == ("alpha", "q", "nz")
    with pytest.raises(OptionError, match="come from another predictor"):
        fid.residual_tests(fit, horizon="one step ahead")
    assert fid.verify(fit, _noisy(_flown(1.0), 9), initial_state="estimate").theil["q"] < 0.1
    omega = np.geomspace(1.0, 20.0, 30)
    model = fid.load_model("rate_first_order")
    response = fid.FrequencyResponse.from_values(
        omega,
        model.frequency_response(omega),
        inputs=["tau_phi"],
        outputs=["p"],
        units={"p": "rad/s"},
    )
    with pytest.raises(DataError, match="no residuals in time"):
        fid.residual_tests(fid.identify(model, response))


def test_the_figure_draws_every_output_and_what_is_left() -> None:
    fit = fid.identify(_model(), _noisy(_flown(), 8))
    drawn = [trace.name for trace in record_figure(fit.records[0]).data]
    assert drawn.count("measured") == drawn.count("model") == 3
    assert drawn.count("measured minus model") == 3

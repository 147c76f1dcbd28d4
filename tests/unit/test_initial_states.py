"""Where states begin: one vocabulary, at the measurement where nothing is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import FitError, OptionError
from flightid.models import RecordValue
from flightid.models.state_space.first_sample import measured_start
from flightid.models.state_space.measured_states import state_outputs
from tests.closeness import assert_close


def glider(**outputs: fid.Output) -> fid.StateSpaceModel:
    """Speed and climb angle; it divides by the speed and declares no trim."""
    seen = outputs or {"V": fid.Output("V", "m/s"), "gamma": fid.Output("gamma", "rad")}
    return fid.StateSpaceModel(
        states={"V": "m/s", "gamma": "rad"},
        input_units={"lift": "m/s^2"},
        measurements=seen,
        equations={"V'": "-D*V - g*sin(gamma)", "gamma'": "(E*lift - g*cos(gamma))/V"},
        parameters=fid.Parameters(
            [
                fid.Parameter("D", 0.05, "1/s"),
                fid.Parameter("E", 1.0, "1"),
                fid.Parameter("g", 9.81, "m/s^2", free=False),
            ]
        ),
        name="glider",
    )


def glide(noise: float = 0.0, seed: int = 0) -> fid.Record:
    time_s = np.arange(300) * 0.02
    random = np.random.default_rng(seed)
    lift = 9.8 + np.repeat(random.choice([-3.0, 0.0, 3.0], 15), 20)
    driven = fid.Record.from_arrays(
        time_s, inputs={"lift": lift}, units={"lift": "m/s^2"}, hold="zero"
    )
    clean = fid.simulate(glider(), driven, initial_state={"V": 30.0, "gamma": 0.1})
    sizes = {"V": 1.0, "gamma": 0.02}
    return clean.replace(
        {k: clean[k] + noise * s * random.standard_normal(300) for k, s in sizes.items()}
    )


@pytest.mark.parametrize("method", ["output_error", "equation_error"])
def test_a_model_that_divides_by_speed_is_fitted_without_a_trim(method: str) -> None:
    options = {"output_bias": False} if method == "output_error" else {}
    start = glider().with_values({"D": 0.03, "E": 0.7})
    fit = fid.identify(start, glide(), method=method, **options)
    wide = 1e-7 if method == "output_error" else 3e-2
    assert_close(fit.parameters["E"].value, 1.0, rtol=wide, why="noise-free, or a local derivative")


def test_states_come_from_combinations_and_the_rest_stays_at_trim() -> None:
    model = glider(
        path=fid.Output(
            "2*V",
            "m/s",
        )
    )
    record = glide()
    inputs, outputs = record.matrix(("lift",)), 2.0 * record["V"][None, :]
    placed = model.linearise({"V": 25.0, "gamma": 0.3})
    found = state_outputs(placed, inputs, outputs).states(outputs)
    assert_close(found[0], record["V"], rtol=1e-12, why="2 V is solved for V")
    assert_close(found[1], np.full(300, 0.3), rtol=1e-12, why="nothing tells gamma")


def test_words_of_initial_state_in_a_fit() -> None:
    record, model = glide(0.01), glider().linearise({"V": 28.0})

    def statuses(start: object) -> list[tuple[float, str | None]]:
        fit = fid.identify(model, record, initial_state=start, output_bias=False)
        return [(e.value, e.status) for e in fit.records[0].initial_state.values()]

    first = [(record["V"][0], "fixed"), (record["gamma"][0], "fixed")]
    assert statuses("measured") == first
    assert statuses("trim") == [(28.0, "fixed"), (0.0, "fixed")]
    assert statuses({"V": 30.0}) == [(30.0, "fixed"), first[1]]
    assert statuses({"V": "trim", "gamma": "estimate"})[0] == (28.0, "fixed")
    assert [status for _, status in statuses("estimate")] == ["free", "free"]
    with pytest.raises(OptionError, match="'estimate', 'measured', 'trim'"):
        statuses({"V": "rest"})


def test_noise_of_a_measured_start_is_carried_into_the_intervals() -> None:
    record = glide(0.02, 3)

    def fitted(flown: fid.Record) -> fid.Fit:
        return fid.identify(glider(), flown, initial_state="measured", output_bias=False)

    fit = fitted(record)
    added = np.zeros((2, 2))
    for place, name in enumerate(("V", "gamma")):
        step = 0.1 * np.sqrt(fit.noise_covariance[place, place])
        ends = []
        for sign in (1.0, -1.0):
            moved = record[name].copy()
            moved[0] += sign * step
            # The sample counts as a start and, once in 300, as a residual.
            found = fitted(record.replace({name: moved})).parameters
            ends.append(np.array([found[n].value for n in ("D", "E")]))
        slope = (ends[0] - ends[1]) / (2.0 * step)
        added += np.outer(slope, slope) * fit.noise_covariance[place, place]
    gained = np.diag(added)
    stated = np.square([fit.parameters[n].stderr for n in ("D", "E")])
    assert np.all(stated > 0.9 * gained), "the start's part alone is no more than the whole"
    assert np.all(stated < 4.0 * gained), "and most of it: one sample against 300"


def test_a_nonlinear_model_is_verified_on_its_own_inputs() -> None:
    record = glide()
    result = fid.verify(glider(), record)
    (made,) = result.predictions
    assert max(result.theil.values()) < 1e-9
    assert "from an initial state solved for over the first 2 s" in result.protocol
    assert_close(made.shifts.input_bias, [0.0], atol=1e-300, why="no shift was asked for")
    off = record.replace({"lift": record["lift"] + 0.2})
    asked = fid.verify(glider(), off, state_bias=True)
    said = next(f for f in asked.findings if f.code == "verification-inputs-shifted")
    assert "lift 0.2" in said.message
    assert fid.verify(glider(), off).theil["V"] > 10 * asked.theil["V"]


def test_simulation_takes_the_same_words() -> None:
    record = glide()
    again = fid.simulate(glider(), record, initial_state="measured")
    assert_close(again["V"], record["V"], rtol=1e-12, why="the same run")
    assert_close(measured_start(glider(), record), [30.0, 0.1], rtol=1e-12, why="first sample")
    with pytest.raises(OptionError, match="use predict"):
        fid.simulate(glider(), record, initial_state="estimate")


def test_what_a_fit_was_told_is_kept_in_its_file(tmp_path: Path) -> None:
    record = glide(0.01)
    fit = fid.identify(glider(), record, initial_state="estimate", output_bias=False)
    fid.write_model(fit, tmp_path / "glider.toml")
    for source in (fit, fid.load_model(tmp_path / "glider.toml")):
        result = fid.verify(source, record)
        assert "an initial state solved for" in result.protocol
        assert "output biases" not in result.protocol
    assert "output biases" in fid.verify(fit.model, record).protocol


def turning(constant: float = 0.5) -> fid.StateSpaceModel:
    return fid.StateSpaceModel(
        states={"q": "rad/s"},
        input_units={"de": "rad"},
        measurements={"q": fid.Output("q", "rad/s")},
        equations={"q'": "Mq*q + Mde*de + M0"},
        parameters=fid.Parameters(
            [
                fid.Parameter("Mq", -2.0, "1/s"),
                fid.Parameter("Mde", -8.0, "1/s^2"),
                fid.Parameter("M0", constant, "rad/s^2"),
            ]
        ),
    )


def test_constants_of_linear_equations_act_in_every_verb() -> None:
    time_s = np.arange(300) * 0.02
    quiet = fid.Record.from_arrays(time_s, inputs={"de": 0.0 * time_s}, units={"de": "rad"})
    run = fid.simulate(turning(), quiet)
    wanted = 0.25 * (1.0 - np.exp(-2.0 * time_s))
    assert_close(run["q"], wanted, atol=1e-12, why="a step of M0 into a lag")
    made = fid.predict(turning(), run)
    assert_close(made.predicted["q"], wanted, atol=1e-12, why="the same constants")


def test_a_constant_that_large_biases_undo_is_named() -> None:
    """A slow lag all but stands still: start and biases undo its constant with ten times its share,
    beside which it had been left out of the words, and the fit ended in an index beyond none."""
    time_s = np.arange(100) * 0.02
    rates = [fid.Parameter("a", -0.02, "1/s"), fid.Parameter("b", 1.0, "1/s")]
    slow = fid.StateSpaceModel(
        states={"x": "1"},
        input_units={"u": "1"},
        measurements={f"y{k}": fid.Output("x", "1") for k in range(5)},
        equations={"x'": "a*x + b + c*u"},
        parameters=fid.Parameters([*rates, fid.Parameter("c", 1.0, "1/s", free=False)]),
    )
    outputs = {f"y{k}": time_s + k for k in range(5)}
    step = np.where(time_s > 1.0, 1.0, 0.0)
    record = fid.Record.from_arrays(time_s, inputs={"u": step}, outputs=outputs)
    with pytest.raises(FitError, match="found b, output bias of y0"):
        fid.identify(slow, record)


def test_a_bias_that_is_a_constant_is_found_before_the_search() -> None:
    time_s = np.arange(300) * 0.02
    driven = fid.Record.from_arrays(time_s, inputs={"de": np.sin(time_s**1.4)}, units={"de": "rad"})
    record = fid.simulate(turning(), driven)
    with pytest.raises(FitError, match="M0, output bias of q, initial q") as told:
        fid.identify(turning(0.1), record)
    assert "output_bias=False" in str(told.value)
    assert "fix M0" in str(told.value)
    fit = fid.identify(turning(0.1), record, output_bias=False)
    assert_close(fit.parameters["M0"].value, 0.5, rtol=1e-7, why="noise-free")
    product = turning().with_values({"Mde": 0.0, "M0": 0.0})
    assert_close(
        fid.identify(product, record, output_bias=False).parameters["Mde"].value,
        -8.0, rtol=1e-6, why="a start at zero is no reason to refuse",
    )  # fmt: skip


def speeds(**initial: RecordValue) -> fid.StateSpaceModel:
    """Body speeds, measured by their size and angle alone; it has no slope at rest."""
    return fid.StateSpaceModel(
        states={"u": "m/s", "w": "m/s"},
        input_units={"d": "m/s^2"},
        measurements={
            "V": fid.Output("sqrt(u^2 + w^2)", "m/s"),
            "alpha": fid.Output("atan2(w, u)", "rad"),
        },
        equations={"u'": "X*u + D*d", "w'": "Z*w + d"},
        parameters=fid.Parameters(
            [
                fid.Parameter("X", -0.1, "1/s"),
                fid.Parameter("Z", -0.5, "1/s"),
                fid.Parameter("D", 3.0, "1"),
            ]
        ),
        initial=initial,
        name="speeds",
    )


def speeding() -> fid.Record:
    drive = np.repeat(np.random.default_rng(4).choice([-2.0, 0.0, 2.0], 15), 20)
    driven = fid.Record.from_arrays(
        np.arange(300) * 0.02, inputs={"d": drive}, units={"d": "m/s^2"}, hold="zero"
    )
    return fid.simulate(speeds(), driven, initial_state={"u": 40.0, "w": 3.0})


@pytest.mark.parametrize("method", ["output_error", "filter_error"])
def test_states_that_only_curved_outputs_tell_begin_at_the_measurement(method: str) -> None:
    record, model = speeding(), speeds()
    assert_close(measured_start(model, record), [40.0, 3.0], rtol=1e-9, why="V and alpha, inverted")
    if method == "output_error":
        fit = fid.identify(
            model.with_values({"X": -0.2, "D": 2.0}), record, method=method, output_bias=False
        )
        assert_close(
            fit.parameters["D"].value, 3.0, rtol=1e-6, why="nothing but the model moves it"
        )
    else:
        assert max(fid.verify(model, record).theil.values()) < 1e-9


def test_declared_initial_values_begin_simulations_and_free_runs() -> None:
    record = speeding()
    held = speeds(u=RecordValue(40.0, free=False), w=RecordValue(3.0, free=False))
    again = fid.simulate(held, record)
    assert_close(again["V"], record["V"], rtol=1e-12, why="the same start, declared")
    for run in (fid.predict(held, record), *fid.verify(held, record).predictions):
        assert run.initial_state == "a given state"
        assert_close(run.predicted["V"], record["V"], rtol=1e-9, why="nothing is solved for")
    near = speeds(u=RecordValue(35.0), w=RecordValue(1.0))
    free = fid.verify(near, record)
    assert max(free.theil.values()) < 1e-9
    assert "an initial state solved for" in free.protocol
    assert fid.simulate(near, record)["V"][0] == pytest.approx(np.hypot(35.0, 1.0), rel=1e-12)
    at_rest = fid.simulate(near, record, initial_state="trim")
    assert at_rest["V"][0] == 0.0, "what the user says comes first"


def test_an_output_without_a_slope_at_the_start_is_named() -> None:
    record, rest = speeding(), {"u": 0.0, "w": 0.0}
    said = r"V, alpha by u, w at u = 0, w = 0.*declare \[initial\] of u"
    with pytest.raises(FitError, match=said):
        fid.identify(speeds(), record, method="output_error", initial_state=rest)
    with pytest.raises(FitError, match=said):
        fid.verify(speeds(), record, initial_state=rest, state_bias=True)


def test_the_default_start_does_not_depend_on_the_method_that_fitted() -> None:
    record = glide(0.01)
    for method in ("output_error", "filter_error", "equation_error"):
        options = {} if method == "equation_error" else {"output_bias": False}
        fit = fid.identify(glider(), record, method=method, **options)
        assert "an initial state solved for" in fid.verify(fit, record).protocol, method

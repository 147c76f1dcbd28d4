"""Controllers closed around models and taken out of data again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.control.closed_loop.result import PLANT
from flightid.control.loops.same_wires import with_part
from flightid.errors import (
    DataError,
    ModelError,
    OptionError,
    ShapeError,
    SingularError,
    UnknownNameError,
)
from flightid.responses.opened import open_loops
from tests.closeness import assert_close
from tests.examples import examples

L = fid.loops
OMEGA = np.geomspace(0.3, 30.0, 12)
INPUTS, OUTPUTS = ("lat", "ped"), ("p", "r", "phi")


def vehicle(seed: int = 1) -> fid.LinearSystem:
    random = np.random.default_rng(seed)
    a = random.standard_normal((3, 3))
    a -= (np.max(np.linalg.eigvals(a).real) + 0.2) * np.eye(3)
    return fid.LinearSystem(
        a, random.standard_normal((3, 2)), np.eye(3), np.zeros((3, 2)), INPUTS, OUTPUTS,
        [0.05, 0.08],
    )  # fmt: skip


def controller(limit: float = 1e6) -> list[L.Block]:
    """Washed-out rates and a share of the stick, on two axes."""
    made = []
    for stick, rate in (("lat", "p"), ("ped", "r")):
        made += [
            L.washout(rate, f"{rate}_w", 0.5),
            L.washout(stick, f"{stick}_w", 1.5),
            L.gain((f"{rate}_w", f"{stick}_w"), f"{stick}_law", [[-0.6, 0.3]]),
            L.limiter(f"{stick}_law", stick, limit),
        ]
    return made


def record(seed: int, n: int = 400, step: float = 0.02) -> fid.Record:
    random = np.random.default_rng(seed)
    sticks = {name: np.cumsum(random.standard_normal(n)) * 0.05 for name in INPUTS}
    sticks = {name: values - values[0] for name, values in sticks.items()}
    return fid.Record.from_arrays(step * np.arange(n), inputs=sticks)


def test_a_closed_loop_is_its_closed_form() -> None:
    plant = fid.LinearSystem([[-1.0]], [[4.0]], [[1.0]], [[0.0]], ("lat",), ("p",), [0.05])
    closed = fid.close_loop(plant, {"lat": {"p": 0.5}})
    s = 1j * OMEGA
    loop = 2.0 / (s + 1) * np.exp(-0.05 * s)
    assert closed.loops.outputs == ("p", "lat_total")
    assert_close(closed.loops.frequency_response(OMEGA)[0, 0], 2 * loop / (1 + loop), rtol=1e-11,
                 why="algebra")  # fmt: skip
    assert_close(closed.broken_at("lat").frequency_response(OMEGA)[0, 0], loop, rtol=1e-11,
                 why="algebra")  # fmt: skip
    root = closed.poles[0].real.value
    assert root is not None
    assert abs(root + 1 + 2 * np.exp(-0.05 * root)) < 1e-9
    margin = closed.margins()["lat"]
    crossover = np.sqrt(3.0)
    wanted = 180 - np.degrees(np.arctan(crossover) + 0.05 * crossover)
    assert_close(margin.phase_margin.value, wanted, atol=0.05, why="crossover between grid points")


@examples(15)
@given(st.integers(0, 10_000))
def test_opening_what_was_closed_gives_the_bare_responses_back(seed: int) -> None:
    plant = vehicle(seed)
    closed = fid.close_loop(plant, controller(), draws=0)
    flown = fid.FrequencyResponse.from_values(
        OMEGA, closed.loops.frequency_response(OMEGA)[:3], inputs=INPUTS, outputs=OUTPUTS
    )
    opened = fid.open_loop(flown, controller())
    bare = plant.frequency_response(OMEGA)
    assert_close(opened.response, bare, atol=1e-9 * np.max(np.abs(bare)), why="an identity")


@examples(10)
@given(st.integers(0, 10_000), st.sampled_from([0.1, 1e6]))
def test_opening_a_record_gives_what_moved_the_vehicle(seed: int, limit: float) -> None:
    closed = fid.close_loop(vehicle(), controller(limit), draws=0)
    flown = closed.loops.simulate(record(seed))
    shares = flown["lat_total"] - flown["lat"]
    assert np.max(np.abs(shares)) <= limit * (1 + 1e-12)
    measured = fid.Record.from_arrays(
        flown.time_s, inputs={n: flown[n] for n in INPUTS}, outputs={n: flown[n] for n in OUTPUTS}
    )
    opened = fid.open_loop(measured, controller(limit))
    exact = {"atol": 1e-4, "why": "rates are straight lines between samples of 20 ms to the log"}
    for name in INPUTS:
        assert_close(opened[name], flown[f"{name}_total"], **exact)
        assert_close(opened[f"{name}_stick"], flown[name], **exact)
    assert opened.excitations == ("lat_stick", "ped_stick")
    logged = measured.replace({n: flown[f"{n}_total"] for n in INPUTS}, step=opened.history[-1])
    back = fid.open_loop(logged, controller(limit), logged="total")
    for name in INPUTS:
        assert_close(back[f"{name}_stick"], flown[name], **exact)
        assert_close(back[name], flown[f"{name}_total"], **exact)


def test_errors_of_opened_responses_are_those_of_draws() -> None:
    random = np.random.default_rng(3)
    plant = vehicle()
    closed = fid.close_loop(plant, controller(), draws=0).loops.frequency_response(OMEGA)[:3]
    scale = 0.01 * np.abs(closed)

    class Independent:
        def covariance(self, outputs, inputs, frequencies):
            found = [scale[o][np.ix_(inputs, frequencies)].ravel() for o in outputs]
            return np.array([np.diag(np.tile(each, 2) ** 2) for each in found])

    def response(values: np.ndarray) -> fid.FrequencyResponse:
        return fid.FrequencyResponse.from_values(OMEGA, values, inputs=INPUTS, outputs=OUTPUTS)

    measured = replace(
        response(closed), errors=Independent(), random_error=np.full(closed.shape, 0.01)
    )
    opened = fid.open_loop(measured, controller())
    washed = np.array([0.6, 0.3])[:, None] * 1j * OMEGA / (1j * OMEGA + np.array([[0.5], [1.5]]))
    feedback = np.zeros((2, 3, len(OMEGA)), dtype=complex)
    forward = np.zeros((2, 2, len(OMEGA)), dtype=complex)
    for axis in range(2):
        feedback[axis, axis], forward[axis, axis] = -washed[0], washed[1]
    assert_close(open_loops(measured, feedback, forward).response, opened.response, rtol=1e-10,
                 why="the same controller by its formula")  # fmt: skip
    draws = []
    for _ in range(800):
        noise = random.standard_normal(closed.shape) + 1j * random.standard_normal(closed.shape)
        draws.append(open_loops(response(closed + scale * noise), feedback, forward).response)
    scatter = np.array(draws)
    for output in range(3):
        found = np.sqrt(np.diag(opened.covariance_at(OMEGA)[output]))
        parts = scatter[:, output].reshape(len(draws), -1)
        sample = np.concatenate([parts.real.std(axis=0), parts.imag.std(axis=0)])
        assert_close(found, sample, rtol=0.1, why="800 draws; first order at 1 %")
        both = np.hypot(*np.split(sample, 2)) / np.sqrt(2)
        relative = (opened.random_error[output] * np.abs(opened.response[output])).ravel()
        assert_close(relative, both, rtol=0.1, why="800 draws")
    # Two parts of one output, across inputs: the correlation is carried too.
    covariance = opened.covariance_at(OMEGA)[0]
    first, second = 0, len(OMEGA)
    wanted = np.cov(scatter[:, 0, 0, 0].real, scatter[:, 0, 1, 0].real)[0, 1]
    size = np.sqrt(covariance[first, first] * covariance[second, second])
    assert_close(covariance[first, second] / size, wanted / size, atol=0.06, why="800 draws")


def test_another_vehicle_in_the_same_loop_is_the_loop_closed_anew() -> None:
    closed = fid.close_loop(vehicle(1), controller(), draws=0)
    other = fid.close_loop(vehicle(2), controller(), draws=0).loops
    first = closed.loops
    assert first.stability() is first.stability()
    assert first.frequency_response(OMEGA).size
    moved = with_part(first, PLANT, vehicle(2))
    for one, two in ((moved, other), (moved.broken_at("lat_total"), other.broken_at("lat_total"))):
        assert np.array_equal(one.frequency_response(OMEGA), two.frequency_response(OMEGA))
        assert np.array_equal(one.poles(), two.poles())
        assert np.array_equal(one.linear_system().a, two.linear_system().a)
    assert not np.allclose(moved.poles()[:3], first.poles()[:3])
    with pytest.raises(ModelError, match=r"takes no other kind of part.*same inputs"):
        with_part(first, PLANT, vehicle(2).select(inputs=["lat"]))
    with pytest.raises(ModelError, match="takes no other kind of part"):
        with_part(first, PLANT, replace(vehicle(2), delays_s=[]).sampled(0.02))


def test_a_fit_gives_intervals_and_says_when_its_vehicles_are_unstable() -> None:
    truth = fid.load_model("rate_first_order").with_values({"Lp": -3.0, "Ltphi": 60.0, "tau": 0.03})
    omega = np.geomspace(0.5, 30.0, 40)
    noise = fid.FrequencyResponse.from_values(
        omega, truth.frequency_response(omega), inputs=truth.inputs, outputs=truth.outputs,
        units=truth.units, random_error=np.full((1, 1, 40), 0.05),
    )  # fmt: skip
    fit = fid.identify(truth, noise)
    (stick,), (rate,) = truth.inputs, truth.outputs
    calm = fid.close_loop(fit, {stick: {rate: 0.1}}, draws=30)
    assert calm.is_stable
    assert calm.unstable_draws == 0
    low, high = calm.poles[0].real.interval95 or (0.0, 0.0)
    assert low < calm.poles[0].real.value < high < 0.0
    assert calm.margins()[stick].phase_margin.interval95 is not None
    around = truth.frequency_response(np.linspace(20.0, 80.0, 6001))[0, 0]
    last = 1.0 / np.abs(around[np.argmin(np.abs(np.angle(around) + np.pi))])
    near = fid.close_loop(fit, {stick: {rate: 0.985 * last}}, seed=2, draws=30)
    assert near.is_stable
    assert 0 < near.unstable_draws < near.draws
    assert any(f.code == "unstable-within-uncertainty" for f in near.findings)
    beyond = fid.close_loop(fit, {stick: {rate: 1.1 * last}}, draws=0)
    assert not beyond.is_stable
    assert beyond.findings[-1].code == "closed-loop-unstable"


def test_refuses_controllers_and_data_without_meaning() -> None:
    plant = vehicle()
    with pytest.raises(UnknownNameError, match="moves no input of the vehicle"):
        fid.close_loop(plant, {"lon": {"p": 1.0}})
    with pytest.raises(UnknownNameError, match="'lat' reads no channel of the vehicle: found 'q'"):
        fid.close_loop(plant, {"lat": {"p": 1.0, "q": 1.0}})
    with pytest.raises(UnknownNameError, match="reads nothing of the vehicle"):
        fid.close_loop(plant, {"lat": {"q": 1.0}}, outside=["q"])
    with pytest.raises(UnknownNameError, match="moves no input of the vehicle: found 'pedal'"):
        fid.close_loop(plant, {"lat": {"p": 1.0}, "pedal": {"r": 1.0}})
    tracked = fid.close_loop(plant, {"lat": {"p": 1.0, "p_ref": -1.0}}, outside=["p_ref"])
    assert "p_ref" in tracked.loops.inputs
    with pytest.raises(OptionError, match="number of draws"):
        fid.close_loop(plant, {"lat": {"p": 1.0}}, draws=-1)
    with pytest.raises(UnknownNameError, match="does not move this input"):
        fid.close_loop(plant, {"lat": {"p": 1.0}}).broken_at("ped")
    with pytest.raises(OptionError, match="what was logged is not known"):
        fid.open_loop(record(1), {"lat": {"p": 1.0}}, logged="both")
    with pytest.raises(DataError, match="no loop can be opened in this"):
        fid.open_loop([1.0], {"lat": {"p": 1.0}})
    flown = fid.FrequencyResponse.from_values([1.0], [1.0], inputs=["lat"], outputs=["p"])
    with pytest.raises(OptionError, match="is that of the bare vehicle"):
        fid.open_loop(flown, {"lat": {"p": 1.0}}, logged="total")
    with pytest.raises(UnknownNameError, match="reads what was not measured"):
        fid.open_loop(flown, {"lat": {"p": 1.0, "r": 1.0}})
    with pytest.raises(SingularError, match="takes out all that enters"):
        fid.open_loop(flown, {"lat": {"p": 1.0}})
    with pytest.raises(ShapeError, match="feedback does not fit"):
        open_loops(flown, np.zeros((2, 1, 1), dtype=complex))


def test_words_of_a_closed_loop() -> None:
    closed = fid.close_loop(vehicle(), controller(0.5), name="rig")
    assert repr(closed).startswith("ClosedLoop(2 actuators [lat, ped], stable, slowest pole -")
    assert "No intervals" in str(closed.summary())
    assert closed.to_dict()["schema"] == "flightid.closed_loop/1"
    assert "<table>" in closed._repr_html_()


def test_a_digital_loop_may_leave_a_delayed_input_alone() -> None:
    # The other input's delay acts on what rests while the loop is broken.
    digital = [
        L.gain(("p", "phi"), "law", [[-0.4, -0.3]]),
        L.sample_and_hold("law", "lat", 0.02, 0.01),
    ]
    closed = fid.close_loop(vehicle(), digital)
    assert closed.is_stable
    # The loop that its gain would first make unstable is the static one.
    still = closed.broken_at("lat").frequency_response([1e-9])[0, 0, 0].real
    found = closed.margins()["lat"].gain_margin.value
    assert_close(found, -20.0 * np.log10(-still), atol=0.05, why="the lowest frequency is not zero")
    assert all(pole.real.value is not None for pole in closed.poles)


def test_a_connection_is_a_linear_system_to_whoever_asks() -> None:
    closed = fid.close_loop(vehicle(), controller(), draws=0)
    system = closed.loops.linear_system()
    slow = np.array([0.3, 2.0])
    assert_close(system.frequency_response(slow), closed.loops.frequency_response(slow), rtol=1e-5,
                 why="delays of order three at 0.2 rad")  # fmt: skip

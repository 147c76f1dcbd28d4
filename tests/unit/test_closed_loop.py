"""Flights under a pilot: what is recorded, what acts where, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flightid as fid
from flightid import errors
from flightid.excitation import Excitation, sweep
from flightid.models.linear.linear_system import LinearSystem
from flightid.simulation import actuator_positions, simulate
from flightid.vehicles import CrudePilot, Disturbance, FlightConditions, fly_closed_loop
from tests.closeness import assert_close

SPIRAL = LinearSystem([[0.3]], [[6.0]], [[1.0]], [[0.0]], ("lat",), ("p",), [0.03])
PILOT = CrudePilot({"lat": {"p": 0.3}}, delay_s=0.1, lag_s=0.05)


def chirp(name: str = "lat", unit: str = "1", duration_s: float = 20.0) -> Excitation:
    return sweep(
        band_rad_s=(1.0, 12.0),
        amplitude=0.1,
        duration_s=duration_s,
        sample_rate_hz=100.0,
        hold_cycles=0.5,
        name=name,
        unit=unit,
    )


def test_the_record_holds_what_the_vehicle_did_with_its_logged_inputs() -> None:
    flight = fly_closed_loop(SPIRAL, PILOT, chirp(), conditions=FlightConditions(), seed=3)
    assert flight.excitations == ("sweep_lat",)
    assert np.array_equal(flight["sweep_lat"], chirp().signals[0])
    free = simulate(SPIRAL, flight)
    assert_close(free["p"], flight["p"], atol=1e-8, why="unstable: rounding grows by e^6")


def test_the_loop_is_the_pilots_equation() -> None:
    """Against an adaptive integrator that knows the delay by its own history."""
    flight = fly_closed_loop(SPIRAL, PILOT, chirp(duration_s=5.0))
    late = np.interp(flight.time_s - 0.1, flight.time_s, flight["p"], left=0.0)

    def arm(t: float, y: np.ndarray) -> np.ndarray:
        return (-y - 0.3 * np.interp(t, flight.time_s, late)) / 0.05

    span = (0.0, flight.time_s[-1])
    held = solve_ivp(arm, span, [0.0], t_eval=flight.time_s, rtol=1e-9, atol=1e-11, max_step=0.01)
    feedback = flight["lat"] - flight["sweep_lat"]
    assert np.std(feedback) > 0.01
    assert_close(feedback, held.y[0], atol=1e-7, why="integrator tolerance")


def test_known_actuators_come_out_of_the_record_again() -> None:
    moved = FlightConditions(actuators={"lat": 15.0})
    flight = fly_closed_loop(SPIRAL, PILOT, chirp(), conditions=moved)
    without = simulate(SPIRAL, actuator_positions(flight, {"lat": 15.0}))
    direct = simulate(SPIRAL, flight)
    away = float(np.max(np.abs(direct["p"] - flight["p"])))
    # The delay stands before the actuator in one and behind it in the other: samples differ a bit.
    assert float(np.max(np.abs(without["p"] - flight["p"]))) < 1e-3 * away


def test_a_gust_counts_against_its_state() -> None:
    model = fid.load_model("r50_hover")
    pilot = CrudePilot({"lat": {"phi": 0.0}}, delay_s=0.2)
    short = chirp(duration_s=6.0)
    still = fly_closed_loop(model, pilot, short)
    gusty = fly_closed_loop(
        model,
        pilot,
        short,
        conditions=FlightConditions(gusts={"v": Disturbance(3.0, 1e14)}),
        seed=5,
    )
    # A gust that lasts for ever is a constant of the air: the vehicle moves as if it had begun
    # with minus that speed, but for the speed over ground.
    pushed = simulate(model, still, initial_state=np.eye(13)[1], units=model.units)
    rest = simulate(model, still, units=model.units)
    scale = float(np.ptp(gusty["p"] - still["p"]) / np.ptp(pushed["p"] - rest["p"]))
    for name in ("p", "r", "ay", "phi"):
        gust = gusty[name] - still[name]
        air = pushed[name] - rest[name]
        sign = np.sign(gust @ air)
        assert_close(gust, sign * scale * air, atol=1e-5 * np.ptp(gust), why="linear; scale from p")


def test_a_pilot_without_gains_keeps_hands_off() -> None:
    stable = LinearSystem([[-4.0]], [[6.0]], [[1.0]], [[0.0]], ("lat",), ("p",))
    flight = fly_closed_loop(stable, CrudePilot({}), chirp())
    assert np.array_equal(flight["lat"], flight["sweep_lat"])
    assert_close(flight["p"], simulate(stable, flight)["p"], atol=1e-12, why="the same exact hold")


def test_noise_and_remnant_have_their_sizes_and_seeds() -> None:
    conditions = FlightConditions(noise={"p": 0.02}, remnant={"lat": Disturbance(0.05, 0.5)})
    pilot = CrudePilot({"lat": {"p": 0.0}}, delay_s=0.1)
    stable = LinearSystem([[-4.0]], [[6.0]], [[1.0]], [[0.0]], ("lat",), ("p",))
    flights = [
        fly_closed_loop(stable, pilot, chirp(duration_s=200.0), conditions=conditions, seed=s)
        for s in (1, 1, 2)
    ]
    assert np.array_equal(flights[0]["p"], flights[1]["p"])
    assert not np.array_equal(flights[0]["p"], flights[2]["p"])
    noise = flights[0]["p"] - simulate(stable, flights[0])["p"]
    assert_close(np.std(noise), 0.02, rtol=0.05, why="scatter of 20000 samples")
    remnant = flights[0]["lat"] - flights[0]["sweep_lat"]
    assert_close(np.std(remnant), 0.05, rtol=0.2, why="scatter of 400 correlation times")


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"pilot": CrudePilot({"lat": {"q": 1.0}})}, errors.UnknownNameError, "watches an output"),
        ({"pilot": CrudePilot({"lon": {"p": 1.0}})}, errors.UnknownNameError, "moves an input"),
        ({"excitation": chirp("lon")}, errors.UnknownNameError, "excitation moves an input"),
        ({"gusts": {"v": Disturbance(1.0, 1.0)}}, errors.UnknownNameError, "a gust counts"),
        ({"remnant": {"x": Disturbance(1.0, 1.0)}}, errors.UnknownNameError, "a remnant moves"),
        ({"noise": {"q": 1.0}}, errors.UnknownNameError, "noise is given"),
        ({"actuators": {"lon": 15.0}}, errors.UnknownNameError, "an actuator has no input"),
        ({"actuators": {"lat": -1.0}}, errors.OptionError, "bandwidth of actuator 'lat'"),
        ({"hold": "cubic"}, errors.OptionError, "hold is not known"),
        ({"seed": -1}, errors.OptionError, "seed is out of range"),
        (
            {"pilot": CrudePilot({"lat": {"p": 1.0}}, delay_s=0.001)},
            errors.OptionError,
            "reacts within a sample",
        ),
        (
            {"pilot": CrudePilot({"lat": {"p": -50.0}}), "excitation": chirp(duration_s=900.0)},
            errors.DataError,
            "output of the closed loop",
        ),
    ],
)
def test_refuses(changes: dict, kind: type[Exception], words: str) -> None:
    options = {"pilot": PILOT, "excitation": chirp(), "hold": "first", "seed": 0} | changes
    named = ("gusts", "remnant", "noise", "actuators")
    conditions = FlightConditions(**{key: options.pop(key) for key in named if key in options})
    pilot, excitation = options.pop("pilot"), options.pop("excitation")
    with pytest.raises(kind, match=words):
        fly_closed_loop(SPIRAL, pilot, excitation, conditions=conditions, **options)


def test_refuses_a_unit_of_another_kind_and_a_meaningless_disturbance() -> None:
    model = fid.load_model("r50_hover")
    with pytest.raises(errors.UnitError, match="excitation of input 'lat'"):
        fly_closed_loop(model, CrudePilot({"lat": {"phi": 0.1}}), chirp(unit="rad"))
    with pytest.raises(errors.OptionError, match="a disturbance has no meaning"):
        Disturbance(-1.0, 1.0)


def test_a_fit_needs_only_the_outputs_of_its_responses() -> None:
    model = fid.load_model("quadrotor_yaw")
    omega = np.geomspace(0.5, 20.0, 30)
    name = model.response_names[0]
    output = name.split("/")[0]
    data = fid.FrequencyResponse.from_values(
        omega,
        model.frequency_response(omega)[[list(model.outputs).index(output)]],
        inputs=model.inputs,
        outputs=[output],
        units=model.units,
    )
    assert fid.identify(model.with_responses(name), data).average_cost < 1e-9

"""The estimator's bias of state-space models: many inputs, closed loops, unstable vehicles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import cont2discrete
from scipy.stats import binom

import flightid as fid
from flightid.identification.frequency_domain.model_residuals import ModelResiduals
from flightid.simulation.model_outputs import (
    between_samples,
    driven_outputs,
    free_outputs,
    split_modes,
    systems_of,
)
from tests.closeness import assert_close

RATE_HZ = 50.0
N = 3500
OMEGA = np.geomspace(0.5, 12.0, 60)
# Without a pilot this helicopter diverges by e^20 over one record.
HOVER = fid.StateSpaceModel(
    states={"u": "ft/s", "q": "rad/s", "theta": "rad", "w": "ft/s"},
    input_units={"lon": "1", "col": "1"},
    measurements={
        "q": fid.Output("q", "rad/s"),
        "theta": fid.Output("theta", "rad"),
        "w": fid.Output("w", "ft/s"),
    },
    equations={
        "u'": "Xu*u - g*theta",
        "q'": "Mu*u + Mq*q + Mlon*lon + Mcol*col",
        "theta'": "q",
        "w'": "Zw*w + Zlon*lon + Zcol*col",
    },
    parameters=fid.Parameters(
        [
            fid.Parameter("Xu", -0.05, "1/s", free=False),
            fid.Parameter("g", 32.2, "ft/s^2", free=False),
            fid.Parameter("Mu", 0.06, "rad/(ft*s)"),
            fid.Parameter("Mq", -1.0, "1/s"),
            fid.Parameter("Mlon", 6.0, "rad/s^2"),
            fid.Parameter("Mcol", 1.5, "rad/s^2"),
            fid.Parameter("Zw", -0.6, "1/s"),
            fid.Parameter("Zlon", 8.0, "ft/s^2"),
            fid.Parameter("Zcol", -45.0, "ft/s^2"),
            fid.Parameter("tau", 0.04, "s", minimum=0.0, maximum=0.3),
        ]
    ),
    delays={"lon": "tau"},
    name="hover",
)
TRUTH = {p.name: float(p.value or 0.0) for p in HOVER.parameters.free}
START = HOVER.with_values(
    {"Mu": 0.05, "Mq": -1.3, "Mlon": 5.0, "Zw": -0.8, "Zcol": -38.0, "tau": 0.05}
)


def flight(noise: float, seed: int = 0) -> fid.Record:
    """A sampled loop holds the vehicle while both sticks are moved; feedback correlates them."""
    random = np.random.default_rng(seed)
    a, b, c, d, delays = HOVER.state_space()
    ad, bd, *_ = cont2discrete((a, b, c, d), 1.0 / RATE_HZ)
    late = round(delays[0] * RATE_HZ)
    rough = np.cumsum(random.standard_normal((2, N)), axis=1)
    injected = 0.02 * (rough - np.linspace(0, 1, N) * rough[:, -1:])
    scatter = noise * random.standard_normal((3, N)) * [[0.1], [0.05], [1.0]]
    state, held = np.zeros(4), np.zeros((2, N))
    measured = np.zeros((3, N))
    for k in range(N):
        old = held[0, k - late] if k >= late else 0.0
        fed = 0.25 * state[1] + 0.4 * state[2] + 0.004 * state[0]
        held[:, k] = injected[:, k] + [-fed, 0.01 * state[3] + 0.2 * fed]
        measured[:, k] = c @ state + d @ [old, held[1, k]] + scatter[:, k]
        state = ad @ state + bd @ [old, held[1, k]]
    return fid.Record.from_arrays(
        np.arange(N) / RATE_HZ,
        inputs={"lon": held[0], "col": held[1]},
        outputs={"q": measured[0], "theta": measured[1], "w": measured[2]},
        excitations={"d_lon": injected[0], "d_col": injected[1]},
        units={"q": "rad/s", "theta": "rad", "w": "ft/s", "lon": "1", "col": "1"},
    )


def response(record: fid.Record) -> fid.FrequencyResponse:
    return fid.estimate_response(
        record,
        inputs=["lon", "col"],
        outputs=["q", "theta", "w"],
        omega_rad_s=OMEGA,
        window_s=[20.0, 10.0],
        estimator="composite",
    )


def fitted(record: fid.Record, **options: object) -> fid.Fit:
    # A band by hand: bands by coherence would differ from flight to flight.
    return fid.identify(
        START,
        response(record),
        hold="zero",
        band_rad_s=(0.7, 6.0),
        minimum_coherence=None,
        **options,
    )


def test_an_unstable_vehicle_with_correlated_inputs_is_recovered_without_noise() -> None:
    record = flight(0.0)
    assert max(HOVER.eigenvalues().real) * record.duration_s > 20.0
    plain = fitted(record, correct_bias=False)
    assert max(abs(plain.parameters[n].value / v - 1) for n, v in TRUTH.items()) > 0.02
    fit = fitted(record)
    assert [f.light.value for f in fit.findings if f.code == "estimator-bias"] == ["green"]
    for name, value in TRUTH.items():
        assert_close(fit.parameters[name].value, value, rtol=1e-4, why=f"{name}: bias is exact")


def test_parts_in_both_directions_of_time_solve_the_same_equations() -> None:
    random = np.random.default_rng(3)
    a = np.array([[0.3, 2.0, 0.0], [-2.0, 0.3, 1.0], [0.5, 0.0, -1.0]])
    b, c = random.standard_normal((3, 2)), random.standard_normal((2, 3))
    d, delays = random.standard_normal((2, 2)), np.array([0.07, 0.031])
    step, n = 0.05, 240
    model = fid.LinearSystem(a, b, c, d, ("u", "v"), ("x", "y"), delays)
    values = np.cumsum(random.standard_normal((2, n)), axis=1)
    values[:, :4] = 0.0
    record = fid.Record.from_arrays(np.arange(n) * step, inputs={"u": values[0], "v": values[1]})
    system = systems_of(HOVER)[0].__class__(("x", "y"), ("u", "v"), (a, b, c, d), delays)
    modes = split_modes(system, n * step)
    assert [each.backwards for each in modes] == [False, True]
    for hold in ("zero", "first"):
        simulated = fid.simulate(model, record, hold=hold, initial_state=[0.2, -0.1, 0.4])
        wanted = simulated.matrix(["x", "y"])
        rest = wanted - driven_outputs(modes, between_samples(values, hold), step, hold)
        basis = free_outputs(modes, n, step)[:3].reshape(3, -1).T
        left = rest.ravel() - basis @ np.linalg.lstsq(basis, rest.ravel(), rcond=None)[0]
        assert np.max(np.abs(left)) < 1e-9 * np.max(np.abs(wanted)), hold


def test_modes_part_where_their_rates_lie_apart() -> None:
    a = np.diag([-1.0, 0.0, 0.3, 0.9])
    system = systems_of(HOVER)[0].__class__(
        ("y",), ("u",), (a, np.ones((4, 1)), np.ones((1, 4)), np.zeros((1, 1))), np.zeros(1)
    )
    assert [len(each.matrices[0]) for each in split_modes(system, 5.0)] == [3, 1]
    assert [len(each.matrices[0]) for each in split_modes(system, 50.0)] == [2, 2]
    assert [len(each.matrices[0]) for each in split_modes(system, 0.1)] == [4]
    forward, backward = split_modes(system, 50.0)
    joined = [
        each.matrices[2] @ expm(0.3 * each.matrices[0]) @ each.matrices[1]
        for each in (forward, backward)
    ]
    assert_close(sum(joined), np.exp(0.3 * np.diag(a)).sum(), rtol=1e-12, why="the same system")


def scores(noise: float, seed: int) -> NDArray[np.float64]:
    fit = fitted(flight(noise, seed))
    pairs = [(fit.parameters[name], value) for name, value in TRUTH.items()]
    return np.array([(p.value - value) / (p.stderr or np.nan) for p, value in pairs])


@pytest.mark.parametrize("flights", [1, pytest.param(3, marks=pytest.mark.nightly)])
def test_a_few_noisy_flights_lie_in_their_errors(flights: int) -> None:
    found = np.array([scores(0.1, seed) for seed in range(flights)])
    assert np.all(np.abs(found) < 4.0), found


@pytest.mark.slow
def test_intervals_of_the_unstable_vehicle_cover_the_truth() -> None:
    n_flights = 200
    found = np.array([scores(0.1, 1000 + seed) for seed in range(n_flights)])
    covered = np.mean(np.abs(found) < 1.96, axis=0)
    low, high = binom.ppf([0.0005, 0.9995], n_flights, 0.95) / n_flights
    assert np.all(covered >= low), covered
    # The heave mode lies at the edge of the band: its bar also holds the doubt about noise there.
    others = np.array([name != "Zw" for name in TRUTH])
    assert np.all(covered[others] <= high), covered
    assert 0.93 <= covered.mean() <= 0.97, covered


def test_an_output_that_a_pilot_holds_while_another_axis_is_flown_is_followed() -> None:
    """What is held to a tenth of what feeds through says nothing against a model half right."""
    model = fid.StateSpaceModel(
        states={"p": "rad/s", "q": "rad/s"},
        input_units={"lat": "1", "lon": "1"},
        measurements={"p": fid.Output("p", "rad/s"), "q": fid.Output("q", "rad/s")},
        equations={"p'": "Lp*p + Llat*lat", "q'": "Mq*q + Mlat*lat + Mlon*lon"},
        parameters=fid.Parameters(
            [
                fid.Parameter("Lp", -2.0, "1/s", free=False),
                fid.Parameter("Llat", 8.0, "rad/s^2", free=False),
                fid.Parameter("Mq", -3.0, "1/s", free=False),
                fid.Parameter("Mlon", 9.0, "rad/s^2", free=False),
                fid.Parameter("Mlat", 4.0, "rad/s^2"),
            ]
        ),
    )
    time_s = np.arange(1500) / RATE_HZ
    swept = np.sin(0.15 * time_s**2)
    records = []
    for lat, lon in ((swept, -0.98 * 4.0 / 9.0 * swept), (0.0 * swept, 0.5 * swept)):
        flown = fid.Record.from_arrays(time_s, inputs={"lat": lat, "lon": lon}, hold="zero")
        records.append(fid.simulate(model, flown, units=dict.fromkeys("pq", "rad/s")))
    response = fid.estimate_response(records, inputs=("lat", "lon"), outputs=("p", "q"))
    held, moved = (float(np.std(each["q"])) for each in records)
    assert moved > 10.0 * held
    assert response.linear is not None
    followed = ModelResiduals(response.linear, response.outputs, "zero")
    left = followed.of(model.with_values({"Mlat": 2.0}).with_responses("p/lat", "q/lat"))
    assert float(np.std(left[0][1])) > 10.0 * held, "half of what feeds through"
    with pytest.raises(fid.errors.DataError, match=r"a residual .* times the measured output"):
        followed.of(model.with_values({"Mlat": 400.0}).with_responses("p/lat", "q/lat"))

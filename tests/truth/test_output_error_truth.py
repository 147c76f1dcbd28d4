"""Output error against what is known exactly: recovery, derivatives, scatter over many flights."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

import flightid as fid
from flightid.identification.records.options import RecordOptions
from flightid.identification.records.setup import prepare_records
from tests.closeness import assert_close

Array = NDArray[np.float64]
DT = 0.02


def _driven(model: fid.StateSpaceModel, n: int, size: float, seed: int = 0) -> fid.Record:
    """Multistep-like inputs: smoothed noise, one seed for each."""
    random = np.random.default_rng(seed)
    inputs = {
        name: size * lfilter([0.1], [1.0, -0.9], np.repeat(random.choice([-1.0, 1.0], n // 25), 25))
        for name in model.inputs
    }
    n = len(next(iter(inputs.values())))
    units = {name: model.units[name] for name in model.inputs}
    return fid.Record.from_arrays(np.arange(n) * DT, inputs=inputs, units=units)


def _flown(model: fid.StateSpaceModel, n: int, size: float) -> fid.Record:
    units = {name: model.units[name] for name in model.outputs}
    return fid.simulate(model, _driven(model, n, size), units=units)


def _library(name: str) -> fid.StateSpaceModel:
    model = fid.load_model(name)
    assert isinstance(model, fid.StateSpaceModel)
    return model


def test_the_rig_quadrotor_is_recovered() -> None:
    truth = _library("quadrotor_roll_pitch")
    start = truth.with_values({p.name: 0.7 * (p.value or 0.0) for p in truth.parameters.free})
    fit = fid.identify(start, _flown(truth, 1000, 0.05))
    for parameter in truth.parameters.free:
        found = fit.parameters[parameter.name].value
        assert_close(found, parameter.value or 0.0, rtol=1e-6, why="noise-free")


def test_an_unstable_helicopter_in_hover_is_recovered_in_part() -> None:
    truth = _library("r50_hover")
    free = ["tau_f", "Lb", "Ma", "Zw", "Zcol", "Nr", "Nped", "Blat", "Alon", "tau_ped"]
    held = {p.name: p.value for p in truth.parameters.free if p.name not in free}
    truth = truth.with_fixed(**{name: value for name, value in held.items() if value is not None})
    start = truth.with_values({name: 0.85 * (truth.parameters[name].value or 0.0) for name in free})
    fit = fid.identify(start, _flown(truth, 300, 0.02))
    for name in free:
        expected = truth.parameters[name].value or 0.0
        assert_close(fit.parameters[name].value, expected, rtol=1e-6, why="noise-free")


@pytest.mark.parametrize("hold", ["first", "zero", "band_limited"])
@pytest.mark.parametrize("tau", [0.013, 0.0413, 0.0])
def test_sensitivities_match_central_differences(hold: str, tau: float) -> None:
    model = _library("short_period").with_fixed(Malphadot=-0.9).with_values({"tau": tau or 0.001})
    if not tau:
        model = model.with_fixed(tau=0.0)
    options = RecordOptions(hold=hold, input_bias=True)
    prepared = prepare_records(model, _flown(model, 200, 0.05), options)
    own = prepared.own[0].filled(np.array([0.01, -0.02, 0.003, 0.1, 0.2, 0.3]))
    free = model.parameters.free_indices
    at = model.parameters.independent_values()

    def outputs(values: Array, numbers: object = own) -> Array:
        native = numbers.native  # type: ignore[attr-defined]
        return model.native.run_record(
            values, free, prepared.arrays[0], native, prepared.hold, False
        )[0]

    slopes = model.native.run_record(at, free, prepared.arrays[0], own.native, prepared.hold, True)[
        1
    ]
    for column, place in enumerate(free):
        step = np.zeros_like(at)
        step[place] = 1e-6 * max(abs(at[place]), 0.01)
        difference = (outputs(at + step) - outputs(at - step)) / (2 * step[place])
        scale = np.max(np.abs(difference))
        assert_close(
            slopes[:, :, column] / scale, difference / scale, atol=2e-6, why="central differences"
        )
    base = np.array([0.01, -0.02, 0.003, 0.1, 0.2, 0.3])
    for k in range(3):
        step = np.zeros(6)
        step[k] = 1e-3
        up, down = (prepared.own[0].filled(base + s * step) for s in (1, -1))
        difference = (outputs(at, up) - outputs(at, down)) / 2e-3
        assert_close(
            slopes[:, :, len(free) + k], difference, atol=1e-9, why="linear in own numbers"
        )


def _coverage(flights: int, *, colour: float, records: int) -> tuple[float, float]:
    """Share of 95 % intervals that hold the truth, of parameters and of own numbers."""
    truth = _library("short_period").with_fixed(Malphadot=-0.9)
    size = {"alpha": 0.002, "q": 0.005, "nz": 0.02}
    bias = {"alpha": 0.01, "q": -0.02, "nz": 0.5}
    clean = [
        fid.simulate(
            truth,
            _driven(truth, 600, 0.05, seed),
            units={name: truth.units[name] for name in truth.outputs},
            output_bias=bias,
            initial_state=[0.01, 0.05],
        )
        for seed in range(records)
    ]
    inside, own = [], []
    for flight in range(flights):
        random = np.random.default_rng(1000 + flight)
        flown = []
        for record in clean:
            noise = {}
            for name, deviation in size.items():
                white = random.standard_normal(record.n_samples + 200)
                shaped = lfilter([np.sqrt(1 - colour**2)], [1.0, -colour], white)[200:]
                noise[name] = record[name] + deviation * shaped
            flown.append(record.replace(noise))
        fit = fid.identify(truth, flown)
        for parameter in truth.parameters.free:
            low, high = fit.parameters[parameter.name].interval95 or (np.nan, np.nan)
            inside.append(low <= (parameter.value or 0.0) <= high)
        for name, value in bias.items():
            low, high = fit.records[0].bias[name].interval95 or (np.nan, np.nan)
            own.append(low <= value <= high)
        for name, value in {"alpha": 0.01, "q": 0.05}.items():
            low, high = fit.records[0].initial_state[name].interval95 or (np.nan, np.nan)
            own.append(low <= value <= high)
    return float(np.mean(inside)), float(np.mean(own))


@pytest.mark.slow
@pytest.mark.parametrize("colour", [0.0, 0.9])
@pytest.mark.parametrize("records", [1, 3])
def test_intervals_hold_the_truth_in_95_of_100_flights(colour: float, records: int) -> None:
    parameters, own = _coverage(250, colour=colour, records=records)
    assert 0.93 <= parameters <= 0.97
    assert 0.93 <= own <= 0.97


@pytest.mark.nightly
def test_intervals_do_not_ignore_the_colour() -> None:
    assert _coverage(12, colour=0.9, records=1)[0] > 0.8

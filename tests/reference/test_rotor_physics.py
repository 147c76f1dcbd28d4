"""Rotor physics against the formulas by hand and the published figures of the R-50."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import flightid as fid
from flightid import errors
from flightid.dynamics import Blade, effective_lock_number
from flightid.dynamics.rotor.blades import flapping_time_constant
from tests.closeness import assert_close

SPEED = 850.0 * 2.0 * math.pi / 60.0
GIVEN = {"rotor time constant": 0.053, "bar time constant": 0.36}


def test_formulas_by_hand() -> None:
    blade = Blade(radius_m=2.0, root_m=1.0, chord_m=0.1, flapping_inertia_kg_m2=0.5, lift_slope=6.0)
    assert_close(blade.lock_number(1.0), 15.0 * 0.1 * 6.0 / 0.5, rtol=1e-14, why="(R⁴−r⁴)ρca/I")
    # ν₀ = √(0.02/2) = 0.1; 1 + 6·0.08/(16·0.1) = 1.3.
    assert_close(effective_lock_number(13.0, 0.08, 0.02, 6.0), 10.0, rtol=1e-14, why="by hand")
    assert_close(flapping_time_constant(4.0, 40.0), 0.1, rtol=1e-14, why="16/(γΩ)")
    # Without lift the inflow does not follow the flapping.
    assert_close(effective_lock_number(13.0, 1e-9, 0.02, 6.0), 13.0, rtol=1e-6, why="limit")


def test_published_figures_of_the_hover() -> None:
    """Mettler, Tischler and Kanade (2002), p. 62: 9.1 and 12.9 rad/s, dampings .16 and .11."""
    found = fid.rotor_physics(fid.load_model("r50_hover"), SPEED, expected=GIVEN)
    for name, printed, tolerance in (
        ("pitch flapping frequency", 9.09, 0.005),
        ("roll flapping frequency", 12.88, 0.005),
        ("pitch flapping damping", 0.16, 0.005),
        ("roll flapping damping", 0.11, 0.005),
        ("rotor time constant", 0.046, 1e-9),
        ("bar time constant", 0.342, 1e-9),
    ):
        value = found[name].identified.value
        assert_close(value, printed, atol=tolerance, why="printed digits")
    assert_close(found["bar time constant"].ratio.value, 0.95, rtol=1e-9, why="0.342/0.36")
    assert_close(found["rotor Lock number"].identified.value, 16 / (0.046 * SPEED), rtol=1e-9,
                 why="16/(τΩ)")  # fmt: skip
    assert_close(found["rotor Lock number"].expected.value, 16 / (0.053 * SPEED), rtol=1e-9,
                 why="of the given time constant")  # fmt: skip
    assert_close(found["lateral gearing"].identified.value, 0.71 / 0.14, rtol=1e-9, why="Bd/Blat")
    assert_close(found["longitudinal gearing"].identified.value, 6.44, rtol=1e-9, why="|Ac/Alon|")
    roll = fid.modes(fid.load_model("r50_hover")).mode("roll/lateral")
    assert found["roll flapping frequency"].expected_from == "full model's mode"
    assert_close(
        found["roll flapping frequency"].expected.value, abs(roll.root), rtol=1e-12, why="its mode"
    )
    assert found["lateral gearing"].expected.value is None
    assert json.loads(json.dumps(found.to_dict()))["schema"] == "flightid.rotor_physics/1"
    assert "full model's mode" in found.summary().to_text()


def _fit(free: set[str], error: float = 0.02, seed: int | None = None) -> fid.Fit:
    model = fid.load_model("r50_hover").with_responses("p/lat", "q/lon", "p/lon", "q/lat")
    rest = {p.name for p in model.parameters.free} - free
    fixed = model.with_fixed(**{name: model.parameters[name].value for name in rest})
    omega = np.geomspace(0.5, 25.0, 40)
    exact = model.frequency_response(omega)
    if seed is not None:
        random = np.random.default_rng(seed)
        noise = random.standard_normal(exact.shape) + 1j * random.standard_normal(exact.shape)
        exact = exact * (1.0 + error * noise)
    data = fid.FrequencyResponse.from_values(
        omega,
        exact,
        inputs=model.inputs,
        outputs=model.outputs,
        units=model.units,
        random_error=np.full(exact.shape, error),
    )
    return fid.identify(fixed, data, n_omega=40)


def test_intervals_and_what_differs_from_theory() -> None:
    fit = _fit({"Lb", "Ma", "tau_s", "Bd", "Ac"})
    lock = 16.0 / (0.36 * SPEED)
    found = fid.rotor_physics(fit, SPEED, bar_lock_number=lock, expected={"lateral gearing": 13.58})
    stiffness, slow = fit.parameters["Lb"], fit.parameters["tau_s"]
    assert fit.covariance is not None
    places = [fit.names.index(name) for name in ("tau_s", "Lb")]
    inner = fit.covariance[np.ix_(places, places)]
    value = 0.5 / (slow.value * np.sqrt(stiffness.value))
    slope = np.array([-value / slow.value, -value / (2.0 * stiffness.value)])
    interval = found["roll flapping damping"].identified.interval95
    assert interval is not None
    half = (interval[1] - interval[0]) / 2.0
    assert_close(half, 1.959964 * np.sqrt(slope @ inner @ slope), rtol=2e-3, why="first order")
    bar = found["bar time constant"]
    assert bar.ratio.interval95 is not None
    assert slow.interval95 is not None
    assert_close(bar.ratio.interval95, np.array(slow.interval95) / 0.36, rtol=1e-6, why="exact")
    assert found["rotor time constant"].identified.interval95 is None
    assert found["rotor time constant"].identified.reason == "its parameters were not fitted"
    assert "lateral gearing" in " ".join(f.message for f in found.findings)
    assert {f.code for f in found.findings} == {"differs-from-theory", "source-evidence"}


def test_renamed_parameters_and_other_structures() -> None:
    plain = fid.load_model("r50_hover")
    found = fid.rotor_physics(plain, SPEED, names={"bar time constant": "none"})
    assert found["roll flapping damping"].formula.endswith("τ of the rotor")
    assert found["roll flapping damping"].identified.value is not None
    with pytest.raises(errors.ModelError, match="there is no such number"):
        found["bar time constant"]


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"rotor_speed_rad_s": 0.0}, errors.OptionError, "the rotor speed is not positive"),
        ({"names": {"tail": "x"}}, errors.OptionError, "there is no such role"),
        ({"expected": {"mast": 1.0}}, errors.OptionError, "nothing is identified under this name"),
        ({"source": 3}, errors.ModelError, "rotor physics needs a state-space model"),
        ({"source": "ah64_hover"}, errors.ModelError, "the model has no parameters of a rotor"),
    ],
)
def test_refused(change: dict[str, object], error: type[Exception], message: str) -> None:
    given: dict[str, object] = {"source": "r50_hover", "rotor_speed_rad_s": SPEED} | change
    if isinstance(given["source"], str):
        given["source"] = fid.load_model(given["source"])
    with pytest.raises(error, match=message):
        fid.rotor_physics(**given)  # type: ignore[arg-type]


def test_blades_without_meaning_are_refused() -> None:
    with pytest.raises(errors.OptionError, match="a blade has a number without meaning"):
        Blade(1.0, 1.5, 0.1, 0.1)
    with pytest.raises(errors.OptionError, match="inflow correction"):
        effective_lock_number(4.0, 0.0, 0.01)


@pytest.mark.slow
def test_intervals_cover() -> None:
    """95 % of 300 flights; the truth of each number is the published model's."""
    names = ("tau_f", "tau_s", "Lb", "Ma", "Bd", "Ac", "Blat", "Alon")
    truth = {
        f.identified.name: f.identified.value
        for f in fid.rotor_physics(fid.load_model("r50_hover"), SPEED).facts
    }
    inside = dict.fromkeys(truth, 0)
    runs = 300
    for seed in range(runs):
        for fact in fid.rotor_physics(_fit(set(names), 0.03, seed), SPEED).facts:
            low, high = fact.identified.interval95 or (math.nan, math.nan)
            inside[fact.identified.name] += low <= (truth[fact.identified.name] or 0.0) <= high
    shares = {name: count / runs for name, count in inside.items()}
    assert 0.93 < float(np.mean(list(shares.values()))) < 0.97, shares
    assert all(0.90 < share < 0.99 for share in shares.values()), shares

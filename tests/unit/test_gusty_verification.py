"""Lights of a free run in gusts: red for what inputs foretell, never for gusts alone."""

import numpy as np
import pytest
import scipy

import flightid as fid

STEP_S = 0.02
ROLL = np.array([[-3.0, 0.4, 0.0], [1.0, 0.0, 0.0], [0.0, 9.8, -0.05]])
AILERON = np.array([[20.0], [0.0], [0.0]])
OUTPUTS = ("p", "phi", "v")


def model(damping: float = 1.0, gain: float = 1.0) -> fid.LinearSystem:
    a = ROLL.copy()
    a[0, 0] *= damping
    return fid.LinearSystem(a, gain * AILERON, np.eye(3), np.zeros((3, 1)), ("da",), OUTPUTS)


def flown(seed: int, gust: float) -> fid.Record:
    """A doublet in a closed loop whose injection nobody logs, by the exact step of SciPy's expm."""
    rng, n = np.random.default_rng(seed), 800
    whole = scipy.linalg.expm(np.block([[ROLL, AILERON], [np.zeros((1, 4))]]) * STEP_S)
    felt = np.array([-0.3, 0.0, 1.0])
    x, u, y, wind = np.zeros(3), np.zeros(n), np.zeros((3, n)), gust * rng.standard_normal()
    for k in range(n):
        doublet = 0.05 * ((100 <= k < 140) - 1.0 * (140 <= k < 180))
        y[:, k] = x + rng.standard_normal(3) * [0.003, 0.002, 0.02]
        u[k] = doublet - (0.1 * y[0, k - 1] + 0.3 * y[1, k - 1] if k else 0.0)
        x = whole[:3, :3] @ x + whole[:3, 3] * u[k] + felt * wind * STEP_S
        wind = 0.98 * wind + gust * 0.2 * rng.standard_normal()
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S, inputs={"da": u}, outputs=dict(zip(OUTPUTS, y, strict=True))
    ).declare(hold="zero")


def lights(which: fid.LinearSystem, gust: float) -> list[bool]:
    """Whether each of eight verifications is red."""
    found = []
    for seed in range(8):
        result = fid.verify(which, flown(seed, gust))
        found.append(any(each.light.value == "red" for each in result.findings))
    return found


def test_gusts_alone_are_not_red() -> None:
    result = fid.verify(model(), flown(0, 1.0))
    assert result.overall_theil > 0.3
    said = [each for each in result.findings if each.code == "verification-theil"]
    assert {each.light.value for each in said} == {"amber"}
    assert "as much as gusts alone make" in str(said[0])
    assert sum(lights(model(), 1.0)) == 0


@pytest.mark.parametrize("wrong", [{"gain": 0.5}, {"gain": -1.0}, {"damping": 3.0}])
def test_wrong_models_stay_red_in_gusts(wrong: dict[str, float]) -> None:
    assert sum(lights(model(**wrong), 1.0)) >= 7


def test_each_output_is_judged_by_its_own_error() -> None:
    """A right output in gusts had been red for the wrong gain of another, which was green."""
    rng, n = np.random.default_rng(2), 1500
    u = np.repeat(np.sign(rng.standard_normal(n // 50)), 50)
    gust, noise = rng.standard_normal(n) * 0.34, rng.standard_normal(n) * 0.05
    heave, spin = np.exp(-0.1 * STEP_S), np.exp(-2.0 * STEP_S)
    driven = np.concatenate([[0.0], u[:-1]])
    w = scipy.signal.lfilter([1.0], [1.0, -heave], 10.0 * (1.0 - heave) * driven + gust)
    r = scipy.signal.lfilter([1.0], [1.0, -spin], (1.0 - spin) * driven) + noise
    record = fid.Record.from_arrays(
        np.arange(n) * STEP_S, inputs={"u": u}, outputs={"w": w, "r": r}
    ).declare(hold="zero")
    a, b, d = np.diag([-0.1, -2.0]), np.array([[1.0], [2.4]]), np.zeros((2, 1))
    wrong = fid.LinearSystem(a, b, np.eye(2), d, ("u",), ("w", "r"))
    said = {each.message.split(":")[0]: each for each in fid.verify(wrong, record).findings}
    lights = {name: said[name].light.value for name in ("all outputs together", "w", "r")}
    assert lights == {"all outputs together": "amber", "w": "amber", "r": "amber"}
    assert "as much as gusts alone make" in said["w"].message
    assert "the model is wrong there" in said["r"].message


def test_errors_without_noise_are_no_gusts() -> None:
    time_s = np.arange(600) * STEP_S
    moved = fid.Record.from_arrays(time_s, inputs={"da": np.sin(2.0 * time_s)})
    record = fid.simulate(model(), moved)
    assert any(each.light.value == "red" for each in fid.verify(model(gain=-1.0), record).findings)

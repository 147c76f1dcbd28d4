"""Lights of a free run in gusts: red for what inputs foretell, never for gusts alone."""

from functools import cache

import numpy as np
import pytest
import scipy

import flightid as fid
from flightid.conventions import Light
from flightid.findings import worst
from flightid.models import Parameter, Parameters
from flightid.validation.verification.contradiction import CODE

STEP_S = 0.02
ROLL = np.array([[-3.0, 0.4, 0.0], [1.0, 0.0, 0.0], [0.0, 9.8, -0.05]])
AILERON = np.array([[20.0], [0.0], [0.0]])
OUTPUTS = ("p", "phi", "v")
UNITS = {"da": "rad", "p": "rad/s", "phi": "rad", "v": "m/s"}


def model(damping: float = 1.0, gain: float = 1.0) -> fid.LinearSystem:
    a = ROLL.copy()
    a[0, 0] *= damping
    return fid.LinearSystem(a, gain * AILERON, np.eye(3), np.zeros((3, 1)), ("da",), OUTPUTS)


def flown(seed: int, gust: float, damping: float = 1.0) -> fid.Record:
    """A doublet in a closed loop whose injection nobody logs, by the exact step of SciPy's expm."""
    rng, n = np.random.default_rng(seed), 800
    a = ROLL.copy()
    a[0, 0] *= damping
    whole = scipy.linalg.expm(np.block([[a, AILERON], [np.zeros((1, 4))]]) * STEP_S)
    felt = np.array([-0.3, 0.0, 1.0])
    x, u, y, wind = np.zeros(3), np.zeros(n), np.zeros((3, n)), gust * rng.standard_normal()
    for k in range(n):
        doublet = 0.05 * ((100 <= k < 140) - 1.0 * (140 <= k < 180))
        y[:, k] = x + rng.standard_normal(3) * [0.003, 0.002, 0.02]
        u[k] = doublet - (0.1 * y[0, k - 1] + 0.3 * y[1, k - 1] if k else 0.0)
        x = whole[:3, :3] @ x + whole[:3, 3] * u[k] + felt * wind * STEP_S
        wind = 0.98 * wind + gust * 0.2 * rng.standard_normal()
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"da": u},
        outputs=dict(zip(OUTPUTS, y, strict=True)),
        units=UNITS,
    ).declare(hold="zero")


@cache
def fitted(damping: float) -> fid.Fit:
    """Of a vehicle with that damping, in calm air."""
    structure = fid.StateSpaceModel(
        states={"p": "rad/s", "phi": "rad", "v": "m/s"},
        input_units={"da": "rad"},
        measurements={n: fid.Output(n, u) for n, u in UNITS.items() if n != "da"},
        equations={"p'": "Lp*p + Lphi*phi + Lda*da", "phi'": "p", "v'": "g*phi + Yv*v"},
        parameters=Parameters(
            [
                Parameter("Lp", -3.0 * damping, "1/s"),
                Parameter("Lphi", 0.4, "1/s^2"),
                Parameter("Lda", 20.0, "1/s^2"),
                Parameter("Yv", -0.05, "1/s"),
                Parameter("g", 9.8, "m/s^2"),
            ]
        ),
    ).with_fixed(g=9.8)
    fit = fid.identify(structure, flown(0, 0.0, damping), method="output_error")
    assert isinstance(fit, fid.Fit)
    return fit


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
    assert "gusts alone could make it" in str(said[0])
    assert sum(lights(model(), 1.0)) == 0


@pytest.mark.parametrize("wrong", [{"gain": 0.5}, {"gain": -1.0}, {"damping": 3.0}])
def test_wrong_models_stay_red_in_gusts(wrong: dict[str, float]) -> None:
    assert sum(lights(model(**wrong), 1.0)) >= 7


def test_each_output_is_judged_by_its_own_error() -> None:
    """A right output in gusts had been red for the wrong gain of another, which was green."""
    spun = "w: spun"  # A name that begins as a sentence about another output does.
    rng, n = np.random.default_rng(2), 1500
    u = np.repeat(np.sign(rng.standard_normal(n // 50)), 50)
    gust, noise = rng.standard_normal(n) * 0.34, rng.standard_normal(n) * 0.05
    heave, spin = np.exp(-0.1 * STEP_S), np.exp(-2.0 * STEP_S)
    driven = np.concatenate([[0.0], u[:-1]])
    w = scipy.signal.lfilter([1.0], [1.0, -heave], 10.0 * (1.0 - heave) * driven + gust)
    r = scipy.signal.lfilter([1.0], [1.0, -spin], (1.0 - spin) * driven) + noise
    record = fid.Record.from_arrays(
        np.arange(n) * STEP_S, inputs={"u": u}, outputs={"w": w, spun: r}
    ).declare(hold="zero")
    a, b, d = np.diag([-0.1, -2.0]), np.array([[1.0], [2.4]]), np.zeros((2, 1))
    wrong = fid.LinearSystem(a, b, np.eye(2), d, ("u",), ("w", spun))
    said = {each.message.split(": Theil")[0]: each for each in fid.verify(wrong, record).findings}
    lights = {name: said[name].light.value for name in ("all outputs together", "w", spun)}
    assert lights == dict.fromkeys(said, "amber")
    assert "gusts alone" not in said["w"].message
    assert "it may follow from what is wrong in w: spun, or be gusts" in said["w"].message
    assert "the model is wrong there" in said[spun].message


def test_errors_without_noise_are_no_gusts() -> None:
    time_s = np.arange(600) * STEP_S
    moved = fid.Record.from_arrays(time_s, inputs={"da": np.sin(2.0 * time_s)})
    record = fid.simulate(model(), moved)
    assert any(each.light.value == "red" for each in fid.verify(model(gain=-1.0), record).findings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damping", "gust", "light"), [(1.0, 0.0, None), (1.3, 0.0, "red"), (1.0, 1.0, "amber")]
)
def test_a_fit_of_a_vehicle_is_contradicted_by_what_it_is_not(
    damping: float, gust: float, light: str | None
) -> None:
    """30 % of damping in calm air is red; gusts that the fit's records had not are amber."""
    found = fid.verify(fitted(damping), flown(5, gust)).findings
    said = {each.light.value for each in found if each.code == CODE}
    assert (light in said and said <= {"amber", light}) if light else not said


@pytest.mark.parametrize(("times", "light"), [(60.0, "green"), (600.0, "unknown")])
def test_white_noise_of_the_measurement_is_no_misfit(times: float, light: str) -> None:
    record = flown(1, 0.0)
    noise = 0.002 * times * np.random.default_rng(2).standard_normal(record.n_samples)
    found = fid.verify(model(), record.replace({"v": record["v"] + noise}))
    assert found.theil["v"] > 0.25
    (said,) = (each for each in found.findings if each.message.startswith("v: "))
    assert said.light.value == light
    assert "white noise of the measurement makes" in said.message


def _sampled(damping: float) -> tuple[np.ndarray, np.ndarray]:
    above, below, _ = scipy.signal.cont2discrete(([9.0], [1.0, damping, 9.0]), 0.04)
    return above.ravel(), below


def _calm(seed: int, damping: float) -> fid.Record:
    """A second order moved by a 3-2-1-1 in calm air, with 1 % of noise."""
    random = np.random.default_rng(seed)
    u = np.repeat([0.0, 1.0, -1.0, 1.0, -1.0, 0.0], [50, 70, 50, 25, 25, 180])
    rows = scipy.signal.lfilter(*_sampled(damping), u)
    rows = rows + 0.01 * np.std(rows) * random.standard_normal(u.size)
    return fid.Record.from_arrays(
        np.arange(u.size) * 0.04, inputs={"u": u}, outputs={"q": rows}, hold="zero"
    )


def test_what_inputs_foretell_in_calm_air_is_never_green_within_the_guide() -> None:
    """A derivative off by a third hid below the coefficient's guide; a right one is green."""
    for damping, light in ((3.0, Light.GREEN), (2.2, Light.AMBER)):
        model = fid.LinearSystem(
            [[0.0, 1.0], [-9.0, -damping]], [[0.0], [9.0]], [[1.0, 0.0]], [[0.0]], ("u",), ("q",)
        )
        result = fid.verify(model, _calm(1, 3.0))
        assert result.theil["q"] < 0.25
        assert worst(result.findings) is light
        said = [each for each in result.findings if each.code == "verification-foretold"]
        assert len(said) == (light is Light.AMBER)

"""The verb identify on state-space models: set-up checks by pair, starts, bad models and data."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError, FitError, ModelError, OptionError, UnitError
from tests.closeness import assert_close
from tests.roll_and_yaw import NOISE, OMEGA, REAL, lateral

UNITS = {"p": "rad/s", "r": "rad/s", "a": "1", "d": "1"}
HELD = {"T": 0.1, "Lz": 0.0, "Nz": 0.0, "Ld": 0.0}


def responses(
    changed: dict[str, complex | np.ndarray] | None = None, **options: object
) -> fid.FrequencyResponse:
    """Exact responses, single pairs of them multiplied by a factor."""
    model = lateral()
    curve = model.frequency_response(OMEGA)
    for name, factor in (changed or {}).items():
        output, source = name.split("/")
        curve[model.outputs.index(output), model.inputs.index(source)] *= factor
    given = {"units": UNITS, "random_error": np.full(curve.shape, NOISE)} | options
    return fid.FrequencyResponse.from_values(
        OMEGA, curve, inputs=["a", "d"], outputs=["p", "r"], **given  # type: ignore[arg-type]
    )  # fmt: skip


def fitted(model: fid.StateSpaceModel, data: fid.FrequencyResponse, **options: object) -> fid.Fit:
    return fid.identify(model, data, correct_bias=False, **options)  # type: ignore[no-any-return, call-overload]


@pytest.mark.parametrize("pair", ["p/a", "r/d", "r/a"])
@pytest.mark.parametrize(
    ("factor", "code"),
    [
        (-1.0, "setup-sign"),
        (1.0 / (1j * OMEGA), "setup-integration"),
        (1j * OMEGA, "setup-integration"),
        (180.0 / np.pi, "setup-unit-factor"),
        (np.pi / 180.0, "setup-unit-factor"),
    ],
)
def test_setup_is_checked_pair_by_pair(pair: str, factor: complex, code: str) -> None:
    gains = {name: value for name, value in REAL.items() if name not in ("La", "Na", "Nd")}
    model = lateral().with_fixed(**HELD, **gains).with_responses("p/a", "r/a", "r/d")
    found = [f for f in fitted(model, responses({pair: factor})).findings if "setup" in f.code]
    assert [f.code for f in found] == [code]
    assert found[0].message.startswith(f"{pair}: ")
    assert not [f for f in fitted(model, responses()).findings if "setup" in f.code]


def test_a_fit_that_fails_says_what_looked_wrong_before_it() -> None:
    model = lateral().with_fixed(**HELD).with_responses("p/a", "r/a", "r/d")
    with pytest.raises(FitError, match=r"p/a: the data lie .* check the sign of the channels"):
        fitted(model, responses({"p/a": -1.0}))


def in_series() -> fid.StateSpaceModel:
    """Two lags one after the other: which is which cannot be told from the end."""
    lags = [fid.Parameter(n, v, "s", minimum=0.02, maximum=5.0) for n, v in (("A", 1), ("B", 1.1))]
    gain = fid.Parameter("K", 1.0, "rad/s", minimum=0.1, maximum=10.0)
    return fid.StateSpaceModel(
        states={"x": "rad/s", "y": "rad/s"},
        input_units={"u": "1"},
        measurements={"y": fid.Output("y", "rad/s")},
        equations={"A*x'": "K*u - x", "B*y'": "x - y"},
        parameters=fid.Parameters([*lags, gain]),
    )


def test_starts_are_clustered_and_reported() -> None:
    model = in_series()
    truth = model.with_values({"A": 0.1, "B": 0.8, "K": 2.0})
    data = fid.FrequencyResponse.from_values(
        OMEGA, truth.frequency_response(OMEGA), inputs=["u"], outputs=["y"],
        units={"u": "1", "y": "rad/s"}, random_error=np.full((1, 1, len(OMEGA)), NOISE),
    )  # fmt: skip
    fit = fitted(model, data, starts=24, seed=5)
    best = [each for each in fit.minima if each.objective < 1e-12]
    assert len(best) == 2
    ends = sorted((each.values["A"], each.values["B"]) for each in best)
    assert_close(ends, [(0.1, 0.8), (0.8, 0.1)], rtol=1e-6, why="both orders of the lags")
    assert all(each.count > 1 for each in best)
    assert sum(each.count for each in fit.minima) <= 24
    assert [each.objective for each in fit.minima] == sorted(e.objective for e in fit.minima)
    assert fitted(model, data, starts=24, seed=5).to_dict() == fit.to_dict()


def test_parameters_that_the_data_cannot_tell_apart_are_named() -> None:
    parameters = [*lateral().with_fixed(**HELD).parameters.values()]
    parameters += [fid.Parameter("eff", 1.0), fid.Parameter("unused", 1.0)]
    base = lateral()
    both = fid.StateSpaceModel(
        states=dict.fromkeys(("p", "r"), "rad/s"),
        input_units=dict(base.input_units),
        measurements={name: fid.Output(name, "rad/s") for name in ("p", "r")},
        equations={
            "p'": "Lp*p + Lr*r + eff*La*a + 0*unused*Ld*d",
            "r'": "Np*p + Nr*r + Na*a + Nd*d",
        },
        parameters=fid.Parameters([p for p in parameters if p.name not in ("T", "Lz", "Nz")]),
    )
    left = fitted(both.with_fixed(eff=1.0), responses())
    assert left.parameters["unused"].status == "not seen"
    assert_close(left.parameters["La"].value, REAL["La"], rtol=1e-8, why="noise-free")
    with pytest.raises(FitError, match="cannot tell these parameters apart: found La, eff"):
        fitted(both.with_fixed(unused=1.0), responses())
    fit = fitted(both.with_fixed(unused=1.0, eff=1.0), responses())
    assert_close(fit.parameters["La"].value, REAL["La"], rtol=1e-8, why="noise-free")


def test_a_parameter_of_pairs_left_out_stays_where_it_was() -> None:
    steps, step_s, rng = 6000, 0.02, np.random.default_rng(4)
    a, d = (lfilter([0.2], [1.0, -0.8], rng.standard_normal(steps)) for _ in range(2))
    truth = {"Lp": -2.0, "La": 6.0, "Nr": -0.7, "Na": 1.0, "Nd": -3.0}
    p, r = (
        lfilter([0.0, (np.exp(pole * step_s) - 1.0) / pole], [1.0, -np.exp(pole * step_s)], moved)
        for pole, moved in ((-2.0, 6.0 * a), (-0.7, a - 3.0 * d))
    )
    p, r = (y + 0.02 * y.std() * rng.standard_normal(steps) for y in (p, r))
    record = fid.Record.from_arrays(
        step_s * np.arange(steps), inputs={"a": a, "d": d}, outputs={"p": p, "r": r}
    ).declare(hold="zero")
    model = fid.StateSpaceModel(
        states={"p": "1", "r": "1"},
        input_units={"a": "1", "d": "1"},
        measurements={name: fid.Output(name, "1") for name in ("p", "r")},
        equations={"p'": "Lp*p + La*a", "r'": "Nr*r + Na*a + Nd*d"},
        parameters=fid.Parameters(
            [fid.Parameter(name, 0.8 * truth[name], "1/s") for name in truth]
        ),
    )
    data = fid.estimate_response(record, band_rad_s=(0.5, 30.0), n_omega=30)
    fit = fid.identify(model.with_responses("p/a", "r/a"), data)
    left = fit.parameters["Nd"]
    assert (left.value, left.status, left.stderr) == (0.8 * truth["Nd"], "not seen", None)
    assert fit.model.parameters["Nd"].free
    assert "not-seen" in {finding.code for finding in fit.findings}
    assert_close(fit.parameters["La"].value, truth["La"], rtol=0.1, why="seen beside it")
    with pytest.MonkeyPatch.context() as patch:  # the search itself leaves it, and goes no way off
        patch.setattr("flightid.identification.frequency_domain.fit.with_starts", lambda f, _: f)
        searched = fid.identify(model.with_responses("p/a", "r/a"), data)
    assert_close(searched.parameters["Nd"].value, 0.8 * truth["Nd"], rtol=1e-9, why="held")


def test_contradictory_bounds_are_refused() -> None:
    with pytest.raises(ModelError, match="bounds of parameter Lp contradict each other: found min"):
        fid.Parameter("Lp", -3.0, "1/s", minimum=0.0, maximum=-5.0)
    with pytest.raises(ModelError, match="value of parameter Lp lies outside its bounds"):
        lateral().with_values({"T": 0.1}).parameters.with_parameter(
            fid.Parameter("Lp", -3.0, "1/s", minimum=-1.0, maximum=0.0)
        )


def test_data_that_are_no_data() -> None:
    model = lateral().with_fixed(**HELD)
    hole = np.ones(len(OMEGA))
    hole[7] = np.nan
    with pytest.raises(DataError, match="not finite"):
        responses({"r/d": hole})
    with pytest.raises(UnitError, match="channel 'r' has another unit"):
        fitted(model, responses(units={**UNITS, "r": "deg/s"}))
    with pytest.raises(DataError, match="too few points to fit"):
        fitted(model, responses(), band_rad_s={"r/d": (50.0, 90.0)})
    poor = np.ones((2, 2, len(OMEGA)))
    poor[1, 0] = 0.2
    with pytest.raises(DataError, match="response r/a has no band to fit"):
        fitted(model, responses(coherence=poor))
    with pytest.raises(OptionError, match="band of response r/d has no meaning"):
        fitted(model, responses(), band_rad_s={"r/d": (9.0, 1.0)})


def test_divergence_is_an_error_and_a_step_into_it_is_not() -> None:
    base = in_series()
    steep = fid.StateSpaceModel(
        states=dict(base.states),
        input_units=dict(base.input_units),
        measurements={"y": fid.Output("y", "rad/s")},
        equations={"A*x'": "K*exp(e)*u - x", "B*y'": "x - y"},
        parameters=fid.Parameters([*base.parameters.values(), fid.Parameter("e", 0.5)]),
    ).with_fixed(K=1.0)
    curve = steep.with_values({"A": 0.1, "B": 0.8, "e": 1.5}).frequency_response(OMEGA)
    data = fid.FrequencyResponse.from_values(
        OMEGA, curve, inputs=["u"], outputs=["y"], units={"u": "1", "y": "rad/s"}
    )
    with pytest.raises(FitError, match="diverged from every start"):
        fitted(steep.with_values({"e": 800.0}), data)
    found = fitted(steep.with_values({"e": 60.0}), data)
    assert_close(found.parameters["e"].value, 1.5, rtol=1e-6, why="noise-free")
    short = fitted(steep, data, maximum_iterations=1)
    assert "not-converged" in [f.code for f in short.findings]


def test_a_response_that_the_start_cannot_have_is_refused() -> None:
    model = lateral().with_fixed(**HELD, Nd=0.0, Lr=0.0)
    with pytest.raises(FitError, match="the model has no response of p/d"):
        fitted(model, responses())

"""Equation error in time and frequency: exactness, closed forms, records, warnings, refusals."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.conditioning.smoothing import local_derivative, local_mean
from flightid.errors import DataError, FitError, ModelError, OptionError, UnknownNameError
from flightid.identification.records.nuisance import Nuisance
from flightid.identification.regression.harmonics import Harmonics
from flightid.identification.regression.right_side import RightSide, RightSides
from flightid.identification.regression.sampled_equations import Reconstruction
from flightid.uncertainty.spectral import spectral_covariance
from tests.closeness import assert_close
from tests.regression_flights import fly, noisy, short_period, values

METHODS = ["equation_error", "fourier_regression", "fourier_output_error"]


def roll(equation: str = "Lp*p + Llat*lat", **bounds: float) -> fid.StateSpaceModel:
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"lat": "1"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": equation},
        parameters=fid.Parameters(
            [
                fid.Parameter("Lp", -1.0, "1/s", **{"minimum": -50.0, **bounds}),
                fid.Parameter("Llat", 5.0, "rad/s^2"),
            ]
        ),
        name="roll",
    )


def roll_flight(model: fid.StateSpaceModel, offset: float = 0.0) -> fid.Record:
    fine = np.arange(20001) * 0.0005
    lat = np.sin(0.9 * fine) + 0.5 * np.sin(2.3 * fine + 1.0)
    driven = fid.Record.from_arrays(fine, inputs={"lat": lat})
    flown = fid.simulate(model, driven, units=model.units)
    return fid.Record.from_arrays(
        fine[::20],
        inputs={"lat": lat[::20] + offset},
        outputs={"p": flown["p"][::20]},
        units=model.units,
        hold="band_limited",
    )


@pytest.mark.parametrize("method", METHODS)
def test_noise_free_flights_give_the_parameters_back(method: str) -> None:
    truth = roll().with_values({"Lp": -4.0, "Llat": 20.0})
    fit = fid.identify(roll(), [roll_flight(truth), roll_flight(truth, 0.3)], method=method)
    for name, value in values(truth).items():
        found = fit.parameters[name].value
        assert_close(found, value, rtol=1e-6, why=f"{method} {name}, trims of a record drop out")


@pytest.mark.parametrize("method", METHODS)
def test_delays_and_left_side_factors_are_found(method: str) -> None:
    truth = short_period()
    start = truth.with_values({name: 0.8 * value for name, value in values(truth).items()})
    fit = fid.identify(start, fly(truth, 10.0), method=method, **_band(method))
    for name, value in values(truth).items():
        assert_close(fit.parameters[name].value, value, rtol=2e-3, why="cubics between samples")


@pytest.mark.parametrize("hold", ["zero", "first", "band_limited"])
def test_linear_equations_are_worked_out_from_few_points(
    hold: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, record = short_period(), fly(short_period(), 4.0)
    reconstruction = Reconstruction.of(model, record)
    motion, right = reconstruction.measured(record), RightSide(reconstruction, hold)
    theta = np.array([0.9 * float(p.value or 0.0) for p in model.parameters.free])

    def sides() -> RightSides:
        return right.at(theta, motion, right.bends(theta, motion))

    found = sides()
    monkeypatch.setattr(fid.StateSpaceModel, "is_linear", False)
    known = sides()
    for name in ("rates", "rate_slopes", "others", "other_slopes"):
        one, other = getattr(found, name), getattr(known, name)
        size = np.max(np.abs(other), initial=0.0)
        assert_close(one, other, atol=1e-13 * size, why=f"{name}: rounding")
    assert np.any(known.rate_slopes)


def _band(method: str) -> dict[str, tuple[float, float]]:
    return {} if method == "equation_error" else {"band_rad_s": (0.0, 20.0)}


def test_equation_error_is_numpy_least_squares_on_means_and_derivatives() -> None:
    model = roll()
    flight = roll_flight(model)
    generator = np.random.default_rng(1)
    measured = flight.replace({"p": flight["p"] + 0.01 * generator.standard_normal(1001)})
    left = local_derivative(measured["p"], 0.01, half_width=3)[4:-4]
    columns = [local_mean(measured[name], half_width=3) for name in ("p", "lat")]
    wanted = np.linalg.lstsq(np.column_stack([*columns, np.ones(993)]), left, rcond=None)[0]
    fit = fid.identify(model, measured, method="equation_error", half_width=3)
    found = [fit.parameters[name].value for name in ("Lp", "Llat")]
    assert_close(found, wanted[:2], rtol=1e-7, why="the same means of cubics")
    assert fit.records[0].outputs == ("p'",)
    assert fit.records[0].measured.unit("p'") == "rad/s^2"
    assert_close(fit.records[0].measured["p'"], left, rtol=1e-12, why="the measured side")


def test_bounds_and_nonlinear_parameters_go_through_the_bounded_search() -> None:
    truth = roll("Lp*p + sqrt(Llat^2 + Lp^2*Lp^2)*lat").with_values({"Lp": -4.0, "Llat": 20.0})
    bounded = roll("Lp*p + sqrt(Llat^2 + Lp^2*Lp^2)*lat", minimum=-3.0).with_values({"Llat": 12.0})
    fit = fid.identify(bounded, roll_flight(truth), method="equation_error")
    assert fit.parameters["Lp"].status == "at bound"
    free = fid.identify(
        roll("Lp*p + sqrt(Llat^2 + Lp^2*Lp^2)*lat").with_values({"Llat": 12.0}),
        roll_flight(truth),
        method="equation_error",
    )
    assert_close(free.parameters["Llat"].value, 20.0, rtol=1e-6, why="exact data")


def test_noise_in_the_states_is_named_with_its_size() -> None:
    flight = noisy(fly(short_period()), 3, factor=6.0)
    fit = fid.identify(short_period(), flight, method="equation_error")
    assert any(finding.code == "attenuation" for finding in fit.findings)
    shift = fit.provenance["attenuation"]
    assert isinstance(shift, dict)
    # Damping and stiffness are attenuated: the true values are larger in size.
    off = fit.parameters["Malpha"].value - values(short_period())["Malpha"]
    assert off * shift["Malpha"] > 0.0
    assert abs(shift["Malpha"] - off) < 0.6 * abs(off)


def test_output_error_may_start_from_equation_error() -> None:
    far = short_period().with_values({"Malpha": 3.0, "Melevator": -1.0, "Mq": -30.0})
    flight = noisy(fly(short_period()), 4)
    fit = fid.identify(far, flight, start_from="equation_error")
    truth = values(short_period())["Malpha"]
    assert_close(fit.parameters["Malpha"].value, truth, rtol=0.01, why="noise")
    with pytest.raises(OptionError, match="needs equations of motion"):
        fid.identify(
            fid.load_model("rate_first_order"),
            roll_flight(roll()).replace(),
            start_from="equation_error",
        )


def test_an_unstable_model_is_no_special_case_in_the_frequency_domain() -> None:
    truth = roll("Lp*p + Llat*lat").with_values({"Lp": 0.4, "Llat": 20.0})
    fit = fid.identify(roll(), roll_flight(truth), method="fourier_output_error")
    assert_close(fit.parameters["Lp"].value, 0.4, rtol=1e-5, why="exact data, growing by e⁸")
    assert_close(
        fit.records[0].modelled["p"], fit.records[0].measured["p"], atol=1e-2, why="band content"
    )


def test_fourier_sums_of_differences_know_their_ends_and_come_back() -> None:
    time_s = np.arange(101) * 0.05
    grid = Harmonics.inside((0.0, 20.0), 101, 0.05)
    walk = time_s**2
    left = grid.total(np.diff(walk))
    right = (grid.turn - 1.0) * grid.total(walk) + 0.05 * grid.turn * (walk[-1] - walk[0])
    assert_close(left, right, atol=1e-12, why="summation by parts")
    wave = np.cos(grid.omega_rad_s[3] * time_s + 0.3)
    assert_close(grid.in_time(grid.total(wave[None]))[0], wave, atol=1e-12, why="one harmonic")


def test_what_cannot_be_fitted_is_refused_with_a_reason() -> None:
    flight = fly(short_period())
    blind = fid.StateSpaceModel(
        states={"p": "rad/s", "b": "rad"},
        input_units={"lat": "1"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lb*b", "b'": "-b/T + lat/T"},
        parameters=fid.Parameters(
            [fid.Parameter("Lb", 1.0, "1/s^2"), fid.Parameter("T", 0.1, "s")]
        ),
    )
    with pytest.raises(FitError, match=r"needs every state measured.*no output for b"):
        fid.identify(blind, roll_flight(roll()), method="equation_error")
    fixed = short_period(**values(short_period()))
    with pytest.raises(FitError, match="no free parameter"):
        fid.identify(fixed, flight, method="equation_error")
    with pytest.raises(OptionError, match="half_width is too small"):
        fid.identify(short_period(), flight, method="equation_error", half_width=0)
    with pytest.raises(OptionError, match="maximum_iterations"):
        fid.identify(short_period(), flight, method="equation_error", maximum_iterations=0)
    with pytest.raises(OptionError, match="hold is not known"):
        fid.identify(short_period(), flight, method="filter_error", hold="second")
    with pytest.raises(DataError, match="too short"):
        fid.identify(short_period(), flight.segment(0.0, 0.2), method="equation_error")
    with pytest.raises(OptionError, match="band has no meaning"):
        fid.identify(short_period(), flight, method="fourier_regression", band_rad_s=(5.0, 1.0))
    with pytest.raises(DataError, match="too few harmonics"):
        fid.identify(short_period(), flight, method="fourier_output_error", band_rad_s=(5.0, 5.5))
    with pytest.raises(UnknownNameError, match="process_noise names an unknown state"):
        fid.identify(short_period(), flight, method="filter_error", process_noise=["w"])
    with pytest.raises(ModelError, match="other than linearly"):
        fid.identify(
            roll("Lp*p + Llat*lat + 0.01*p'^2/(Llat)"), roll_flight(roll()), method="equation_error"
        )
    still = roll_flight(roll()).replace({"p": np.zeros(1001), "lat": np.zeros(1001)})
    with pytest.raises(FitError, match="does not move"):
        fid.identify(roll(), still, method="fourier_output_error")


def test_local_mean_belongs_to_the_derivative() -> None:
    time_s = np.arange(40) * 0.1
    for width in (1, 2, 4):
        slope = local_derivative(time_s**4, 0.1, half_width=width)[width + 1 : -width - 1]
        mean = local_mean(4.0 * time_s**3, half_width=width)
        assert_close(mean, slope, atol=1e-12, rtol=1e-12, why="cubics between samples are exact")
    with pytest.raises(OptionError, match="needs neighbours"):
        local_mean(time_s, half_width=0)
    with pytest.raises(DataError, match="too few samples"):
        local_mean(time_s[:5])


def test_constants_of_a_record_are_least_squares_too() -> None:
    generator = np.random.default_rng(0)
    apart, rows = generator.standard_normal((30, 3)), generator.standard_normal(30)
    alike = apart.copy()
    alike[:, 2] = alike[:, 0]  # not seen apart
    for directions in (apart, alike, apart * np.array([1e-120, 1.0, 1e120])):
        found = Nuisance.best(directions, rows)
        size = np.linalg.norm(directions, axis=0)
        wanted = np.linalg.lstsq(directions / size, rows, rcond=None)[0]
        assert_close(found.values * size, wanted, atol=1e-12, why="minimum norm")
        left = found.removed_from(rows)
        assert_close((directions / size).T @ left, np.zeros(3), atol=1e-12, why="orthogonal")


def test_spectral_covariance_of_white_noise_is_the_plain_one() -> None:
    generator = np.random.default_rng(5)
    rows = generator.standard_normal((1, 4000, 2)) + 1j * generator.standard_normal((1, 4000, 2))
    noise = generator.standard_normal((1, 4000)) + 1j * generator.standard_normal((1, 4000))
    covariance, freedom = spectral_covariance(rows, noise)
    plain = np.linalg.inv(np.einsum("fp,fq->pq", rows[0].conj(), rows[0]).real)
    assert_close(np.diag(covariance), np.diag(plain), rtol=0.1, why="4000 frequencies")
    assert freedom > 1000.0


def test_fourier_output_error_refuses_what_has_no_harmonics_apart() -> None:
    bent = fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"da": "rad"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p*abs(p) + Lda*da"},
        parameters=fid.Parameters(
            [fid.Parameter("Lp", -3.0, "1/rad"), fid.Parameter("Lda", 12.0, "1/s^2")]
        ),
        name="bent",
    )
    time_s = np.arange(200) * 0.02
    driven = fid.Record.from_arrays(time_s, inputs={"da": np.sin(3 * time_s)}, units={"da": "rad"})
    record = fid.simulate(bent, driven)
    with pytest.raises(FitError, match=r"equations of 'bent'.*'fourier_regression'"):
        fid.identify(bent, record, method="fourier_output_error")


def test_noise_of_derivatives_is_no_misfit() -> None:
    flight = noisy(fly(short_period()), 0, 8.0)
    fit = fid.identify(short_period(), flight, method="equation_error")
    said = [each for each in fit.findings if each.code == "output-unexplained"]
    assert all(str(each.light) == "green" for each in said), said
    assert any("white noise of the measurements makes" in each.message for each in said)

"""Models beside the records of a response."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import scipy

import flightid as fid
from flightid.identification.frequency_domain import model_residuals, without_bias
from flightid.identification.frequency_domain.bias_objective import Objective
from flightid.identification.frequency_domain.bias_search import SearchOutcome, search
from flightid.identification.frequency_domain.estimator_bias import Correction, resonant_up_to
from flightid.identification.frequency_domain.model_residuals import ModelResiduals
from flightid.identification.frequency_domain.unknown_motion import MotionBasis
from flightid.responses.errors.noise import NoiseSpectrum, noise_of_residuals
from flightid.responses.errors.random_error import ErrorSelection
from flightid.responses.windows.transform import FoldedBasis
from tests.closeness import assert_close

MEASURED = {"u": "m/s", "q": "rad/s", "v": "m/s", "p": "rad/s"}


def test_a_model_whose_input_the_response_lacks_is_not_corrected() -> None:
    model = fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"da": "rad", "dr": "rad"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Lda*(da + dr)"},
        parameters=fid.Parameters(
            [fid.Parameter("Lp", -3.0, "1/s"), fid.Parameter("Lda", 12.0, "1/s^2")]
        ),
        name="roll",
    ).with_responses("p/da")
    made = fid.excitation.sweep(
        band_rad_s=(1.0, 20.0), amplitude=0.1, duration_s=40.0, sample_rate_hz=50.0, name="da"
    )
    both = fid.Record.from_arrays(
        made.time_s, inputs={**made.by_name, "dr": np.zeros_like(made.time_s)}
    )
    flown = fid.simulate(model, both, units={"p": "rad/s"})
    measured = fid.Record.from_arrays(
        made.time_s,
        inputs=made.by_name,
        outputs={"p": flown["p"]},
        units={"da": "rad", "p": "rad/s"},
    )
    response = fid.estimate_response(measured, band_rad_s=(1.5, 15.0), n_omega=30)
    fit = fid.identify(model, response)
    said = "no samples of its input dr; needed every input of the model; the response holds da"
    assert any(said in each.message for each in fit.findings)
    assert all(each.interval95 is None for each in fit.parameters.values())


def swept() -> fid.FrequencyResponse:
    """A sweep of a first-order rate, with a noisy gyro."""
    made = fid.excitation.sweep(
        band_rad_s=(1.0, 20.0), amplitude=0.1, duration_s=40.0, sample_rate_hz=50.0, name="tau_phi"
    )
    flown = fid.simulate(
        fid.load_model("rate_first_order"),
        fid.Record.from_excitation(made),
        units={"p": "rad/s"},
        noise=fid.Noise(sensor={"p": 0.05}),
    )
    return fid.estimate_response(flown, band_rad_s=(1.5, 15.0), n_omega=30)


def test_a_fit_makes_each_basis_and_follows_each_model_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model, response = fid.load_model("rate_first_order"), swept()
    bases: list[tuple[object, ...]] = []
    followed: list[tuple[ModelResiduals, list[float | None]]] = []
    make, follow = FoldedBasis.of, ModelResiduals._follow

    def counted(plan, omega, detrend="none"):
        bases.append((plan, omega.tobytes(), detrend))
        return make(plan, omega, detrend)

    def followed_once(self, model):
        followed.append((self, [p.value for p in model.parameters.values()]))
        return follow(self, model)

    monkeypatch.setattr(FoldedBasis, "of", counted)
    monkeypatch.setattr(ModelResiduals, "_follow", followed_once)
    fid.identify(model, response)
    assert len(bases) == len(set(bases)) > 1
    assert not any(one[0] is other[0] and one[1] == other[1] for one, other in pairwise(followed))


def hovering() -> fid.StateSpaceModel:
    """Pitch and roll of a hovering vehicle, each with a slow mode that grows, and coupled."""
    free = {"Mu": 0.004, "Mv": 0.003, "Lv": -0.03, "Lu": 0.004, "Mq": -1.2, "Lp": -3.0}
    known = {"Xu": -0.02, "Yv": -0.05, "g": 9.8, "Mlon": 3.0, "Llat": 6.0}
    units = {"Mq": "1/s", "Lp": "1/s", "Xu": "1/s", "Yv": "1/s", "g": "m/s^2"}
    units |= {"Mlon": "1/s^2", "Llat": "1/s^2"}
    return fid.StateSpaceModel(
        states={**MEASURED, "theta": "rad", "phi": "rad"},
        input_units={"lon": "rad", "lat": "rad"},
        measurements={n: fid.Output(n, u) for n, u in MEASURED.items()},
        equations={
            "u'": "Xu*u - g*theta",
            "v'": "Yv*v + g*phi",
            "q'": "Mu*u + Mv*v + Mq*q + Mlon*lon",
            "p'": "Lu*u + Lv*v + Lp*p + Llat*lat",
            "theta'": "q",
            "phi'": "p",
        },
        parameters=fid.Parameters(
            [
                fid.Parameter(name, value, units.get(name, "rad/m/s"), free=name in free)
                for name, value in {**free, **known}.items()
            ]
        ),
        name="hover",
    )


def test_slopes_of_what_a_growing_model_leaves_are_its_differences() -> None:
    """Of outputs that no model explains: weights and bases of unknown motion move with it too."""
    rng, n = np.random.default_rng(2), 600
    noise = scipy.signal.lfilter([0.05], [1.0, -0.95], rng.standard_normal((6, n)), axis=1)
    record = fid.Record.from_arrays(
        np.arange(n) / 10.0,
        inputs=dict(zip(("lon", "lat"), 0.02 * noise[:2], strict=True)),
        outputs=dict(zip(MEASURED, noise[2:] * [[20.0], [1.0], [20.0], [1.0]], strict=True)),
        units={"lon": "rad", "lat": "rad", **MEASURED},
    )
    response = fid.estimate_response(record, band_rad_s=(1.0, 5.0), n_omega=5)
    assert response.linear is not None
    followed = ModelResiduals(response.linear, response.outputs, "zero")
    model = hovering()
    free = [(p.name, p.value or 0.0) for p in model.parameters.free]
    moved = [(model.with_values({n: v * (1.0 + 1e-5)}), v * 1e-5) for n, v in free]
    slopes = followed.slopes(model, moved)[0]
    for (name, value), slope in zip(free, slopes, strict=True):
        ends = [followed.of(model.with_values({name: value * (1.0 + s)}))[0] for s in (-1e-4, 1e-4)]
        wanted = (ends[0] - ends[1]) / (2e-4 * value)
        assert np.linalg.norm(slope - wanted) < 0.01 * np.linalg.norm(wanted), name


def test_records_of_any_lengths_are_followed_as_each_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Those of one length are worked on together, as many as memory allows."""
    rng, model = np.random.default_rng(4), hovering()
    records = []
    for n in (300, 260, 300, 300, 260):
        lon, lat, *noise = rng.standard_normal((6, n))
        record = fid.Record.from_arrays(
            np.arange(n) / 10.0,
            inputs={"lat": 1e-3 * lat, "lon": 1e-3 * lon},
            outputs=dict(zip(MEASURED, noise, strict=True)),
            units={"lon": "rad", "lat": "rad", **MEASURED},
        )
        records.append(record)
    moved = [(model.with_values({"Mq": -1.2001}), -1e-4), (model.with_values({"Lp": -2.9}), 0.1)]
    response = fid.estimate_response(records, band_rad_s=(2.0, 8.0), n_omega=4)
    assert response.linear is not None
    linear = response.linear
    for hold in ("zero", "band_limited"):
        found = []
        for at_once in (model_residuals.AT_ONCE, 1):
            monkeypatch.setattr(model_residuals, "AT_ONCE", at_once)
            followed = ModelResiduals(linear, response.outputs, hold)
            groups = sorted(each for some in followed._alike.values() for each in some)
            assert groups == ([(0, 2, 3), (1, 4)] if at_once > 1 else [(k,) for k in range(5)])
            found.append((followed.of(model), followed.slopes(model, moved)))
        for together, alone in zip(*found, strict=True):
            for one, other, record in zip(together, alone, records, strict=True):
                assert one.shape == other.shape
                assert one.shape[-1] == record.n_samples
                assert_close(one, other, rtol=1e-6, atol=1e-7, why="differences of a step of 1e-4")
        monkeypatch.undo()


def test_a_fit_that_cannot_be_followed_begins_from_the_model(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Leakage bends the fit without correction, which may diverge where the model does not."""
    asked: list[np.ndarray] = []

    def refused_first(objective: Objective, x: np.ndarray) -> SearchOutcome:
        asked.append(x)
        if len(asked) == 1:
            raise fid.errors.DataError("the model cannot be followed over the records")
        return search(objective, x)

    monkeypatch.setattr(without_bias, "search", refused_first)
    fit = fid.identify(fid.load_model("rate_first_order"), swept())
    assert fit.provenance["estimator_bias"]["applied"]
    assert len(asked) == 2
    begun = [p.value for p in fid.load_model("rate_first_order").parameters.free]
    assert asked[1].tolist() == begun
    assert all(p.stderr for p in fit.parameters.values() if p.status == "free")


def test_noise_through_a_slow_light_mode_is_as_strong_as_its_peak() -> None:
    """Gusts of a mode that decays: a mean over a group of bins held a third of their power."""
    rng, step_s, n = np.random.default_rng(5), 0.1, 800
    pole = np.exp((-0.1 + 0.6j) * step_s)
    resonance = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    records = []
    for _ in range(4):
        control, gust = rng.standard_normal((2, n + 2000))
        output = scipy.signal.lfilter([0.0, 0.01], resonance, control)
        output += scipy.signal.lfilter([0.01], resonance, gust)
        records.append(
            fid.Record.from_arrays(
                np.arange(n) * step_s,
                inputs={"u": control[2000:]},
                outputs={"y": output[2000:]},
                units={"u": "1", "y": "1"},
                hold="zero",
            )
        )
    response = fid.estimate_response(records, band_rad_s=(0.4, 5.0), n_omega=20, loop="open")
    parameters = [
        fid.Parameter("K", 1.0, "1/s^2"),
        fid.Parameter("d", 0.2, "1/s"),
        fid.Parameter("w2", 0.37, "1/s^2"),
    ]
    path = fid.TransferFunction("y", "u", "K", denominator=("s^2 + d*s + w2",))
    model = fid.TransferFunctionModel((path,), fid.Parameters(parameters))
    known = Correction(response, "zero").errors(model)
    assert isinstance(known, ErrorSelection)
    noise = known.errors.noise  # type: ignore[attr-defined]
    omega, gain = scipy.signal.freqz([0.01], resonance, np.linspace(0.5, 0.7, 50) * step_s)
    truth = 2.0 * step_s * float(np.mean(np.abs(gain) ** 2))
    assert 0.6 * truth < np.mean(noise.at(omega / step_s)) < 1.6 * truth
    assert resonant_up_to(model, 0.05) == 0.0, "groups that are narrower than the mode show it"


def test_noise_through_a_growing_mode_is_as_strong_as_its_peak() -> None:
    """A band narrower than a group of bins, and than the grid of the estimate that it replaces."""
    rng, step_s, n = np.random.default_rng(3), 0.1, 800
    pole = np.exp((-0.03 + 0.6j) * step_s)
    resonance = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    white = rng.standard_normal((4, 1, n + 2000))
    left = scipy.signal.lfilter([1.0], resonance, white, axis=2)[:, :, 2000:]
    given = rng.standard_normal((4, 4, n))
    omega, gain = scipy.signal.freqz([1.0], resonance, np.linspace(0.5, 0.7, 50) * step_s)
    truth = 2.0 * step_s * float(np.mean(np.abs(gain) ** 2))
    at = omega / step_s
    smooth, found = (noise_of_residuals(left, given, step_s, 5.0, up_to) for up_to in (0.0, 1.2))
    assert np.mean(smooth.at(at)) < 0.4 * truth < 0.7 * truth < np.mean(found.at(at)) < 1.5 * truth
    coarse = NoiseSpectrum(np.array([0.25, 3.0]), np.ones((1, 2)))
    kept = coarse.replaced(found, np.array([0]))
    assert_close(kept.at(at), found.at(at), rtol=1e-9, why="on its own frequencies")
    assert_close(found.at(np.array([4.0])), smooth.at(np.array([4.0])), rtol=1e-9, why="above")


def test_a_motion_that_stands_still_has_no_direction() -> None:
    """An integrator stays where it began; divided by nothing it overflowed in slopes."""
    free = np.stack([np.ones((1, 50)), np.linspace(0.0, 1.0, 50)[None]])
    found = MotionBasis.of(free)
    assert np.isinf(found.lengths[0])
    assert not np.any(found.motions[0])
    assert not np.any(1e300 * np.ones(2) / found.lengths == np.inf)

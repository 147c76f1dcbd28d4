"""Gusts that move all outputs of an unstable vehicle at once: intervals, and what they rest on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.excitation import sweep
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.responses.errors.random_error import Points, combined, covariances
from flightid.responses.store import read_response, write_response
from flightid.vehicles import CrudePilot, Disturbance, FlightConditions, fly_closed_loop
from tests.closeness import assert_close

RATE_HZ = 25.0
FLIGHTS = 200
# Left alone this vehicle diverges with a time to double of four seconds.
HOVER = fid.StateSpaceModel(
    states={"u": "ft/s", "q": "rad/s", "theta": "rad", "w": "ft/s"},
    input_units={"lon": "1", "col": "1"},
    measurements={
        "u": fid.Output("u", "ft/s"),
        "q": fid.Output("q", "rad/s"),
        "theta": fid.Output("theta", "rad"),
        "w": fid.Output("w", "ft/s"),
    },
    equations={
        "u'": "Xu*u - g*theta",
        "q'": "Mu*u + Mq*q + Mw*w + Mlon*lon + Mcol*col",
        "theta'": "q",
        "w'": "Zw*w + Zlon*lon + Zcol*col",
    },
    parameters=fid.Parameters(
        [
            fid.Parameter("Xu", -0.05, "1/s"),
            fid.Parameter("g", 32.2, "ft/s^2", free=False),
            fid.Parameter("Mu", 0.01, "rad/(ft*s)"),
            fid.Parameter("Mq", -1.0, "1/s"),
            fid.Parameter("Mw", 0.02, "rad/(ft*s)"),
            fid.Parameter("Mlon", 6.0, "rad/s^2"),
            fid.Parameter("Mcol", 1.5, "rad/s^2"),
            fid.Parameter("Zw", -0.6, "1/s"),
            fid.Parameter("Zlon", 15.0, "ft/s^2"),
            fid.Parameter("Zcol", -45.0, "ft/s^2"),
            fid.Parameter("tau", 0.04, "s", minimum=0.0, maximum=0.3),
        ]
    ),
    delays={"lon": "tau"},
    name="hover",
)
TRUTH = {p.name: float(p.value or 0.0) for p in HOVER.parameters.free}
PILOT = CrudePilot(
    {
        "lon": {"theta": 0.35, "q": 0.15, "u": -0.003},
        "col": {"w": -0.012, "theta": 0.05},
    },
    delay_s=0.2,
    lag_s=0.1,
)
CONDITIONS = FlightConditions(
    gusts={"u": Disturbance(3.0, 2.0), "w": Disturbance(1.5, 1.0)},
    remnant={"lon": Disturbance(0.005, 0.4), "col": Disturbance(0.005, 0.4)},
    noise={"u": 0.05, "q": 0.002, "theta": 0.002, "w": 0.05},
)


def _fly(seed: int, duration_s: float = 60.0, repeats: int = 2) -> list[fid.Record]:
    return [
        fly_closed_loop(
            HOVER,
            PILOT,
            sweep(
                band_rad_s=(0.4, 12.0),
                amplitude=amplitude,
                duration_s=duration_s,
                sample_rate_hz=RATE_HZ,
                hold_cycles=1.0,
                name=name,
            ),
            conditions=CONDITIONS,
            seed=100 * seed + 10 * number + place,
        )
        for number in range(repeats)
        for place, (name, amplitude) in enumerate((("lon", 0.12), ("col", 0.15)))
    ]


def _estimate(records: list[fid.Record]) -> fid.FrequencyResponse:
    return fid.estimate_response(
        records,
        inputs=("lon", "col"),
        outputs=("u", "q", "theta", "w"),
        excitations=("sweep_lon", "sweep_col"),
        estimator="instrument",
        window_s=(20.0, 10.0, 5.0),
        band_rad_s=(0.7, 12.0),
        n_omega=24,
    )


def _fit(seed: int) -> fid.Fit:
    response = _estimate(_fly(seed))
    kept = fid.coherent_pairs(response)
    start = HOVER.with_values({name: 1.1 * value for name, value in TRUTH.items()})
    return fid.identify(
        start.with_responses(*kept.names), response, band_rad_s=kept.bands, hold="first"
    )


@pytest.mark.parametrize("method", ["composite", "instrument", "local_polynomial"])
def test_errors_of_an_output_and_its_late_copy_are_one(method: str) -> None:
    n, late, rng = 6000, 3, np.random.default_rng(4)
    excitation, noise = rng.standard_normal(n), rng.standard_normal(n + 20)
    noise = np.convolve(noise, [1.0, 0.8, 0.5], mode="valid")[:n]
    y = np.convolve(excitation, [0.5, 0.3])[:n] + 0.3 * noise
    u = excitation - 0.2 * np.roll(y, 1)
    record = fid.Record.from_arrays(
        np.arange(n) / 50.0,
        inputs={"u": u if method == "instrument" else excitation},
        outputs={"y": y, "late": np.roll(y, late)},
        excitations={"r": excitation},
    )
    response = fid.estimate_response(
        record,
        inputs="u",
        outputs=("late", "y"),
        excitations="r" if method == "instrument" else None,
        band_rad_s=(4.0, 40.0),
        n_omega=9,
        estimator=method,
    )
    assert response.errors is not None
    places = np.arange(response.n_frequencies)
    wanted = [Points(output, np.array([0]), places) for output in (0, 1)]
    turn = np.exp(-1j * response.omega_rad_s * late / 50.0)
    real, imaginary = np.diag(turn.real), np.diag(turn.imag)
    turned = np.block([[real, -imaginary], [imaginary, real]])
    alone = covariances(response.errors, wanted)[0]
    for gain, expected in ((-turned, 0.0), (turned, 4.0)):
        found = combined(response.errors, wanted, [np.eye(len(turned)), gain])
        share = np.diag(found) / np.diag(alone)
        assert_close(share, expected, atol=0.15, why="a late copy, but for what lies at the ends")


def test_one_output_at_a_time_is_what_it_was() -> None:
    response = _estimate(_fly(0, duration_s=40.0, repeats=1))
    assert response.errors is not None
    wanted = [
        Points(2, np.array([0, 1]), np.array([2, 5, 9])),
        Points(1, np.array([1]), np.array([0, 5])),
    ]
    alone = covariances(response.errors, wanted)
    for place, each in enumerate(alone):
        found = combined(response.errors, [wanted[place]], [np.eye(len(each))])
        scale = float(np.max(np.abs(each)))
        assert_close(found, each, atol=1e-6 * scale, why="side lobes beyond the band")
    wide = np.eye(sum(len(each) for each in alone))
    gains = [wide[:, : len(alone[0])], wide[:, len(alone[0]) :]]
    joint = combined(response.errors, wanted, gains)
    lowest = float(np.linalg.eigvalsh(joint)[0])
    assert lowest > -1e-9 * float(np.trace(joint))
    size = len(alone[0])
    shared = joint[:size, size:] / np.sqrt(np.outer(*map(np.diag, alone)))
    assert np.max(np.abs(shared)) > 0.3, "what moves the rate moves the attitude"


def test_a_response_from_a_file_does_not_know_what_outputs_share(tmp_path: Path) -> None:
    response = _estimate(_fly(0)).select(outputs=["q", "theta"], inputs=["lon"])
    known = {name: TRUTH[name] for name in ("Mw", "Mcol", "Zw", "Zlon", "Zcol")}
    model = HOVER.with_fixed(**known).with_responses("q/lon", "theta/lon")
    options = {"band_rad_s": (0.8, 8.0), "correct_bias": False}
    # A file brings no records to take leakage out by, which would be more than noise explains.
    response = Correction(response, "band_limited").apply(model.with_values(TRUTH))
    stored = read_response(write_response(response, tmp_path / "response.nc"))
    fits = [fid.identify(model, each, **options) for each in (response, stored)]
    codes = [{finding.code for finding in fit.findings} for fit in fits]
    assert "intervals-by-output" not in codes[0]
    assert "intervals-by-output" in codes[1]
    wide, narrow = (fit.parameters["Mlon"].stderr or 0.0 for fit in fits)
    # Rate and attitude see the same gusts: taken as two witnesses they would halve the variance.
    assert 1.2 < wide / narrow < 1.6


@pytest.mark.slow
def test_intervals_in_common_gusts_cover_the_truth() -> None:
    inside, distance = [], []
    for seed in range(FLIGHTS):
        fit = _fit(seed)
        assert fit.intervals_from == "response covariance"
        for name, value in TRUTH.items():
            found = fit.parameters[name]
            if found.interval95 is None or found.stderr is None:
                inside.append(False)
                continue
            inside.append(found.interval95[0] <= value <= found.interval95[1])
            distance.append((found.value - value) / found.stderr)
    assert 0.93 <= np.mean(inside) <= 0.97
    assert 0.9 <= np.std(distance) <= 1.1

"""Do 95 % intervals of margins cover the truth in 95 of 100 flights? Flown and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.identification.uncertain_of import uncertain_of
from flightid.responses.errors.random_error import StoredCovariance
from tests.closeness import assert_close

STEP_S = 0.02
DURATION_S = 60.0
FLIGHTS = 240
OMEGA = np.geomspace(1.5, 35.0, 30)
PLANT = fid.LinearSystem([[-3.0]], [[60.0]], [[1.0]], [[0.0]], ("u",), ("p",), [0.05])
GAIN, INTEGRAL = 0.16, 1.5


def law(z):
    """PI in samples, z = e^{jωT}."""
    return GAIN * (1.0 + INTEGRAL * STEP_S / (z - 1.0))


def broken_loop():
    """The loop from error to feedback as a system of samples, exact for the held controller."""
    plant = PLANT.sampled(STEP_S)
    a, b, c, d, _ = plant.state_space()
    n = len(a)
    # The controller's state adds up errors; its output feeds the plant.
    return fid.LinearSystem(
        np.block([[a, b * GAIN * INTEGRAL * STEP_S], [np.zeros((1, n)), np.ones((1, 1))]]),
        np.vstack([b * GAIN, [[1.0]]]),
        np.hstack([c, d * GAIN * INTEGRAL * STEP_S]),
        d * GAIN,
        ("e",),
        ("y",),
        sample_time_s=STEP_S,
    )


def flight(seed):
    """Feedback y, error e and plant input u under a swept reference and coloured gusts."""
    rng = np.random.default_rng(seed)
    loop = broken_loop()
    a, b, c, _, _ = loop.state_space()
    count = int(DURATION_S / STEP_S)
    time = np.arange(count) * STEP_S
    low, high = 0.4, 45.0
    rate = np.log(high / low) / DURATION_S
    sweep = np.sin(low / rate * (np.exp(rate * time) - 1.0)) + 0.05 * rng.standard_normal(count)
    gust = signal.lfilter([0.03], [1.0, -0.93], rng.standard_normal(count))
    numerator, denominator = signal.ss2tf(a, b, c, np.zeros((1, 1)))
    closed = denominator + numerator[0]
    feedback = signal.lfilter(numerator[0], closed, sweep) + signal.lfilter(
        denominator, closed, gust
    )
    error = sweep - feedback
    command = GAIN * (error + INTEGRAL * STEP_S * np.concatenate([[0.0], np.cumsum(error)[:-1]]))
    return fid.Record.from_arrays(
        time,
        inputs={"e": error, "tau_phi": command},
        outputs={"p": feedback},
        excitations={"r": sweep},
        units={"p": "rad/s"},
    )


def estimated(record, **options):
    """The response of a flight, its covariance worked out once for all that is asked of it."""
    response = fid.estimate_response(record, omega_rad_s=OMEGA, **options)
    covariance = response.covariance_at(OMEGA)
    return replace(response, errors=StoredCovariance(covariance, len(OMEGA)))


def covered(found, truth, names, hits):
    for name in names:
        interval = getattr(found, name).interval95
        value = getattr(truth, name).value
        if interval is not None:
            hits.setdefault(name, []).append(interval[0] <= value <= interval[1])


LEAST = {"bandwidth": 0.90}
"""The disturbance bandwidth moves by half a standard error with the windows' resolution."""


def judge(hits, title):
    shares = {name: float(np.mean(each)) for name, each in hits.items()}
    counts = {name: len(each) for name, each in hits.items()}
    for name, share in shares.items():
        assert counts[name] >= 200, (title, name, counts[name])
        assert LEAST.get(name, 0.92) <= share <= 0.98, (title, shares)
    return shares


MARGINS = ("crossover", "phase_margin", "gain_margin", "delay_margin")


def test_a_flight_is_the_loop_it_is_said_to_be():
    record = flight(0)
    found = fid.estimate_response(
        record, inputs=["e"], outputs=["p"], estimator="instrument", omega_rad_s=OMEGA
    )
    exact = broken_loop().frequency_response(OMEGA)[0, 0]
    z = np.exp(1j * OMEGA * STEP_S)
    parts = law(z) * PLANT.sampled(STEP_S).frequency_response(OMEGA)[0, 0]
    assert_close(np.abs(exact / parts), np.ones(len(OMEGA)), rtol=1e-9, why="one loop, two ways")
    ratio = found.response[0, 0] / exact
    assert_close(np.median(np.abs(ratio - 1)), 0.0, atol=0.15, why="an unbiased estimate")


@pytest.mark.slow
def test_intervals_of_measured_loops_cover():
    truth = fid.margins(broken_loop())
    rejected = fid.disturbance_rejection(broken_loop())
    direct, inverse = {}, {}
    for seed in range(FLIGHTS):
        record = flight(seed)
        loop = estimated(record, inputs=["e"], outputs=["p"], estimator="instrument")
        covered(fid.margins(loop), truth, MARGINS, direct)
        covered(fid.disturbance_rejection(loop), rejected, ("bandwidth",), direct)
        error = estimated(record, inputs=["r"], outputs=["e"])
        covered(fid.margins(error, given="sensitivity"), truth, MARGINS, inverse)
        found = fid.disturbance_rejection(error, given="sensitivity")
        covered(found, rejected, ("bandwidth", "peak"), inverse)
    judge(direct, "broken loop by the excitation")
    judge(inverse, "sensitivity")


@pytest.mark.slow
def test_intervals_of_fits_cover():
    truth = fid.margins(broken_loop())
    model = fid.load_model("rate_first_order")
    hits = {}
    for seed in range(FLIGHTS):
        response = fid.estimate_response(
            flight(seed),
            inputs=model.inputs,
            outputs=model.outputs,
            estimator="instrument",
            omega_rad_s=OMEGA,
        )
        fit = fid.identify(model, response, hold="zero")
        # The plant as the controller sees it: held inputs, samples out.
        sampled = uncertain_of(fit).then(lambda m: m.linear_system().sampled(STEP_S))
        found = fid.margins(sampled, controller=lambda s: law(np.exp(s * STEP_S)))
        covered(found, truth, MARGINS, hits)
    judge(hits, "fits")

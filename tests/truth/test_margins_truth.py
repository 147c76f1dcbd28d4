"""Margins of models and measurements against closed forms, eigenvalues and first-order errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.control.margins.loop_metrics import loop_metrics
from flightid.identification.uncertain_of import uncertain_of
from tests.closeness import assert_close
from tests.examples import examples

LAW = 0.15


def integrator(gain=4.0, delay=0.1):
    return fid.LinearSystem([[0.0]], [[gain]], [[1.0]], [[0.0]], ("e",), ("y",), [delay])


def fitted(seed=1, n=60, top=60.0):
    truth = fid.load_model("rate_integrator").with_values({"Ltphi": 150.0, "tau": 0.02})
    omega = np.geomspace(2.0, top, n)
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((2, 1, 1, n)) * 0.03
    values = truth.frequency_response(omega) * (1 + noise[0] + 1j * noise[1])
    data = fid.FrequencyResponse.from_values(
        omega,
        values,
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full((1, 1, n), 0.03),
    )
    return fid.identify(truth, data), data


def test_closed_forms_are_met_to_the_last_digits():
    found = fid.margins(integrator())
    assert_close(found.crossover.value, 4.0, rtol=1e-9, why="k")
    assert_close(found.phase_margin.value, 90 - np.degrees(0.4), rtol=1e-9, why="90 − kτ")
    assert_close(found.delay_margin.value, 0.5 * np.pi / 4 - 0.1, rtol=1e-9, why="π/2k − τ")
    limit = 0.5 * np.pi / 0.1
    assert_close(found.phase_crossover.value, limit, rtol=1e-9, why="π/2τ")
    assert_close(found.gain_margin.value, 20 * np.log10(limit / 4.0), rtol=1e-9, why="ω_180/k")
    second = fid.LinearSystem(
        [[0.0, 1.0], [0.0, -3.0]], [[0.0], [25.0]], [[1.0, 0.0]], [[0.0]], ("e",), ("y",)
    )
    peak = fid.margins(second).sensitivity_peak.value
    x = np.linspace(0, 4, 1_000_001)
    top = np.sqrt(np.max((x**2 + 0.36 * x) / ((1 - x) ** 2 + 0.36 * x)))
    assert_close(peak, top, rtol=1e-9, why="dense search")


def test_intervals_are_those_of_the_parameters():
    fit, _ = fitted()
    found = fid.margins(fit, controller=LAW)
    names, covariance = fit.names, fit.covariance
    gain, delay = (fit.parameters[name].value for name in ("Ltphi", "tau"))
    slopes = np.zeros((2, len(names)))
    slopes[0, names.index("Ltphi")] = LAW
    slopes[1, names.index("Ltphi")] = -np.degrees(LAW * delay)
    slopes[1, names.index("tau")] = -np.degrees(LAW * gain)
    stderr = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    half = [np.ptp(q.interval95) / 2 for q in (found.crossover, found.phase_margin)]
    assert_close(half, 1.959964 * stderr, rtol=1e-4, why="first order, closed form")
    assert_close(found.crossover.value, LAW * gain, rtol=1e-6, why="k L")


@pytest.mark.parametrize(("kind", "top"), [("fit", 60.0), ("fit", 3000.0), ("data", 60.0)])
def test_intervals_agree_with_draws(kind, top):
    fit, data = fitted(top=top)
    source = fit if kind == "fit" else data
    found = fid.margins(source, controller=LAW, band_rad_s=(2.0, top))
    omega = found.curve.omega_rad_s
    draws = [
        each.response if kind == "data" else each.frequency_response(omega)
        for each in uncertain_of(source).draws(300, 3)
    ]
    drawn = loop_metrics(omega, LAW * np.array(draws)[:, 0, 0])
    told = [(found.crossover, drawn.crossover_rad_s), (found.phase_margin, drawn.phase_margin_deg)]
    if top == 3000.0:  # far above the crossover, where no resonance comes near to −1
        told.append((found.modulus_margin, drawn.modulus_margin))
    elif kind == "fit":
        assert found.modulus_margin.interval95 is None
        assert "resonance above the identified band" in found.modulus_margin.reason
    for quantity, values in told:
        half = np.ptp(quantity.interval95) / 2
        assert_close(1.96 * np.std(values), half, rtol=0.2, why=f"{quantity.name}: 300 draws")


def test_closed_and_sensitivity_give_the_broken_loop():
    omega = np.geomspace(0.5, 50.0, 80)
    loop = integrator().frequency_response(omega)

    def given(values):
        return fid.FrequencyResponse.from_values(
            omega, values, inputs=["e"], outputs=["y"], random_error=np.full((1, 1, 80), 0.01)
        )

    broken = fid.margins(given(loop))
    for kind, values, slope in (
        ("closed", loop / (1 + loop), 1 / (1 + loop)),
        ("sensitivity", 1 / (1 + loop), loop / (1 + loop)),
    ):
        found = fid.margins(given(values), given=kind)
        for one, two in zip(found.quantities, broken.quantities, strict=True):
            assert (one.value is None) == (two.value is None)
            if one.value is not None:
                assert_close(one.value, two.value, rtol=1e-9, why=kind)
        # d ln L = d ln T / (1 − T) = −d ln S / (1 − S): relative errors grow by the inverse slope.
        expected = 20 / np.log(10) * 0.01 / np.abs(slope[0, 0])
        assert_close(found.curve.stderr_db, expected, rtol=0.01, why="growth of the errors")


def test_margins_of_a_measurement_are_those_of_its_model():
    omega = np.geomspace(0.5, 50.0, 400)
    exact = fid.margins(integrator())
    values = integrator().frequency_response(omega)
    found = fid.margins(
        fid.FrequencyResponse.from_values(omega, values, inputs=["e"], outputs=["y"])
    )
    for one, two in zip(found.quantities, exact.quantities, strict=True):
        if two.value is not None:
            assert_close(one.value, two.value, rtol=1e-4, why=f"{one.name} between grid points")


def chain(a, b, c):
    """The system with an integrator, continuous or of samples, in front."""
    n = len(a)
    return (
        np.block([[a, b], [np.zeros((1, n + 1))]]),
        np.vstack([np.zeros((n, 1)), np.ones((1, 1))]),
        np.hstack([c, np.zeros((1, 1))]),
    )


@examples(40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(0, 2), st.booleans())
def test_nyquist_verdict_of_models_equals_eigenvalues(seed, order, integrators, sampled):
    rng = np.random.default_rng(seed)
    size, shift = (0.7, 0.0) if sampled else (3.0, rng.choice([0.0, 3.0, 6.0]))
    a = size * rng.standard_normal((order, order)) - shift * np.eye(order)
    b, c = rng.standard_normal((order, 1)), rng.standard_normal((1, order))
    c = c * rng.choice([0.3, 1.0, 5.0, 30.0])
    for _ in range(integrators):
        a, b, c = chain(a, b, c)
        a[-1, -1] = 1.0 if sampled else 0.0
    closed = np.linalg.eigvals(a - b @ c)
    away = np.abs(closed) - 1 if sampled else closed.real
    open_poles = np.linalg.eigvals(a)
    edge = np.abs(np.abs(open_poles) - 1) if sampled else np.abs(open_poles.real)
    if np.min(np.abs(away)) < 1e-3 or np.any((edge < 1e-3) & (np.abs(open_poles.imag) > 1e-6)):
        return
    loop = fid.LinearSystem(
        a, b, c, [[0.0]], ("e",), ("y",), sample_time_s=0.1 if sampled else None
    )
    found = fid.margins(loop)
    assert found.unstable_poles == np.count_nonzero(away > 0)
    red = [each.code for each in found.findings if each.light == "red"]
    assert ("closed-loop-unstable" in red) == bool(np.any(away > 0))


@pytest.mark.parametrize("gain", [2.0, 6.0, 12.0, 30.0])
def test_delays_count_as_poles(gain):
    # k/s e^{−τs} is stable for kτ < π/2 and takes on a pair at each further 2π.
    found = fid.margins(integrator(gain, 0.3))
    expected = 2 * max(0, int(np.ceil((gain * 0.3 - 0.5 * np.pi) / (2 * np.pi))))
    assert found.unstable_poles == expected
    assert found.is_stable == (expected == 0)


def test_a_controller_may_be_given_in_every_form():
    plant = integrator(1.0, 0.05)
    lag = fid.LinearSystem([[-20.0]], [[20.0]], [[3.0]], [[0.0]], ("y",), ("e",))
    one = fid.margins(plant, controller=lag)
    two = fid.margins(plant, controller=lambda s: 3 * 20 / (s + 20))
    assert_close(one.phase_margin.value, two.phase_margin.value, rtol=1e-9, why="the same law")
    omega = np.geomspace(0.2, 100.0, 500)
    values = plant.frequency_response(omega)
    seen = fid.FrequencyResponse.from_values(omega, values, inputs=["e"], outputs=["y"])
    for law in (lag, 3 * 20 / (1j * omega + 20)):
        three = fid.margins(seen, controller=law)
        assert_close(three.phase_margin.value, one.phase_margin.value, rtol=1e-4, why="measured")
    flipped = fid.margins(integrator(-4.0), controller=-1.0)
    assert_close(flipped.phase_margin.value, 90 - np.degrees(0.4), rtol=1e-9, why="adding junction")


def test_a_connection_broken_at_a_signal_is_the_loop():
    blocks = fid.loops
    closed = fid.connect(
        [
            blocks.sum_of("e", "r", "-y"),
            blocks.transfer("e", "u", [4.0], [1.0, 0.0]),
            blocks.delay("u", "y", 0.1),
        ],
        inputs=["r"],
        outputs=["y"],
    )
    direct = fid.margins(integrator())
    for signal in ("e", "u", "y"):
        found = fid.margins(closed.broken_at(signal))
        for one, two in zip(found.quantities, direct.quantities, strict=True):
            assert (one.value is None) == (two.value is None)
            if one.value is not None:
                assert_close(one.value, two.value, rtol=1e-6, why=f"{one.name} at {signal}")
    assert found.is_stable == closed.is_stable
    disk = fid.disk_margin(closed.broken_at("e")).alpha.value
    assert_close(disk, fid.disk_margin(integrator()).alpha.value, rtol=1e-6, why="one loop")

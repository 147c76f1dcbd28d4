"""Nonlinear output error against aeroid (JAX) and diffrax: a quadrotor for 60 s at 100 Hz.

One evaluation is the outputs and their Jacobian by all parameters, with the same Runge-Kutta steps
(diffrax: Tsitouras' method with the same step). Compilation is shown apart; ours has none. Peers
that are not installed are named and left out.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import flightid as fid
from flightid import _native
from flightid.table import Column, Table

SAMPLE_S, N_SAMPLES, REPEATS = 0.01, 6001, 5
GRAVITY = 9.80665


def quadrotor_inputs() -> np.ndarray:
    """Thrust and torques over the inertias, shape (4, N_SAMPLES)."""
    t = np.arange(N_SAMPLES) * SAMPLE_S
    return np.vstack(
        [
            1.25 * GRAVITY + 2.0 * np.sin(3.1 * t),
            0.1 * np.sin(6.0 * t),
            0.1 * np.cos(5.0 * t),
            0.05 * np.sin(2.0 * t),
        ]
    )


def _dynamics(np_like: Any) -> Callable[..., Any]:
    def rates(_: Any, x: Any, u: Any, p: Any) -> Any:
        sin, cos = np_like.sin, np_like.cos
        phi, theta, psi, u_, v, w, a, b, c = (x[k] for k in range(3, 12))
        thrust, roll, pitch, yaw = (x[k] for k in range(12, 16))
        sf, cf, st, ct, sp, cp = sin(phi), cos(phi), sin(theta), cos(theta), sin(psi), cos(psi)
        turn = b * sf + c * cf
        return np_like.stack(
            [
                u_ * ct * cp + v * (sf * st * cp - cf * sp) + w * (cf * st * cp + sf * sp),
                u_ * ct * sp + v * (sf * st * sp + cf * cp) + w * (cf * st * sp - sf * cp),
                u_ * st - v * sf * ct - w * cf * ct,
                a + st / ct * turn,
                b * cf - c * sf,
                turn / ct,
                c * v - b * w - GRAVITY * st + p["Xu"] * u_ / p["m"],
                a * w - c * u_ + GRAVITY * ct * sf + p["Yv"] * v / p["m"],
                b * u_ - a * v + GRAVITY * ct * cf + (p["Zw"] * w - thrust) / p["m"],
                ((p["Iyy"] - p["Izz"]) * b * c + p["Lp"] * a + roll) / p["Ixx"],
                ((p["Izz"] - p["Ixx"]) * a * c + p["Mq"] * b + pitch) / p["Iyy"],
                ((p["Ixx"] - p["Iyy"]) * a * b + p["Nr"] * c + yaw) / p["Izz"],
                (u[0] - thrust) / p["tau_m"],
                (u[1] - roll) / p["tau_m"],
                (u[2] - pitch) / p["tau_m"],
                (u[3] - yaw) / p["tau_m"],
            ]
        )

    return rates


def _timed(call: Callable[[], object]) -> tuple[float, float]:
    """First call, and the best of the others."""
    times = []
    for _ in range(REPEATS + 1):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return times[0], min(times[1:])


def _ours(inputs: np.ndarray, start: np.ndarray) -> Callable[[], object]:
    model = fid.load_model("quadrotor_6dof").with_fixed(tau_d=0.0).with_free("tau_d")
    runs = _native.EquationRecords(model.native, [1], [([], np.zeros((0, 0)), 0, np.zeros((0, 0)))])
    record = (inputs, np.zeros((12, N_SAMPLES)), SAMPLE_S)
    own = (start, np.zeros(4), np.zeros(12), [], [], [], [])
    values, free = model.parameters.independent_values(), model.parameters.free_indices
    return lambda: runs.run_record(0, values, free, record, own, "first", True)


def _aeroid(inputs: np.ndarray, start: np.ndarray, values: dict[str, float]) -> Any:
    aeroid, autodiff = importlib.import_module("aeroid"), importlib.import_module("aeroid.autodiff")
    jax = autodiff._require_jax()
    states = (*"xyz", "phi", "theta", "psi", "u", "v", "w", "p", "q", "r", *"TLMN")
    model = aeroid.Model(
        dynamics=_dynamics(jax.numpy),
        states=states,
        controls=("F", "tau_phi", "tau_theta", "tau_psi"),
        parameters=values,
    )
    names = tuple(values)
    stamps = np.arange(N_SAMPLES) * SAMPLE_S
    rollout = autodiff._JaxRollout(
        model, stamps, inputs.T, start, names, np.array([values[n] for n in names]), range(12)
    )
    ones = np.ones(len(names))
    return lambda: (rollout.outputs(ones), rollout.residual_jacobian(ones))


def _diffrax(inputs: np.ndarray, start: np.ndarray, values: dict[str, float]) -> Any:
    jax, diffrax = importlib.import_module("jax"), importlib.import_module("diffrax")
    jax.config.update("jax_enable_x64", True)
    stamps = jax.numpy.arange(N_SAMPLES) * SAMPLE_S
    path = diffrax.LinearInterpolation(ts=stamps, ys=jax.numpy.asarray(inputs.T))
    rates, names = _dynamics(jax.numpy), tuple(values)

    def outputs(theta: Any) -> Any:
        parameters = {name: theta[k] for k, name in enumerate(names)}
        term = diffrax.ODETerm(lambda t, x, _: rates(t, x, path.evaluate(t), parameters))
        found = diffrax.diffeqsolve(
            term,
            diffrax.Tsit5(),
            0.0,
            stamps[-1],
            SAMPLE_S,
            jax.numpy.asarray(start),
            saveat=diffrax.SaveAt(ts=stamps),
            stepsize_controller=diffrax.ConstantStepSize(),
            adjoint=diffrax.ForwardMode(),
            max_steps=2 * N_SAMPLES,
        )
        return found.ys[:, :12]

    both = jax.jit(lambda theta: (outputs(theta), jax.jacfwd(outputs)(theta)))
    theta = jax.numpy.asarray([values[name] for name in names])
    return lambda: jax.block_until_ready(both(theta))


def run() -> Table:
    """Milliseconds of one evaluation with Jacobian, compilation apart, and ratios to ours."""
    inputs, start = quadrotor_inputs(), np.zeros(16)
    start[12] = 1.25 * GRAVITY
    model = fid.load_model("quadrotor_6dof")
    values = {
        each.name: float(each.value or 0.0)
        for each in model.parameters.free
        if each.name != "tau_d"
    }
    _, ours = _timed(_ours(inputs, start))
    rows: list[tuple[object, ...]] = [("flightid, 12 parameters", 0.0, 1e3 * ours, 1.0)]
    for name, make in (("aeroid", _aeroid), ("diffrax", _diffrax)):
        try:
            call = make(inputs, start, values)
        except ImportError as error:
            print(f"{name} left out: {error}")
            continue
        first, best = _timed(call)
        rows.append((f"{name} (JAX), 11 parameters", first - best, 1e3 * best, best / ours))
    columns = (
        Column("evaluation with Jacobian"),
        Column("compilation", "s"),
        Column("time", "ms"),
        Column("ratio"),
    )
    return Table("Nonlinear output error: quadrotor, 60 s at 100 Hz", columns, tuple(rows))


if __name__ == "__main__":
    print(run())

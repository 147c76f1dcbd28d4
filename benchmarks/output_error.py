"""Output error of a linear model, 130 s at 100 Hz with 8 parameters, against the usual ways.

Two rates, two controls; the same record, start and weights for all; initial state at rest. Peers:
exact sensitivities in NumPy, all columns and samples advanced at once by doubling; SciPy's
`lsim` under `least_squares` with its finite differences; the package aeroid with JAX gradients,
its fastest mode, whose compilation is part of each call as its verb does it.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import StateSpace, lsim

import flightid as fid
from flightid.models import Parameter, Parameters
from flightid.table import Column, Table

Array = NDArray[np.float64]
NAMES = ("Lp", "Lr", "Np", "Nr", "La", "Ld", "Na", "Nd")
TRUTH = np.array([-4.0, 1.2, -0.3, -0.9, 25.0, 3.0, -1.5, -6.0])
START = 0.7 * TRUTH
DT, N = 0.01, 13_000
NOISE = np.array([0.02, 0.01])
REPEATS = 5
STARTS = 20
STEPS = 4


def two_rates() -> fid.StateSpaceModel:
    """The model at its start values."""
    units = dict.fromkeys(NAMES[:4], "1/s") | dict.fromkeys(NAMES[4:], "1/s^2")
    return fid.StateSpaceModel(
        states={"p": "rad/s", "r": "rad/s"},
        input_units={"aileron": "rad", "rudder": "rad"},
        measurements={"p": fid.Output("p", "rad/s"), "r": fid.Output("r", "rad/s")},
        equations={
            "p'": "Lp*p + Lr*r + La*aileron + Ld*rudder",
            "r'": "Np*p + Nr*r + Na*aileron + Nd*rudder",
        },
        parameters=Parameters(
            [
                Parameter(name, value, units[name], *sorted((0.2 * value, 3.0 * value)))
                for name, value in zip(NAMES, START.tolist(), strict=True)
            ]
        ),
        name="two rates",
    )


def two_rates_record(seed: int = 0) -> fid.Record:
    """One flight with noise, from the true model at rest."""
    time_s = np.arange(N) * DT
    controls = {
        "aileron": 0.05 * np.sin(0.06 * time_s**1.7),
        "rudder": 0.04 * np.sin(0.05 * time_s**1.8 + 1.0),
    }
    driven = fid.Record.from_arrays(time_s, inputs=controls, units=dict.fromkeys(controls, "rad"))
    truth = two_rates().with_values(dict(zip(NAMES, TRUTH.tolist(), strict=True)))
    flown = fid.simulate(truth, driven, units={"p": "rad/s", "r": "rad/s"})
    noise = np.random.default_rng(seed).standard_normal((2, N)) * NOISE[:, None]
    return flown.replace({"p": flown["p"] + noise[0], "r": flown["r"] + noise[1]})


def _matrices(theta: Array) -> tuple[Array, Array]:
    return theta[:4].reshape(2, 2), theta[4:].reshape(2, 2)


def _discrete(theta: Array, slope: Array | None = None) -> tuple[Array, Array, Array]:
    """Transition and the weights of this sample and the next, or their derivative."""
    n, m = 2, 2
    a, b = _matrices(theta)
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n], block[:n, n : n + m] = a * DT, b * DT
    block[n : n + m, n + m :] = np.eye(m)
    if slope is None:
        found = expm(block)[:n]
    else:
        da, db = _matrices(slope)
        change = np.zeros_like(block)
        change[:n, :n], change[:n, n : n + m] = da * DT, db * DT
        both = np.block([[block, change], [np.zeros_like(block), block]])
        found = expm(both)[:n, n + 2 * m :]
    ramp = found[:, n + m :]
    return found[:, :n], found[:, n : n + m] - ramp, ramp


def _numpy_sensitivities(theta: Array, inputs: Array) -> tuple[Array, Array]:
    parts = [_discrete(theta, slope) for slope in np.eye(8)]
    transition, now, ahead = _discrete(theta)
    later = np.hstack([inputs[:, 1:], inputs[:, -1:]])
    forced = now @ inputs + ahead @ later
    slopes = np.stack([each[0] for each in parts])
    pushed = np.stack([each[1] @ inputs + each[2] @ later for each in parts])
    x = _advanced(transition, forced[None])[0]
    return x, _advanced(transition, slopes @ x + pushed)


def _advanced(transition: Array, forced: Array) -> Array:
    """States (k, 2, N) of k recursions from rest, by doubling: a product a power of two."""
    states = np.zeros_like(forced)
    states[..., 1:] = forced[..., :-1]
    power, span = transition, 1
    while span < N and np.abs(power).max() > 1e-17:
        states[..., span:] += power @ states[..., :-span]
        power, span = power @ power, 2 * span
    return states


def _numpy_fit(inputs: Array, measured: Array) -> Array:
    theta = START.copy()
    for _ in range(STEPS):
        outputs, derivatives = _numpy_sensitivities(theta, inputs)
        residual = ((measured - outputs) / NOISE[:, None]).ravel()
        slopes = (derivatives / NOISE[:, None]).reshape(8, -1)
        theta = theta + np.linalg.solve(slopes @ slopes.T, slopes @ residual)
    return theta


def _lsim_fit(inputs: Array, measured: Array) -> Array:
    time_s = np.arange(N) * DT

    def residuals(theta: Array) -> Array:
        a, b = _matrices(theta)
        system = StateSpace(a, b, np.eye(2), np.zeros((2, 2)))
        return np.asarray(((lsim(system, inputs.T, time_s)[1] - measured.T) / NOISE).ravel())

    return np.asarray(least_squares(residuals, START, x_scale=np.abs(START)).x)


def _aeroid_fit(record: fid.Record) -> Callable[[], Array] | None:
    try:
        import aeroid  # noqa: PLC0415
        import jax.numpy as jnp  # noqa: PLC0415
    except ImportError as error:
        print(f"aeroid is left out: {error}")
        return None

    def dynamics(_: float, x: Array, u: Array, parameters: dict[str, float]) -> object:
        v = parameters
        return jnp.stack(
            [
                v["Lp"] * x[0] + v["Lr"] * x[1] + v["La"] * u[0] + v["Ld"] * u[1],
                v["Np"] * x[0] + v["Nr"] * x[1] + v["Na"] * u[0] + v["Nd"] * u[1],
            ]
        )

    model = aeroid.Model(
        dynamics=dynamics,
        states=("p", "r"),
        controls=("aileron", "rudder"),
        parameters=dict(zip(NAMES, START.tolist(), strict=True)),
    )
    names = ("p", "r", "aileron", "rudder")
    data = aeroid.FlightData(record.time_s, {name: record[name] for name in names})

    def fit() -> Array:
        found = aeroid.identify(
            model,
            data,
            NAMES,
            gradient="jax",
            weights={"p": 1 / NOISE[0], "r": 1 / NOISE[1]},
            x0=np.zeros(2),
        )
        return np.array([found.parameters[name] for name in NAMES])

    return fit


def _best(call: Callable[[], Array], repeats: int) -> tuple[float, Array]:
    found = call()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return min(times), found


def _native(record: fid.Record, starts: int) -> Callable[[], Array]:
    """The search alone, as the peers have it: without statistics, findings and provenance."""
    from flightid.identification.output_error.search import search_records  # noqa: PLC0415
    from flightid.identification.records.options import RecordOptions  # noqa: PLC0415
    from flightid.identification.records.setup import prepare_records  # noqa: PLC0415

    options = RecordOptions(starts=starts, initial_state="trim", output_bias=False)
    prepared = prepare_records(two_rates(), record, options)
    return lambda: search_records(prepared, options)[0].x


def run() -> Table:
    """Processor seconds of one fit from the same start, and the ratio to the native search."""
    record = two_rates_record()
    inputs, measured = record.matrix(("aileron", "rudder")), record.matrix(("p", "r"))
    timed = {
        "native search": _best(_native(record, 1), REPEATS),
        f"native search, {STARTS} starts": _best(_native(record, STARTS), 2),
        "NumPy, exact sensitivities": _best(lambda: _numpy_fit(inputs, measured), REPEATS),
        "SciPy lsim, finite differences": _best(lambda: _lsim_fit(inputs, measured), 1),
    }
    verb = two_rates()
    timed["flightid.identify, with intervals"] = _best(
        lambda: np.array(
            [
                p.value
                for p in fid.identify(
                    verb, record, initial_state="trim", output_bias=False
                ).parameters.values()
            ]
        ),
        2,
    )
    aeroid = _aeroid_fit(record)
    if aeroid is not None:
        timed["aeroid, JAX"] = _best(aeroid, 1)
    base, best = timed["native search"]
    rows = tuple(
        (name, 1e3 * seconds, seconds / base, float(np.max(np.abs(found / best - 1.0))))
        for name, (seconds, found) in timed.items()
    )
    columns = (
        Column("way"),
        Column("time", "ms", 4),
        Column("ratio", digits=4),
        Column("largest relative difference", digits=2),
    )
    return Table("Output error, 130 s at 100 Hz, 8 parameters", columns, rows)


if __name__ == "__main__":
    print(run())

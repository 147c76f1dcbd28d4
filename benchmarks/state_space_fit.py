"""A 13-state, 40-parameter, 31-response, 60-frequency fit against SciPy on the same problem.

The vehicle is the R-50 in hover with six more couplings. The peers minimise the same weighted dB
and degree residuals from the same start: SciPy's `least_squares` with its own finite differences,
and with the analytic Jacobian vectorised over frequency in NumPy (batched solves, one adjoint
solution for all outputs, one product for all parameters of a response).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

import flightid as fid
from flightid.identification.frequency_domain.selection import coherence_weight
from flightid.table import Column, Table

OMEGA = np.geomspace(0.3, 40.0, 60)
DECIBEL, DEGREE = 20.0 / np.log(10.0), 180.0 / np.pi
REPEATS = 7
NOISE = 0.03
COUPLINGS = {
    "Lw": (0.03, "rad/(ft*s)", "p'", "w"),
    "Mw": (-0.02, "rad/(ft*s)", "q'", "w"),
    "Lped": (4.0, "rad/s^2", "p'", "ped"),
    "Lcol": (1.5, "rad/s^2", "p'", "col"),
    "Mcol": (-2.0, "rad/s^2", "q'", "col"),
    "Yped": (2.0, "ft/s^2", "v'", "ped"),
}
"""Six more parameters: value, unit, equation, and what it multiplies."""
PAIRS = [
    *(f"{output}/lat" for output in ("um", "vm", "w", "p", "q", "r", "ax", "ay")),
    *(f"{output}/lon" for output in ("um", "vm", "w", "p", "q", "r", "ax", "ay")),
    *(f"{output}/ped" for output in ("vm", "w", "p", "q", "r", "ax", "ay")),
    *(f"{output}/col" for output in ("um", "vm", "w", "p", "q", "r", "ax", "az")),
]


def vehicle() -> fid.StateSpaceModel:
    """The R-50 in hover with 40 free parameters and 31 responses."""
    plain = fid.load_model("r50_hover").to_dict()
    equations = dict(plain["equations"])  # type: ignore[call-overload]
    parameters = dict(plain["parameters"])  # type: ignore[call-overload]
    for name, (value, unit, left, factor) in COUPLINGS.items():
        equations[left] += f" + {name}*{factor}"
        parameters[name] = {"value": value, "unit": unit}
    content = {**plain, "equations": equations, "parameters": parameters}
    content = {key: value for key, value in content.items() if key not in ("schema", "responses")}
    return fid.StateSpaceModel.from_dict(content).with_responses(*PAIRS)


@dataclass(frozen=True)
class Case:
    """The numbers of the fit: what is measured, its weights, and the start."""

    model: fid.StateSpaceModel
    measured: np.ndarray
    gain: np.ndarray
    phase: np.ndarray
    start: np.ndarray

    @property
    def data(self) -> list[tuple[np.ndarray, ...]]:
        """As the native fit takes it."""
        return [(OMEGA, row, self.gain, self.phase) for row in np.ascontiguousarray(self.measured)]

    @property
    def begun(self) -> fid.StateSpaceModel:
        """The model at the start."""
        names = (parameter.name for parameter in self.model.parameters.free)
        return self.model.with_values(dict(zip(names, self.start.tolist(), strict=True)))

    @property
    def responses(self) -> fid.FrequencyResponse:
        """As the verb takes it; pairs that are not fitted hold ones."""
        names = [pair.split("/") for pair in PAIRS]
        outputs, inputs = (list(dict.fromkeys(each)) for each in zip(*names, strict=True))
        values = np.ones((len(outputs), len(inputs), len(OMEGA)), dtype=complex)
        for (output, source), row in zip(names, self.measured, strict=True):
            values[outputs.index(output), inputs.index(source)] = row
        return fid.FrequencyResponse.from_values(
            OMEGA,
            values,
            inputs=inputs,
            outputs=outputs,
            units={name: self.model.units[name] for name in (*outputs, *inputs)},
            coherence=np.full(values.shape, 0.95),
            random_error=np.full(values.shape, NOISE),
        )


def make_case(noise: float, seed: int, spread: float) -> Case:
    """Responses of the truth with noise, and a start within a relative spread of it."""
    model, random = vehicle(), np.random.default_rng(seed)
    values = model.parameters.independent_values()
    clean = model.native.response(values, OMEGA)
    errors = noise * random.standard_normal((2, *clean.shape))
    truth = values[model.parameters.free_indices]
    start = truth * random.uniform(1.0 - spread, 1.0 + spread, len(truth))
    weight = coherence_weight(np.full(len(OMEGA), 0.95)) * 20.0 / len(OMEGA)
    gain, phase = np.sqrt(weight), np.sqrt(0.01745 * weight)
    return Case(model, clean * np.exp(errors[0] + 1j * errors[1]), gain, phase, start)


def bounds(model: fid.StateSpaceModel) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds of the free parameters."""
    free = model.parameters.free
    return np.array([p.minimum for p in free]), np.array([p.maximum for p in free])


def native_fit(case: Case, starts: np.ndarray, iterations: int = 200) -> list:  # type: ignore[type-arg]
    """Ends of the native search from each start."""
    low, high = bounds(case.model)
    parameters = case.model.parameters
    return case.model.native.fit(
        parameters.independent_values(),
        parameters.free_indices,
        case.data,
        [],
        np.ascontiguousarray(np.atleast_2d(starts)),
        low,
        high,
        iterations,
    )


class Peer:
    """The same residuals and their analytic Jacobian, vectorised over frequency in NumPy."""

    def __init__(self, case: Case) -> None:
        self.case, model = case, case.model
        self.values = model.parameters.independent_values()
        self.places = model.parameters.free_indices
        self.point = model._point(None)
        self.slopes = model.native.sensitivities(self.values, self.point, self.places)
        tape = model.parameters.tape(model.delays.values())
        self.late = tape.jacobian(self.values, self.places)
        names = [pair.split("/") for pair in PAIRS]
        self.rows = np.array([model.outputs.index(output) for output, _ in names])
        self.columns = np.array([model.inputs.index(source) for _, source in names])
        self.n = len(model.states)

    def parts(self, x: np.ndarray) -> tuple[np.ndarray, ...]:
        """Matrices at each frequency, states, responses without delay, and delays."""
        values = self.values.copy()
        values[self.places] = x
        found, slopes = self.case.model.native.linearise(values, self.point)
        s, n = 1j * OMEGA[:, None, None], self.n
        dynamic = s * slopes[:, :n] + slopes[:, n : 2 * n]
        states = np.linalg.solve(dynamic[:, :n], -slopes[:n, 2 * n :])
        whole = dynamic[:, n:] @ states + slopes[n:, 2 * n :]
        delays = found[-len(self.case.model.inputs) :]
        return dynamic, states, whole[:, self.rows, self.columns], delays

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Weighted dB, then degrees."""
        _, _, curves, delays = self.parts(x)
        turn = np.exp(-1j * np.outer(OMEGA, delays[self.columns]))
        ratio = (curves * turn) / self.case.measured.T
        gain, phase = self.case.gain[:, None], self.case.phase[:, None]
        both = gain * DECIBEL * np.log(np.abs(ratio)), phase * DEGREE * np.angle(ratio)
        return np.concatenate([part.ravel() for part in both])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """From one adjoint solution for all outputs, and sums over the entries' derivatives."""
        dynamic, states, curves, _ = self.parts(x)
        n = self.n
        adjoints = np.linalg.solve(dynamic[:, :n].transpose(0, 2, 1), dynamic[:, n:].swapaxes(1, 2))
        outer = np.concatenate(
            [
                -adjoints.swapaxes(1, 2)[:, self.rows],
                np.eye(len(dynamic[0]) - n)[self.rows][None] + np.zeros((len(OMEGA), 1, 1)),
            ],
            axis=2,
        )
        eye = np.broadcast_to(np.eye(states.shape[2]), (len(OMEGA), *[states.shape[2]] * 2))
        inner = np.concatenate([1j * OMEGA[:, None, None] * states, states, eye], axis=1)
        k, i, j = np.nonzero(self.slopes)
        terms = outer[:, :, i] * inner[:, j][:, :, self.columns].swapaxes(1, 2)
        terms *= self.slopes[k, i, j]
        spread = np.zeros((len(k), len(self.places)))
        spread[np.arange(len(k)), k] = 1.0
        gradient = (terms @ spread) / curves[:, :, None]
        gradient -= 1j * OMEGA[:, None, None] * self.late[self.columns]
        gain, phase = self.case.gain[:, None, None], self.case.phase[:, None, None]
        both = gain * DECIBEL * gradient.real, phase * DEGREE * gradient.imag
        return np.concatenate([part.reshape(-1, len(self.places)) for part in both])

    def fit(self, jacobian: object) -> float:
        """Cost at the end of SciPy's search."""
        low, high = bounds(self.case.model)
        start = np.clip(self.case.start, low + 1e-9, high - 1e-9)
        found = least_squares(self.residuals, start, jacobian, (low, high), x_scale="jac")
        return float(2.0 * found.cost)


def _best(call: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return min(times)


def run() -> Table:
    """Milliseconds a fit, and the ratio to the native fit."""
    case = make_case(NOISE, seed=0, spread=0.2)
    peer, begun, data = Peer(case), case.begun, case.responses

    def verb() -> fid.Fit:
        return fid.identify(begun, data, n_omega=len(OMEGA))

    cases = (
        ("flightid, native", lambda: native_fit(case, case.start)[0][1], REPEATS),
        ("flightid, identify with error bars", lambda: verb().cost, REPEATS),
        ("SciPy least_squares, analytic NumPy", lambda: peer.fit(peer.jacobian), 3),
        ("SciPy least_squares, finite differences", lambda: peer.fit("2-point"), 1),
    )
    found = [(name, 1e3 * _best(call, repeats), call()) for name, call, repeats in cases]
    rows = tuple((name, ms, ms / found[0][1], cost) for name, ms, cost in found)
    columns = (
        Column("fit"),
        Column("time", "ms", 3),
        Column("times the native", digits=3),
        Column("cost", digits=8),
    )
    notes = (f"{native_fit(case, case.start)[0][4]} steps of the native search.",)
    title = "13 states, 40 parameters, 31 responses, 60 frequencies; one start"
    return Table(title, columns, rows, notes)

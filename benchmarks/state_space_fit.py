"""A 13-state, 40-parameter, 31-response, 60-frequency fit against SciPy on the same problem.

The vehicle is the R-50 in hover with six more couplings. The peers minimise the same weighted dB
and degree residuals from the same start: SciPy's `least_squares` with its own finite differences,
and with the analytic Jacobian vectorised over frequency in NumPy (batched solves, one adjoint
solution for all outputs, one product for all parameters of a response).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import flightid as fid
from flightid.identification.selection import coherence_weight

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

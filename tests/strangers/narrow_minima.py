"""Minima with the estimator inside: how many searches end at a wrong one, how many are refused.

Run: python -m tests.strangers.narrow_minima [--runs 200] [--first-seed 1000]

"light": a lightly damped mode in records of 10 to 40 s, whose leakage makes many narrow minima. A
fit is wrong where its cost is 5 % above that of the one that begins at the truth. "lacking": sweeps
of a rate behind two lags and something that the structure lacks (a filter, a load, a bending
frame), where the cost may rise as leakage is taken out; wrong as above, from the best that the
structure can at the fitted points.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import StateSpace, TransferFunction, lfilter, lsim

import flightid as fid
from flightid.errors import FlightidError
from tests.strangers import responses
from tests.strangers.noises import Array

WRONG = 1.05
STEP_S, EVERY = 0.001, 5


@dataclass(frozen=True)
class Searched:
    """A fit beside the one that begins where it should end."""

    cost: float
    least: float
    plain: float
    applied: bool
    scores: tuple[float, ...]

    @property
    def wrong(self) -> bool:
        """Whether a lower minimum is known."""
        return self.applied and self.cost > WRONG * self.least

    @property
    def risen(self) -> bool:
        """Whether the cost rose by more than a tenth at the lowest minimum that is known."""
        return self.least > 1.1 * self.plain


def _begun_at(
    model: fid.TransferFunctionModel | fid.StateSpaceModel,
    response: fid.FrequencyResponse,
    truth: dict[str, float],
) -> Searched:
    fit = fid.identify(model, response)
    exact = fid.identify(model.with_values(truth), response)
    plain = fid.identify(model, response, correct_bias=False)
    done = bool(fit.provenance["estimator_bias"]["applied"])  # type: ignore[index]
    known = [(fit.parameters[name], value) for name, value in truth.items()]
    scores = tuple((p.value - value) / p.stderr for p, value in known if p.stderr)
    least = min(exact.objective, fit.objective) if done else exact.objective
    return Searched(fit.objective, least, plain.objective, done, scores)


def light(seed: int) -> Searched:
    """A mode of damping .005 to .1, swept or by multisine, noise of .2 to 15 %."""
    r = np.random.default_rng(seed)
    zeta = float(r.choice([0.005, 0.01, 0.02, 0.05, 0.1]))
    n = round(float(r.choice([10, 20, 30, 40])) / responses.STEP_S)
    shape = responses.sweep if r.random() < 0.5 else responses.multisine
    roughness, u = float(r.choice([0.002, 0.01, 0.05, 0.15])), shape(n)
    damping = 2.0 * zeta * np.sqrt(responses.NATURAL)
    a = [[0.0, 1.0], [-responses.NATURAL, -damping]]
    y = responses.held(a, [0.0, 8.0], [[1.0, 0.0]], u)[0]
    record = fid.Record.from_arrays(
        np.arange(n) * responses.STEP_S, inputs={"u": u},
        outputs={"y": y + roughness * y.std() * r.standard_normal(n)}, hold="zero",
    )  # fmt: skip
    model = responses.oscillator(zeta * float(np.exp(r.normal(0.0, 0.4))))
    truth = {"K": 8.0, "d": damping, "w2": responses.NATURAL}
    return _begun_at(model, fid.estimate_response(record), truth)


def _vehicle(r: np.random.Generator) -> TransferFunction:
    """Two lags, and what a rate with a motor's lag does not hold."""
    gain, damping = 1000.0 * np.exp(r.normal(0.0, 0.5)), np.exp(r.normal(np.log(2.5), 0.5))
    lag = np.exp(r.normal(np.log(0.03), 0.3))
    above, below = np.array([gain]), np.polymul([1.0, damping], [lag, 1.0])
    kind = r.integers(3)
    if kind == 0:
        below = np.polymul(below, [1.0 / (2.0 * np.pi * r.uniform(15.0, 90.0)), 1.0])
    elif kind == 1:
        w, z = r.uniform(1.5, 8.0), r.uniform(0.03, 0.4)
        above = gain * np.array([1.0, 0.54 * w, (0.95 * w) ** 2])
        below = np.polymul(below, [1.0, 2.0 * z * w, w * w])
    else:
        w, z = r.uniform(60.0, 200.0), r.uniform(0.02, 0.3)
        below = np.polymul(below, [1.0 / w**2, 2.0 * z / w, 1.0])
    return TransferFunction(above, below)


def _best(vehicle: TransferFunction, fit: fid.Fit) -> dict[str, float]:
    """What a rate with a motor's lag can at best at the points that a fit has chosen."""
    model, names = fit.model, [p.name for p in fit.model.parameters.free]
    omega = fit.responses[0].omega_rad_s
    _, true = vehicle.freqresp(omega)

    def missed(x: Array) -> Array:
        gain, damping, lag, delay = x
        s = 1j * omega
        own = gain * np.exp(-delay * s) / ((s - damping) * (lag * s + 1.0))
        error = np.log(own / true)
        return np.concatenate([8.7 * error.real, 7.6 * error.imag])

    begun = np.array([model.parameters[name].value for name in names])
    free = model.parameters.free
    limits = [p.minimum for p in free], [p.maximum for p in free]
    scale = np.maximum(np.abs(begun), 1e-4)
    found = least_squares(missed, np.clip(begun, *limits), bounds=limits, x_scale=scale)
    return dict(zip(names, map(float, found.x), strict=True))


def lacking(seed: int) -> Searched:
    """A sweep of 10 to 40 s, noise of .05 to 10 %, half of it slow."""
    r = np.random.default_rng(seed)
    vehicle, duration_s = _vehicle(r), float(r.choice([10, 20, 40]))
    t = np.arange(0.0, duration_s, STEP_S)
    low, high = r.uniform(0.2, 2.0), r.uniform(12.0, 50.0)
    rate = np.log(high / low) / duration_s
    fade = np.minimum(1.0, np.minimum(t, duration_s - t))
    u = 0.05 * fade * np.sin(2.0 * np.pi * low * (np.exp(rate * t) - 1.0) / rate)
    _, p, _ = lsim(StateSpace(vehicle), u, t)
    slow = lfilter([1.0], [1.0, STEP_S / 0.2 - 1.0], r.standard_normal(t.size))
    noise = 0.6 * slow / slow.std() + 0.8 * r.standard_normal(t.size)
    p = p + float(np.exp(r.uniform(np.log(0.0005), np.log(0.1)))) * p.std() * noise
    record = fid.Record.from_arrays(
        t[::EVERY], inputs={"tau_phi": u[::EVERY]}, outputs={"p": p[::EVERY]},
        units={"p": "rad/s", "tau_phi": "1"}, hold="band_limited",
    )  # fmt: skip
    model = fid.load_model("rate_motor_lag", axis="roll")
    response = fid.estimate_response(record)
    return _begun_at(model, response, _best(vehicle, fid.identify(model, response)))


def main() -> None:
    """Print both counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=1000)
    asked = parser.parse_args()
    for kind in (light, lacking):
        found: list[Searched] = []
        for seed in range(asked.first_seed, asked.first_seed + asked.runs):
            try:
                found.append(kind(seed))
            except FlightidError:
                continue  # no coherent band
        scores = np.abs([score for each in found for score in each.scores])
        risen = [each for each in found if each.risen]
        print(
            f"{kind.__name__}: {len(found)} fits, wrong {sum(e.wrong for e in found)}, "
            f"refused {sum(not e.applied for e in found)}; cost risen at the lowest minimum "
            f"{len(risen)}, refused of them {sum(not e.applied for e in risen)}; "
            f"{100.0 * np.mean(scores < 1.96):.1f} % of {scores.size} intervals hold"
        )


if __name__ == "__main__":
    main()

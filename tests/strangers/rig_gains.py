"""Gains of a plain PID for rigs flown open loop: plants, noise, black boxes and orders; SciPy's."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

import flightid as fid
from flightid.conventions import Light
from tests.strangers import noises
from tests.strangers.gain_counts import Outcome
from tests.strangers.hover import margins

Array = NDArray[np.float64]
SAMPLES, LIMIT, WATCHED = 1500, 1.0, 600
TRUTHS = {
    "lag": 1, "two lags": 2, "resonance": 2, "lag and resonance": 3, "two lags, light mode": 4,
}  # fmt: skip
"""And their orders."""
METHODS = ("oe", "bj", "arx", "armax", "subspace")
NOISES = ("white", "ar1", "equation")
CONTROLLERS = ("pi", "pid", "pi_d")
TOLERANCE = {"phase margin": 0.25, "gain margin": 0.1}
P, S = fid.PolynomialModel, fid.InnovationsModel


@dataclass(frozen=True)
class Rig:
    """A sampled plant and what was drawn beside it."""

    truth: str
    b: Array
    a: Array
    delay: int
    step_s: float
    method: str
    order: int
    noise: str
    level: float
    controller: str
    known_delay: bool

    @property
    def right(self) -> bool:
        """Whether model and method hold plant and noise: a noise of the output is no ARX."""
        # Subspace holds a delay as states alone.
        least = TRUTHS[self.truth] + (self.delay if self.method == "subspace" else 0)
        whole = self.order >= least and (self.known_delay or self.method == "subspace")
        noises_held = {
            "oe": NOISES, "bj": NOISES, "arx": ("equation",), "armax": ("white", "equation"),
            "subspace": ("white", "equation"),
        }  # fmt: skip
        return whole and self.noise in noises_held[self.method]

    @property
    def asked(self) -> str:
        """The structure in words."""
        if self.method == "subspace":
            return f"order {self.order - TRUTHS[self.truth] - self.delay:+d}, delay as states"
        known = "" if self.known_delay else ", no delay"
        return f"order {self.order - TRUTHS[self.truth]:+d}{known}"

    @property
    def structure(self) -> object:
        """What is asked of `identify`."""
        n, nk = self.order, 1 + self.delay if self.known_delay else 1
        orders = {"nb": n, "nk": nk}
        if self.method == "oe":
            return P.oe("u", "y", nf=n, **orders)
        if self.method == "bj":
            return P.bj("u", "y", nf=n, nc=0, nd=1, **orders)
        if self.method == "arx":
            return P.arx("u", "y", na=n, **orders)
        if self.method == "armax":
            return P.armax("u", "y", na=n, nc=n, **orders)
        return S.subspace("u", "y", order=n)


def drawn(seed: int) -> Rig:
    """Plant, method, order, noise and controller."""
    r = np.random.default_rng([seed, 3])
    truth = str(r.choice([*TRUTHS]))
    slow = float(np.exp(r.uniform(np.log(0.05), np.log(5.0))))
    step = slow / float(r.uniform(5.0, 15.0))
    num, den = np.array([float(r.uniform(0.3, 3.0)) * float(r.choice([1, 1, -1]))]), np.ones(1)
    if "lag" in truth:
        den = np.polymul(den, [slow, 1.0])
    if "two" in truth:
        den = np.polymul(den, [slow * float(r.uniform(0.2, 0.8)), 1.0])
    if "resonance" in truth:
        w, zeta = 1.0 / (slow * float(r.uniform(0.5, 1.0))), float(r.uniform(0.05, 0.4))
        den = np.polymul(den, [w**-2, 2.0 * zeta / w, 1.0])
    if "mode" in truth:
        w, zeta = float(r.uniform(2.0, 4.0)) / slow, 0.03
        mode = np.array([w**-2, 2.0 * zeta / w, 1.0])
        # Beside the plant: (share s² + mode)/mode.
        num = np.polymul(num, np.polyadd(mode, [float(r.uniform(0.02, 0.1)) * w**-2 * 4, 0.0, 0.0]))
        den = np.polymul(den, mode)
    b, a, _ = cont2discrete((num, den), step)
    method = str(r.choice(METHODS))
    delay = int(r.integers(0, 4))
    order = TRUTHS[truth] + (delay if method == "subspace" else 0)
    order = max(1, order + int(r.choice([0, 0, 0, 1, -1])))
    return Rig(
        truth, b.ravel(), a, delay, step, method, order,
        str(r.choice(NOISES)), float(np.exp(r.uniform(np.log(0.005), np.log(0.1)))),
        str(r.choice(CONTROLLERS)), bool(r.uniform() < 0.8),
    )  # fmt: skip


def late(rig: Rig) -> Array:
    """Numerator with the delay."""
    return np.concatenate([np.zeros(rig.delay), rig.b])


def record(rig: Rig, seed: int) -> fid.Record:
    """Random levels held for a few samples, and what the sensor says."""
    r = np.random.default_rng([seed, 7])
    held = int(r.integers(3, 9))
    u = np.repeat(r.choice([-1.0, 1.0], -(-SAMPLES // held)), held)[:SAMPLES]
    u = u * np.repeat(r.uniform(0.3, 1.0, -(-SAMPLES // 50)), 50)[:SAMPLES]
    y = lfilter(late(rig), rig.a, u)
    noise = noises.ar1(r, SAMPLES, pole=0.9) if rig.noise == "ar1" else noises.white(r, SAMPLES)
    if rig.noise == "equation":
        noise = lfilter([1.0], rig.a, noise)
        noise = noise / noise.std()
    return fid.Record.from_arrays(
        np.arange(SAMPLES) * rig.step_s,
        inputs={"u": u},
        outputs={"y": y + rig.level * y.std() * noise},
        hold="zero",
    )


def tried(seed: int, *, draws: int = 60) -> Outcome:
    """Draw, record, fit, tune and close the loop around the true plant."""
    begun, rig = time.process_time(), drawn(seed)

    def outcome(verdict: str, why: str, broken: str = "", wasted: bool = False) -> Outcome:
        return Outcome(
            seed, f"rig, {rig.truth}", rig.asked, rig.method, rig.right, verdict, why,
            broken, time.process_time() - begun, wasted,
        )  # fmt: skip

    controller = fid.ControllerOptions(controller=rig.controller)
    try:
        fit = fid.identify(rig.structure, record(rig, seed))
    except fid.FlightidError as error:
        return outcome("refused", str(error))
    try:
        design = fid.tune_controller(fit, controller=controller, draws=draws, seed=seed)
    except fid.FlightidError as error:
        lost = rig.right and _would_hold(fit, rig, seed, controller)
        return outcome("refused", str(error), wasted=lost)
    if not design.exists:
        lost = rig.right and known_exactly(rig, controller, design)
        return outcome("none", design.findings[0].message, wasted=lost)
    broken = broken_promise(design, rig, seed)
    red = [f.message for f in design.findings if f.light is Light.RED]
    if red:
        return outcome("red", "; ".join(red), broken, rig.right and not broken)
    light = max((f.light for f in design.findings), key=[*Light].index)
    doubts = "; ".join(f.code for f in design.findings if f.light is not Light.GREEN)
    return outcome(str(light), doubts, broken)


def _would_hold(fit: fid.Fit, rig: Rig, seed: int, controller: fid.ControllerOptions) -> bool:
    """Whether refused gains of a right structure would have kept what they promise."""
    try:
        design = fid.tune_controller(fit, controller=controller, draws=60, accept_red=True)
    except fid.FlightidError:
        return False
    return design.exists and not broken_promise(design, rig, seed)


def known_exactly(rig: Rig, controller: fid.ControllerOptions, found: fid.PidDesign) -> bool:
    """Whether one who knew the plant would find gains inside the band that the data showed."""
    b = np.trim_zeros(rig.b, "f")
    lead = rig.delay + int(np.argmax(rig.b != 0.0))
    truth = P(("u",), "y", rig.step_s, b=[b], f=[rig.a], nk=(lead,))
    band = found.provenance["band_rad_s"]
    return fid.tune_controller(truth, controller=controller, nominal=True, band_rad_s=band).exists


def controller_polynomials(design: fid.PidDesign, step: float) -> tuple[Array, Array]:
    """Of the law in the documentation: backward differences, the derivative behind its lag."""
    k, sign = design.loop.gains, -1.0 if design.loop.direct else 1.0
    lag = k.get("Tf", 0.0)
    slope, rise = np.array([lag + step, -lag]), np.array([1.0, -1.0])
    num = np.polyadd(k.get("Kp", 0.0) * np.polymul(rise, slope), np.zeros(3))
    num = np.polyadd(num, k.get("Ki", 0.0) * step * np.polymul([1.0, 0.0], slope))
    num = np.polyadd(num, k.get("Kd", 0.0) * np.polymul(rise, rise))
    return sign * num, np.polymul(rise, slope)


def broken_promise(design: fid.PidDesign, rig: Rig, seed: int) -> str:
    """Close the loop around the true plant; compare its margins with the least promised."""
    num, den = controller_polynomials(design, rig.step_s)
    b, a = rig.b, np.polymul(rig.a, np.concatenate([[1.0], np.zeros(rig.delay)]))
    open_num, open_den = np.polymul(num, b), np.polymul(den, a)
    if np.abs(np.roots(np.polyadd(open_num, open_den))).max() >= 1.0:
        return "unstable"
    omega = np.geomspace(1e-4, 0.9999, 6000) * np.pi / rig.step_s
    z = np.exp(1j * omega * rig.step_s)
    true = margins(np.polyval(open_num, z) / np.polyval(open_den, z))
    for kind, value in zip(("phase margin", "gain margin"), true, strict=True):
        least = design.worst_case("loop", kind).worst
        if least is not None and value < least - TOLERANCE[kind]:
            return f"{kind} {value:.2f}, promised {least:.2f}"
    return "limit cycle" if swings(rig, num, den, seed) else ""


def swings(rig: Rig, num: Array, den: Array, seed: int) -> bool:
    """Whether the loop, its output limited, still swings long after a push."""
    r = np.random.default_rng([seed, 11])
    # A difference equation asks nothing of how b is conditioned; a loop begins a sample later.
    late = np.zeros(rig.delay + len(rig.a) - len(rig.b))
    b = np.concatenate([late, rig.b])[1:] / rig.a[0]
    moved, pushed = np.zeros(len(rig.a) - 1), np.zeros(len(b))
    u, e = np.zeros(3), np.zeros(3)
    stop, seen = 1e-3 * float(np.abs(rig.b).sum()), np.zeros(WATCHED)
    for t in range(WATCHED):
        out = float(b @ pushed - rig.a[1:] / rig.a[0] @ moved)
        moved = np.concatenate([[out], moved[:-1]])
        y = out + stop * r.standard_normal() + (0.05 if t < 5 else 0.0)
        e = np.concatenate([[-y], e[:2]])
        wanted = (num @ e - den[1:] @ u[:2]) / den[0]
        u = np.concatenate([[float(np.clip(wanted, -LIMIT, LIMIT))], u[:2]])
        seen[t] = u[0]
        pushed = np.concatenate([[u[0]], pushed[:-1]])
    return bool(np.mean(np.abs(seen[-WATCHED // 3 :]) >= LIMIT) > 0.02)

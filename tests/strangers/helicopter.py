"""Flights like the R-50's: published equations in SciPy, truths drawn, gusts, a pilot in the loop.

Mettler, Tischler and Kanade, Journal of the American Helicopter Society 47(1), 2002, tables 4, 5.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.linalg import expm

import flightid as fid
from tests.strangers.counting import Case, Trial, fit_trial
from tests.strangers.noises import Array

STEP_S = 0.02
G = 32.2
STATES = ("u", "v", "p", "q", "phi", "theta", "a", "b", "w", "r", "rfb", "c", "d")
INPUTS = ("lat", "lon", "ped", "col")
OUTPUTS = ("um", "vm", "w", "p", "q", "r", "ax", "ay", "az")
AMPLITUDES = (0.2, 0.2, 0.3, 0.12)
NOISE = np.array([0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.3, 0.3, 0.3])
SPREAD = 0.25
PUBLISHED = {
    "tau_f": 0.046, "hcg": -0.411, "tau_s": 0.342, "Xu": -0.0505, "Yv": -0.154, "Lu": -0.144,
    "Lv": 0.143, "Lb": 166.0, "Mu": -0.0561, "Mv": -0.0585, "Ma": 82.6, "Ba": 0.368, "Bd": 0.71,
    "Ab": -0.189, "Ac": 0.644, "Zb": -131.0, "Za": -9.75, "Zw": -0.614, "Zr": 0.93, "Np": -3.53,
    "Nv": 0.0301, "Nw": 0.0857, "Nr": -4.13, "Kr": 2.16, "Blat": 0.14, "Blon": 0.0138,
    "Alat": 0.0313, "Alon": -0.1, "Zcol": -45.8, "Ncol": -3.33, "Nped": 33.1, "Dlat": 0.273,
    "Clon": -0.259, "tau_ped": 0.0991,
}  # fmt: skip


def matrices(k: dict[str, float]) -> tuple[Array, Array]:
    """F (13, 13) and G (13, 4) of the published equations."""
    place = {name: i for i, name in enumerate(STATES)}
    f, g = np.zeros((13, 13)), np.zeros((13, 4))

    def put(state: str, terms: dict[str, float], scale: float = 1.0) -> None:
        for name, value in terms.items():
            if name in INPUTS:
                g[place[state], INPUTS.index(name)] += value / scale
            else:
                f[place[state], place[name]] += value / scale

    put("u", {"u": k["Xu"], "theta": -G, "a": -G})
    put("v", {"v": k["Yv"], "phi": G, "b": G})
    put("p", {"u": k["Lu"], "v": k["Lv"], "b": k["Lb"]})
    put("q", {"u": k["Mu"], "v": k["Mv"], "a": k["Ma"]})
    put("phi", {"p": 1.0})
    put("theta", {"q": 1.0})
    lag = k["tau_f"]
    put("a", {"q": -lag, "a": -1.0, "b": k["Ab"], "c": k["Ac"], "lat": k["Alat"]}, lag)
    put("a", {"lon": k["Alon"]}, lag)
    put("b", {"p": -lag, "a": k["Ba"], "b": -1.0, "d": k["Bd"], "lat": k["Blat"]}, lag)
    put("b", {"lon": k["Blon"]}, lag)
    put("w", {"a": k["Za"], "b": k["Zb"], "w": k["Zw"], "r": k["Zr"], "col": k["Zcol"]})
    put("r", {"v": k["Nv"], "p": k["Np"], "w": k["Nw"], "r": k["Nr"], "rfb": -k["Nped"]})
    put("r", {"ped": k["Nped"], "col": k["Ncol"]})
    put("rfb", {"r": k["Kr"], "rfb": 2.0 * k["Nr"]})
    put("c", {"q": -k["tau_s"], "c": -1.0, "lon": k["Clon"]}, k["tau_s"])
    put("d", {"p": -k["tau_s"], "d": -1.0, "lat": k["Dlat"]}, k["tau_s"])
    return f, g


def measured(k: dict[str, float], f: Array, g: Array) -> tuple[Array, Array]:
    """Rows of the outputs on states and inputs."""
    c, d = np.zeros((9, 13)), np.zeros((9, 4))
    one, h = np.eye(13), k["hcg"]
    c[0], c[1], c[2] = one[0] + h * one[3], one[1] - h * one[2], one[8]
    c[3], c[4], c[5] = one[2], one[3], one[9]
    c[6], d[6] = f[0] + h * f[3] + G * one[5], g[0] + h * g[3]
    c[7], d[7] = f[1] - h * f[2] - G * one[4], g[1] - h * g[2]
    c[8], d[8] = f[8], g[8]
    return c, d


def sweep(random: np.random.Generator, n: int, low: float = 0.32, high: float = 28.0) -> Array:
    """Logarithmic sweep with a slow cycle first and a little of a pilot's roughness."""
    t = np.arange(n) * STEP_S
    lead = 2.0 * np.pi / low
    rate = np.log(high / low) / (t[-1] - lead)
    later = np.maximum(t - lead, 0.0)
    phase = low * np.minimum(t, lead) + low * (np.exp(rate * later) - 1.0) / rate
    return np.sin(phase) * (1.0 + 0.05 * random.standard_normal())


class Vehicle:
    """One truth, discretised exactly with its pedal's delay; gusts act through speeds."""

    def __init__(self, k: dict[str, float]) -> None:
        self.f, self.g = matrices(k)
        self.c, self.d = measured(k, self.f, self.g)
        self._discretise(k["tau_ped"])

    def _discretise(self, pedal_delay_s: float) -> None:
        self.whole = int(np.ceil(pedal_delay_s / STEP_S - 1e-9))
        part = self.whole * STEP_S - pedal_delay_s
        # Gusts of u, v, w are held over a step: what moves the air moves the speed terms.
        wide = np.column_stack([self.g, -self.f[:, [0, 1, 8]]])
        self.a, self.b = step(self.f, wide, STEP_S)
        early, late = step(self.f, wide, part), step(self.f, wide, STEP_S - part)
        self.newer = early[1][:, 2]
        self.older = early[0] @ late[1][:, 2]

    def fly(self, seed: int, driven: int, n: int) -> fid.Record | None:
        """One sweep under the pilot; None where the pilot loses it."""
        random = np.random.default_rng(seed)
        injected = np.zeros((4, n))
        injected[driven] = AMPLITUDES[driven] * sweep(random, n)
        gusts = coloured(random, n, (1.0, 1.0, 0.7), (2.0, 2.0, 1.0))
        hands = coloured(random, n, (0.01,) * 4, (0.3,) * 4)
        x, u, y = np.zeros(len(self.f)), np.zeros((4, n)), np.zeros((9, n))
        fed, attitude = np.zeros((4, n + 10)), np.zeros(4)
        for k in range(n):
            aim = -np.array(
                [
                    0.7 * x[4] + 0.007 * x[1],
                    -0.7 * x[5] + 0.007 * x[0],
                    0.15 * x[9],
                    -0.012 * x[8],
                ]
            )
            attitude += (STEP_S / 0.1) * (aim - attitude)
            fed[:, k + 10] = attitude
            u[:, k] = injected[:, k] + hands[:, k] + fed[:, k]
            old = u[2, k - self.whole] if k >= self.whole else u[2, 0]
            new = u[2, k - self.whole + 1] if k >= self.whole - 1 else u[2, 0]
            now = np.array([u[0, k], u[1, k], old, u[3, k]])
            wind = gusts[:, k]
            y[:, k] = self.c @ x + self.d @ now - self.c_gust @ wind
            now[2] = 0.0
            x = self.a @ x + self.b @ np.concatenate([now, wind])
            x += self.newer * new + self.older * old
            if not np.all(np.abs(x) < 300.0):
                return None
        return record(u, y + NOISE[:, None] * random.standard_normal((9, n)), injected)

    @property
    def c_gust(self) -> Array:
        """Gusts in what accelerometers feel; speeds are measured over ground."""
        rows = np.zeros((9, 3))
        rows[6:] = self.c[6:][:, [0, 1, 8]]
        return rows


def step(f: Array, g: Array, time_s: float) -> tuple[Array, Array]:
    """Transition and input integral over a time."""
    n, m = g.shape
    both = expm(np.block([[f, g], [np.zeros((m, n + m))]]) * time_s)
    return both[:n, :n], both[:n, n:]


def coloured(
    random: np.random.Generator, n: int, sizes: tuple[float, ...], times_s: tuple[float, ...]
) -> Array:
    """First-order gusts."""
    out = np.zeros((len(sizes), n))
    decay = np.exp(-STEP_S / np.array(times_s))
    value = np.array(sizes) * random.standard_normal(len(sizes))
    for k in range(n):
        out[:, k] = value
        drive = np.array(sizes) * np.sqrt(1.0 - decay**2)
        value = decay * value + drive * random.standard_normal(len(sizes))
    return out


UNITS = dict(zip(OUTPUTS, ["ft/s"] * 3 + ["rad/s"] * 3 + ["ft/s^2"] * 3, strict=True))


def record(u: Array, y: Array, injected: Array) -> fid.Record:
    """What was logged: sticks, outputs and the sweep that was added."""
    return fid.Record.from_arrays(
        np.arange(u.shape[1]) * STEP_S,
        inputs=dict(zip(INPUTS, u, strict=True)),
        outputs=dict(zip(OUTPUTS, y, strict=True)),
        excitations={f"sweep_{name}": each for name, each in zip(INPUTS, injected, strict=True)},
        units={**UNITS, **dict.fromkeys(INPUTS, "1")},
        hold="zero",
    )


def drawn(seed: int, repeats: int) -> tuple[dict[str, float], list[fid.Record]]:
    """A truth within its spread that the pilot can hold, and its sweeps."""
    random = np.random.default_rng(10_000 + seed)
    while True:
        k = {name: v * random.uniform(1 - SPREAD, 1 + SPREAD) for name, v in PUBLISHED.items()}
        vehicle = Vehicle(k)
        flown = [
            vehicle.fly(100 * seed + 10 * again + place, place, 2500)
            for again in range(repeats)
            for place in range(4)
        ]
        kept = [each for each in flown if each is not None]
        if len(kept) == len(flown):
            return k, kept


def fly(seed: int, *, repeats: int = 2) -> Trial:
    """Response by instrument, then all coherent responses in one fit from the published values."""
    truth, records = drawn(seed, repeats)
    response = fid.estimate_response(
        records,
        inputs=INPUTS,
        outputs=OUTPUTS,
        estimator="instrument",
        band_rad_s=(0.5027, 26.0),
        n_omega=36,
        window_s=[25.0, 12.5, 5.0],
    )
    model = fid.load_model("r50_hover").with_responses(*coherent(response))
    return fit_trial(lambda: fid.identify(model, response), truth)


def coherent(response: fid.FrequencyResponse) -> list[str]:
    """Responses with coherence 0.6 over an octave without a gap."""
    names = []
    for output in response.outputs:
        for source in response.inputs:
            band = response.pair(output, source).usable_band(0.6)
            if band and band[1] > 2.0 * band[0]:
                names.append(f"{output}/{source}")
    return names


CASES = (Case("response, R-50 drawn +-25 %, gusts", partial(fly, repeats=2)),)

"""Simulated flights of the AH-64 model: sweeps, doublets and 3-2-1-1s under a crude pilot.

The vehicle is the library's model and nothing else; what a flight adds is here: a pilot who holds
attitude and speed of an unstable vehicle, gusts, restless hands, sensor noise. Units are feet,
radians and inches of stick.
"""

from __future__ import annotations

import flightid as fid
from flightid.excitation import Excitation, doublet, modified_3211, sweep
from flightid.vehicles import CrudePilot, Disturbance, FlightConditions, fly_closed_loop

SAMPLE_RATE_HZ = 50.0
INPUTS = ("lon", "lat", "ped", "col")
OUTPUTS = ("u", "v", "p", "q", "r", "ax", "ay", "az")
AMPLITUDES_IN = {"lon": 1.0, "lat": 1.0, "ped": 1.0, "col": 0.8}
LEAD_S = 8.0
"""What is flown before a manoeuvre and cut away: its record does not begin at rest."""
PILOT = CrudePilot(
    {
        "lon": {"theta": 3.6, "q": 1.8, "u": -0.03},
        "lat": {"phi": 1.8, "p": 0.5, "v": 0.018},
        "ped": {"r": 0.9},
        "col": {"w": -0.06},
    },
    delay_s=0.2,
    lag_s=0.1,
)
GUSTS = {"u": Disturbance(1.0, 3.0), "v": Disturbance(1.0, 3.0), "w": Disturbance(0.8, 2.0)}
REMNANT = dict.fromkeys(INPUTS, Disturbance(0.05, 0.5))
NOISE = {
    **dict.fromkeys(("u", "v", "w"), 0.2),
    **dict.fromkeys(("p", "q", "r"), 0.002),
    **dict.fromkeys(("phi", "theta"), 0.002),
    **{"ax": 0.1, "ay": 0.1, "az": 0.2},
}
CONDITIONS = FlightConditions(gusts=GUSTS, remnant=REMNANT, noise=NOISE)


def truth() -> fid.StateSpaceModel:
    """The vehicle that is flown."""
    model = fid.load_model("ah64_hover")
    assert isinstance(model, fid.StateSpaceModel)
    return model


def fly_sweeps(seed: int, *, repeats: int = 2, duration_s: float = 150.0) -> list[fid.Record]:
    """One frequency sweep a record, 0.2 to 30 rad/s, each stick in turn.

    Parameters
    ----------
    seed : int
        Seed of gusts, remnant and noise.
    repeats : int
        Sweeps of each stick.
    duration_s : float
        Length of a record, s.

    Returns
    -------
    list of Record
    """
    return [
        _fly(
            sweep(
                band_rad_s=(0.2, 30.0),
                amplitude=AMPLITUDES_IN[name],
                duration_s=duration_s,
                sample_rate_hz=SAMPLE_RATE_HZ,
                hold_cycles=1.0,
                name=name,
                unit="in",
            ),
            1000 * seed + 10 * number + place,
            f"sweep of {name}, {number + 1}",
        )
        for number in range(repeats)
        for place, name in enumerate(INPUTS)
    ]


def fly_manoeuvres(seed: int) -> list[fid.Record]:
    """A doublet and a 3-2-1-1 of each stick, 15 s each, cut from longer flights.

    Parameters
    ----------
    seed : int
        Seed of gusts, remnant and noise.

    Returns
    -------
    list of Record
    """
    flown = []
    for place, name in enumerate(INPUTS):
        common = {
            "amplitude": 0.7 * AMPLITUDES_IN[name],
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "lead_s": LEAD_S + 1.0,
            "name": name,
            "unit": "in",
        }
        shapes = {
            "doublet": doublet(step_s=1.0, tail_s=12.0, **common),
            "3-2-1-1": modified_3211(step_s=0.8, tail_s=8.4, **common),
        }
        for number, (kind, shape) in enumerate(shapes.items()):
            whole = _fly(shape, 1000 * seed + 500 + 10 * number + place, f"{kind} of {name}")
            flown.append(whole.segment(LEAD_S, whole.time_s[-1]))
    return flown


def _fly(shape: Excitation, seed: int, name: str) -> fid.Record:
    return fly_closed_loop(truth(), PILOT, shape, conditions=CONDITIONS, seed=seed, name=name)

"""Simulated flights of the published R-50 models: sweeps and doublets under a crude pilot.

The vehicle is a published model and nothing else; what a flight adds is here: servos, a pilot who
holds attitude and speed, gusts, restless hands, sensor noise. Units are feet and radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import flightid as fid
from flightid.excitation import Excitation, doublet, sweep
from flightid.simulation import actuator_positions
from flightid.vehicles import CrudePilot, Disturbance, FlightConditions, fly_closed_loop

SAMPLE_RATE_HZ = 50.0
INPUTS = ("lat", "lon", "ped", "col")
# Swashplate servos, equation (1) of the paper; the pedal's servo is part of the yaw model.
SERVOS = {"lat": 15.0, "lon": 15.0, "col": 15.0}
# A pilot holds attitude and, slowly, speed over ground, yaw rate and climb.
PILOT = CrudePilot(
    {
        "lat": {"phi": 0.7, "vm": 0.007},
        "lon": {"theta": -0.7, "um": 0.007},
        "ped": {"r": 0.15},
        "col": {"w": -0.012},
    },
    delay_s=0.2,
    lag_s=0.1,
)
# Standard deviations at 50 samples a second: fibre-optic rates, accelerometers in an airframe that
# shakes, speeds and attitudes of an inertial filter with differential GPS.
NOISE = {
    **dict.fromkeys(("p", "q", "r"), 0.01),
    **dict.fromkeys(("phi", "theta"), 0.003),
    **dict.fromkeys(("um", "vm", "w"), 0.1),
    **dict.fromkeys(("ax", "ay", "az"), 0.3),
}
GUSTS = {
    "u": Disturbance(1.0, 2.0),
    "v": Disturbance(1.0, 2.0),
    "w": Disturbance(0.7, 1.0),
}
AMPLITUDES = {"lat": 0.2, "lon": 0.2, "ped": 0.3, "col": 0.12}
CONDITIONS = FlightConditions(
    gusts=GUSTS,
    remnant=dict.fromkeys(INPUTS, Disturbance(0.01, 0.3)),
    noise=NOISE,
    actuators=SERVOS,
)


LIBRARY = {"hover": "r50_hover", "cruise": "r50_cruise"}


@dataclass(frozen=True)
class Plan:
    """How one flight condition is flown.

    Attributes
    ----------
    condition : str
        ``"hover"`` or ``"cruise"``.
    lowest_rad_s : float
        Where sweeps begin, rad/s.
    sweep_s : float
        Length of a record, s.
    repeats : int
        Records of each input.
    """

    condition: str
    lowest_rad_s: float
    sweep_s: float
    repeats: int

    def sweeps(self, seed: int) -> list[fid.Record]:
        """Sweep one input a record, as often as planned; inputs are what the servos give."""
        return [actuator_positions(record, SERVOS) for record in self.fly_sweeps(seed)]

    def doublets(self, seed: int) -> list[fid.Record]:
        """Doublets for verification; inputs are what the servos give."""
        return [actuator_positions(record, SERVOS) for record in self.fly_doublets(seed)]

    def fly_sweeps(self, seed: int) -> list[fid.Record]:
        """Sweep one stick a record, as often as planned."""
        return [
            self._fly(_sweep(self, name), f"{name} sweep {number + 1}", seed, number)
            for number in range(self.repeats)
            for name in INPUTS
        ]

    def fly_doublets(self, seed: int) -> list[fid.Record]:
        """Doublets for verification, one stick a record; no fit sees them."""
        return [self._fly(_doublet(name), f"{name} doublet", seed, -1) for name in INPUTS]

    def _fly(self, shape: Excitation, name: str, seed: int, number: int) -> fid.Record:
        return fly_closed_loop(
            fid.load_model(LIBRARY[self.condition]),
            PILOT,
            shape,
            conditions=CONDITIONS,
            seed=1000 * seed + 10 * (number + 1) + INPUTS.index(shape.names[0]),
            name=name,
        )


def plan(condition: str, *, full: bool) -> Plan:
    """Plan the short form, or the full study: three times the flights."""
    if condition == "hover":
        return Plan("hover", 0.32, 50.0, 6 if full else 2)
    # The paper had ten seconds a pass in cruise; twenty-five make the speed derivatives visible.
    return Plan("cruise", 0.5, 25.0, 9 if full else 3)


def _sweep(plan: Plan, name: str) -> Excitation:
    return sweep(
        band_rad_s=(plan.lowest_rad_s, 28.0),
        amplitude=AMPLITUDES[name],
        duration_s=plan.sweep_s,
        sample_rate_hz=SAMPLE_RATE_HZ,
        hold_cycles=1.0,
        name=name,
    )


def _doublet(name: str) -> Excitation:
    return doublet(
        amplitude=AMPLITUDES[name],
        step_s=0.4,
        sample_rate_hz=SAMPLE_RATE_HZ,
        lead_s=1.0,
        tail_s=4.2,
        name=name,
    )

"""Margins that the nonlinear simulation shows when it flies: broken loops from sweeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import flightid as fid
from flightid.record import Record
from flightid.vehicles import Autopilot, Flight, SidActivation, fly

AXES = ("roll", "pitch", "yaw")
COMMANDS = {"roll": "tau_phi", "pitch": "tau_theta", "yaw": "tau_psi"}
ANGLES = {"roll": "phi", "pitch": "theta", "yaw": "psi"}
BAND_RAD_S = (1.5, 110.0)
ANGLE_BAND_RAD_S = (0.8, 45.0)


def loops(autopilot: Autopilot, axis: str, seed: int) -> dict[str, fid.Margins]:
    """Margins of the whole loop, broken at the mixer, and of the angle loop.

    A chirp that is added to the controller's output returns as output over chirp = 1/(1 + L); one
    that is added to the angle's set-point as angle over set-point = L/(1 + L).

    Parameters
    ----------
    autopilot : Autopilot
        With the gains to judge.
    axis : str
    seed : int
        Of the flight's noise.
    """
    place = AXES.index(axis)
    mixer = SidActivation(
        axis=10 + place, start_s=10.0, magnitude=0.1, start_hz=0.1, stop_hz=20.0, record_s=150.0,
        fade_out_s=1.0, leave_after_s=175.0,
    )  # fmt: skip
    flight = fly(runs=[mixer], autopilot=autopilot, seed=seed)
    found = {"whole loop": _margins(flight, mixer, COMMANDS[axis], "sensitivity", BAND_RAD_S)}
    if axis != "yaw":
        # Yaw's set-point of this mode is a rate, so its angle loop has no such sweep.
        angle = replace(mixer, axis=1 + place, magnitude=3.0, stop_hz=9.0)
        flight = fly(runs=[angle], autopilot=autopilot, seed=seed + 1)
        found["angle loop"] = _margins(flight, angle, ANGLES[axis], "closed", ANGLE_BAND_RAD_S)
    return found


def _margins(
    flight: Flight, run: SidActivation, channel: str, given: str, band: tuple[float, float]
) -> fid.Margins:
    start, stop = flight.span(run)
    record = flight.record((start, stop + 20.0))
    chirp = record["excitation"]
    if given == "closed":
        # Set-points are in degrees, and the angle controller takes them in the loop that makes
        # them; the record says when the rate controller, one loop later, acts on them.
        chirp = np.radians(np.append(chirp[1:], chirp[-1]))
    inputs = {"chirp": chirp}
    channels = Record.from_arrays(
        record.time_s, inputs=inputs, outputs={channel: record[channel]},
        units={channel: record.channels[channel].unit, "chirp": record.channels[channel].unit},
    )  # fmt: skip
    response = fid.estimate_response(
        [channels], inputs=["chirp"], outputs=[channel], estimator="composite",
        band_rad_s=band, n_omega=120, window_s=[40, 20, 10],
    )  # fmt: skip
    return fid.margins(response, "chirp", channel, given=given)

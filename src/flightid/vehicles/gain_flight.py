"""The verb: tuned gains in the simulated vehicle, whose broken loops are measured by sweeps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flightid.control.margins.loop_source import Given
from flightid.control.margins.margins import Margins, margins
from flightid.control.tuning.limits import ANGLE, WHOLE, Limit, limits
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.result import Tuning
from flightid.control.tuning.worst_cases import WorstCase
from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.progress import progress
from flightid.record import Record
from flightid.responses import estimate_response
from flightid.uncertainty.estimate import Reading
from flightid.vehicles.autopilot import Autopilot, SidActivation
from flightid.vehicles.flight import MIXER_AXES, Flight, fly
from flightid.vehicles.gain_flight_result import FlownMargin, GainFlight
from flightid.vehicles.quadrotor import QuadrotorParameters, Sensors, Turbulence
from flightid.vehicles.truth import AXES, COMMANDS

ANGLES = ("phi", "theta", "psi")
"""Attitude by axis."""
START_S, SETTLED_S, AFTER_S = 10.0, 2.0, 20.0
"""When a sweep begins, when the start of the flight is over, and the rest after a sweep, s."""
LOWEST_HZ, FADE_S = 0.1, 1.0
INSIDE = (2.4, 0.875)
"""Band of the response over the sweep's own ends, where its power is whole."""
N_OMEGA = 120
WINDOWS_S = (40.0, 20.0, 10.0)
NAMES = ("crossover", "phase margin", "gain margin", "delay margin", "sensitivity peak")


@dataclass(frozen=True)
class GainFlightOptions(Options):
    """How tuned gains are flown again, and their loops measured.

    Example
    -------
    >>> GainFlightOptions(record_s=100.0).mixer_magnitude
    0.1
    """

    seed: int = option(100, minimum=0, doc="Of the noise of the first of these flights.")
    mixer_magnitude: float = option(
        0.1, above=0.0, maximum=1.0, doc="Sweep at the mixer, of the full command."
    )
    mixer_stop_hz: float = option(20.0, unit="Hz", above=1.0, doc="Where that sweep ends.")
    angle_magnitude_deg: float = option(
        3.0, unit="deg", above=0.0, doc="Sweep of the angle's set-point."
    )
    angle_stop_hz: float = option(9.0, unit="Hz", above=1.0, doc="Where that sweep ends.")
    record_s: float = option(150.0, unit="s", minimum=60.0, doc="Length of a sweep.")


def fly_gains(
    tuning: Tuning,
    *,
    vehicle: QuadrotorParameters | None = None,
    autopilot: Autopilot | None = None,
    sensors: Sensors | None = None,
    turbulence: Turbulence | None = None,
    options: GainFlightOptions | None = None,
) -> GainFlight:
    """Fly tuned gains in the simulated quadrotor and measure the loops that they close.

    A chirp that is added to the controller's output comes back as 1/(1 + L) of the whole loop,
    broken at the mixer; one on the angle's set-point as L/(1 + L) of the angle loop. Yaw's
    set-point is a rate in that mode, so its angle loop is not measured. One flight a sweep.

    Parameters
    ----------
    tuning : Tuning
        All sound axes fly their new gains at once; the others keep those of `autopilot`.
    vehicle, autopilot, sensors, turbulence : optional
        As for `flightid.vehicles.fly`; the autopilot with the gains that flew first.
    options : GainFlightOptions, optional

    Raises
    ------
    DataError
        No axis has sound gains.
    UnknownNameError
        Gains of another autopilot than the simulated ArduCopter.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., section 5.11:
    broken-loop responses from closed-loop sweeps.

    Example
    -------
    >>> study = fid.run_study("examples/quadrotor_tuning/study.toml")     # doctest: +SKIP
    >>> fly_gains(study.tuning).meeting                                  # doctest: +SKIP
    10
    """
    if not tuning.sound:
        raise DataError(
            "there are no gains to fly again",
            found="; ".join(f"{axis}: {why}" for axis, why in tuning.left_out.items()) or "no axis",
            needed="an axis without a red verdict",
        )
    asked = options or GainFlightOptions()
    gains = {name: value for each in tuning.sound for name, value in each.parameters.items()}
    flown = (autopilot or Autopilot()).with_parameters(gains)
    made: list[FlownMargin] = []
    loops: dict[str, Margins] = {}
    largest: dict[str, float] = {}
    lost: dict[str, str] = {}
    jobs = [(design, *sweep) for design in tuning.sound for sweep in _sweeps(design, asked)]
    with progress(len(jobs), "flying the new gains") as advance:
        for place, (design, loop, run) in enumerate(jobs):
            name = f"{design.axis}, {loop}"
            try:
                flight = fly(
                    runs=[run], vehicle=vehicle, autopilot=flown, sensors=sensors,
                    turbulence=turbulence, seed=asked.seed + place,
                )  # fmt: skip
                largest.setdefault(design.axis, _largest_command(flight, design.axis))
                loops[name] = _measured(flight, run, design.axis, loop)
                made += _beside(tuning, design, loop, loops[name])
            except DataError as error:
                lost[name] = error.reason
            advance()
    return GainFlight(gains, tuple(made), loops, largest, lost)


def _sweeps(design: PidDesign, asked: GainFlightOptions) -> Iterator[tuple[str, SidActivation]]:
    """Loops of an axis that a sweep can show, and that something was promised of."""
    place = AXES.index(design.axis)
    mixer = SidActivation(
        axis=MIXER_AXES[place], start_s=START_S, magnitude=asked.mixer_magnitude,
        start_hz=LOWEST_HZ, stop_hz=asked.mixer_stop_hz, record_s=asked.record_s,
        fade_out_s=FADE_S, leave_after_s=asked.record_s + 25.0,
    )  # fmt: skip
    promised = {each.loop for each in design.worst_cases}
    if WHOLE in promised:
        yield WHOLE, mixer
    if ANGLE in promised and design.axis != "yaw":
        yield (
            ANGLE,
            replace(
                mixer,
                axis=1 + place,
                magnitude=asked.angle_magnitude_deg,
                stop_hz=asked.angle_stop_hz,
            ),
        )


def _largest_command(flight: Flight, axis: str) -> float:
    """Hands off, before the sweep."""
    time_s = flight.time_s
    quiet = (time_s >= SETTLED_S) & (time_s < START_S)
    return float(np.max(np.abs(flight[COMMANDS[AXES.index(axis)]][quiet])))


def _measured(flight: Flight, run: SidActivation, axis: str, loop: str) -> Margins:
    """Margins of the loop that a sweep shows."""
    start, stop = flight.span(run)
    record = flight.record((start, stop + AFTER_S))
    at_mixer = loop == WHOLE
    channel = (COMMANDS if at_mixer else ANGLES)[AXES.index(axis)]
    given: Given = "sensitivity" if at_mixer else "closed"
    chirp = record["excitation"]
    if not at_mixer:
        # Set-points are in degrees, and the angle controller takes them in the loop that makes
        # them; the record says when the rate controller, one loop later, acts on them.
        chirp = np.radians(np.append(chirp[1:], chirp[-1]))
    unit = record.channels[channel].unit
    channels = Record.from_arrays(
        record.time_s, inputs={"chirp": chirp}, outputs={channel: record[channel]},
        units={channel: unit, "chirp": unit},
    )  # fmt: skip
    ends = (2.0 * np.pi * run.start_hz * INSIDE[0], 2.0 * np.pi * run.stop_hz * INSIDE[1])
    response = estimate_response(
        [channels], inputs=["chirp"], outputs=[channel], estimator="composite",
        band_rad_s=ends, n_omega=N_OMEGA, window_s=WINDOWS_S,
    )  # fmt: skip
    return margins(response, "chirp", channel, given=given)


def _beside(tuning: Tuning, design: PidDesign, loop: str, found: Margins) -> Iterator[FlownMargin]:
    """What was promised of a loop beside what was measured."""
    asked = limits(design.requirements, (loop,), None)
    for name in NAMES:
        number = _number(tuning, design, loop, name)
        measured: Reading = getattr(found, name.replace(" ", "_"))
        of_it = [limit for limit in asked if limit.name == f"{loop}: {name}"]
        yield FlownMargin(
            design.axis, loop, name, number.estimate, number.worst, number.flown, measured,
            number.required, _slack(of_it, measured), number.digits,
        )  # fmt: skip


def _number(tuning: Tuning, design: PidDesign, loop: str, name: str) -> WorstCase:
    """With all loops closed where the axes were designed alone."""
    closed = [
        number
        for each in tuning.together
        for axis in each.closed
        for number in axis.worst_cases
        if (axis.axis, number.loop, number.name) == (design.axis, loop, name)
    ]
    return closed[0] if closed else design.worst_case(loop, name)


def _slack(asked: list[Limit], measured: Reading) -> float | None:
    """What a requirement leaves at the end of the interval that meets it best."""
    if not asked or measured.value is None:
        return None
    ends = np.array([measured.value, *(measured.interval95 or ())])
    return float(min(np.max(limit.slack(ends)) for limit in asked))

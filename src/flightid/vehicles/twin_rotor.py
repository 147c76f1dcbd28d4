"""A simulated twin-rotor rig: two rotors on a pivoted beam (native side: `twin_rotor.rs`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.errors import OptionError, ShapeError
from flightid.frozen import dataclass
from flightid.models.linear.linear_system import LinearSystem
from flightid.record import Record, Step
from flightid.vehicles.twin_rotor_parameters import (
    Draught,
    Encoders,
    TwinRotorParameters,
)

INPUTS = ("u1", "u2")
OUTPUTS = ("y1", "y2")
UNITS = {"u1": "V", "u2": "V", "y1": "rad", "y2": "rad", "pitch": "rad", "yaw": "rad"}
STATES = ("pitch", "pitch_rate", "yaw", "yaw_rate", "tau_1", "tau_2", "reaction_lag")
STEP_S = 0.005
"""Longest Runge–Kutta step; a fifth of it changes no angle by more than 1e-6 rad."""


@dataclass(frozen=True)
class TwinRotor:
    """A beam that pitches and yaws on a pivot, with a rotor and its motor at each end.

    Two inputs: voltages of the main rotor ``u1`` and of the tail rotor ``u2``. Two outputs: pitch
    ``y1`` from the horizontal and yaw ``y2``. Motors with lag, thrust that grows with the square of
    the rotor's speed, gravity, viscous and Coulomb friction, gyroscopic and centrifugal moments,
    the reaction of the main rotor on yaw, a cable that twists, encoders and moving air.

    Attributes
    ----------
    parameters : TwinRotorParameters
    encoders : Encoders
    draught : Draught

    Reference
    ---------
    Feedback Instruments, *Twin Rotor MIMO System Control Experiments*, 33-949S; cable: Rahideh &
    Shaheed, Proc. IMechE Part I 221 (2007), 89–101.

    Example
    -------
    >>> rig = TwinRotor()
    >>> {name: round(volts, 3) for name, volts in rig.trim_v.items()}
    {'u1': 0.822, 'u2': -0.251}
    """

    parameters: TwinRotorParameters = field(default_factory=TwinRotorParameters)
    encoders: Encoders = field(default_factory=Encoders)
    draught: Draught = field(default_factory=Draught)

    def locked(self) -> TwinRotor:
        """The rig with its yaw axis locked: one degree of freedom."""
        return replace(self, parameters=replace(self.parameters, yaw_locked=True))

    @property
    def trim_v(self) -> dict[str, float]:
        """Voltages that hold the beam level with the cable untwisted, V."""
        main, tail = self._trim_speeds()
        k = self.parameters.motor_gain_per_v
        return {"u1": main / k[0], "u2": tail / k[1]}

    def _trim_speeds(self) -> tuple[float, float]:
        p = self.parameters
        lift = p.gravity_moment_n_m * math.sin(-p.rest_angle_rad)
        return p.speed_for(0, lift), p.speed_for(1, p.reaction_gain * lift)

    def _trim_state(self) -> NDArray[np.float64]:
        main, tail = self._trim_speeds()
        lift = self.parameters.gravity_moment_n_m * math.sin(-self.parameters.rest_angle_rad)
        return np.array([0.0, 0.0, 0.0, 0.0, main, tail, lift])

    def run(
        self,
        inputs: Mapping[str, ArrayLike],
        *,
        sample_time_s: float = 0.1,
        seed: int = 0,
        name: str = "twin rotor",
    ) -> Record:
        """Apply voltages about the trim and record the angles; starts level and at rest.

        Parameters
        ----------
        inputs : mapping of str to array_like, shape (n,)
            Departure of ``u1``, ``u2`` from their trim, V, held between samples; one left out
            keeps its trim.
        sample_time_s : float
            Time between samples, s.
        seed : int
            Seed of draught and sensor noise.
        name : str
            Name of the record.

        Returns
        -------
        Record
            Inputs ``u1``, ``u2`` (V, with their trim), outputs ``y1`` pitch and ``y2`` yaw as
            measured, others ``pitch`` and ``yaw`` as they were (rad).

        Raises
        ------
        OptionError
            No input, another name, or a sample time that is not positive.
        ShapeError
            Inputs of different length.
        DataError
            An input with a sample that is not finite, or a run that diverges.

        Example
        -------
        >>> record = TwinRotor().run({"u1": np.full(50, 0.1)})
        >>> record.inputs, record.outputs
        (('u1', 'u2'), ('y1', 'y2'))
        """
        voltages, n = self._voltages(inputs, sample_time_s)
        substeps = max(1, math.ceil(sample_time_s / STEP_S - 1e-9))
        rows = _native.run_twin_rotor(
            self.parameters.to_native(),
            asdict(self.encoders),
            asdict(self.draught),
            self._trim_state(),
            voltages,
            sample_time_s,
            substeps,
            seed,
        )
        return Record.from_arrays(
            np.arange(n) * sample_time_s,
            inputs=dict(zip(INPUTS, voltages, strict=True)),
            outputs=dict(zip(OUTPUTS, rows[:2], strict=True)),
            others={"pitch": rows[2], "yaw": rows[3]},
            units=UNITS,
            trim=self.trim_v,
            name=name,
            history=[Step("TwinRotor.run", {"seed": seed, "step_s": sample_time_s / substeps})],
        )

    def _voltages(
        self, inputs: Mapping[str, ArrayLike], sample_time_s: float
    ) -> tuple[NDArray[np.float64], int]:
        given = {key: np.atleast_1d(np.asarray(v, np.float64)) for key, v in inputs.items()}
        stray = sorted(set(given) - set(INPUTS))
        if stray or not given:
            raise OptionError(
                "the rig has two inputs", found=stray or "none", needed=f"one or both of {INPUTS}"
            )
        if not (sample_time_s > 0 and math.isfinite(sample_time_s)):
            raise OptionError("sample_time_s has no meaning", found=sample_time_s, needed="> 0")
        lengths = {len(samples) for samples in given.values()}
        if len(lengths) > 1:
            raise ShapeError("inputs differ in length", found=sorted(lengths), needed="one length")
        n = lengths.pop()
        trim = self.trim_v
        rows = [trim[key] + given.get(key, np.zeros(n)) for key in INPUTS]
        return np.ascontiguousarray(rows), n

    def linearised(self) -> LinearSystem:
        """The rig about its trim, without Coulomb friction, which has no slope there.

        Returns
        -------
        LinearSystem
            Seven states (`STATES`), inputs ``u1``, ``u2`` (V), outputs ``y1``, ``y2`` (rad).

        Example
        -------
        >>> poles = np.linalg.eigvals(TwinRotor().linearised().state_space()[0])
        >>> round(float(np.max(np.abs(poles.imag)) / (2 * np.pi)), 2)
        0.34
        """
        p = self.parameters
        main, tail = self._trim_speeds()
        lift = p.gravity_moment_n_m * math.sin(-p.rest_angle_rad)
        slope_1, slope_2 = p.thrust_slope(0, main), p.thrust_slope(1, tail)
        quick = p.reaction_lead_s / p.reaction_lag_s
        a = np.zeros((7, 7))
        a[0, 1] = 1.0
        a[1, 0] = -p.gravity_moment_n_m * math.cos(p.rest_angle_rad)
        a[1, 1] = -p.viscous_friction_n_m_s[0]
        a[1, 3] = -p.gyroscopic_s * lift
        a[1, 4] = slope_1
        a[1] /= p.inertia_kg_m2[0]
        if not p.yaw_locked:
            a[2, 3] = 1.0
            a[3, 2] = -p.cable_stiffness_n_m
            a[3, 3] = -p.viscous_friction_n_m_s[1]
            a[3, 4] = -p.reaction_gain * quick * slope_1
            a[3, 5] = slope_2
            a[3, 6] = -p.reaction_gain * (1.0 - quick)
            a[3] /= p.inertia_kg_m2[1]
        b = np.zeros((7, 2))
        for motor in (0, 1):
            a[4 + motor, 4 + motor] = -1.0 / p.motor_lag_s[motor]
            b[4 + motor, motor] = p.motor_gain_per_v[motor] / p.motor_lag_s[motor]
        a[6, 4], a[6, 6] = slope_1 / p.reaction_lag_s, -1.0 / p.reaction_lag_s
        c = np.zeros((2, 7))
        c[0, 0] = c[1, 2] = 1.0
        return LinearSystem(a, b, c, np.zeros((2, 2)), INPUTS, OUTPUTS)

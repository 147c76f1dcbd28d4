"""Flights of a linear vehicle with a pilot or controller in its loop (`vehicle_loop.rs`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field
from itertools import chain

import numpy as np

from flightid import _native
from flightid.errors import OptionError, UnitError, UnknownNameError
from flightid.excitation.excitation import Excitation
from flightid.frozen import dataclass
from flightid.models.linear.hold_equivalent import Hold
from flightid.models.linear.realisation import Matrices
from flightid.models.model import LinearModel
from flightid.record import Record, Step
from flightid.simulation.actuators import check_actuators, contiguous, with_actuators
from flightid.units import canonical

STANDING_BY = "sweep_"
"""Prefix of the channels that hold what was added to each input."""


@dataclass(frozen=True)
class Disturbance:
    """First-order Gauss–Markov process that moves an input by itself: a gust, a restless hand.

    Attributes
    ----------
    deviation : float
        Standard deviation, in the input's unit.
    time_s : float
        Correlation time, s: for a gust length over airspeed. Zero gives white noise.

    Reference
    ---------
    MIL-HDBK-1797: Dryden's longitudinal spectrum has this shape.

    Example
    -------
    >>> Disturbance(3.0, 1.5).deviation
    3.0
    """

    deviation: float
    time_s: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.deviation) and self.deviation >= 0.0 and self.time_s >= 0.0):
            raise OptionError(
                "a disturbance has no meaning",
                found=f"deviation {self.deviation}, correlation time {self.time_s} s",
                needed="numbers from 0 up",
            )


@dataclass(frozen=True)
class CrudePilot:
    """Feeds measured motion back to the sticks: gains, one delay, one lag of the arm.

    ``stick = −Σ gain · e^(−delay s) / (lag s + 1) · measured``, on each stick.

    Attributes
    ----------
    gains : mapping of str to mapping of str to float
        By stick, then by measured channel; stick unit over channel unit. Empty: hands off.
    delay_s : float
        Reaction time, s; a sample of the flight or more.
    lag_s : float
        Neuromuscular lag, s; zero for none.

    Reference
    ---------
    McRuer & Jex, IEEE Trans. Human Factors in Electronics 8 (1967): gain, delay and lag of the
    crossover model.

    Example
    -------
    >>> pilot = CrudePilot({"lat": {"phi": 0.5, "p": 0.1}}, delay_s=0.2)
    >>> pilot.inputs, pilot.outputs, float(pilot.state_space()[1][0, 0])
    (('phi', 'p'), ('lat',), -5.0)
    """

    gains: Mapping[str, Mapping[str, float]]
    delay_s: float = 0.2
    lag_s: float = 0.1

    @property
    def inputs(self) -> tuple[str, ...]:
        """Measured channels that the pilot watches."""
        return tuple(dict.fromkeys(chain.from_iterable(self.gains.values())))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Sticks that the pilot moves."""
        return tuple(self.gains)

    def state_space(self) -> Matrices:
        """A, B, C, D and the delay of each watched channel, s."""
        gain = np.array(
            [[-row.get(name, 0.0) for name in self.inputs] for row in self.gains.values()]
        ).reshape(len(self.gains), len(self.inputs))
        n, delays_s = len(self.gains), np.full(len(self.inputs), self.delay_s)
        if self.lag_s == 0.0:
            none = np.zeros((0, 0))
            return none, np.zeros((0, len(self.inputs))), np.zeros((n, 0)), gain, delays_s
        unit = np.eye(n)
        return -unit / self.lag_s, gain / self.lag_s, unit, np.zeros(gain.shape), delays_s


@dataclass(frozen=True)
class FlightConditions:
    """What a flight meets besides its inputs.

    Attributes
    ----------
    gusts : mapping of str to Disturbance
        Motion of the air by the state of the vehicle that it counts against, in the state's unit:
        ``{"v": Disturbance(3.0, 1.5)}`` is a side gust. Everything that this state's derivatives
        do, the gust does with the opposite sign.
    remnant : mapping of str to Disturbance
        Motion of a stick that no feedback explains, by input.
    noise : mapping of str to float
        Standard deviation of the white noise of an output, in its unit.
    actuators : mapping of str to float
        Bandwidth of the first-order actuator of an input, rad/s; without one where left out.

    Example
    -------
    >>> FlightConditions(noise={"p": 0.01}, actuators={"lat": 15.0}).actuators["lat"]
    15.0
    """

    gusts: Mapping[str, Disturbance] = field(default_factory=dict)
    remnant: Mapping[str, Disturbance] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    actuators: Mapping[str, float] = field(default_factory=dict)


def fly_closed_loop(
    vehicle: LinearModel,
    pilot: LinearModel,
    excitation: Excitation,
    *,
    conditions: FlightConditions | None = None,
    hold: Hold = "first",
    seed: int = 0,
    name: str = "flight",
) -> Record:
    """Fly a linear vehicle with a pilot in the loop and an excitation added to the sticks.

    The flight starts at rest. Inputs are logged as stick positions: feedback, remnant and
    excitation together, before the actuators.

    Assumes: a linear vehicle, exact holds, white measurement noise that the pilot sees too.

    Parameters
    ----------
    vehicle : LinearModel
        The truth. Gusts need a `StateSpaceModel`, whose states have names.
    pilot : LinearModel
        Its inputs are outputs of the vehicle, its outputs inputs of the vehicle; every input has a
        delay of a sample or more: a `CrudePilot`, a controller as `LinearSystem`.
    excitation : Excitation
        What is added to the vehicle's inputs, by name; its samples are those of the flight.
    conditions : FlightConditions, optional
        Gusts, remnant, noise, actuators; none when left out.
    hold : {"first", "zero"}
        What inputs and measurements do between samples.
    seed : int
        Seed of gusts, remnant and noise, from 0.
    name : str
        Name of the record.

    Returns
    -------
    Record
        Inputs by name, outputs with noise, and for each input the excitation ``"sweep_<input>"``,
        zero where nothing was added.

    Raises
    ------
    UnknownNameError
        Pilot, excitation or conditions name a channel or state that the vehicle lacks.
    OptionError
        A pilot without delay, a hold, bandwidth or seed without meaning.
    UnitError
        Excitation and vehicle disagree on the unit of an input.
    DataError
        The flight diverges: the pilot does not stabilise the vehicle.

    Reference
    ---------
    Franklin, Powell & Workman, Digital Control of Dynamic Systems, 3rd ed., sections 4.3.3, 6.3.

    Example
    -------
    >>> from flightid.excitation import sweep
    >>> from flightid.models.linear.linear_system import LinearSystem
    >>> roll = LinearSystem([[0.5]], [[10.0]], [[1.0]], [[0.0]], ("lat",), ("p",))
    >>> chirp = sweep(band_rad_s=(1.0, 20.0), amplitude=0.1, duration_s=20.0, sample_rate_hz=50.0,
    ...               name="lat")
    >>> flight = fly_closed_loop(roll, CrudePilot({"lat": {"p": 0.3}}, delay_s=0.1), chirp,
    ...                          conditions=FlightConditions(noise={"p": 0.01}), seed=1)
    >>> flight.inputs, flight.outputs, flight.excitations
    (('lat',), ('p',), ('sweep_lat',))
    """
    given = conditions or FlightConditions()
    _check(vehicle, pilot, excitation, given, hold, seed)
    inputs, outputs = tuple(vehicle.inputs), tuple(vehicle.outputs)
    matrices = with_actuators(_with_gusts(vehicle, given.gusts), inputs, given.actuators)
    added = np.zeros((len(inputs) + len(given.gusts), excitation.n_samples))
    for row, signal in excitation.by_name.items():
        added[inputs.index(row)] = signal
    still = Disturbance(0.0, 1.0)
    moving = [*(given.remnant.get(each, still) for each in inputs), *given.gusts.values()]
    flown, measured = _native.fly_closed_loop(
        matrices,
        contiguous(pilot.state_space()),
        [outputs.index(each) for each in pilot.inputs],
        [inputs.index(each) for each in pilot.outputs],
        added,
        [(each.deviation, each.time_s) for each in moving],
        [float(given.noise.get(each, 0.0)) for each in outputs],
        excitation.sample_time_s,
        hold == "first",
        seed,
    )
    units = dict(getattr(vehicle, "units", None) or {})
    standing_by = {STANDING_BY + each: row for each, row in zip(inputs, added, strict=False)}
    units |= {STANDING_BY + each: units[each] for each in inputs if each in units}
    return Record.from_arrays(
        excitation.time_s,
        inputs=dict(zip(inputs, flown, strict=False)),
        outputs=dict(zip(outputs, measured, strict=True)),
        excitations=standing_by,
        units=units,
        name=name,
        history=[Step("fly_closed_loop", {"seed": seed, "hold": hold})],
    )


def _with_gusts(vehicle: LinearModel, gusts: Mapping[str, Disturbance]) -> Matrices:
    """State space with one more input for each gust: minus its state's column, but no motion."""
    a, b, c, d, delays_s = vehicle.state_space()
    if gusts:
        found = vehicle.matrices()  # type: ignore[attr-defined]
        columns = [list(vehicle.states).index(name) for name in gusts]  # type: ignore[attr-defined]
        effect = -a[:, columns]
        b = np.hstack([b, effect])
        d = np.hstack([d, found.h1 @ effect])
        delays_s = np.concatenate([delays_s, np.zeros(len(columns))])
    return a, b, c, d, delays_s


def _check(
    vehicle: LinearModel,
    pilot: LinearModel,
    excitation: Excitation,
    conditions: FlightConditions,
    hold: str,
    seed: int,
) -> None:
    inputs, outputs = tuple(vehicle.inputs), tuple(vehicle.outputs)
    states = tuple(getattr(vehicle, "states", ()))
    for what, names, known in (
        ("the pilot watches an output that the vehicle lacks", pilot.inputs, outputs),
        ("the pilot moves an input that the vehicle lacks", pilot.outputs, inputs),
        ("the excitation moves an input that the vehicle lacks", excitation.names, inputs),
        ("a gust counts against a state that the vehicle lacks", conditions.gusts, states),
        ("a remnant moves an input that the vehicle lacks", conditions.remnant, inputs),
        ("noise is given for an output that the vehicle lacks", conditions.noise, outputs),
    ):
        _require_known(what, names, known)
    check_actuators(conditions.actuators, inputs)
    if hold not in ("zero", "first"):
        raise OptionError("hold is not known", found=hold, needed="'zero' or 'first'")
    if not 0 <= seed < 2**64:
        raise OptionError("seed is out of range", found=seed, needed="0 to 2^64 - 1")
    shortest = float(np.min(pilot.state_space()[4], initial=np.inf))
    if shortest < excitation.sample_time_s * (1.0 - 1e-9):
        raise OptionError(
            "the pilot reacts within a sample",
            found=f"a delay of {shortest:g} s",
            needed=f"{excitation.sample_time_s:g} s, one sample, or more",
        )
    units = getattr(vehicle, "units", None) or {}
    for name in excitation.names:
        if canonical(units.get(name, excitation.unit)) != excitation.unit:
            raise UnitError(
                f"excitation of input {name!r} has another unit than the vehicle",
                found=excitation.unit,
                needed=units[name],
            )


def _require_known(what: str, names: Iterable[str], known: tuple[str, ...]) -> None:
    for name in names:
        if name not in known:
            raise UnknownNameError(what, found=name, needed=", ".join(known) or "none")

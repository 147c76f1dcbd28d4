"""Tuned gains around a model, one frame at a time, by each controller's own recursion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from flightid.control.autopilots import AUTOPILOTS, AXES, AxisLoop, axis_loop
from flightid.control.autopilots.pid_loop import PidLoop
from flightid.control.tuning.tune_pid import CHANNELS
from flightid.errors import OptionError, UnitError, UnknownNameError

ANGLES = {"roll": "phi", "pitch": "theta", "yaw": "psi"}
ROLES = {"Kp": "p", "Ki": "i", "Kd": "d", "b": "b", "c": "c", "Tf": "filter_s", "Tt": "tracking_s"}
"""Roles of a PID's numbers by the names under which `flightid.tune` writes them."""
WHOLE = 1e-9


class GainController:
    """Controllers of axes, each by its own recursion, around the model's channels.

    The pilot commands ``<output>_command``: the angle where the model has one and the controller an
    angle loop, else the rate.

    Parameters
    ----------
    loops : mapping of str to AxisLoop
        By the model's input that each moves.
    measured : mapping of str to (str, str or None)
        By the same inputs the output of the inner loop, and the angle of the outer one.

    Example
    -------
    >>> loop = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    >>> law = GainController({"tau_phi": loop}, {"tau_phi": ("p", "phi")})
    >>> law.commands, round(law.step({"phi_command": 0.1}, {"p": 0.0, "phi": 0.0})["tau_phi"], 4)
    (('phi_command',), 0.0609)
    """

    def __init__(
        self, loops: Mapping[str, AxisLoop], measured: Mapping[str, tuple[str, str | None]]
    ) -> None:
        self.loops, self.measured = dict(loops), dict(measured)
        self._runners = {name: loop.runner() for name, loop in loops.items()}
        self.commands = tuple(f"{angle or rate}_command" for rate, angle in measured.values())

    def step(self, given: Mapping[str, float], outputs: Mapping[str, float]) -> dict[str, float]:
        """What each controller gives, from the pilot's commands and the model's last outputs."""
        found = {}
        for name, loop in self.loops.items():
            rate, angle = self.measured[name]
            wanted = given.get(f"{angle or rate}_command", 0.0)
            if angle is not None:
                wanted = loop.angle_gain_1_s * (wanted - outputs[angle])
            found[name] = self._runners[name](wanted, outputs[rate])
        return found


def gain_controller(
    gains: Mapping[str, float],
    model: Any,  # noqa: ANN401 — its channels and units are all that is asked of it
    rate_hz: float,
    autopilot: str | None = None,
) -> GainController:
    """Controllers of the axes that parameters of an autopilot speak of.

    Parameters
    ----------
    gains : mapping of str to float
        By the autopilot's names, as `read_parameters` reads them; what is not among them has the
        autopilot's default.
    model : Model or LinearSystem
        Vehicle with the channels of `CHANNELS`.
    rate_hz : float
        At which the controllers run, Hz.
    autopilot : str, optional
        Default: the first whose parameters these are.

    Raises
    ------
    OptionError
        No autopilot has these parameters.
    UnknownNameError
        The model has not the channels of an axis.
    UnitError
        A rate or an angle of the model is not in rad.
    """
    kinds = AUTOPILOTS if autopilot is None else (autopilot,)
    for kind in kinds:
        fresh = {axis: axis_loop(kind, axis, loop_rate_hz=rate_hz) for axis in AXES}
        own = {
            axis: {n: v for n, v in gains.items() if n in loop.gains}
            for axis, loop in fresh.items()
        }
        # Gyro filters belong to every axis: they choose none.
        shared = set.intersection(*({*loop.gains} for loop in fresh.values()))
        axes = [axis for axis in AXES if own[axis].keys() - shared]
        if axes:
            return _of_axes({axis: fresh[axis].with_gains(own[axis]) for axis in axes}, model)
    raise OptionError(
        "these are gains of no autopilot that is known",
        found=", ".join(list(gains)[:4]) or "nothing",
        needed=f"parameters of {', '.join(kinds)}",
    )


def _of_axes(loops: Mapping[str, AxisLoop], model: Any) -> GainController:  # noqa: ANN401
    made, measured = {}, {}
    for axis, loop in loops.items():
        moved, rate = CHANNELS[axis]
        if moved not in model.inputs or rate not in model.outputs:
            raise UnknownNameError(
                f"the model has not the channels of the {axis} gains",
                found=f"{', '.join(model.outputs)} from {', '.join(model.inputs)}",
                needed=f"{rate} from {moved}",
            )
        angle = ANGLES[axis] if ANGLES[axis] in model.outputs and loop.angle_gain_1_s else None
        for name, unit in ((rate, "rad/s"), (angle, "rad")):
            found = model.units.get(name, unit) if name else unit
            if found != unit:
                raise UnitError(f"output {name!r} of the model", found=found, needed=unit)
        made[moved], measured[moved] = loop, (rate, angle)
    return GainController(made, measured)


def pid_controller(
    tables: Iterable[Mapping[str, Any]],
    model: Any,  # noqa: ANN401
    rate_hz: float,
) -> GainController:
    """PID controllers as `flightid.tune` writes them, tables ``[[controller]]``, around a model.

    Parameters
    ----------
    tables : iterable of mapping
    model : Model or LinearSystem
        With one input, or as many as there are controllers: in the order of the file.
    rate_hz : float
        Of the flight, Hz; continuous controllers are sampled at it.

    Raises
    ------
    OptionError
        A table that does not describe a PID, or one of another rate than the flight's.
    UnknownNameError
        An output that the model has not.
    """
    listed = list(tables)
    if not listed or len(listed) != len(model.inputs):
        raise OptionError(
            "controllers and inputs of the model do not go together",
            found=f"{len(listed)} controllers for {', '.join(model.inputs)}",
            needed="one [[controller]] for each input, in their order",
        )
    loops: dict[str, AxisLoop] = {}
    measured: dict[str, tuple[str, str | None]] = {}
    for moved, table in zip(model.inputs, listed, strict=True):
        output = str(table.get("output", ""))
        if output not in model.outputs:
            raise UnknownNameError(
                "a controller holds no output of the model",
                found=output, needed=", ".join(model.outputs),
            )  # fmt: skip
        loops[moved], measured[moved] = _pid(table, output, rate_hz), (output, None)
    return GainController(loops, measured)


def _pid(table: Mapping[str, Any], output: str, rate_hz: float) -> PidLoop:
    own = table.get("sample_time_s")
    if own is not None and abs(float(own) * rate_hz - 1.0) > WHOLE:
        raise OptionError(
            "the controller runs at a rate of its own",
            found=f"{rate_hz:g} Hz", needed=f"sample_rate_hz={1 / float(own):g}",
        )  # fmt: skip
    values = {role: float(table[name]) for name, role in ROLES.items() if name in table}
    if {"Kp", "Ki", "Kd"}.isdisjoint(table):
        raise OptionError("a [[controller]] has no gains", needed="Kp, Ki or Kd")
    values = {"b": 1.0, "c": 1.0, "filter_s": 0.0} | values
    names = {role: name for name, role in ROLES.items() if role in values}
    low, high, reach = (
        None if key not in table else float(table[key])
        for key in ("output_low", "output_high", "output_rate_per_s")
    )
    return PidLoop(
        output, values, names, rate_hz, rate_hz, direct=bool(table.get("direct_action", False)),
        low=low, high=high, rate_per_s=reach,
    )  # fmt: skip

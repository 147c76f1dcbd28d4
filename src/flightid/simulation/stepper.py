"""A model advanced one sample at a time, for whoever does not know its inputs beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.models import LinearModel, LinearSystem, NarxModel, StateSpaceModel
from flightid.models.model import linear_system, model_of
from flightid.simulation.noise import Noise, moving_air
from flightid.simulation.nonlinear import run_equations, start_of

Array = NDArray[np.float64]


class Controller(Protocol):
    """What moves a model's inputs beside the pilot, one frame at a time."""

    @property
    def commands(self) -> tuple[str, ...]:
        """What the pilot moves of it, by name; at rest zero."""

    def step(self, given: Mapping[str, float], outputs: Mapping[str, float]) -> dict[str, float]:
        """What is added to inputs, from all that the pilot gives and the last sample's outputs."""


class Stepper:
    """A model at a fixed rate: inputs of an instant in, outputs of that instant out.

    Inputs are steps between samples. A linear model is exact, delays included. Equations take
    Runge-Kutta steps on the mean of their delayed input over a sample.

    Parameters
    ----------
    model : StateSpaceModel, NarxModel, or what `linear_system` takes
        Nonlinear ones take inputs whole, linear ones as departures.
    sample_time_s : float
        s.
    feedback : mapping of str to mapping of str to float, optional
        Stability augmentation: by input the gain on each output, added to the pilot's input from
        the outputs of the last sample.
    limits : mapping of str to (float, float), optional
        Lowest and highest value of an input, after the augmentation.
    controller : Controller, optional
        Beside the feedback; its commands are inputs too.
    noise : Noise, optional
        Gusts, process and sensor noise, of a linear model: the draws of `simulate` with this seed.

    Attributes
    ----------
    calm : bool
        Set it and gusts and process noise go on unfelt; errors of the sensors stay.

    Raises
    ------
    OptionError
        A sample time that is not positive or not the discrete model's own, or limits that cross.
    UnknownNameError
        Feedback or limits of channels that the model does not have.

    Example
    -------
    >>> lag = LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> stepper = Stepper(lag, 0.1)
    >>> stepper.step({"u": 1.0})["y"], round(stepper.step({"u": 1.0})["y"], 6)
    (0.0, 0.095163)
    """

    def __init__(
        self,
        model: object,
        sample_time_s: float,
        *,
        feedback: Mapping[str, Mapping[str, float]] | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
        controller: Controller | None = None,
        noise: Noise | None = None,
    ) -> None:
        if not (np.isfinite(sample_time_s) and sample_time_s > 0.0):
            raise OptionError("the sample time is not positive", found=sample_time_s)
        self.sample_time_s = sample_time_s
        self._plant = _plant(model, sample_time_s)
        self._air: _Air | None = None
        self.calm = False
        if noise is not None:
            if not isinstance(self._plant, _Samples):
                raise OptionError(
                    "noise is flown on linear models alone", found=repr(model), needed="linear"
                )
            self._air = _Air(cast("LinearModel", model_of(model)), noise, sample_time_s)
        moved, self.outputs = self._plant.inputs, self._plant.outputs
        commands = () if controller is None else controller.commands
        self._moved, self._controller = moved, controller
        self.inputs = (*moved, *commands)
        self.rest = self._plant.rest | dict.fromkeys(commands, 0.0)
        self._gains = np.zeros((len(moved), len(self.outputs)))
        for name, row in (feedback or {}).items():
            for output, gain in row.items():
                self._gains[_place("input", name, moved),
                            _place("output", output, self.outputs)] = gain  # fmt: skip
        self._low = np.full(len(moved), -np.inf)
        self._high = -self._low
        for name, (low, high) in (limits or {}).items():
            if not low < high:
                raise OptionError(f"limits of {name} cross", found=(low, high))
            place = _place("input", name, moved)
            self._low[place], self._high[place] = low, high
        self._last = np.zeros(len(self.outputs))

    def step(self, inputs: Mapping[str, float]) -> dict[str, float]:
        """Advance one sample.

        Parameters
        ----------
        inputs : mapping of str to float
            The pilot's, in their units; those left out rest (at the trim of a nonlinear model).

        Returns
        -------
        dict of str to float
            Outputs at this instant.

        Raises
        ------
        UnknownNameError
            There is no such input.
        DataError
            An input is not finite, or the model diverges.
        """
        given = np.array([self.rest[name] for name in self.inputs])
        for name, value in inputs.items():
            given[_place("input", name, self.inputs)] = value
        if not np.all(np.isfinite(given)):
            raise DataError("an input is not finite", found=str(dict(inputs)))
        driven = given[: len(self._moved)] + self._gains @ self._last
        if self._controller is not None:
            named = dict(zip(self.inputs, given.tolist(), strict=True))
            last = dict(zip(self.outputs, self._last.tolist(), strict=True))
            for name, value in self._controller.step(named, last).items():
                driven[self._moved.index(name)] += value
        driven = np.clip(driven, self._low, self._high)
        found = self._plant.step(driven)
        if self._air is not None and isinstance(self._plant, _Samples):
            found = found + self._air.outputs(calm=self.calm)
            kick = self._air.step()
            if not self.calm:
                self._plant.push(kick)
        if not np.all(np.abs(found) < 1e30):
            raise DataError("the model diverges", found=str(dict(inputs)))
        self._last = found
        return dict(zip(self.outputs, found.tolist(), strict=True))


def _plant(model: object, sample_time_s: float) -> _Samples | _Equations | _Recursion:
    if isinstance(model, NarxModel):
        return _Recursion(model, sample_time_s)
    if isinstance(model, StateSpaceModel) and not model.is_linear:
        return _Equations(model, sample_time_s)
    return _Samples(linear_system(model), sample_time_s)


class _Recursion:
    """A NARX model, from rest at its training means; inputs are whole."""

    def __init__(self, model: NarxModel, sample_time_s: float) -> None:
        model.scaling.require_sample_time(sample_time_s)
        self.inputs, self.outputs = model.inputs, model.outputs
        self.rest = {name: float(model.scaling.mean[name]) for name in model.inputs}
        self._model, self._mean = model, float(model.scaling.mean[model.output])
        self._past: list[float] = []
        self._moved: list[Array] = []

    def step(self, u: Array) -> Array:
        memory = self._model.memory
        self._moved = [*self._moved[-memory:], u] if memory else [u]
        short = len(self._past) < memory
        y = self._mean
        if not short:
            y = self._model.after(np.column_stack(self._moved), np.array(self._past))
        self._past = [*self._past, y][-memory:] if memory else []
        return np.array([y])


class _Samples:
    """A linear system, sampled exactly."""

    def __init__(self, system: LinearSystem, sample_time_s: float) -> None:
        step = system.sample_time_s
        if step is not None and abs(step / sample_time_s - 1.0) > 1e-9:
            raise OptionError(
                "a discrete model has a sample time of its own", found=sample_time_s, needed=step
            )
        whole = system.sampled(sample_time_s) if step is None else system.with_pade()
        self.inputs, self.outputs = system.inputs, system.outputs
        self.rest = dict.fromkeys(self.inputs, 0.0)
        self._a, self._b, self._c, self._d, _ = whole.state_space()
        self._x = np.zeros(whole.order)

    def step(self, u: Array) -> Array:
        y = self._c @ self._x + self._d @ u
        self._x = self._a @ self._x + self._b @ u
        return np.asarray(y)

    def push(self, states: Array) -> None:
        """Add to the model's own states, which stand first."""
        self._x[: len(states)] += states


class _Air:
    """Gusts and noise one sample at a time; states that feel them are the plant's own."""

    def __init__(self, model: LinearModel, noise: Noise, sample_time_s: float) -> None:
        self._moving = moving_air(model, noise, sample_time_s)
        self._n = len(self._moving.transition) - len(noise.gusts)
        self._gusts = self._moving.start
        self._white, self._blown, self._sensed = (noise.stream(k) for k in (1, 2, 0))
        self._blown.standard_normal(len(noise.gusts))
        outputs = linear_system(model).outputs
        noise.on_sensors(outputs, 0)
        self._errors = np.array([noise.sensor.get(name, 0.0) for name in outputs])

    def outputs(self, *, calm: bool) -> Array:
        """What outputs hold of this instant's gusts and sensors' errors, beside the states."""
        felt = self._moving.seen[:, self._n :] @ self._gusts * (not calm)
        return np.asarray(felt + self._errors * self._sensed.standard_normal(len(felt)))

    def step(self) -> Array:
        """Move the air on; what that adds to the states of the next sample."""
        m, n = self._moving, self._n
        draws = [self._white.standard_normal(n), self._blown.standard_normal(len(self._gusts))]
        kick = m.root @ np.concatenate(draws) + m.transition[:, n:] @ self._gusts
        self._gusts = kick[n:]
        return np.asarray(kick[:n])


class _Equations:
    """A nonlinear model, two samples at a time."""

    def __init__(self, model: StateSpaceModel, sample_time_s: float) -> None:
        self.inputs, self.outputs = model.inputs, model.outputs
        self.rest = {name: float(model.trim.get(name, 0.0)) for name in model.inputs}
        late = model.matrices().delays_s / sample_time_s
        self._lag, self._part = np.floor(late).astype(int), late - np.floor(late)
        self._model = replace(model, delays={}, blocks=(), bare=None)
        self._step_s = sample_time_s
        self._x = start_of(model, None)
        self._past: Array | None = None

    def step(self, u: Array) -> Array:
        depth = int(self._lag.max(initial=0)) + 2
        if self._past is None:
            self._past = np.repeat(u[:, None], depth, axis=1)
        self._past = np.hstack([u[:, None], self._past[:, :-1]])
        rows = np.arange(len(u))
        newer, older = self._past[rows, self._lag], self._past[rows, self._lag + 1]
        seen = np.where(self._part > 0.0, older, newer)
        mean = newer + self._part * (older - newer)
        states, outputs = run_equations(
            self._model, np.column_stack([mean, mean]), self._step_s, first_order_hold=False,
            initial_state=self._x, substeps=None,
        )  # fmt: skip
        if np.any(seen != mean):
            _, outputs = run_equations(
                self._model, seen[:, None], self._step_s, first_order_hold=False,
                initial_state=self._x, substeps=None,
            )  # fmt: skip
        self._x = np.ascontiguousarray(states[:, 1])
        return np.asarray(outputs[:, 0])


def _place(kind: str, name: str, known: tuple[str, ...]) -> int:
    if name not in known:
        raise UnknownNameError(f"there is no such {kind}", found=name, needed=", ".join(known))
    return known.index(name)

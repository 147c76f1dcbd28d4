"""Noise in a simulation: white noise and gusts on the way, errors of the sensors at the end."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import ModelError, OptionError, UnknownNameError
from flightid.frozen import dataclass
from flightid.models import LinearModel, StateSpaceModel
from flightid.models.model import linear_system
from flightid.models.sampled.recursion import run_recursion
from flightid.models.state_space.parts import derivative
from flightid.option_forms import NUMBER
from flightid.options import Options, option

Array = NDArray[np.float64]
NOISE_PARTS = 8
"""Values of white noise in a sample of a nonlinear model whose inputs are straight lines."""


@dataclass(frozen=True, repr=False)
class Noise(Options):
    """What disturbs a simulated flight, with its seed.

    Attributes
    ----------
    sensor : mapping of str to float
        Standard deviation of white noise by output, in its unit, a new draw each sample.
    process : mapping of str to float
        White noise on a state's derivative: the state alone would wander by this much in one
        second, unit of the state per √s. For a sampled system the deviation a sample.
    gusts : mapping of str to (float, float)
        Moving air by velocity or rate state: standard deviation, in its unit, and correlation time,
        s. Equations feel the state less the gust; the shape is Dryden's longitudinal one.
    seed : int
        The three kinds have streams of their own: one does not change when another is added.

    Raises
    ------
    OptionError
        A negative deviation, a correlation time that is not positive, a negative seed.

    Reference
    ---------
    MIL-HDBK-1797, Dryden form, with correlation time L/V.

    Example
    -------
    >>> Noise(sensor={"p": 0.01}, gusts={"v": (1.5, 2.0)})
    Noise(sensor p, gusts v, seed 0)
    """

    sensor: Mapping[str, float] = option(
        default_factory=dict, doc="Deviation of white noise by output, in its unit."
    )
    process: Mapping[str, float] = option(
        default_factory=dict, doc="White noise on a state's derivative, unit of the state/√s."
    )
    gusts: Mapping[str, tuple[float, float]] = option(
        default_factory=dict,
        doc="Moving air by velocity or rate state: DEVIATION:SECONDS of correlation.",
    )
    seed: int = option(0, minimum=0, doc="Seed of the noise.")

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind in ("sensor", "process"):
            for name, size in getattr(self, kind).items():
                _require_size(f"{kind} noise of {name}", size)
        for name, gust in self.gusts.items():
            _require_gust(name, gust)

    @property
    def moves(self) -> bool:
        """Whether anything disturbs the states."""
        return bool(self.process or self.gusts)

    def stream(self, place: int) -> np.random.Generator:
        """Random numbers of one kind: 0 sensor, 1 process, 2 gusts."""
        return np.random.default_rng(np.random.SeedSequence(self.seed).spawn(3)[place])

    def on_sensors(self, outputs: tuple[str, ...], n_samples: int) -> Array:
        """Errors of the sensors, shape (n_outputs, n_samples), in the outputs' units.

        Raises
        ------
        UnknownNameError
            There is no such output.
        """
        _require_known("output", self.sensor, outputs)
        sizes = np.array([[self.sensor.get(name, 0.0)] for name in outputs])
        draws = self.stream(0).standard_normal((n_samples, len(outputs))).T
        return np.asarray(sizes * draws)

    def __repr__(self) -> str:
        """What is disturbed, on one line."""
        kinds = ("sensor", "process", "gusts")
        parts = [f"{kind} {', '.join(each)}" for kind in kinds if (each := getattr(self, kind))]
        return f"Noise({', '.join(parts) or 'none'}, seed {self.seed})"


def linear_disturbance(
    model: LinearModel, noise: Noise, sample_time_s: float, n_samples: int
) -> Array:
    """What process noise and gusts add to the outputs of a linear model, exact at the samples.

    Parameters
    ----------
    model : LinearModel
    noise : Noise
    sample_time_s : float
        s.
    n_samples : int

    Returns
    -------
    ndarray, shape (n_outputs, n_samples)
        The vehicle starts undisturbed, the gusts in their steady state.

    Raises
    ------
    UnknownNameError
        There is no such state.
    OptionError
        Gusts on a sampled system, whose states have no rates.

    Reference
    ---------
    Van Loan, *IEEE Trans. Automatic Control* 23 (1978), eqs. 1.2 and 2.1: the covariance
    ∫ exp(Aτ) Q exp(Aᵀτ) dτ of a sample's noise.
    """
    system = linear_system(model)
    _require_known("state", (*noise.process, *noise.gusts), system.states)
    a, _, c, _, _ = system.state_space()
    sizes = np.array([noise.process.get(name, 0.0) for name in system.states])
    if system.is_discrete:
        if noise.gusts:
            raise OptionError(
                "gusts need the rates of a continuous model", found=", ".join(noise.gusts)
            )
        draws = noise.stream(1).standard_normal((n_samples, system.order)).T
        return np.asarray(c @ run_recursion(a, sizes[:, None] * draws))
    moved = moving_air(model, noise, sample_time_s)
    n = system.order
    draws = _draws(noise, n, len(noise.gusts), n_samples)
    start = np.concatenate([np.zeros(n), moved.start])
    return np.asarray(moved.seen @ run_recursion(moved.transition, moved.root @ draws, start))


@dataclass(frozen=True)
class MovingAir:
    """Process noise and gusts of a linear model as one recursion, z' = transition z + root draw.

    Attributes
    ----------
    transition, root : ndarray, shape (n + m, n + m)
        Of the model's n states and m gusts, over a sample.
    seen : ndarray, shape (n_outputs, n + m)
        Outputs of both.
    start : ndarray, shape (m,)
        Gusts in their steady state.
    """

    transition: Array
    root: Array
    seen: Array
    start: Array


def moving_air(model: LinearModel, noise: Noise, sample_time_s: float) -> MovingAir:
    """The recursion behind `linear_disturbance`, for whoever flies on without an end.

    Raises
    ------
    UnknownNameError
        There is no such state.
    OptionError
        Gusts on a sampled system, whose states have no rates.
    """
    system = linear_system(model)
    _require_known("state", (*noise.process, *noise.gusts), system.states)
    if system.is_discrete:
        raise OptionError(
            "gusts need the rates of a continuous model", found=", ".join(noise.gusts)
        )
    a, _, c, _, _ = system.state_space()
    sizes = np.array([noise.process.get(name, 0.0) for name in system.states])
    n = system.order
    columns = [system.states.index(name) for name in noise.gusts]
    times = np.array([time_s for _, time_s in noise.gusts.values()])
    steady = np.array([size for size, _ in noise.gusts.values()])
    felt = np.zeros((len(c), n)) if not isinstance(model, StateSpaceModel) else _felt(model, a)
    whole = np.block([[a, -a[:, columns]], [np.zeros((len(times), n)), np.diag(-1.0 / times)]])
    seen = np.hstack([c, -felt[:, columns]])
    density = np.diag(np.concatenate([sizes**2, 2.0 * steady**2 / times]))
    transition, covariance = sampled_noise(whole, density, sample_time_s)
    start = steady * noise.stream(2).standard_normal(len(times))
    return MovingAir(transition, _root(covariance), seen, start)


def sampled_noise(a: Array, density: Array, sample_time_s: float) -> tuple[Array, Array]:
    """Transition and noise covariance over a sample of dx = A x dt + dw, E dw dwᵀ = Q dt.

    Short steps are doubled, so that fast modes do not overflow in the exponential of −A.

    Returns
    -------
    tuple of ndarray
        exp(A T) and ∫ exp(Aτ) Q exp(Aᵀτ) dτ, both (n, n).

    Reference
    ---------
    Van Loan, *IEEE Trans. Automatic Control* 23 (1978), eqs. 1.2 and 2.1.

    Example
    -------
    >>> transition, covariance = sampled_noise(np.array([[-2.0]]), np.array([[4.0]]), 0.5)
    >>> bool(np.isclose(covariance[0, 0], 1.0 - np.exp(-2.0)))
    True
    """
    n = len(a)
    size = float(np.abs(a).sum(axis=1).max(initial=0.0)) * sample_time_s
    doublings = max(0, math.ceil(math.log2(size))) if size > 1.0 else 0
    step = sample_time_s / 2**doublings
    made = scipy.linalg.expm(np.block([[-a, density], [np.zeros((n, n)), a.T]]) * step)
    transition = np.asarray(made[n:, n:].T)
    covariance = np.asarray(transition @ made[:n, n:])
    for _ in range(doublings):
        covariance = covariance + transition @ covariance @ transition.T
        transition = transition @ transition
    return transition, 0.5 * (covariance + covariance.T)


def disturbed_equations(
    model: StateSpaceModel, noise: Noise, sample_time_s: float, n_samples: int
) -> tuple[StateSpaceModel, Array]:
    """A nonlinear model with its noise as further inputs, and their samples.

    White noise is white up to half the rate given: each value is the mean over a sample.

    Parameters
    ----------
    model : StateSpaceModel
    noise : Noise
    sample_time_s : float
        s.
    n_samples : int

    Returns
    -------
    tuple of StateSpaceModel and ndarray
        Samples of the further inputs, shape (n_noises, n_samples).

    Raises
    ------
    UnknownNameError
        There is no such state.
    ModelError
        A name that the noise would need is taken.
    """
    _require_known("state", (*noise.process, *noise.gusts), model.states)
    inputs, rows = dict(model.input_units), []
    equations = dict(model.equations)
    white = noise.stream(1)
    for name, size in noise.process.items():
        added = _free_name(f"noise_{name}", model)
        inputs[added] = f"({model.states[name]})/(s)"
        rows.append(size / math.sqrt(sample_time_s) * white.standard_normal(n_samples))
        equations = _replaced(equations, derivative(name), f"({derivative(name)} - {added})")
    moving = noise.stream(2)
    for name, (size, time_s) in noise.gusts.items():
        added = _free_name(f"gust_{name}", model)
        inputs[added] = model.states[name]
        keep = math.exp(-sample_time_s / time_s)
        draws = moving.standard_normal(n_samples) * size
        draws[1:] *= math.sqrt(1.0 - keep * keep)
        gust = run_recursion(np.array([[keep]]), draws[None, 1:], draws[:1])
        last = keep * gust[0, -1] + draws[-1] if n_samples > 1 else draws[0]
        rows.append(np.append(gust[0], last)[:n_samples])
        equations = _replaced(equations, name, f"({name} - {added})")
    made = replace(
        model, equations=equations, input_units=inputs, blocks=(), bare=None,
        delays={name: delay for name, delay in model.delays.items() if delay != "0"},
    )  # fmt: skip
    return made, np.array(rows).reshape(len(rows), n_samples)


def between_samples(values: Array, parts: int) -> Array:
    """Samples and points on the straight lines between them, shape (m, (n − 1) parts + 1).

    Example
    -------
    >>> between_samples(np.array([[0.0, 1.0]]), 2)
    array([[0. , 0.5, 1. ]])
    """
    places = np.arange((values.shape[1] - 1) * parts + 1) / parts
    whole = np.arange(values.shape[1])
    return np.array([np.interp(places, whole, row) for row in values]).reshape(
        len(values), len(places)
    )


def _felt(model: StateSpaceModel, a: Array) -> Array:
    """How outputs that hold state derivatives feel the states through them."""
    return np.asarray(model.matrices().h1 @ a)


def _draws(noise: Noise, n_states: int, n_gusts: int, n_samples: int) -> Array:
    """White numbers of both kinds from their own streams; gusts go on after their start."""
    moving = noise.stream(2)
    moving.standard_normal(n_gusts)
    white = noise.stream(1).standard_normal((n_samples, n_states))
    return np.hstack([white, moving.standard_normal((n_samples, n_gusts))]).T


def _root(covariance: Array) -> Array:
    """A square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def _replaced(equations: Mapping[str, str], name: str, other: str) -> dict[str, str]:
    pattern = re.compile(rf"(?<![A-Za-z0-9_]){re.escape(name)}(?![A-Za-z0-9_'])")
    return {
        pattern.sub(other, left): pattern.sub(other, right) for left, right in equations.items()
    }


def _free_name(name: str, model: StateSpaceModel) -> str:
    taken = {*model.states, *model.inputs, *model.parameters, *model.definitions, *model.outputs}
    if name in taken:
        raise ModelError(
            "a name that the noise needs is taken", found=name, action="rename it in the model"
        )
    return name


def _require_gust(name: str, gust: Any) -> None:  # noqa: ANN401 — checked here
    if not (isinstance(gust, tuple | list) and len(gust) == 2):
        raise OptionError(
            f"the gust on {name} is not a deviation and a time", found=gust,
            needed=f"(deviation, seconds); on the command line {name}=DEVIATION:SECONDS",
        )  # fmt: skip
    size, time_s = gust
    _require_size(f"gust on {name}", size)
    if not (NUMBER.fits(time_s) and time_s > 0.0):
        raise OptionError(
            f"the gust on {name} has no correlation time", found=time_s, needed="above 0 s"
        )


def _require_size(subject: str, size: Any) -> None:  # noqa: ANN401 — checked here
    if not (NUMBER.fits(size) and size >= 0.0):
        raise OptionError(f"{subject} has no meaning", found=size, needed="zero or more")


def _require_known(kind: str, names: Iterable[str], known: Iterable[str]) -> None:
    listed = tuple(known)
    for name in names:
        if name not in listed:
            raise UnknownNameError(
                f"noise is asked for on an unknown {kind}", found=name, needed=", ".join(listed)
            )

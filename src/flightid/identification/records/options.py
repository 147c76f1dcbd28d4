"""Options of a fit to records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from scipy.stats import norm

from flightid.errors import OptionError, UnknownNameError

InitialState = str | Mapping[str, float | str]
Freedom = bool | Sequence[str]

ESTIMATE, TRIM = "estimate", "trim"
HOLDS = ("first", "zero")
COVARIANCES = ("diagonal", "full")
LOSSES = ("gaussian", "huber")
STARTS = ("model", "equation_error")


@dataclass(frozen=True)
class RecordOptions:
    """Options of output error; see `flightid.identify`."""

    starts: int = 1
    seed: int = 0
    initial_state: InitialState = ESTIMATE
    output_bias: Freedom = True
    input_bias: Freedom = False
    noise_covariance: str = "diagonal"
    loss: str = "gaussian"
    loss_limit: float = 1.345
    hold: str = "first"
    start_from: str = "model"
    maximum_iterations: int = 100

    def __post_init__(self) -> None:
        for name, known in (
            ("noise_covariance", COVARIANCES),
            ("loss", LOSSES),
            ("hold", HOLDS),
            ("start_from", STARTS),
        ):
            found = getattr(self, name)
            if found not in known:
                raise OptionError(
                    f"{name} is not known", found=repr(found), needed=" or ".join(known)
                )
        if isinstance(self.initial_state, str) and self.initial_state not in (ESTIMATE, TRIM):
            raise OptionError(
                "initial_state is not known",
                found=repr(self.initial_state),
                needed="'estimate', 'trim', or a mapping of states to numbers or 'estimate'",
            )
        if self.maximum_iterations < 1:
            raise OptionError(
                "maximum_iterations is too small", found=self.maximum_iterations, needed="1 or more"
            )
        if not 0.0 < self.loss_limit < 100.0:
            raise OptionError(
                "loss_limit has no meaning", found=self.loss_limit, needed="deviations, above 0"
            )

    @property
    def limit(self) -> float:
        """Residual, in deviations, beyond which it counts less; infinite for Gauss."""
        return self.loss_limit if self.loss == "huber" else float(np.inf)

    @property
    def consistency(self) -> float:
        """Variance that the limit leaves of Gaussian noise: E min(u², k²)."""
        if np.isinf(self.limit):
            return 1.0
        k = self.limit
        inside = float(norm.cdf(k) - norm.cdf(-k))
        return inside - 2.0 * k * float(norm.pdf(k)) + k**2 * (1.0 - inside)

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {each.name: _plain(getattr(self, each.name)) for each in fields(self)}


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return dict(value)
    return list(value) if isinstance(value, list | tuple) else value


def chosen(option: Freedom, names: Sequence[str], subject: str) -> list[int]:
    """Places of the names that an option frees.

    Raises
    ------
    UnknownNameError
        A name that is not there.
    """
    if isinstance(option, bool):
        return list(range(len(names))) if option else []
    wanted = (option,) if isinstance(option, str) else tuple(option)
    for name in wanted:
        if name not in names:
            raise UnknownNameError(
                f"{subject} names an unknown channel", found=repr(name), needed=", ".join(names)
            )
    return [names.index(name) for name in wanted]


def initial_values(
    option: InitialState, states: Sequence[str], trim: Sequence[float]
) -> tuple[list[float], list[int]]:
    """Initial state and the places of its free entries.

    Raises
    ------
    UnknownNameError
        A state that is not there.
    OptionError
        Neither a number nor ``"estimate"``.
    """
    values = list(map(float, trim))
    if isinstance(option, str):
        return values, list(range(len(states))) if option == ESTIMATE else []
    free = []
    for name, given in option.items():
        if name not in states:
            raise UnknownNameError(
                "initial_state names an unknown state", found=repr(name), needed=", ".join(states)
            )
        place = list(states).index(name)
        if given == ESTIMATE:
            free.append(place)
        elif isinstance(given, int | float):
            values[place] = float(given)
        else:
            raise OptionError(
                f"initial_state of {name} is not known",
                found=repr(given),
                needed="a number or 'estimate'",
            )
    return values, sorted(free)

"""Options of a fit to records."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import OptionError, UnknownNameError
from flightid.frozen import dataclass
from flightid.options import Options, option

Array = NDArray[np.float64]
InitialState = str | Mapping[str, float | str]
Freedom = bool | str | Sequence[str]

ESTIMATE, MEASURED, TRIM = "estimate", "measured", "trim"
STARTS_OF_STATES = (ESTIMATE, MEASURED, TRIM)
HOLDS = ("first", "zero", "band_limited")
COVARIANCES = ("diagonal", "full")
LOSSES = ("gaussian", "huber")
STARTS = ("model", "equation_error")


@dataclass(frozen=True)
class RecordOptions(Options):
    """Options of output error; see `flightid.identify`."""

    starts: int = option(
        1, minimum=1, doc="Number of starts: the model's values, then a Latin hypercube."
    )
    seed: int = option(0, minimum=0, doc="Seed of the hypercube.")
    initial_state: InitialState = option(
        ESTIMATE,
        choices=STARTS_OF_STATES,
        doc="State at the first sample of each record; by state a number or one of these words.",
    )
    output_bias: Freedom = option(
        True, doc="Constants added to outputs of each record, estimated: all, none, or names."
    )
    input_bias: Freedom = option(
        False, doc="Constants added to inputs of each record, estimated: all, none, or names."
    )
    record_parameters: Sequence[str] = option(
        (), doc="Parameters that each record has for itself: of its channel, else estimated."
    )
    noise_covariance: str = option(
        "diagonal", choices=COVARIANCES, doc="Whether noise of outputs may be correlated."
    )
    loss: str = option("gaussian", choices=LOSSES, doc="'huber' counts outliers less.")
    loss_limit: float = option(
        1.345, unit="deviations", above=0.0, below=100.0, doc="Where 'huber' begins."
    )
    hold: str = option(
        "first", choices=HOLDS, doc="What inputs do between samples, where no record knows."
    )
    start_from: str = option("model", choices=STARTS, doc="Where the first start comes from.")
    maximum_iterations: int = option(100, minimum=1, doc="Most steps of each start.")

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
        inside = float(scipy.special.ndtr(k) - scipy.special.ndtr(-k))
        return (
            inside
            - 2.0 * k * math.exp(-0.5 * k**2) / math.sqrt(2.0 * math.pi)
            + k**2 * (1.0 - inside)
        )


def chosen(freed: Freedom, names: Sequence[str], subject: str) -> list[int]:
    """Places of the names that an option frees.

    Raises
    ------
    UnknownNameError
        A name that is not there.
    """
    if isinstance(freed, bool):
        return list(range(len(names))) if freed else []
    wanted = (freed,) if isinstance(freed, str) else tuple(freed)
    for name in wanted:
        if name not in names:
            raise UnknownNameError(
                f"{subject} names an unknown channel", found=repr(name), needed=", ".join(names)
            )
    return [names.index(name) for name in wanted]


def initial_values(
    start: InitialState, states: Sequence[str], trim: Array, measured: Array
) -> tuple[Array, list[int], list[int]]:
    """Initial state, the places of its free entries, and of those held at the measurement.

    A search begins at the measurement too. States that a mapping does not name are measured.

    Parameters
    ----------
    start : str or mapping of str to float or str
    states : sequence of str
    trim, measured : ndarray, shape (n_states,)
        The latter at the trim where nothing measures a state.

    Raises
    ------
    UnknownNameError
        A state that is not there.
    OptionError
        Neither a number nor one of the words.
    """
    asked = dict.fromkeys(states, start) if isinstance(start, str) else dict(start)
    for name, given in asked.items():
        if name not in states:
            raise UnknownNameError(
                "initial_state names an unknown state", found=repr(name), needed=", ".join(states)
            )
        if given not in STARTS_OF_STATES and not isinstance(given, int | float):
            raise OptionError(
                f"initial_state of {name} is not known",
                found=repr(given),
                needed="a number, " + ", ".join(map(repr, STARTS_OF_STATES)),
            )
    values = measured.copy()
    free: list[int] = []
    held: list[int] = []
    for place, name in enumerate(states):
        given = asked.get(name, MEASURED)
        if given == TRIM:
            values[place] = trim[place]
        elif not isinstance(given, str):
            values[place] = float(given)
        else:
            (free if given == ESTIMATE else held).append(place)
    return values, free, held

"""The state matrix of any linear model with its uncertain, and what its states are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import UnknownNameError
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.identification.uncertain_of import uncertain_of
from flightid.models import LinearSystem, StateSpaceModel
from flightid.models.model import linear_system, model_of
from flightid.uncertainty.uncertain import Uncertain, uncertain_numbers

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StateMatrix:
    """The linear system of a source, with the uncertainty of its matrix A.

    Attributes
    ----------
    name : str
        The model's.
    system : LinearSystem
    directions : ndarray, shape (k, n, n), or None
        Independent moves of A of one standard error each; None where `reason` says why.
    reason : str
    physical : bool
        Whether the states mean something: not those of a black box.
    states : tuple of str
        Their names, conventional where the user said so.

    Example
    -------
    >>> import flightid as fid
    >>> read_states(fid.load_model("short_period"), {}).states
    ('alpha', 'q')
    """

    name: str
    system: LinearSystem
    directions: Array | None
    reason: str
    physical: bool
    states: tuple[str, ...]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each state by the name in `states`."""
        kept = self.system.units
        pairs = zip(self.system.states, self.states, strict=True)
        return {new: kept.get(old, "1") for old, new in pairs}

    def carried(self, function: Callable[[Array], ArrayLike]) -> Uncertain[NDArray[np.float64]]:
        """Values and covariance of what is computed from A; see `Uncertain.carried`.

        Parameters
        ----------
        function : callable
            From A (n, n) to k numbers; NaN for one that is not determined.
        """
        a = np.asarray(self.system.a)
        values = np.atleast_1d(np.asarray(function(a), dtype=np.float64))
        if self.directions is None:
            return uncertain_numbers(values, None, self.reason)
        ends = [
            np.atleast_1d(np.asarray(function(a + move), dtype=np.float64))
            - np.atleast_1d(np.asarray(function(a - move), dtype=np.float64))
            for move in self.directions
        ]
        slopes = np.array(ends).reshape(len(ends), len(values)) / 2.0
        return uncertain_numbers(values, slopes.T @ slopes)


def read_states(source: object, states: Mapping[str, str]) -> StateMatrix:
    """Take the state matrix of a fit, a model or a system.

    Parameters
    ----------
    source : Fit, model or LinearSystem
    states : mapping of str to str
        Conventional name by the model's own name of a state.

    Raises
    ------
    ModelError
        There is no linear system in the source.
    UnknownNameError
        There is no such state.
    """
    system = linear_system(source)
    model = model_of(source)
    for name in states:
        if name not in system.states:
            raise UnknownNameError(
                "there is no such state", found=repr(name), needed=", ".join(system.states)
            )
    made_up = tuple(f"x{k + 1}" for k in range(system.order))
    physical = isinstance(model, StateSpaceModel) or (
        isinstance(model, LinearSystem) and system.states != made_up
    )
    directions, reason = _directions(source)
    return StateMatrix(
        getattr(model, "name", "linear system"),
        system,
        directions,
        reason,
        physical or bool(states),
        tuple(states.get(name, name) for name in system.states),
    )


def _directions(source: object) -> tuple[Array | None, str]:
    """Moves of A along independent directions of one standard error each, or why there are none."""
    uncertain = uncertain_of(source)
    if uncertain.covariance is None:
        return None, uncertain.reason
    model = model_of(source)
    known = source if isinstance(source, Fit) else getattr(model, "estimated", None)
    if known is not None and isinstance(model, StateSpaceModel):
        return _exact_directions(model, known.names, uncertain.covariance), ""
    order = linear_system(source).order
    slopes = uncertain.slopes(lambda model: np.asarray(linear_system(model).a).ravel())
    return slopes.reshape(-1, order, order), ""


def _exact_directions(model: StateSpaceModel, names: Sequence[str], covariance: Array) -> Array:
    """From dA = M⁻¹(dF − dM A), without differences."""
    a, m, by_name = model.state_space()[0], model.matrices().m, model.matrix_derivatives()
    slopes = np.array(
        [np.linalg.solve(m, by_name[name].f - by_name[name].m @ a) for name in names]
    ).reshape(len(names), *a.shape)
    sizes, turned = np.linalg.eigh(covariance)
    factor = turned * np.sqrt(np.maximum(sizes, 0.0))
    return np.asarray(np.einsum("pk,pst->kst", factor, slopes))

"""The protocol of every model, whatever its kind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, Self, runtime_checkable

from flightid.errors import ModelError
from flightid.models.estimated import EstimateProvenance
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.linear.realisation import Matrices
from flightid.models.parameters import Parameter
from flightid.table import Table


@runtime_checkable
class Model(Protocol):
    """What every kind of model has; `models/kinds.py` lists the kinds.

    Settings of a search are no part of a model: a structure (`PolynomialStructure`,
    `SubspaceStructure`, `NarxStructure`) holds them, and `identify` turns it into a model.
    """

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        ...

    @property
    def units(self) -> Mapping[str, str]:
        """Unit by channel."""
        ...

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Its numbers by name; coefficients of a black box, none of bare matrices."""
        ...

    @property
    def estimated(self) -> EstimateProvenance | None:
        """What a fit knew of the parameters; None for numbers without a fit."""
        ...

    @property
    def sample_time_s(self) -> float | None:
        """Sample time, s; None for continuous time."""
        ...

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Copy with other values of some parameters."""
        ...

    def linear_system(self) -> LinearSystem:
        """Its linear system; ModelError with the reason where there is none."""
        ...

    def summary(self) -> Table:
        """A table of it."""
        ...

    def to_dict(self) -> dict[str, object]:
        """Plain values with ``schema`` and ``kind``, without what is absent."""
        ...


@runtime_checkable
class LinearModel(Protocol):
    """What can be simulated: named inputs and outputs, and a state space with input delays."""

    @property
    def inputs(self) -> Sequence[str]:
        """Names of the inputs."""
        ...

    @property
    def outputs(self) -> Sequence[str]:
        """Names of the outputs."""
        ...

    def state_space(self) -> Matrices:
        """A (n, n), B (n, m), C (p, n), D (p, m) and the delay of each input (m,), s."""
        ...


def model_of(source: object) -> object:
    """The model of a fit, or the source itself."""
    inner = getattr(source, "model", None)
    return source if inner is None else inner


def linear_system(source: object) -> LinearSystem:
    """The linear system of a model, a fit, an interconnection or itself.

    Parameters
    ----------
    source : object
        With a method ``linear_system()``, as every model and every fit has, or a `LinearModel` of
        one's own. Nonlinear models are linearised at their trim; noise models are left out.

    Raises
    ------
    ModelError
        There is none, with the reason.

    Example
    -------
    >>> import flightid as fid
    >>> linear_system(fid.load_model("rate_integrator")).order
    1
    """
    made = getattr(source, "linear_system", None)
    if callable(made):
        found: LinearSystem = made()
        return found
    if isinstance(source, LinearModel):
        a, b, c, d, delays_s = source.state_space()
        return LinearSystem(a, b, c, d, tuple(source.inputs), tuple(source.outputs), delays_s)
    raise ModelError(
        "there is no linear system in this",
        found=type(source).__name__,
        needed="a model, a fit of one, or matrices",
    )

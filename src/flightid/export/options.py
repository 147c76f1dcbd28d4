"""Options of an export, by format; see `flightid.export`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from flightid.frozen import dataclass
from flightid.models.linear.hold_equivalent import Hold
from flightid.options import Options, option

Interface = Literal["model-exchange", "co-simulation"]


@dataclass(frozen=True)
class SampleTimeOptions(Options):
    """Step of code that advances by itself.

    Example
    -------
    >>> SampleTimeOptions(sample_time_s=0.01).to_dict()
    {'sample_time_s': 0.01, 'substeps': None}
    """

    sample_time_s: float | None = option(
        None, unit="s", above=0.0, doc="Step of the code; a sampled model has its own."
    )
    substeps: int | None = option(
        None, minimum=1, doc="Runge-Kutta steps in a sample, for equations."
    )


@dataclass(frozen=True)
class SourceOptions(SampleTimeOptions):
    """How a model becomes C.

    Example
    -------
    >>> SourceOptions(sample_time_s=0.01).hold
    'zero'
    """

    hold: Hold = option("zero", choices=("zero", "first"), doc="What inputs do between samples.")
    tunable: bool = option(
        False, doc="Equations with parameters to change, in place of exact samples."
    )


@dataclass(frozen=True)
class FmuOptions(SampleTimeOptions):
    """How a model becomes a functional mock-up unit; its step is that of co-simulation.

    Example
    -------
    >>> FmuOptions().compile
    True
    """

    interfaces: tuple[Interface, ...] | None = option(
        None,
        choices=("model-exchange", "co-simulation"),
        doc="Kinds of FMU; left out: both where the model allows it.",
    )
    pade_order: int | None = option(
        None, minimum=1, doc="Degree of rational delays, which model exchange needs."
    )
    compile: bool = option(True, doc="Put a binary for this machine into the unit.")


@dataclass(frozen=True)
class JsbsimOptions(Options):
    """What JSBSim's aerodynamics need beside a model.

    Example
    -------
    >>> JsbsimOptions(mass_kg=1247.0).mass_kg
    1247.0
    """

    mass_kg: float | None = option(
        None, unit="kg", above=0.0, doc="Of the vehicle; needed where the model has velocities."
    )
    inertia_kg_m2: Mapping[str, float] | None = option(
        None, unit="kg m^2", doc="Moments of inertia: ixx, iyy, izz and, where it is not zero, ixz."
    )
    trim: Mapping[str, float] | None = option(
        None, doc="Where the model was linearised: u and w in m/s, theta in rad, and inputs."
    )
    properties: Mapping[str, str] | None = option(
        None, doc="JSBSim's property by input or state, for names that it does not know."
    )


FORMATS: Mapping[str, type[Options]] = {
    "toml": Options,
    "mat": Options,
    "json": Options,
    "npz": Options,
    "c": SourceOptions,
    "fmu": FmuOptions,
    "jsbsim": JsbsimOptions,
}
"""Formats of an export with the dataclass of their options."""

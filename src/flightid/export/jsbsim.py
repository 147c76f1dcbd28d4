"""Export to JSBSim: stability and control derivatives as functions of its aerodynamic axes.

JSBSim adds gravity and the motion of the axes itself, so they are taken out of the force equations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import STANDARD_GRAVITY_M_S2, Light
from flightid.errors import ExportError, OptionError
from flightid.export.exported import ExportFiles
from flightid.export.fmu_description import plain
from flightid.export.names import identifier
from flightid.export.options import JsbsimOptions
from flightid.files import write_atomically
from flightid.findings import Finding
from flightid.models import LinearSystem
from flightid.models.model import linear_system

Array = NDArray[np.float64]
FT_M = 0.3048
LBF_N = 4.4482216152605
NEGLIGIBLE = 1e-6
"""Share of gravity or speed below which what is left of them is rounding."""
PROPERTIES = {
    "u": "velocities/u-aero-fps", "v": "velocities/v-aero-fps", "w": "velocities/w-aero-fps",
    "alpha": "aero/alpha-rad", "beta": "aero/beta-rad", "p": "velocities/p-aero-rad_sec",
    "q": "velocities/q-aero-rad_sec", "r": "velocities/r-aero-rad_sec",
    "elevator": "fcs/elevator-pos-rad", "aileron": "fcs/left-aileron-pos-rad",
    "rudder": "fcs/rudder-pos-rad",
}  # fmt: skip
_ANGLES = ("phi", "theta", "psi")
_MOMENTS = {"p": "ROLL", "q": "PITCH", "r": "YAW"}
_FORCES = {"u": "X", "v": "Y", "beta": "Y", "w": "Z", "alpha": "Z"}


def export_jsbsim(model: object, path: Path, name: str, options: JsbsimOptions) -> ExportFiles:
    """Write the aerodynamics section of a JSBSim aircraft from a linear model's derivatives.

    Parameters
    ----------
    model : what `linear_system` takes, with states named u, v or beta, w or alpha, p, q, r
        In SI units and radians, body axes; phi, theta and psi may be states too.
    path : Path
        File ending in ``.xml``, for ``<aerodynamics file="..."/>``.
    name : str
        Of the model.
    options : JsbsimOptions
        A trim that is left out is the model's own constants U0, W0, theta0, else what is needed is
        asked for; properties go before `PROPERTIES`.

    Raises
    ------
    ExportError
        A state, input or derivative has no place in JSBSim; the message names all of them.
    OptionError
        Mass, inertia or trim is missing or has no meaning.

    Assumes
    -------
    Trim forces are those of steady straight flight and hold the thrust too. Input delays are left
    out with a finding.

    Reference
    ---------
    Stevens, Lewis & Johnson, *Aircraft Control and Simulation*, 3rd ed., eqs. 1.7-16 and 1.7-18.
    Berndt, *JSBSim Reference Manual*, section on aerodynamics.
    """
    if path.suffix.lower() != ".xml":
        raise OptionError("a JSBSim file ends in .xml", found=path.name)
    system = linear_system(model)
    if system.is_discrete:
        raise ExportError("JSBSim takes derivatives in continuous time", found=repr(system))
    point = _trim_of(model, options.trim)
    known = {**PROPERTIES, **(options.properties or {})}
    _check_names(system, known)
    root = Element("aerodynamics")
    SubElement(root, "documentation").text = plain(f"{name}: written by flightid")
    for axis, rows in _axes(system, point, options.mass_kg, options.inertia_kg_m2).items():
        part = SubElement(root, "axis", name=axis)
        if axis in ("X", "Y", "Z"):
            _trim_force(part, axis, point, options.mass_kg or 0.0)
        for variable, factor in rows.items():
            _function(part, axis, variable, factor, known[variable], point)
    indent(root)
    text = '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
    write_atomically(path, text)
    findings = _delay_findings(system)
    facts = {
        "use": f'<aerodynamics file="{path.name}"/>',
        "axes": ", ".join(str(each.get("name")) for each in root.findall("axis")),
    }
    return ExportFiles("jsbsim", (path,), facts, tuple(findings))


def _trim_of(model: object, given: Mapping[str, float] | None) -> dict[str, float]:
    found: dict[str, float] = {}
    parameters: Any = getattr(model, "parameters", None)
    for name, own in (("u", "U0"), ("w", "W0"), ("theta", "theta0")):
        if parameters is not None and own in parameters and parameters[own].value is not None:
            found[name] = float(parameters[own].value)
    found |= {key: float(value) for key, value in (given or {}).items()}
    if not all(map(math.isfinite, found.values())):
        raise OptionError("a trim value is not finite", found=str(found))
    return found


def _check_names(system: LinearSystem, known: Mapping[str, str]) -> None:
    states = [
        name
        for name in system.states
        if name not in _MOMENTS and name not in _FORCES and name not in _ANGLES
    ]
    inputs = [name for name in system.inputs if name not in known]
    if states or inputs:
        raise ExportError(
            "the model holds what JSBSim's aerodynamics do not know",
            found=", ".join([*(f"state {x}" for x in states), *(f"input {x}" for x in inputs)]),
            needed=f"states among {', '.join([*_MOMENTS, *_FORCES, *_ANGLES])}; inputs among "
            f"{', '.join(known)}",
            action="name the property of an input with properties={...}; reduce further states "
            "to derivatives first",
        )


def _axes(
    system: LinearSystem,
    trim: Mapping[str, float],
    mass_kg: float | None,
    inertia: Mapping[str, float] | None,
) -> dict[str, dict[str, float]]:
    """Derivatives by axis and variable, N or N m per SI unit."""
    a, b, *_ = system.state_space()
    names = (*system.states, *system.inputs)
    rows = np.hstack([a, b])
    found: dict[str, dict[str, float]] = {}
    for state, axis in _FORCES.items():
        if state in system.states:
            row = rows[system.states.index(state)].copy()
            row = _force(row, state, axis, names, trim)
            found[axis] = _named(axis, row * _mass(mass_kg), names)
    rates = np.array(
        [rows[system.states.index(x)] if x in system.states else 0 * rows[0] for x in _MOMENTS]
    )
    if np.any(rates):
        moments = _inertia(inertia) @ rates
        for axis, row in zip(_MOMENTS.values(), moments, strict=True):
            if np.any(row):
                found[axis] = _named(axis, row, names)
    if not found:
        raise ExportError("the model has neither a force nor a moment", found=", ".join(names))
    return found


def _force(
    row: Array, state: str, axis: str, names: tuple[str, ...], trim: Mapping[str, float]
) -> Array:
    """Specific force: the state's row without gravity and the motion of the axes."""
    u, w, theta = (_needed(trim, key) for key in ("u", "w", "theta"))
    if state in ("alpha", "beta"):
        row = row * u
    own = {
        "X": {"q": -w, "r": 0.0, "theta": -math.cos(theta)},
        "Y": {"p": w, "r": -u, "phi": math.cos(theta)},
        "Z": {"q": u, "theta": -math.sin(theta)},
    }[axis]
    for name, factor in own.items():
        if name not in names:
            continue
        place = names.index(name)
        gravity = name in _ANGLES
        row[place] -= factor * (STANDARD_GRAVITY_M_S2 if gravity else 1.0)
        if gravity and abs(row[place]) < 1e-3 * STANDARD_GRAVITY_M_S2:
            row[place] = 0.0  # A model's own g differs in its last digits.
        elif abs(row[place]) < NEGLIGIBLE * max(abs(u), 1.0):
            row[place] = 0.0
    return row


def _named(axis: str, row: Array, names: tuple[str, ...]) -> dict[str, float]:
    found = {name: float(value) for name, value in zip(names, row, strict=True) if value != 0.0}
    left = [name for name in found if name in _ANGLES]
    if left:
        raise ExportError(
            f"axis {axis} depends on the attitude in a way that is not gravity",
            found=", ".join(f"{name}: {found[name]:.4g}" for name in left),
            needed="derivatives by velocities, rates and controls",
            action="check trim u, w and theta against the model's point of linearisation",
        )
    return found


def _function(
    part: Element, axis: str, variable: str, factor: float, prop: str, trim: Mapping[str, float]
) -> None:
    kind = "force" if axis in ("X", "Y", "Z") else "moment"
    name = f"aero/{kind}/{axis}_by_{identifier(variable)}"
    item = SubElement(part, "function", name=name)
    SubElement(item, "description").text = plain(f"{axis} by {variable}, flightid derivative")
    product = SubElement(item, "product")
    is_speed = variable in ("u", "v", "w")
    unit = LBF_N * (1.0 if kind == "force" else FT_M)
    SubElement(product, "value").text = repr(factor / unit * (FT_M if is_speed else 1.0))
    offset = _offset(variable, trim) / (FT_M if is_speed else 1.0)
    place = SubElement(product, "difference") if offset else product
    SubElement(place, "property").text = plain(prop)
    if offset:
        SubElement(place, "value").text = repr(offset)


def _offset(variable: str, trim: Mapping[str, float]) -> float:
    if variable == "alpha" and "alpha" not in trim:
        return math.atan2(trim.get("w", 0.0), _needed(trim, "u"))
    return trim.get(variable, 0.0)


def _trim_force(part: Element, axis: str, trim: Mapping[str, float], mass_kg: float) -> None:
    theta = _needed(trim, "theta")
    share = {"X": math.sin(theta), "Y": 0.0, "Z": -math.cos(theta)}[axis]
    if share:
        item = SubElement(part, "function", name=f"aero/force/{axis}_trim")
        SubElement(item, "description").text = "what holds the weight at the trim, thrust included"
        force = mass_kg * STANDARD_GRAVITY_M_S2 * share / LBF_N
        SubElement(item, "value").text = repr(force)


def _needed(trim: Mapping[str, float], key: str) -> float:
    if key not in trim:
        raise OptionError(
            "the trim of the model is not known",
            found=", ".join(trim) or "nothing",
            needed=f"trim={{{key!r}: ...}}, in m/s or rad",
        )
    return trim[key]


def _mass(mass_kg: float | None) -> float:
    if mass_kg is None or not (math.isfinite(mass_kg) and mass_kg > 0.0):
        raise OptionError("forces need the mass", found=mass_kg, needed="mass_kg above 0")
    return mass_kg


def _inertia(given: Mapping[str, float] | None) -> Array:
    values = dict(given or {})
    known = {"ixx", "iyy", "izz", "ixz"}
    if set(values) - known or not {"ixx", "iyy", "izz"} <= set(values):
        raise OptionError(
            "moments need the inertia",
            found=", ".join(values) or None,
            needed="inertia_kg_m2 with ixx, iyy, izz and perhaps ixz",
        )
    x, y, z, xz = (float(values.get(key, 0.0)) for key in ("ixx", "iyy", "izz", "ixz"))
    found = np.array([[x, 0.0, -xz], [0.0, y, 0.0], [-xz, 0.0, z]])
    if not np.all(np.isfinite(found)) or np.linalg.eigvalsh(found)[0] <= 0.0:
        raise OptionError("the inertia is that of no body", found=str(values))
    return found


def _delay_findings(system: LinearSystem) -> list[Finding]:
    late = zip(system.inputs, np.asarray(system.delays_s), strict=True)
    listed = [f"{name} {delay:g} s" for name, delay in late if delay]
    if not listed:
        return []
    return [
        Finding(
            "delays-left-out",
            Light.AMBER,
            f"JSBSim's aerodynamics know no delays: {', '.join(listed)} left out",
            "put an actuator with <delay> into flight_control",
        )
    ]

"""Physics of a rotor with stabilizer bar: what blades and mixer promise, what was identified."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from flightid.conventions import Light
from flightid.dynamics.conditions.ratios import ratio_of
from flightid.dynamics.modes.modes import modes
from flightid.dynamics.rotor.blades import flapping_time_constant
from flightid.dynamics.rotor.result import FULL, GIVEN, THEORY, RotorFact, RotorPhysics
from flightid.errors import ModelError, OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.identification.uncertain_of import source_findings
from flightid.identification.uncertain_parameters import uncertain_parameters
from flightid.models import StateSpaceModel
from flightid.uncertainty.estimate import UNHEARD, Estimate, Reading
from flightid.uncertainty.uncertain import Uncertain

NAMES: Mapping[str, str] = {
    "rotor time constant": "tau_f",
    "bar time constant": "tau_s",
    "roll stiffness": "Lb",
    "pitch stiffness": "Ma",
    "lateral bar": "Bd",
    "lateral stick": "Blat",
    "longitudinal bar": "Ac",
    "longitudinal stick": "Alon",
}
"""Parameter of a library model by role."""
FLAPPING = {"roll": ("roll stiffness", "p"), "pitch": ("pitch stiffness", "q")}


def rotor_physics(
    source: object,
    rotor_speed_rad_s: float,
    *,
    lock_number: float | None = None,
    bar_lock_number: float | None = None,
    expected: Mapping[str, float] | None = None,
    names: Mapping[str, str] | None = None,
) -> RotorPhysics:
    """Identified rotor parameters against what the rotor's physics says.

    Parameters
    ----------
    source : Fit or StateSpaceModel
        A model with rotor flapping; a model alone has no intervals.
    rotor_speed_rad_s : float
        Ω.
    lock_number, bar_lock_number : float, optional
        Of blade and bar (`Blade.lock_number`, in hover with `effective_lock_number`); they give the
        theory of the time constants.
    expected : mapping of str to float, optional
        Other numbers to hold the identified ones against, by their name in the result, such as
        ``"bar time constant"`` (s) or ``"lateral gearing"`` as measured on the vehicle.
    names : mapping of str to str, optional
        Parameters by role (`flightid.dynamics.rotor.rotor_physics.NAMES`) where they differ
        from the library's.

    Returns
    -------
    RotorPhysics
        Time constants and Lock numbers 16/(τΩ) of rotor and bar, flapping frequencies √L_b and √M_a
        and dampings 1/(2τ√L_b) beside the full model's modes, gearing of the bar's mixer.

    Raises
    ------
    ModelError
        Not a state-space model, or none of the parameters is in it.
    OptionError
        A rotor speed that is not positive, an unknown role or name.

    Reference
    ---------
    Mettler, Tischler & Kanade, "System identification modeling of a small-scale unmanned
    rotorcraft", *J. American Helicopter Society* 47(1), 2002, eqs. 15 and 28 to 30.

    Example
    -------
    >>> import flightid as fid
    >>> found = rotor_physics(fid.load_model("r50_hover"), 89.0)
    >>> round(found["roll flapping damping"].identified.value, 2)
    0.11
    """
    model = source.model if isinstance(source, Fit) else source
    if not isinstance(model, StateSpaceModel):
        raise ModelError(
            "rotor physics needs a state-space model",
            found=type(model).__name__,
            needed="equations with rotor flapping, such as r50_hover",
        )
    if not rotor_speed_rad_s > 0.0:
        raise OptionError("the rotor speed is not positive", found=rotor_speed_rad_s)
    unknown = set(names or {}) - set(NAMES)
    if unknown:
        raise OptionError(
            "there is no such role", found=", ".join(sorted(unknown)), needed=", ".join(NAMES)
        )
    roles = {
        role: name for role, name in {**NAMES, **(names or {})}.items() if name in model.parameters
    }
    locks = {"rotor": lock_number, "bar": bar_lock_number}
    values = _expected(rotor_speed_rad_s, locks, dict(expected or {}))
    uncertain = uncertain_parameters(source)
    facts = []
    for item in _formulas(roles, rotor_speed_rad_s):
        mine = _carried(uncertain, roles, item)
        theirs, where = _reference(item.name, values, source, mine.unit)
        facts.append(RotorFact(mine, item.text, theirs, where, ratio_of(mine, theirs)))
    if not facts:
        raise ModelError(
            "the model has no parameters of a rotor",
            found=", ".join(model.parameters),
            needed=", ".join(f"{role}: {name}" for role, name in NAMES.items()),
            action="name them: names={'rotor time constant': …}",
        )
    stray = set(expected or {}) - {fact.identified.name for fact in facts}
    if stray:
        raise OptionError(
            "nothing is identified under this name",
            found=", ".join(sorted(stray)),
            needed=", ".join(fact.identified.name for fact in facts),
        )
    found = tuple(facts)
    return RotorPhysics(
        model.name, rotor_speed_rad_s, found, (*_judge(found), *source_findings(source))
    )


@dataclass(frozen=True)
class _Formula:
    name: str
    unit: str
    text: str
    needs: tuple[str, ...]
    value: Callable[..., float]


def _formulas(roles: Mapping[str, str], speed: float) -> Iterator[_Formula]:
    every: list[_Formula] = []
    for what in ("rotor", "bar"):
        role = f"{what} time constant"
        every.append(_Formula(role, "s", "τ", (role,), lambda tau: tau))
        every.append(
            _Formula(f"{what} Lock number", "1", "16/(τ Ω)", (role,), lambda t: 16.0 / (t * speed))
        )
    slow = "bar time constant" if "bar time constant" in roles else "rotor time constant"
    for axis, (role, _) in FLAPPING.items():
        letter = "L_b" if axis == "roll" else "M_a"
        every.append(
            _Formula(f"{axis} flapping frequency", "rad/s", f"√{letter}", (role,), np.sqrt)
        )
        every.append(
            _Formula(
                f"{axis} flapping damping",
                "1",
                f"1/(2 τ √{letter}), τ of the {slow.split(maxsplit=1)[0]}",
                (slow, role),
                lambda tau, stiffness: 0.5 / (tau * np.sqrt(stiffness)),
            )
        )
    for axis, text in (("lateral", "B_d/B_lat"), ("longitudinal", "A_c/A_lon")):
        needs = (f"{axis} bar", f"{axis} stick")
        every.append(
            _Formula(f"{axis} gearing", "1", f"size of {text}", needs, lambda b, s: abs(b / s))
        )
    for item in every:
        if set(item.needs) <= set(roles):
            yield item


def _expected(
    speed: float, locks: Mapping[str, float | None], given: Mapping[str, float]
) -> dict[str, tuple[float, str]]:
    """Expected numbers with where they come from; a time constant tells its Lock number too."""
    found: dict[str, tuple[float, str]] = {}
    for what, number in locks.items():
        slow, lock = f"{what} time constant", f"{what} Lock number"
        if number is not None:
            found[lock] = (number, THEORY)
            found[slow] = (flapping_time_constant(number, speed), THEORY)
        if slow in given:
            found[lock] = (16.0 / (given[slow] * speed), THEORY)
    return {**found, **{name: (value, GIVEN) for name, value in given.items()}}


def _carried(
    uncertain: Uncertain[dict[str, float]], roles: Mapping[str, str], item: _Formula
) -> Reading:
    def value(parameters: dict[str, float]) -> float:
        with np.errstate(invalid="ignore", divide="ignore"):
            return float(item.value(*(np.float64(parameters[roles[role]]) for role in item.needs)))

    found = uncertain.carried(value).number(
        0, item.name, item.unit, "the parameters give no such number"
    )
    if found.interval95 is None and found.reason == UNHEARD:
        return Estimate(item.name, found.value, item.unit, None, "its parameters were not fitted")
    return found


def _reference(
    name: str, values: Mapping[str, tuple[float, str]], source: object, unit: str
) -> tuple[Reading, str]:
    if name in values:
        value, where = values[name]
        return Estimate(name, value, unit, None, "exact"), where
    axis = name.split(maxsplit=1)[0]
    if axis in FLAPPING and "flapping" in name:
        return _of_mode(axis, name, source)
    return Estimate(name, None, unit, None, "nothing to hold it against"), ""


def _of_mode(axis: str, name: str, source: object) -> tuple[Reading, str]:
    """Natural frequency or damping of the lightest mode that turns about the axis with flapping.

    Its errors are those of the same parameters: the ratio has the identified number's alone.
    """
    found = [m for m in modes(source) if m.is_pair and m.name.startswith(f"{axis}/")]
    if not found:
        return Estimate(name, None, "1", None, "the full model has no such mode"), ""
    mode = min(found, key=lambda each: each.damping_ratio.value or 0.0)
    number = mode.natural_frequency if "frequency" in name else mode.damping_ratio
    return Estimate(name, number.value, number.unit, None, "same fit"), FULL


def _judge(facts: tuple[RotorFact, ...]) -> Iterator[Finding]:
    for fact in facts:
        interval, told = fact.identified.interval95, fact.expected.value
        if interval is None or told is None or fact.expected_from not in (THEORY, GIVEN):
            continue
        if not interval[0] <= told <= interval[1]:
            yield Finding(
                "differs-from-theory",
                Light.AMBER,
                f"{fact.identified.name}: identified {fact.identified.text}, "
                f"{fact.expected_from} {told:.4g}",
                "look for what the theory, the measurement or the model's structure leaves out",
            )

"""Equivalent systems of low order, as data: one transfer function with delay for each kind."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.models import Parameter, Parameters, TransferFunction, TransferFunctionModel
from flightid.units import canonical

GAIN, DELAY = "K", "tau"
OSCILLATION = "s^2 + 2*zeta*omega*s + omega^2"
_DAMPING = (0.5, 0.01, 3.0, "1", "damping ratio")
_FREQUENCY = (2.0, 0.05, 40.0, "rad/s", "natural frequency")
_ROLL = (0.3, 0.005, 30.0, "s", "roll-mode time constant")
_ZERO = (1.0, 0.005, 30.0, "1/s", "zero of the numerator")
_SPIRAL = (-0.05, -2.0, 1.0, "1/s", "spiral root; positive grows")
Numbers = tuple[float, float, float, str, str]


@dataclass(frozen=True)
class Structure:
    """One kind of equivalent system, without its gain and delay.

    Attributes
    ----------
    title : str
    numerator, denominator : tuple of str
        Factors in ``s``.
    gain_per_s : int
        Power of seconds below the unit of output over input in the gain's unit.
    numbers : mapping of str to tuple
        By parameter: value to start from, lowest, highest, unit, meaning.
    rated : mapping of str to mapping of str to str
        By chart: its quantity by parameter or by derived quantity.

    Example
    -------
    >>> STRUCTURES["roll"].denominator
    ('T_R*s + 1',)
    """

    title: str
    numerator: tuple[str, ...]
    denominator: tuple[str, ...]
    gain_per_s: int
    numbers: Mapping[str, Numbers]
    rated: Mapping[str, Mapping[str, str]]


_DELAYED = {"equivalent_delay": {"delay": DELAY}}
_DUTCH = {"dutch_roll": {"damping": "zeta", "decay": "decay", "frequency": "omega"}}
_PITCH = {
    "short_period_damping": {"damping": "zeta"},
    "control_anticipation": {"damping": "zeta", "cap": "cap", "frequency": "omega"},
    "short_period_frequency": {"n_alpha": "n_alpha", "frequency": "omega", "cap": "cap"},
    **_DELAYED,
}
STRUCTURES: Mapping[str, Structure] = {
    "short_period": Structure(
        "pitch rate, short period",
        ("s + inverse_T_theta2",),
        (OSCILLATION,),
        1,
        {"inverse_T_theta2": (*_ZERO[:4], "1/T_θ2"), "zeta": _DAMPING, "omega": _FREQUENCY},
        _PITCH,
    ),
    "pitch_attitude": Structure(
        "pitch attitude, short period",
        ("s + inverse_T_theta2",),
        ("s", OSCILLATION),
        2,
        {"inverse_T_theta2": (*_ZERO[:4], "1/T_θ2"), "zeta": _DAMPING, "omega": _FREQUENCY},
        _PITCH,
    ),
    "roll": Structure(
        "roll rate, roll mode",
        (),
        ("T_R*s + 1",),
        0,
        {"T_R": _ROLL},
        {"roll_mode": {"time_constant": "T_R"}, **_DELAYED},
    ),
    "roll_attitude": Structure(
        "roll attitude, roll mode",
        (),
        ("s", "T_R*s + 1"),
        1,
        {"T_R": _ROLL},
        {"roll_mode": {"time_constant": "T_R"}, **_DELAYED},
    ),
    "roll_spiral": Structure(
        "roll attitude, roll mode and spiral",
        (),
        ("s - spiral", "T_R*s + 1"),
        1,
        {"spiral": _SPIRAL, "T_R": _ROLL},
        {
            "roll_mode": {"time_constant": "T_R"},
            "spiral": {"time_to_double": "time_to_double"},
            **_DELAYED,
        },
    ),
    "roll_dutch_roll": Structure(
        "roll rate, roll mode and Dutch roll",
        ("s^2 + 2*zeta_phi*omega_phi*s + omega_phi^2",),
        ("T_R*s + 1", OSCILLATION),
        0,
        {
            "zeta_phi": (*_DAMPING[:4], "damping ratio of the numerator"),
            "omega_phi": (*_FREQUENCY[:4], "frequency of the numerator"),
            "T_R": _ROLL,
            "zeta": _DAMPING,
            "omega": _FREQUENCY,
        },
        {"roll_mode": {"time_constant": "T_R"}, **_DUTCH, **_DELAYED},
    ),
    "dutch_roll": Structure(
        "sideslip, Dutch roll",
        (),
        (OSCILLATION,),
        2,
        {"zeta": _DAMPING, "omega": _FREQUENCY},
        {**_DUTCH, **_DELAYED},
    ),
    "yaw": Structure(
        "yaw rate, Dutch roll",
        ("s + inverse_T_r",),
        (OSCILLATION,),
        1,
        {"inverse_T_r": (*_ZERO[:4], "1/T_r"), "zeta": _DAMPING, "omega": _FREQUENCY},
        {**_DUTCH, **_DELAYED},
    ),
    "yaw_spiral": Structure(
        "yaw rate, Dutch roll and spiral",
        ("s^2 + 2*zeta_r*omega_r*s + omega_r^2",),
        ("s - spiral", OSCILLATION),
        1,
        {
            "zeta_r": (0.2, -0.95, 3.0, "1", "damping ratio of the numerator"),
            "omega_r": (0.5, 0.01, 40.0, "rad/s", "frequency of the numerator"),
            "spiral": _SPIRAL,
            "zeta": _DAMPING,
            "omega": _FREQUENCY,
        },
        {"spiral": {"time_to_double": "time_to_double"}, **_DUTCH, **_DELAYED},
    ),
}


def structure_of(kind: str) -> Structure:
    """The structure of a kind.

    Raises
    ------
    OptionError
        There is no such kind.
    """
    if kind not in STRUCTURES:
        raise OptionError("kind is not known", found=kind, needed=", ".join(STRUCTURES))
    return STRUCTURES[kind]


def equivalent_model(
    kind: str, output: str, control: str, units: Mapping[str, str]
) -> TransferFunctionModel:
    """Equivalent system of one pair, with its start values.

    Parameters
    ----------
    kind : str
    output, control : str
    units : mapping of str to str
        Of both channels.

    Example
    -------
    >>> print(equivalent_model("roll", "p", "lat", {"p": "rad/s"}))
    p/lat = K / (T_R*s + 1) * exp(-(tau) s)
    """
    structure = structure_of(kind)
    above, below = units.get(output, "1"), units.get(control, "1")
    unit = canonical(f"({above})/({below})/s**{structure.gain_per_s}")
    parameters = [Parameter(GAIN, 1.0, unit, note="gain")]
    parameters += [
        Parameter(name, value, unit, low, high, note=note)
        for name, (value, low, high, unit, note) in structure.numbers.items()
    ]
    parameters.append(Parameter(DELAY, 0.05, "s", -0.1, 0.6, note="equivalent time delay"))
    response = TransferFunction(
        output, control, GAIN, structure.numerator, structure.denominator, DELAY
    )
    return TransferFunctionModel(
        (response,),
        Parameters(parameters),
        {output: above, control: below},
        name=f"Equivalent system: {structure.title}",
        source="MIL-STD-1797A (1990), appendix A; Hodgkinson, Aircraft Handling Qualities (1999)",
    )

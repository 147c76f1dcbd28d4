"""Actuators, sensors and filters as blocks: their kinds, and each as a transfer function.

A block is written in the normalised variable σ = s T or s / ω, with coefficients that are formulas
of the model's parameters, so that its states have the unit of the signal and numbers near one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from flightid.errors import ModelError
from flightid.formula import NAME, require_name
from flightid.frozen import dataclass
from flightid.models.language.reading import read_text, require_keys

MAXIMUM_ORDER = 10
MAXIMUM_BLOCKS = 50
_PADE_HIGHEST = 5


@dataclass(frozen=True)
class Realisation:
    """A block as a fraction of polynomials, coefficients by rising power, as many below as above.

    Attributes
    ----------
    numerator, denominator : tuple of str
        Formulas; the denominator's last one is ``"1"`` where `step` or `rate` normalises s.
    step, rate : str
        Formula of T in σ = s T, or of ω in σ = s / ω; both empty where σ is s itself.
    delay : str
        Formula of a pure delay, s.
    """

    numerator: tuple[str, ...] = ("1",)
    denominator: tuple[str, ...] = ("1",)
    step: str = ""
    rate: str = ""
    delay: str = ""

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.denominator) - 1


@dataclass(frozen=True)
class ModelBlock:
    """An actuator at an input, or a sensor or filter at an output.

    Attributes
    ----------
    name : str
        Name; its states are ``<name>_1``, …, and its output is called `name` in the model.
    at : str
        Input or output at which it stands.
    kind : str
        One of `KINDS`.
    values : mapping of str to object
        What the kind needs: numbers, formulas of the model's parameters, whole orders, or lists of
        coefficients.
    note : str

    Raises
    ------
    ModelError
        A kind or key that is unknown, missing or of the wrong type.

    Reference
    ---------
    Oppenheim & Schafer, *Discrete-Time Signal Processing*, 3rd ed., app. B (Butterworth); Golub &
    Van Loan, *Matrix Computations*, 4th ed., sec. 9.3.1 (Padé of the exponential); ArduPilot
    `NotchFilter`, `LowPassFilter2p` and PX4 `NotchFilter`, `LowPassFilter2p` (before bilinear
    transformation).

    Example
    -------
    >>> ModelBlock("servo", "lat", "second_order_lag", {"omega": 40.0, "zeta": 0.7})
    ModelBlock(servo at lat: second_order_lag, omega = 40, zeta = 0.7)
    """

    name: str
    at: str
    kind: str
    values: Mapping[str, Any]
    note: str = ""

    def __post_init__(self) -> None:
        require_name(self.name, "a block")
        if self.kind not in KINDS:
            raise ModelError(
                f"kind of block {self.name} is not known",
                found=repr(self.kind),
                needed=f"one of {', '.join(KINDS)}",
            )
        units, _ = KINDS[self.kind]
        subject = f"block {self.name}"
        require_keys(self.values, set(units), subject)
        missing = [key for key in units if key not in self.values and key not in _OPTIONAL]
        if missing:
            raise ModelError(f"{subject} lacks {', '.join(missing)}", needed=", ".join(units))
        for key, value in self.values.items():
            _check_value(f"{subject}.{key}", units[key], value)
        object.__setattr__(self, "values", dict(self.values))

    def __repr__(self) -> str:
        """Place, kind and values on one line."""
        return f"ModelBlock({self.shown()})"

    def shown(self) -> str:
        """``"servo at lat: second_order_lag, omega = 40, zeta = 0.7"``."""
        values = ", ".join(f"{key} = {_printed(value)}" for key, value in self.values.items())
        return f"{self.name} at {self.at}: {self.kind}" + (f", {values}" if values else "")

    @property
    def numbers(self) -> dict[str, tuple[float, str]]:
        """Plain numbers by key, with the unit of each; lists are left out."""
        units, _ = KINDS[self.kind]
        return {
            key: (float(value), units[key])
            for key, value in self.values.items()
            if units[key] not in ("order", "list") and not isinstance(value, str)
        }

    def realised(self) -> Realisation:
        """The block as a transfer function."""
        return KINDS[self.kind][1](self.values)

    def to_dict(self) -> dict[str, object]:
        """Plain values; `read_block` reads them."""
        note = {"note": self.note} if self.note else {}
        return {"at": self.at, "kind": self.kind, **self.values, **note}


def read_block(name: str, item: object) -> ModelBlock:
    """A block from its table in a model file.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type.
    """
    if not isinstance(item, dict):
        raise ModelError(f"block {name} must be a table", found=repr(item)[:80])
    values = {key: value for key, value in item.items() if key not in ("at", "kind", "note")}
    for key in ("at", "kind"):
        if key not in item:
            raise ModelError(f"block {name} lacks {key!r}", needed="at and kind")
    texts = [read_text(item.get(key, ""), f"block {name}.{key}") for key in ("at", "kind", "note")]
    return ModelBlock(name, texts[0], texts[1], values, texts[2])


def _check_value(subject: str, unit: str, value: object) -> None:
    if unit == "order":
        good = isinstance(value, int) and not isinstance(value, bool)
        if not good or not 1 <= int(str(value)) <= MAXIMUM_ORDER:
            raise ModelError(f"{subject} must be a whole number", found=repr(value)[:80],
                             needed=f"1 to {MAXIMUM_ORDER}")  # fmt: skip
    elif unit == "list":
        if not isinstance(value, list | tuple) or not 1 <= len(value) <= MAXIMUM_ORDER + 1:
            raise ModelError(f"{subject} must be a list", found=repr(value)[:80],
                             needed=f"1 to {MAXIMUM_ORDER + 1} coefficients")  # fmt: skip
        for entry in value:
            _check_value(subject, "1", entry)
    elif isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ModelError(f"{subject} must be a number or a formula", found=repr(value)[:80])
    elif not isinstance(value, str) and not math.isfinite(value):
        raise ModelError(f"{subject} is not finite", found=value)


def _printed(value: object) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_printed, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def wrapped(value: object) -> str:
    """A formula that may stand beside any operator.

    Example
    -------
    >>> wrapped("T"), wrapped("a + b")
    ('T', '(a + b)')
    """
    text = str(value)
    return text if NAME.fullmatch(text) else f"({text})"


def _fixed(coefficients: Iterable[float]) -> tuple[str, ...]:
    return tuple(
        repr(float(value)) if value != int(value) else str(int(value)) for value in coefficients
    )


def _butterworth(order: int) -> tuple[str, ...]:
    angles = np.pi * (2.0 * np.arange(1, order + 1) + order - 1.0) / (2.0 * order)
    rising = np.real(np.poly(np.exp(1j * angles)))[::-1]
    return _fixed(np.where(np.abs(rising - np.round(rising)) < 1e-12, np.round(rising), rising))


def _low_pass(order: int, rate: str) -> Realisation:
    below = _butterworth(order)
    return Realisation(("1", *["0"] * order), below, rate=rate)


def _pade(values: Mapping[str, Any]) -> Realisation:
    order = int(values.get("order", 2))
    if order > _PADE_HIGHEST:
        raise ModelError("order of a Padé delay", found=order, needed=f"1 to {_PADE_HIGHEST}")
    factorial = math.factorial
    powers = [
        factorial(2 * order - k) / (factorial(k) * factorial(order - k)) for k in range(order + 1)
    ]
    below = [power / powers[-1] for power in powers]
    above = [power * (-1) ** k for k, power in enumerate(below)]
    return Realisation(_fixed(above), _fixed(below), step=str(values["delay"]))


def _second_order(values: Mapping[str, Any]) -> Realisation:
    return Realisation(
        ("1", "0", "0"), ("1", f"2*{wrapped(values['zeta'])}", "1"), rate=str(values["omega"])
    )


def _lead_lag(values: Mapping[str, Any]) -> Realisation:
    lag = str(values["lag"])
    return Realisation(("1", f"{wrapped(values['lead'])}/{wrapped(lag)}"), ("1", "1"), step=lag)


def _ardupilot_notch(values: Mapping[str, Any]) -> Realisation:
    centre = wrapped(values["centre_hz"])
    edge = f"({centre} - 0.5*{wrapped(values['bandwidth_hz'])})"
    # With n octaves between the edges, 2^(n/2) is centre over edge and Q is 2^(n/2) / (2^n - 1).
    inverse_quality = f"({centre}/{edge} - {edge}/{centre})"
    depth = f"10^(-{wrapped(values['attenuation_db'])}/20)"
    return Realisation(
        ("1", f"{depth}*{inverse_quality}", "1"),
        ("1", inverse_quality, "1"),
        rate=f"2*pi*{centre}",
    )


def _px4_notch(values: Mapping[str, Any]) -> Realisation:
    centre = wrapped(values["centre_hz"])
    width = f"{wrapped(values['bandwidth_hz'])}/{centre}"
    return Realisation(("1", "0", "1"), ("1", width, "1"), rate=f"2*pi*{centre}")


def _transfer(values: Mapping[str, Any]) -> Realisation:
    below = [str(entry) for entry in reversed(values["denominator"])]
    above = [str(entry) for entry in reversed(values["numerator"])]
    if len(above) > len(below):
        raise ModelError(
            "a block has more zeros than poles",
            found=f"degree {len(above) - 1} over {len(below) - 1}",
            needed="at least as many poles as zeros",
        )
    return Realisation((*above, *["0"] * (len(below) - len(above))), tuple(below))


Build = Callable[[Mapping[str, Any]], Realisation]
_HERTZ = {"cutoff_hz": "Hz"}
_NOTCH = {"centre_hz": "Hz", "bandwidth_hz": "Hz"}
_OPTIONAL = {"order"}
# Unit of each value, and the transfer function.
KINDS: dict[str, tuple[dict[str, str], Build]] = {
    "first_order_lag": (
        {"T": "s"},
        lambda v: Realisation(("1", "0"), ("1", "1"), step=str(v["T"])),
    ),
    "second_order_lag": ({"omega": "rad/s", "zeta": "1"}, _second_order),
    "lead_lag": ({"lead": "s", "lag": "s"}, _lead_lag),
    "washout": ({"T": "s"}, lambda v: Realisation(("0", "1"), ("1", "1"), step=str(v["T"]))),
    "pade_delay": ({"delay": "s", "order": "order"}, _pade),
    "delay": ({"delay": "s"}, lambda v: Realisation(delay=str(v["delay"]))),
    "butterworth": (
        {"omega": "rad/s", "order": "order"},
        lambda v: _low_pass(int(v.get("order", 2)), str(v["omega"])),
    ),
    "ardupilot_low_pass": (_HERTZ, lambda v: _low_pass(2, f"2*pi*{wrapped(v['cutoff_hz'])}")),
    "ardupilot_low_pass_first_order": (
        _HERTZ,
        lambda v: _low_pass(1, f"2*pi*{wrapped(v['cutoff_hz'])}"),
    ),
    "ardupilot_notch": ({**_NOTCH, "attenuation_db": "1"}, _ardupilot_notch),
    "px4_low_pass": (_HERTZ, lambda v: _low_pass(2, f"2*pi*{wrapped(v['cutoff_hz'])}")),
    "px4_notch": (_NOTCH, _px4_notch),
    "transfer": ({"numerator": "list", "denominator": "list"}, _transfer),
}

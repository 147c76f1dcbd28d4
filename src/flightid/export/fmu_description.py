"""modelDescription.xml of an FMU: variables, units, start values and structure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from flightid.errors import UnitError
from flightid.export.c_source import CSource, Entry
from flightid.export.options import Interface
from flightid.frozen import dataclass
from flightid.units import DIMENSIONLESS, si_base
from flightid.version import VERSION

_SI = {
    "kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "mole": "mol",
    "candela": "cd", "radian": "rad",
}  # fmt: skip


@dataclass(frozen=True)
class FmuDescription:
    """What modelDescription.xml says.

    Attributes
    ----------
    code : CSource
        The model, whose arrays give the value references.
    name, token : str
        Name of the model and its instantiation token.
    interfaces : tuple of str
        ``"model-exchange"`` and ``"co-simulation"``, or one of them.
    """

    code: CSource
    name: str
    token: str
    interfaces: tuple[Interface, ...]

    def text(self) -> str:
        """The XML document.

        Returns
        -------
        str

        Reference
        ---------
        FMI 3.0.2, section 2.4.
        """
        root = Element(
            "fmiModelDescription",
            fmiVersion="3.0",
            modelName=plain(self.name),
            instantiationToken=self.token,
            generationTool=f"flightid {VERSION}",
            variableNamingConvention="flat",
            description=plain(self.code.method),
        )
        able = {"modelIdentifier": self.code.prefix, "canGetAndSetFMUState": "true"}
        if "model-exchange" in self.interfaces:
            SubElement(root, "ModelExchange", able)
        if "co-simulation" in self.interfaces:
            step = {"fixedInternalStepSize": repr(self.code.sample_time_s)}
            fixed = {"canHandleVariableCommunicationStepSize": "false"}
            SubElement(root, "CoSimulation", able | fixed | step)
        self._units(root)
        SubElement(root, "DefaultExperiment", stepSize=repr(self.code.sample_time_s))
        self._variables(SubElement(root, "ModelVariables"))
        self._structure(SubElement(root, "ModelStructure"))
        indent(root)
        return (
            '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
        )

    @property
    def has_derivatives(self) -> bool:
        """Whether states are continuous for the importer."""
        return "model-exchange" in self.interfaces

    def _units(self, root: Element) -> None:
        code = self.code
        entries = (*code.states, *code.inputs, *code.outputs, *code.parameters)
        units = {entry.unit for entry in entries}
        if self.has_derivatives:
            units |= {_rate(entry.unit) for entry in code.states}
        listed = sorted(units - {DIMENSIONLESS, ""})
        if not listed:
            return
        table = SubElement(root, "UnitDefinitions")
        for unit in listed:
            item = SubElement(table, "Unit", name=plain(unit))
            base = base_unit(unit)
            if base is not None:
                SubElement(item, "BaseUnit", base)

    def _variables(self, parent: Element) -> None:
        code, n = self.code, len(self.code.states)
        first_u = 1 + 2 * n
        first_y, first_p = (
            first_u + len(code.inputs),
            first_u + len(code.inputs) + len(code.outputs),
        )
        _variable(parent, "time", 0, "independent", "continuous", "s" if code.states else "")
        shown = unique_names(
            [e.name for e in (*code.inputs, *code.outputs, *code.parameters)],
            [f"state.{e.name}" for e in code.states],
        )
        count = len(shown) - n
        for k, entry in enumerate(code.states):
            name = shown[count + k]
            extra = {"initial": "exact", "start": repr(entry.start)}
            _variable(parent, name, 1 + k, "local", "continuous", entry.unit, extra)
            if self.has_derivatives:
                extra = {"initial": "calculated", "derivative": str(1 + k)}
                rate = _rate(entry.unit)
                _variable(parent, f"der({name})", 1 + n + k, "local", "continuous", rate, extra)
        for k, entry in enumerate(code.inputs):
            extra = {"start": repr(entry.start)}
            _variable(parent, shown[k], first_u + k, "input", "continuous", entry.unit, extra)
        for k, entry in enumerate(code.outputs):
            name = shown[len(code.inputs) + k]
            extra = {"initial": "calculated"}
            _variable(parent, name, first_y + k, "output", "continuous", entry.unit, extra)
        for k, entry in enumerate(code.parameters):
            name = shown[len(code.inputs) + len(code.outputs) + k]
            extra = {"initial": "exact", **_bounds(entry), "start": repr(entry.start)}
            _variable(parent, name, first_p + k, "parameter", "tunable", entry.unit, extra)

    def _structure(self, parent: Element) -> None:
        n, m = len(self.code.states), len(self.code.inputs)
        outputs = [str(1 + 2 * n + m + k) for k in range(len(self.code.outputs))]
        rates = [str(1 + n + k) for k in range(n)] if self.has_derivatives else []
        for reference in outputs:
            SubElement(parent, "Output", valueReference=reference)
        for reference in rates:
            SubElement(parent, "ContinuousStateDerivative", valueReference=reference)
        for reference in (*outputs, *rates):
            SubElement(parent, "InitialUnknown", valueReference=reference)


def plain(text: str) -> str:
    """A text that XML can hold: no control characters, surrogates or line ends.

    Example
    -------
    >>> plain("a" + chr(0) + "b" + chr(10))
    'a b '
    """
    return re.sub("[\x00-\x1f\x7f\ud800-\udfff\ufffe\uffff]", " ", text)


def unique_names(*groups: Iterable[str]) -> list[str]:
    """Names that XML can hold, each its own; the first to come keeps it.

    Example
    -------
    >>> unique_names(["p", "time"], ["p", ""])
    ['p', 'time#2', 'p#2', 'value']
    """
    found: list[str] = []
    for name in (each for group in groups for each in group):
        stem = plain(name).strip() or "value"
        made, count = stem, 1
        while made in found or made == "time":
            count += 1
            made = f"{stem}#{count}"
        found.append(made)
    return found


def base_unit(unit: str) -> dict[str, str] | None:
    """Exponents and factor of a unit in SI, as attributes; None where it has none.

    Example
    -------
    >>> base_unit("deg/s")
    {'s': '-1', 'rad': '1', 'factor': '0.0174532925199433'}
    """
    try:
        factor, powers = si_base(unit)
    except UnitError:
        return None
    if any(name not in _SI or power != int(power) for name, power in powers.items()):
        return None
    found = {short: str(int(powers[name])) for name, short in _SI.items() if name in powers}
    return found if factor == 1.0 else {**found, "factor": repr(factor)}


def _rate(unit: str) -> str:
    return "1/s" if unit in (DIMENSIONLESS, "") else f"({unit})/s"


def _bounds(entry: Entry) -> dict[str, str]:
    pairs = {"min": entry.minimum, "max": entry.maximum}
    return {key: repr(float(value)) for key, value in pairs.items() if math.isfinite(value)}


def _variable(
    parent: Element,
    name: str,
    reference: int,
    causality: str,
    variability: str,
    unit: str,
    extra: dict[str, str] | None = None,
) -> None:
    words = {"name": name, "valueReference": str(reference)}
    words |= {"causality": causality, "variability": variability}
    if unit not in (DIMENSIONLESS, "") and causality != "independent":
        words["unit"] = plain(unit)
    SubElement(parent, "Float64", words | (extra or {}))

"""Transfer functions with delay, several at once with shared parameters (native: `transfer.rs`).

H(s) = gain · Π numerator factors / Π denominator factors · e^(−delay s). Gain, delay and the
coefficients of the factors are formulas of the parameters; factors are polynomials in ``s``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.dimensions import require_unit
from flightid.errors import DataError, ModelError, UnknownNameError
from flightid.formula import formula_names
from flightid.frozen import dataclass
from flightid.models.adjustable import Adjustable
from flightid.models.estimated import EstimateProvenance
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.linear.realisation import Matrices, canonical_form, one_delay_for_each_input
from flightid.models.parameters import Parameters
from flightid.result import TableView
from flightid.table import Table
from flightid.units import DIMENSIONLESS, canonical

SCHEMA = "flightid.transfer_function_model/1"


@dataclass(frozen=True)
class TransferFunction:
    """One response, written as formulas.

    Attributes
    ----------
    output, input : str
        Channel names.
    gain : str
        Formula, in the unit that makes the whole output over input.
    numerator, denominator : tuple of str
        Factors: polynomials in ``s`` with formulas as coefficients.
    delay : str
        Formula, s.

    Example
    -------
    >>> print(TransferFunction("p", "tau_phi", "Ltphi", denominator=("s - Lp",), delay="tau"))
    p/tau_phi = Ltphi / (s - Lp) * exp(-(tau) s)
    """

    output: str
    input: str
    gain: str = "1"
    numerator: tuple[str, ...] = ()
    denominator: tuple[str, ...] = ()
    delay: str = "0"

    @property
    def name(self) -> str:
        """``"output/input"``."""
        return f"{self.output}/{self.input}"

    @property
    def formula(self) -> str:
        """The rational part as one formula of the parameters and ``s``."""
        above = "*".join(f"({factor})" for factor in (self.gain, *self.numerator))
        below = "*".join(f"({factor})" for factor in self.denominator)
        return f"{above}/({below})" if below else above

    def __str__(self) -> str:
        """Formula on one line."""
        above = " * ".join([self.gain, *(f"({factor})" for factor in self.numerator)])
        below = " ".join(f"({factor})" for factor in self.denominator)
        below = f"({below})" if len(self.denominator) > 1 else below
        delay = "" if self.delay == "0" else f" * exp(-({self.delay}) s)"
        return f"{self.name} = {above}" + (f" / {below}" if below else "") + delay


@dataclass(frozen=True, repr=False)
class TransferFunctionModel(Adjustable, TableView):
    """Transfer functions of the same parameters.

    Attributes
    ----------
    responses : tuple of TransferFunction
        One for each pair of output and input that is modelled.
    parameters : Parameters
        What the formulas name.
    units : mapping of str to str
        Unit by channel name; a channel left out is dimensionless.
    name, source, note : str
        What it is, where it comes from, what to know.
    estimated : EstimateProvenance or None
        What a fit knew of the parameters, where the model comes from its file.

    Raises
    ------
    ModelError
        A formula outside the grammar, a name that is not a parameter, or units that clash.

    Example
    -------
    >>> from flightid.models import Parameter, Parameters
    >>> model = TransferFunctionModel(
    ...     (TransferFunction("p", "tau", "K", denominator=("T*s + 1",), delay="tau_p"),),
    ...     Parameters([Parameter("K", 40.0, "rad/s"), Parameter("T", 0.2, "s"),
    ...                 Parameter("tau_p", 0.01, "s")]),
    ...     units={"p": "rad/s"}, name="roll")
    >>> model
    TransferFunctionModel('roll', 1 response [p/tau], 3 parameters, 3 free)
    >>> model.poles()["p/tau"]
    array([-5.+0.j])
    """

    responses: tuple[TransferFunction, ...]
    parameters: Parameters
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = "transfer functions"
    source: str = ""
    note: str = ""
    estimated: EstimateProvenance | None = field(default=None, compare=False)
    native: _native.TransferFunctions = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "responses", tuple(self.responses))
        channels = [*self.inputs, *self.outputs]
        units = {name: canonical(self.units.get(name, DIMENSIONLESS)) for name in channels}
        object.__setattr__(self, "units", units)
        self._check()
        texts = [(r.gain, list(r.numerator), list(r.denominator), r.delay) for r in self.responses]
        names = [parameter.name for parameter in self.parameters.independent]
        pairs = list(zip(*self._places(), strict=True))
        compiled = _native.TransferFunctions(texts, names, self.parameters.definitions, pairs)
        object.__setattr__(self, "native", compiled)

    def _check(self) -> None:
        if not self.responses:
            raise ModelError("a model needs a response", needed="at least one transfer function")
        names = self.response_names
        if len(set(names)) < len(names):
            raise ModelError("a response is given twice", found=", ".join(names))
        known = {**self.parameters.units, "s": "1/s"}
        for response in self.responses:
            # Each text alone first, so that a fault is placed in what was written.
            for text in (response.gain, *response.numerator, *response.denominator):
                formula_names(text)
            for text, with_s in ((response.formula, True), (response.delay, False)):
                for name in formula_names(text):
                    if name not in known or (name == "s" and not with_s):
                        raise ModelError(
                            f"response {response.name} names an unknown parameter",
                            found=repr(name),
                            needed=f"one of {', '.join(self.parameters)}",
                        )
            unit = _quotient(self.units[response.output], self.units[response.input])
            require_unit(response.formula, unit, known, subject=f"response {response.name}")
            if response.delay != "0":
                subject = f"delay of response {response.name}"
                require_unit(response.delay, "s", known, subject=subject)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, in order of first use."""
        return tuple(dict.fromkeys(response.input for response in self.responses))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs, in order of first use."""
        return tuple(dict.fromkeys(response.output for response in self.responses))

    @property
    def response_names(self) -> tuple[str, ...]:
        """``"output/input"`` of each response."""
        return tuple(response.name for response in self.responses)

    def _places(self) -> tuple[list[int], list[int]]:
        outputs, inputs = self.outputs, self.inputs
        rows = [outputs.index(response.output) for response in self.responses]
        return rows, [inputs.index(response.input) for response in self.responses]

    def frequency_response(
        self, omega_rad_s: ArrayLike, values: Mapping[str, float] | None = None
    ) -> NDArray[np.complex128]:
        """H(jω) of all pairs; a pair without a transfer function is zero.

        Parameters
        ----------
        omega_rad_s : array_like, shape (n_freqs,)
            Frequencies, rad/s.
        values : mapping of str to float, optional
            Parameter values instead of the model's.

        Returns
        -------
        ndarray of complex, shape (n_outputs, n_inputs, n_freqs)
            In output unit over input unit.

        Raises
        ------
        DataError
            The response is not finite, for example an integrator at ω = 0.
        """
        omega = np.ascontiguousarray(np.atleast_1d(omega_rad_s), dtype=np.float64)
        found = self.native.response(self.parameters.independent_values(values), omega)
        if not np.all(np.isfinite(found)):
            raise DataError(
                "the model has no finite response at these frequencies",
                found=f"{omega.min():g} to {omega.max():g} rad/s",
                needed="frequencies that are not poles of the model",
            )
        result = np.zeros((len(self.outputs), len(self.inputs), len(omega)), dtype=np.complex128)
        rows, columns = self._places()
        result[rows, columns] = found
        return result

    def factored(
        self, values: Mapping[str, float] | None = None
    ) -> dict[str, tuple[float, list[NDArray[np.float64]], list[NDArray[np.float64]], float]]:
        """Gain, numerator and denominator factors and delay by response, as numbers.

        Returns
        -------
        dict of str to tuple
            Factors have their highest power of s first; the delay is in s.
        """
        found = self.native.factored(self.parameters.independent_values(values))
        return {
            name: (gain, [_descending(f) for f in above], [_descending(f) for f in below], delay)
            for name, (gain, above, below, delay) in zip(self.response_names, found, strict=True)
        }

    def poles(self, values: Mapping[str, float] | None = None) -> dict[str, NDArray[np.complex128]]:
        """Poles by response, rad/s, without the delay."""
        return {name: _roots(below) for name, (_, _, below, _) in self.factored(values).items()}

    def zeros(self, values: Mapping[str, float] | None = None) -> dict[str, NDArray[np.complex128]]:
        """Zeros by response, rad/s, without the delay."""
        return {name: _roots(above) for name, (_, above, _, _) in self.factored(values).items()}

    def state_space(self, values: Mapping[str, float] | None = None) -> Matrices:
        """State space with the exact delay of each input kept apart.

        Parameters
        ----------
        values : mapping of str to float, optional
            Parameter values instead of the model's.

        Returns
        -------
        tuple of ndarray
            A (n, n), B (n, n_inputs), C (n_outputs, n), D (n_outputs, n_inputs) and the delay of
            each input (n_inputs,), s. Each response has its own states in controllable form.

        Raises
        ------
        ModelError
            A response with more zeros than poles, a negative delay, or one input with several.
        """
        rows, columns = self._places()
        found = list(self.factored(values).values())
        delays = one_delay_for_each_input(columns, [delay for *_, delay in found], self.inputs)
        shape = (len(self.outputs), len(self.inputs))
        a, b, c, d = canonical_form(
            shape,
            [(row, column, *f[:3]) for row, column, f in zip(rows, columns, found, strict=True)],
        )
        return a, b, c, d, delays

    @property
    def sample_time_s(self) -> None:
        """None: continuous time."""
        return None

    def linear_system(self) -> LinearSystem:
        """Its state space with the delays of the inputs.

        Raises
        ------
        ModelError
            A response with more zeros than poles, a negative delay, or one input with several.
        """
        a, b, c, d, delays_s = self.state_space()
        return LinearSystem(
            a, b, c, d, self.inputs, self.outputs, delays_s, units=self.units, name=self.name
        )

    def response(self, name: str) -> TransferFunction:
        """The transfer function of one pair, by ``"output/input"``.

        Raises
        ------
        UnknownNameError
            There is no such response.
        """
        for response in self.responses:
            if response.name == name:
                return response
        raise UnknownNameError(
            "there is no such response", found=repr(name), needed=", ".join(self.response_names)
        )

    def __repr__(self) -> str:
        """Name, responses and number of parameters on one line."""
        n, shown = len(self.responses), ", ".join(self.response_names)
        plural = "" if n == 1 else "s"
        parameters = f"{len(self.parameters)} parameters, {len(self.parameters.free)} free"
        return f"TransferFunctionModel({self.name!r}, {n} response{plural} [{shown}], {parameters})"

    def __str__(self) -> str:
        """Formulas, one a line."""
        return "\n".join(map(str, self.responses))

    def summary(self) -> Table:
        """Table of the parameters, with the formulas below."""
        table = self.parameters.summary().without_empty_columns()
        notes = [*map(str, self.responses), self.source and f"Source: {self.source}", self.note]
        return Table(
            self.name,
            table.columns,
            table.rows,
            tuple(note for note in notes if note),
        )

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key."""
        return {
            "schema": SCHEMA,
            "kind": "transfer",
            "name": self.name,
            "inputs": {name: self.units[name] for name in self.inputs},
            "outputs": {name: self.units[name] for name in self.outputs},
            "responses": {
                r.name: {
                    "gain": r.gain,
                    "numerator": list(r.numerator),
                    "denominator": list(r.denominator),
                    "delay": r.delay,
                }
                for r in self.responses
            },
            "parameters": self.parameters.to_dict(),
            "source": self.source,
            "note": self.note,
        }


def _quotient(above: str, below: str) -> str:
    return above if below == DIMENSIONLESS else f"({above})/({below})"


def _descending(ascending: list[float]) -> NDArray[np.float64]:
    return np.array(ascending[::-1], dtype=np.float64)


def _roots(factors: list[NDArray[np.float64]]) -> NDArray[np.complex128]:
    found = [np.roots(factor).astype(np.complex128) for factor in factors]
    return np.concatenate([np.zeros(0, dtype=np.complex128), *found])

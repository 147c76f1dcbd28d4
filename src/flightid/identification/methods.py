"""The table of methods: what fits a kind of model to a kind of data, and its options.

A new method is one folder and one line here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flightid.errors import FitError, OptionError
from flightid.frozen import dataclass
from flightid.identification.filter_error.fit import fit_filter_error
from flightid.identification.fit import Fit
from flightid.identification.frequency_domain.fit import fit_responses
from flightid.identification.frequency_domain.options import FrequencyDomainOptions
from flightid.identification.joint.fit import fit_jointly
from flightid.identification.joint.options import JointOptions
from flightid.identification.narx.fit import fit_narx
from flightid.identification.output_error.fit import fit_output_error
from flightid.identification.prediction_error.fit import fit_polynomial
from flightid.identification.records.options import RecordOptions
from flightid.identification.regression.equation_error import (
    fit_equation_error,
    fit_fourier_regression,
)
from flightid.identification.regression.fourier_output_error_fit import fit_fourier_output_error
from flightid.identification.regression.options import (
    EquationErrorOptions,
    FilterErrorOptions,
    FourierOptions,
    FourierOutputErrorOptions,
)
from flightid.identification.subspace.fit import fit_subspace
from flightid.models import StateSpaceModel, TransferFunctionModel
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.narx.structure import NarxStructure
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.options import Options, checked
from flightid.record import Record
from flightid.responses import FrequencyResponse

RESPONSES, RECORDS, BOTH = "responses", "records", "responses and records"
GREY = (TransferFunctionModel, StateSpaceModel)


@dataclass(frozen=True)
class NoOptions(Options):
    """Of a method whose settings are the structure's."""


@dataclass(frozen=True)
class Method:
    """One way to fit some kinds of model to one kind of data.

    Attributes
    ----------
    name : str
        As `identify` takes it.
    kinds : tuple of type
        Models with start values, or structures.
    data : str
        ``"responses"``, ``"records"`` or ``"responses and records"``.
    fit : callable
        ``fit(model, data, options)``; ``fit(model, data)`` where there are no options.
    options : type
        Dataclass of its options; `identify` refuses any other.
    """

    name: str
    kinds: tuple[type, ...]
    data: str
    fit: Callable[..., Fit]
    options: type[Options] = NoOptions

    def run(self, model: object, data: object, given: dict[str, Any]) -> Fit:
        """Fit a model.

        Raises
        ------
        OptionError
            An option that this method does not have, or outside its range.
        """
        items = flat(data) if self.data == BOTH else data
        options = checked(self.options, given, "this fit")
        return self.fit(model, items, *(() if self.options is NoOptions else (options,)))


METHODS: list[Method] = [
    Method("frequency_domain", GREY, RESPONSES, fit_responses, FrequencyDomainOptions),
    Method("output_error", GREY, RECORDS, fit_output_error, RecordOptions),
    Method("equation_error", GREY[1:], RECORDS, fit_equation_error, EquationErrorOptions),
    Method("fourier_regression", GREY[1:], RECORDS, fit_fourier_regression, FourierOptions),
    Method(
        "fourier_output_error", GREY[1:], RECORDS, fit_fourier_output_error,
        FourierOutputErrorOptions,
    ),
    Method("filter_error", GREY[1:], RECORDS, fit_filter_error, FilterErrorOptions),
    Method("joint", GREY, BOTH, fit_jointly, JointOptions),
    Method("prediction_error", (PolynomialStructure,), RECORDS, fit_polynomial),
    Method("subspace", (SubspaceStructure,), RECORDS, fit_subspace),
    Method("orthogonal_least_squares", (NarxStructure,), RECORDS, fit_narx),
]  # fmt: skip
"""The first method of a kind of model and a kind of data is its default."""


def takes_responses(name: str) -> bool:
    """Whether a method of that name fits responses, alone or with records."""
    return any(way.data != RECORDS for way in METHODS if way.name == name)


def flat(data: object) -> list[object]:
    """The items of data, those of sequences in it among them."""
    if not (isinstance(data, list | tuple) and data):
        return [data]
    return [item for part in data for item in flat(part)]


def kind_of(data: object) -> str:
    """Kind of data: ``"responses"``, ``"records"``, ``"responses and records"``, or its type."""
    items = flat(data)
    kinds = [
        RESPONSES if isinstance(item, FrequencyResponse) else RECORDS
        for item in items
        if isinstance(item, FrequencyResponse | Record)
    ]
    if len(kinds) < len(items):
        return type(data).__name__
    return kinds[0] if len(set(kinds)) == 1 else BOTH


def methods_for(kind: type, data: str) -> dict[str, Method]:
    """Methods by name for a kind of model and a kind of data, the default first.

    Example
    -------
    >>> list(methods_for(TransferFunctionModel, RECORDS))
    ['output_error']
    """
    return {way.name: way for way in METHODS if kind in way.kinds and data == way.data}


def method_of(model: object, data: object, name: str | None) -> Method:
    """The method for a model and data, by its name or the default.

    Raises
    ------
    FitError
        Nothing fits such a model to such data.
    OptionError
        There is no method of that name for them.
    """
    kind = kind_of(data)
    ways = methods_for(type(model), kind)
    if not ways:
        pairs = {f"{each.__name__} and {way.data}": None for way in METHODS for each in way.kinds}
        raise FitError(
            "there is no fit for this model and these data",
            found=f"{type(model).__name__} and {type(data).__name__}",
            needed="; ".join(pairs),
        )
    if name is None:
        return next(iter(ways.values()))
    if name not in ways:
        raise OptionError(
            f"method is not known for a {type(model).__name__} and {kind}",
            found=repr(name),
            needed=" or ".join(map(repr, ways)),
        )
    return ways[name]

"""What a study file may say about a model without equations: structure, and orders to try."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from typing import Any

from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.models import NarxStructure, SubspaceStructure
from flightid.models.polynomial.orders import ANY, EVERY_ORDER, USED, OrderOptions
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.options import Options, option, option_values
from flightid.study.reading import TableReader, read_own

NARX, SUBSPACE = "narx", "subspace"
ORDERS: dict[str, tuple[str, ...]] = {
    **USED,
    NARX: ("output_lags", "input_lags"),
    SUBSPACE: (),
    ANY: tuple(EVERY_ORDER),
}
"""Orders of each structure, of which several may be tried."""
SPECTRUM = "spectrum"
"""What may stand for the lags of an output: they follow from the data."""
CHOICES = ("balanced", "free_run", "simplest", "bic")


CHOOSE = {NARX: "free_run", ANY: "simplest"}
"""How a structure of a kind is chosen unless a study says it."""


@dataclass(frozen=True, kw_only=True)
class StructureSettings(OrderOptions):
    """A structure whose model is found from records alone: keys of a ``[[model]]``.

    Attributes
    ----------
    options : mapping
        Further options of the structure.
    """

    structure: str = option(choices=ORDERS, doc="Kind of model; any: all of them are tried.")
    inputs: tuple[str, ...] = option(doc="Those whose response has no coherence are left out.")
    outputs: tuple[str, ...] = option(doc="One; of 'subspace' one or more.")
    select: tuple[str, ...] = option((), doc="Records on which free runs rank several structures.")
    coherence: tuple[str, ...] | None = option(
        None, doc="Records of the coherence test and of the spectra; default: those of the fit."
    )
    output_lags: int | tuple[int, ...] | str | None = option(
        None, minimum=0, choices=(SPECTRUM,), doc="Lags of the output of NARX, or by its spectrum."
    )
    input_lags: int | tuple[int, ...] | None = option(
        None, minimum=0, doc="Lags of each input of NARX."
    )
    width: float | tuple[float, ...] | None = option(
        None, unit="deviations", doc="Widths of radial functions to try."
    )
    choose: str | None = option(
        None,
        choices=CHOICES,
        doc="balanced: fewest coefficients within 6 of the smallest AICc, of free-run errors "
        "within 5 % or chance of the smallest; free_run: that one; simplest: fewest coefficients "
        "within 2 % of it; default: what fits the kind.",
    )
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def usual(self) -> Mapping[str, tuple[int, ...]]:
        """Orders that need not be given."""
        return EVERY_ORDER if self.structure == ANY else {"nk": (1,)}

    @property
    def orders(self) -> dict[str, tuple[int, ...]]:
        """Orders to try by name; none where the spectrum of the output tells them."""
        told = {name: getattr(self, name) for name in ORDERS[self.structure]}
        return {
            name: _several(self.usual[name] if given is None else given)
            for name, given in told.items()
        }

    @property
    def widths(self) -> tuple[float, ...]:
        """Widths of radial functions to try."""
        return _several(NarxStructure.width if self.width is None else self.width)

    @property
    def rule(self) -> str:
        """How a structure is chosen: one of `CHOICES`."""
        return self.choose or CHOOSE.get(self.structure, CHOICES[0])

    @property
    def is_scanned(self) -> bool:
        """Whether several structures are tried."""
        counts = [len(values) for values in (*self.orders.values(), self.widths)]
        return self.structure == ANY or max(counts) > 1

    @property
    def scans_orders(self) -> bool:
        """Whether several polynomial structures are tried."""
        return self.is_scanned and self.structure not in (NARX, SUBSPACE)


def _several(given: Any) -> tuple[Any, ...]:  # noqa: ANN401 - numbers, one or several
    if given == SPECTRUM:
        return ()
    return tuple(given) if isinstance(given, list | tuple) else (given,)


def read_structure(reader: TableReader, identify: tuple[str, ...]) -> StructureSettings:
    """Take the keys of a ``[[model]]`` with a ``structure``; its other keys are left to the caller.

    Parameters
    ----------
    reader : TableReader
    identify : tuple of str
        Records of the fit, on which coherence is tested where nothing else is said.

    Raises
    ------
    StudyError
        A value does not fit; several structures without records to choose on.
    """
    made = read_own(StructureSettings, reader)
    kind = made.structure
    known = (*ORDERS[kind], *(("width",) if kind == NARX else ()))
    for name in (*EVERY_ORDER, *ORDERS[NARX], "width"):
        if name in reader and name not in known:
            needed = ", ".join(known) or "no orders"
            raise reader.error(name, "has no meaning here", found=kind, needed=needed)
        told = getattr(made, name)
        if isinstance(told, tuple) and len({*told}) < len(told):
            raise reader.error(name, "is tried twice", found=told, needed="different numbers")
        if name in ORDERS[kind] and name not in reader and name not in made.usual:
            raise reader.error(name, "is missing", found="none", needed="a number, or several")
    further = STRUCTURES.get(kind, PolynomialStructure)
    given = {name: told for name, told in reader.options(further).items() if name not in known}
    options = option_values(further, given, reader.told, error=StudyError)
    flown = identify if made.coherence is None else made.coherence
    made = replace(made, options=options, coherence=flown)
    if kind != SUBSPACE and len(made.outputs) != 1:
        raise reader.error("outputs", "does not fit", found=made.outputs, needed="one output")
    if made.is_scanned and not made.select:
        raise reader.error(
            "select",
            "is missing: several structures are tried",
            found="none",
            needed="records on which free runs rank them",
        )
    if kind == NARX and made.rule != "free_run":
        raise reader.error(
            "choose", "does not fit", found=made.choose, needed="'free_run' for NARX models"
        )
    if kind == ANY and made.rule in ("balanced", "bic"):
        raise reader.error(
            "choose",
            "does not fit: kinds share no information criterion",
            found=made.choose,
            needed="'free_run' or 'simplest'",
        )
    return made


STRUCTURES: dict[str, type[Options]] = {NARX: NarxStructure, SUBSPACE: SubspaceStructure}
"""What holds the options of a kind; the others are polynomials."""

"""What a study file may say about a model without equations: structure, and orders to try."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from flightid.models import NarxStructure, SubspaceStructure
from flightid.models.polynomial.orders import ANY, EVERY_ORDER, USED
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.option_forms import NOTHING
from flightid.options import Options, options_of, read_value
from flightid.study.reading import TableReader

NARX, SUBSPACE = "narx", "subspace"
ORDERS: dict[str, tuple[str, ...]] = {
    **USED,
    NARX: ("output_lags", "input_lags"),
    SUBSPACE: (),
    ANY: tuple(EVERY_ORDER),
}
"""Orders of each structure, of which several may be tried."""
WORDS = {"output_lags": "spectrum"}
"""What may stand for an order's numbers: they follow from the data."""
CHOICES = ("balanced", "free_run", "simplest", "bic")


CHOOSE = {NARX: "free_run", ANY: "simplest"}
"""How a structure of a kind is chosen unless a study says it."""


@dataclass(frozen=True)
class StructureSettings:
    """A structure whose model is found from records alone.

    Attributes
    ----------
    kind : str
        ``"arx"``, ``"armax"``, ``"oe"``, ``"bj"``, ``"narx"``, ``"subspace"``; ``"any"`` of them.
    inputs : tuple of str
        Those whose response has no coherence are left out.
    outputs : tuple of str
        One; of ``"subspace"`` one or more.
    select : tuple of str
        Records on which free runs rank several structures.
    coherence : tuple of str
        Records of the coherence test and of the spectra.
    orders : mapping of str to tuple of int
        Orders to try by name; for ``"narx"`` output_lags, none where the spectrum of the output
        tells them, and input_lags.
    widths : tuple of float
        Widths of radial functions to try.
    choose : str
        How a structure is chosen: ``"free_run"`` smallest error on the selection records,
        ``"simplest"`` fewest coefficients within 2 % of it, ``"bic"``, or ``"balanced"``: the
        smallest AICc among those within 10 % of it, of OE and BJ first those with no fewer
        coefficients of B than of F.
    options : mapping
        Further options of the structure.
    """

    kind: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    select: tuple[str, ...]
    coherence: tuple[str, ...]
    orders: Mapping[str, tuple[int, ...]]
    widths: tuple[float, ...] = ()
    choose: str = CHOICES[0]
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_scanned(self) -> bool:
        """Whether several structures are tried."""
        counts = [len(values) for values in self.orders.values()]
        return self.kind == ANY or max([*counts, len(self.widths)], default=1) > 1


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
    kind = reader.choice("structure", ORDERS)
    is_narx = kind == NARX
    usual = EVERY_ORDER if kind == ANY else {"nk": (1,)}
    made = StructureSettings(
        kind,
        reader.names("inputs"),
        reader.names("outputs"),
        reader.names("select", ()),
        reader.names("coherence", identify),
        {
            name: reader.integers(name, usual.get(name), word=WORDS.get(name, ""))
            for name in ORDERS[kind]
        },
        reader.numbers("width", (NarxStructure.width,)) if is_narx else (),
        reader.choice("choose", CHOICES, CHOOSE.get(kind, CHOICES[0])),
        _options(kind, reader),
    )
    if kind != SUBSPACE and len(made.outputs) != 1:
        raise reader.error("outputs", "does not fit", found=made.outputs, needed="one output")
    if made.is_scanned and not made.select:
        raise reader.error(
            "select",
            "is missing: several structures are tried",
            found="none",
            needed="records on which free runs rank them",
        )
    if is_narx and made.choose != "free_run":
        raise reader.error(
            "choose", "does not fit", found=made.choose, needed="'free_run' for NARX models"
        )
    if kind == ANY and made.choose in ("balanced", "bic"):
        raise reader.error(
            "choose",
            "does not fit: kinds share no information criterion",
            found=made.choose,
            needed="'free_run' or 'simplest'",
        )
    return made


def _options(kind: str, reader: TableReader) -> dict[str, Any]:
    """Options of the structure among the keys of the model: those of its fields."""
    options = STRUCTURES.get(kind, PolynomialStructure)
    given: dict[str, Any] = {}
    for each in options_of(options):
        if each.name in TAKEN[kind]:
            continue
        reader.know(each.name)
        if each.name in reader:
            # TOML has no word for None.
            value = reader.peek(each.name)
            value = None if value == "none" and NOTHING in each.forms else read_value(each, value)
            problem = each.problem(value)
            if problem is not None:
                raise reader.error(
                    each.name, problem.removeprefix(f"{each.name} "),
                    found=reader.peek(each.name), needed=each.needed,
                )  # fmt: skip
            given[each.name] = value
    return given


STRUCTURES: dict[str, type[Options]] = {NARX: NarxStructure, SUBSPACE: SubspaceStructure}
"""What holds the options of a kind; the others are polynomials."""
TAKEN: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(ORDERS, ()),
    NARX: ("output_lags", "input_lags", "width"),
}
"""Options that are read as several to try."""

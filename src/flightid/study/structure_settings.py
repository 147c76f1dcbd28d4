"""What a study file may say about a model without equations: structure, and orders to try."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from flightid.models import NarxStructure, SubspaceStructure
from flightid.models.innovations.structure import METHODS as SUBSPACE_METHODS
from flightid.models.narx.structure import CANDIDATES, REGULARISATIONS, STOPS
from flightid.models.narx.terms import KERNELS, WIDTH_FACTORS
from flightid.models.polynomial.structure import INITIAL_STATES
from flightid.models.sampled.channels import OFFSETS
from flightid.study.reading import TableReader

NARX, SUBSPACE = "narx", "subspace"
ORDERS: dict[str, tuple[str, ...]] = {
    "arx": ("na", "nb", "nk"),
    "armax": ("na", "nb", "nc", "nk"),
    "oe": ("nb", "nf", "nk"),
    "bj": ("nb", "nc", "nd", "nf", "nk"),
    NARX: ("output_lags", "input_lags"),
    SUBSPACE: (),
}
"""Orders of each structure, of which several may be tried."""
CHOICES = ("balanced", "free_run", "simplest", "bic")


@dataclass(frozen=True)
class StructureSettings:
    """A structure whose model is found from records alone.

    Attributes
    ----------
    kind : str
        ``"arx"``, ``"armax"``, ``"oe"``, ``"bj"``, ``"narx"`` or ``"subspace"``.
    inputs : tuple of str
        Those whose response has no coherence are left out.
    outputs : tuple of str
        One; of ``"subspace"`` one or more.
    select : tuple of str
        Records on which free runs rank several structures.
    coherence : tuple of str
        Records of the coherence test and of the spectra.
    orders : mapping of str to tuple of int
        Orders to try by name; for ``"narx"`` output_lags and input_lags.
    widths : tuple of float
        Widths of radial functions to try.
    choose : str
        How a structure is chosen: ``"free_run"`` smallest error on the selection records,
        ``"simplest"`` fewest coefficients within 2 % of it, ``"bic"``, or ``"balanced"``: the
        smallest BIC among those within 10 % of it.
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
        return max([*counts, len(self.widths)], default=1) > 1


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
    made = StructureSettings(
        kind,
        reader.names("inputs"),
        reader.names("outputs"),
        reader.names("select", ()),
        reader.names("coherence", identify),
        {name: reader.integers(name, (1,) if name == "nk" else None) for name in ORDERS[kind]},
        reader.numbers("width", (NarxStructure.width,)) if is_narx else (),
        reader.choice("choose", CHOICES, "free_run" if is_narx else CHOICES[0]),
        OPTIONS.get(kind, _polynomial_options)(reader),
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
    return made


def _polynomial_options(reader: TableReader) -> dict[str, Any]:
    return {
        "initial_state": reader.choice("initial_state", INITIAL_STATES, INITIAL_STATES[0]),
        "backcast": reader.flag("backcast", False),
        "offsets": reader.choice("offsets", OFFSETS, OFFSETS[0]),
        "enforce_stability": reader.flag("enforce_stability", False),
    }


def _subspace_options(reader: TableReader) -> dict[str, Any]:
    usual = SubspaceStructure
    return {
        "order": reader.maybe(lambda key: reader.integer(key, minimum=1), "order"),
        "method": reader.choice("method", SUBSPACE_METHODS, usual.method),
        "horizon": reader.maybe(lambda key: reader.integer(key, minimum=1), "horizon"),
        "direct": reader.flag("direct", usual.direct),
        "refine": reader.flag("refine", usual.refine),
        "initial_state": reader.choice("initial_state", INITIAL_STATES, INITIAL_STATES[0]),
        "offsets": reader.choice("offsets", OFFSETS, OFFSETS[0]),
        "maximum_order": reader.integer("maximum_order", usual.maximum_order, minimum=1),
    }


def _narx_options(reader: TableReader) -> dict[str, Any]:
    usual = NarxStructure
    kernel = reader.choice("kernel", (*KERNELS, "none"), usual.kernel or "none")
    return {
        "kernel": None if kernel == "none" else kernel,
        "width_convention": reader.choice("width_convention", WIDTH_FACTORS, "beta"),
        "candidates": reader.choice("candidates", CANDIDATES, usual.candidates),
        "n_candidates": reader.integer("n_candidates", usual.n_candidates, minimum=1),
        "seed": reader.integer("seed", usual.seed),
        "delay": reader.integer("delay", usual.delay),
        "constant": reader.flag("constant", usual.constant),
        "linear": reader.flag("linear", usual.linear),
        "degree": reader.integer("degree", usual.degree, minimum=1),
        "stop": reader.choice("stop", STOPS, usual.stop),
        "goal": reader.number("goal", usual.goal),
        "maximum_terms": reader.integer("maximum_terms", usual.maximum_terms, minimum=1),
        "regularisation": reader.choice("regularisation", REGULARISATIONS, usual.regularisation),
        "penalty": reader.number("penalty", usual.penalty),
        "held_back": reader.number("held_back", usual.held_back),
        "guard": reader.number("guard", usual.guard),
    }


OPTIONS: dict[str, Callable[[TableReader], dict[str, Any]]] = {
    NARX: _narx_options,
    SUBSPACE: _subspace_options,
}
"""Readers of the options of a kind; the others are polynomials."""

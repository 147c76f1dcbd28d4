"""What a study file may say about a black-box model: structure, orders to try, records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from flightid.models import NarxStructure
from flightid.models.narx.structure import CANDIDATES, STOPS
from flightid.models.narx.terms import KERNELS, WIDTH_FACTORS
from flightid.models.polynomial.structure import INITIAL_STATES
from flightid.models.sampled.channels import OFFSETS
from flightid.study.reading import TableReader

ORDERS = {
    "arx": ("na", "nb", "nk"),
    "armax": ("na", "nb", "nc", "nk"),
    "oe": ("nb", "nf", "nk"),
    "bj": ("nb", "nc", "nd", "nf", "nk"),
}
NARX = "narx"
STRUCTURES = (*ORDERS, NARX)
CHOICES = ("balanced", "free_run", "simplest", "bic")


@dataclass(frozen=True)
class BlackBoxSettings:
    """One black-box model to identify.

    Attributes
    ----------
    name : str
        Title in the report.
    structure : str
        ``"arx"``, ``"armax"``, ``"oe"``, ``"bj"`` or ``"narx"``.
    inputs : tuple of str
        Those whose response has no coherence are left out.
    output : str
    identify, select, verify, coherence : tuple of str
        Records of the fit, of the choice among structures, of the verification, and of the
        coherence test and the spectra.
    band_rad_s : tuple of float
        Band of the coherence test, rad/s.
    minimum_coherence, minimum_decades : float
        What a response must have to be fitted.
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

    name: str
    structure: str
    inputs: tuple[str, ...]
    output: str
    identify: tuple[str, ...]
    select: tuple[str, ...]
    verify: tuple[str, ...]
    coherence: tuple[str, ...]
    band_rad_s: tuple[float, float]
    minimum_coherence: float
    minimum_decades: float
    orders: Mapping[str, tuple[int, ...]]
    widths: tuple[float, ...] = ()
    choose: str = CHOICES[0]
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def segments(self) -> tuple[str, ...]:
        """Every record that the model uses."""
        return (*self.identify, *self.select, *self.verify, *self.coherence)

    @property
    def is_scanned(self) -> bool:
        """Whether several structures are tried."""
        counts = [len(values) for values in self.orders.values()]
        return max([*counts, len(self.widths)]) > 1


def read_black_box(reader: TableReader) -> BlackBoxSettings:
    """Check a table ``[[model]]`` that has a ``structure``.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit; several structures without records to choose on.
    """
    structure = reader.choice("structure", STRUCTURES)
    identify = reader.names("identify")
    is_narx = structure == NARX
    band = reader.interval("band_rad_s")
    if band[0] <= 0:
        raise reader.error("band_rad_s", "does not fit", found=band, needed="positive frequencies")
    made = BlackBoxSettings(
        reader.text("name"),
        structure,
        reader.names("inputs"),
        reader.text("output"),
        identify,
        reader.names("select", ()),
        reader.names("verify", ()),
        reader.names("coherence", identify),
        band,
        reader.positive("minimum_coherence", 0.6),
        reader.positive("minimum_decades", 0.3),
        _orders(reader, ("output_lags", "input_lags") if is_narx else ORDERS[structure]),
        reader.numbers("width", (NarxStructure.width,)) if is_narx else (),
        reader.choice("choose", CHOICES, "free_run" if is_narx else CHOICES[0]),
        _narx_options(reader) if is_narx else _polynomial_options(reader),
    )
    reader.finish()
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


def _orders(reader: TableReader, names: tuple[str, ...]) -> dict[str, tuple[int, ...]]:
    return {name: reader.integers(name, (1,) if name == "nk" else None) for name in names}


def _polynomial_options(reader: TableReader) -> dict[str, Any]:
    return {
        "initial_state": reader.choice("initial_state", INITIAL_STATES, INITIAL_STATES[0]),
        "backcast": reader.flag("backcast", False),
        "offsets": reader.choice("offsets", OFFSETS, OFFSETS[0]),
        "enforce_stability": reader.flag("enforce_stability", False),
    }


def _narx_options(reader: TableReader) -> dict[str, Any]:
    usual = NarxStructure
    kernel = reader.choice("kernel", (*KERNELS, "none"), usual.kernel or "none")
    return {
        "kernel": None if kernel == "none" else kernel,
        "width_convention": reader.choice("width_convention", WIDTH_FACTORS, "beta"),
        "candidates": reader.choice("candidates", CANDIDATES, usual.candidates),
        "n_candidates": reader.integer("n_candidates", usual.n_candidates, minimum=1),
        "delay": reader.integer("delay", usual.delay),
        "constant": reader.flag("constant", usual.constant),
        "linear": reader.flag("linear", usual.linear),
        "degree": reader.integer("degree", usual.degree, minimum=1),
        "stop": reader.choice("stop", STOPS, usual.stop),
        "goal": reader.number("goal", usual.goal),
        "maximum_terms": reader.integer("maximum_terms", usual.maximum_terms, minimum=1),
        "guard": reader.number("guard", usual.guard),
    }

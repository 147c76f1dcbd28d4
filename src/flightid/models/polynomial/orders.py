"""Orders of a polynomial model, one structure's or those of a scan; see `flightid.scan_orders`."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.frozen import dataclass
from flightid.options import Options, option

KINDS = ("arx", "armax", "oe", "bj")
ANY = "any"
"""Every kind of a scan: these, subspace models and NARX."""
USED = {
    "arx": ("na", "nb", "nk"),
    "armax": ("na", "nb", "nc", "nk"),
    "oe": ("nb", "nf", "nk"),
    "bj": ("nb", "nc", "nd", "nf", "nk"),
}
"""Orders that each kind has."""
EVERY_ORDER: dict[str, tuple[int, ...]] = {
    "na": (1, 2, 3, 4),
    "nb": (1, 2, 3),
    "nc": (1, 2),
    "nd": (1, 2),
    "nf": (1, 2, 3, 4),
    "nk": (1, 2, 3),
}
"""Orders that a scan of every kind tries unless it is told: two modes with their delays."""
Orders = int | Sequence[int] | None


@dataclass(frozen=True)
class OrderOptions(Options):
    """Orders of A y = Σ (Bᵢ/Fᵢ) uᵢ(t - nkᵢ) + (C/D) e; of a scan several.

    Example
    -------
    >>> OrderOptions(na=2, nb=(1, 2)).to_dict()["nb"]
    [1, 2]
    """

    na: Orders = option(None, minimum=0, doc="Degree of A.")
    nb: Orders = option(None, minimum=0, doc="Coefficients of B.")
    nc: Orders = option(None, minimum=0, doc="Degree of C.")
    nd: Orders = option(None, minimum=0, doc="Degree of D.")
    nf: Orders = option(None, minimum=0, doc="Degree of F.")
    nk: Orders = option(None, minimum=0, doc="Delay, samples.")


@dataclass(frozen=True)
class ScanOptions(OrderOptions):
    """A scan of orders: its kind, and what is tried.

    Example
    -------
    >>> ScanOptions().kind
    'armax'
    """

    kind: str = option("armax", choices=(*KINDS, ANY), doc="Kind of model; any: all.")

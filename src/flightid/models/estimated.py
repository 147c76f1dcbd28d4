"""What a fit knew of a model's numbers, kept with the model in its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models.language.reading import (
    read_list,
    read_matrix,
    read_names,
    read_number,
    read_table,
    read_text,
    require_keys,
)

Array = NDArray[np.float64]
_KEYS = {
    "names", "covariance", "method", "intervals_from", "bands", "evidence", "provenance",
    "model_errors", "withheld",
}  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class EstimateProvenance:
    """Where the numbers of a model come from, and how well they are known.

    Attributes
    ----------
    names : tuple of str
        Parameters of `covariance`.
    covariance : ndarray, shape (n, n), or None
        Of the estimates over repeated flights; None where it is not known.
    method : str
        Of `flightid.identify`.
    intervals_from : str
        What the covariance rests on.
    bands : mapping of str to (float, float)
        Fitted band of each response, rad/s; empty for a fit of records.
    evidence : mapping
        Plain values of the fit's `flightid.evidence.Evidence`.
    provenance : mapping
        Hash of the data, options, version.
    model_errors : mapping of str to mapping
        Plain values of the fit's `ModelErrorBound` by response.
    withheld : str
        Why there is no covariance; empty where there is one or the data's errors are not known.

    Example
    -------
    >>> EstimateProvenance(("Lp",), np.array([[0.01]]), "output_error")
    EstimateProvenance(1 number with covariance, by output_error)
    """

    names: tuple[str, ...]
    covariance: Array | None
    method: str = ""
    intervals_from: str = ""
    bands: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    evidence: Mapping[str, object] = field(default_factory=dict)
    provenance: Mapping[str, object] = field(default_factory=dict)
    model_errors: Mapping[str, Any] = field(default_factory=dict)
    withheld: str = ""

    def __repr__(self) -> str:
        """Size and method on one line."""
        n = len(self.names)
        known = "" if self.covariance is None else " with covariance"
        return f"EstimateProvenance({n} number{'' if n == 1 else 's'}{known}, by {self.method})"

    def to_dict(self) -> dict[str, object]:
        """Plain values without what is absent, as TOML has no null."""
        table: dict[str, object] = {
            "names": list(self.names),
            "method": self.method,
            "intervals_from": self.intervals_from,
            "bands": {name: list(band) for name, band in self.bands.items()},
            "evidence": _plain(self.evidence),
            "provenance": _plain(self.provenance),
            "model_errors": _plain(self.model_errors),
        }
        if self.withheld:
            table["withheld"] = self.withheld
        if self.covariance is not None:
            table["covariance"] = self.covariance.tolist()
        return table

    @classmethod
    def from_dict(cls, content: Mapping[str, object], known: Sequence[str]) -> EstimateProvenance:
        """From plain values such as a TOML file gives.

        Parameters
        ----------
        content : mapping
        known : sequence of str
            Names of the model's parameters.

        Raises
        ------
        ModelError
            A key is unknown or of the wrong type; a name that is no parameter of the model; a
            covariance that does not fit the names or is none.
        """
        require_keys(content, _KEYS, "estimated")
        names = read_names(content, "names")
        stray = set(names) - set(known)
        if stray:
            raise ModelError("estimated names no parameter", found=", ".join(sorted(stray))[:200])
        covariance = None
        if "covariance" in content:
            covariance = read_matrix(content["covariance"], "covariance", (len(names),) * 2)
            _require_covariance(covariance)
        bands = read_table(content, "bands", required=False)
        return cls(
            names,
            covariance,
            read_text(content.get("method", ""), "method"),
            read_text(content.get("intervals_from", ""), "intervals_from"),
            {name: _band(item) for name, item in bands.items()},
            read_table(content, "evidence", required=False),
            read_table(content, "provenance", required=False),
            read_table(content, "model_errors", required=False),
            read_text(content.get("withheld", ""), "withheld"),
        )


def _require_covariance(found: Array) -> None:
    size = float(np.max(np.abs(found), initial=0.0))
    if not (
        np.all(np.isfinite(found))
        and np.all(np.diag(found) >= 0.0)
        and np.allclose(found, found.T, rtol=1e-6, atol=1e-9 * size)
    ):
        raise ModelError(
            "a matrix is no covariance", needed="symmetric, finite, no variance below 0"
        )


def _band(item: object) -> tuple[float, float]:
    listed = read_list(item, "bands")
    if len(listed) != 2:
        raise ModelError("a band is two frequencies", found=repr(item)[:80])
    low, high = (read_number(value, "bands") for value in listed)
    return low, high


def _plain(value: object) -> object:
    """Values that TOML has: what is None is left out, what it does not know becomes text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value if item is not None]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    return value if isinstance(value, bool | int | float | str) else str(value)

"""Structures side by side: cost, number of parameters, and how well these are known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import (
    CORRELATION_GUIDE,
    CRAMER_RAO_GUIDE_PERCENT,
    INSENSITIVITY_GUIDE_PERCENT,
)
from flightid.identification.reduction.result import worst_percents
from flightid.result import Result
from flightid.table import Cell, Column, Table

LIKELIHOODS = ("output_error", "filter_error")
"""Methods whose objective is the negative logarithm of the likelihood, without its constant."""


def information_criterion(fit: Fit) -> float | None:
    """Akaike's criterion of a fit, in the convention that its residuals are independent.

    n ln(J/n) + 2 k for a weighted cost J of n residuals and k free parameters; for a likelihood
    cost, whose residuals have variance one, J + 2 k; for a negative logarithm of the likelihood of
    records 2 (J + k). Only differences between fits of the same
    data have a meaning, and neighbouring frequencies are not independent, so that the criterion
    ranks structures and is no test.

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    float or None
        None where the model follows the data without any residual, and for a regression.

    Reference
    ---------
    Akaike, "A new look at the statistical model identification", *IEEE Trans. Automatic Control*
    19 (1974), eq. 4; Ljung, *System Identification*, 2nd ed., §16.4.

    Example
    -------
    >>> import flightid as fid
    >>> omega = [1.0, 2.0, 4.0, 8.0]
    >>> model = fid.load_model("rate_integrator").with_fixed(tau=0.02)
    >>> data = fid.FrequencyResponse.from_values(omega, [1.0, 0.6 - 0.1j, 0.3 - 0.2j, 0.1 - 0.2j],
    ...     inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"})
    >>> fit = fid.identify(model, data)
    >>> float(round(information_criterion(fit) - 8 * np.log(fit.objective / 8), 6))
    2.0
    """
    k = len(fit.names)
    if fit.method in LIKELIHOODS:
        return 2.0 * (fit.objective + k)
    if _is_likelihood(fit):
        return fit.objective + 2.0 * k
    n = 2 * sum(len(each.omega_rad_s) for each in fit.responses)
    if n == 0 or fit.objective <= n * np.finfo(float).eps:
        return None
    return float(n * np.log(fit.objective / n) + 2.0 * k)


def _is_likelihood(fit: Fit) -> bool:
    options = fit.provenance.get("options")
    return isinstance(options, Mapping) and options.get("cost") == "likelihood"


@dataclass(frozen=True)
class StructureRow:
    """One structure in a comparison.

    Attributes
    ----------
    n_free : int
        Parameters that were estimated.
    average_cost : float
    criterion : float or None
        Akaike's criterion less that of the best structure; None without residuals.
    worst_cramer_rao_percent, worst_insensitivity_percent : float or None
    worst_correlation : float or None
        Largest size of a correlation between two parameters.
    n_outside : int
        Parameters that break a guide.
    light : str
        Of the fit's evidence.
    """

    n_free: int
    average_cost: float
    criterion: float | None
    worst_cramer_rao_percent: float | None
    worst_insensitivity_percent: float | None
    worst_correlation: float | None
    n_outside: int
    light: str = ""


@dataclass(frozen=True, repr=False, eq=False)
class StructureComparison(Result, schema="flightid.structure_comparison/1"):
    """Result of `flightid.compare_structures`.

    Attributes
    ----------
    fits : mapping of str to Fit
        By name.
    rows : mapping of str to StructureRow
        By name.
    findings : tuple of Finding

    Example
    -------
    >>> StructureComparison({}, {"a": StructureRow(3, 20.0, 0.0, 9.0, 5.0, 0.4, 0),
    ...                          "b": StructureRow(4, 19.9, 1.8, 30.0, 12.0, 0.99, 1)}, ()).best
    'a'
    """

    fits: Mapping[str, Fit]
    rows: Mapping[str, StructureRow]
    findings: tuple[Finding, ...]

    @property
    def best(self) -> str | None:
        """Name of the structure with the least criterion; None where one has no residuals."""
        known = {name: row.criterion for name, row in self.rows.items()}
        if any(value is None for value in known.values()):
            return None
        return min(known, key=lambda name: known[name] or 0.0)

    def __repr__(self) -> str:
        """Count and the best structure on one line."""
        best = self.best
        tail = "" if best is None else f", best {best!r}"
        return f"StructureComparison({len(self.rows)} structures{tail})"

    def summary(self) -> Table:
        """Table with one structure a row."""
        columns = (
            Column("structure"),
            Column("free parameters"),
            Column("average cost", digits=5),
            Column("ΔAIC", digits=4),
            Column("worst insensitivity", "%", 3),
            Column("worst Cramér–Rao", "%", 3),
            Column("worst correlation", digits=3),
            Column("outside the guides"),
            Column("light"),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                name,
                row.n_free,
                row.average_cost,
                row.criterion,
                row.worst_insensitivity_percent,
                row.worst_cramer_rao_percent,
                row.worst_correlation,
                row.n_outside,
                row.light,
            )
            for name, row in self.rows.items()
        ]
        return Table("Structures", columns, tuple(rows), tuple(map(str, self.findings)))

    def _computed(self) -> dict[str, object]:
        return {"best": self.best}


def compare_structures(fits: Mapping[str, Fit]) -> StructureComparison:
    """Set fits of several structures to the same data side by side.

    Parameters
    ----------
    fits : mapping of str to Fit
        Results of `flightid.identify` by name, with the same data and options.

    Raises
    ------
    OptionError
        Fewer than two fits, or fits with different options.
    DataError
        Fits of different data or responses.

    Assumes
    -------
    Akaike's criterion as it is used here takes residuals as independent: it ranks structures and
    is no test.

    Reference
    ---------
    Akaike (1974), eq. 4; guides: Tischler & Remple, 2nd ed., §12.3.4.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> omega = np.geomspace(1.0, 50.0, 60)
    >>> vehicle = fid.load_model("rate_motor_lag")
    >>> data = fid.FrequencyResponse.from_values(
    ...     omega, vehicle.frequency_response(omega) * (1 + 0.01 * np.sin(37 * omega)),
    ...     inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"})
    >>> names = ["rate_first_order", "rate_motor_lag"]
    >>> fid.compare_structures({n: fid.identify(fid.load_model(n), data) for n in names})
    StructureComparison(2 structures, best 'rate_motor_lag')
    """
    if len(fits) < 2:
        raise OptionError("there is nothing to compare", found=len(fits), needed="two fits or more")
    _require_same(fits)
    known = {name: information_criterion(fit) for name, fit in fits.items()}
    least = min((value for value in known.values() if value is not None), default=0.0)
    rows = {
        name: _row(fit, None if known[name] is None else (known[name] or 0.0) - least)
        for name, fit in fits.items()
    }
    return StructureComparison(dict(fits), rows, tuple(_judge(rows)))


def _require_same(fits: Mapping[str, Fit]) -> None:
    first, *others = fits.items()
    for name, fit in others:
        pair = f"{first[0]!r} and {name!r}"
        same = fit.provenance.get("data_sha256") == first[1].provenance.get("data_sha256")
        if not same or set(fit.costs) != set(first[1].costs):
            raise DataError(
                f"structures {pair} were fitted to different data",
                found=f"{', '.join(first[1].costs)} and {', '.join(fit.costs)}",
                needed="the same data and responses",
                action="fit each structure to the same data",
            )
        if fit.provenance.get("options") != first[1].provenance.get("options"):
            raise OptionError(
                f"structures {pair} were fitted with different options",
                needed="the same cost, band and weights",
                action="give identify the same options for each",
            )


def _row(fit: Fit, criterion: float | None) -> StructureRow:
    slack, bound = worst_percents(fit)
    size = np.abs(np.triu(fit.correlation, k=1))
    outside = [
        p
        for p in (fit.parameters[name] for name in fit.names)
        if (p.insensitivity_percent or 0.0) > INSENSITIVITY_GUIDE_PERCENT
        or (p.cramer_rao_percent or 0.0) > CRAMER_RAO_GUIDE_PERCENT
    ]
    return StructureRow(
        len(fit.names),
        fit.average_cost,
        criterion,
        bound,
        slack,
        float(size.max()) if len(fit.names) > 1 else None,
        len(outside),
        str(fit.evidence.light),
    )


def _judge(rows: Mapping[str, StructureRow]) -> list[Finding]:
    found = []
    for name, row in rows.items():
        high = row.worst_correlation is not None and row.worst_correlation > CORRELATION_GUIDE
        if row.n_outside or high:
            pair = ", two parameters hardly told apart" if high else ""
            found.append(
                Finding(
                    "structure-outside",
                    Light.AMBER,
                    f"{name}: {row.n_outside} of {row.n_free} parameters break a guide{pair}",
                    "reduce it: leave out what the data do not determine (--reduce)",
                )
            )
    return found

"""The fit: a model with estimates, how well each is known, and where it all comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flightid.findings import Finding
from flightid.identification.fitted_record import FittedRecord
from flightid.models import GreyBoxModel
from flightid.models.linear.linear_system import LinearSystem
from flightid.responses import PairResponse
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate

SCHEMA = "flightid.fit/1"


@dataclass(frozen=True)
class FittedResponse:
    """One measured response with the model beside it.

    Attributes
    ----------
    name : str
        ``"output/input"``.
    cost : float
        J of this response; guide: at most 100, and 150 to 200 for a single off-axis one.
    measured : PairResponse
        The whole measured response.
    omega_rad_s : ndarray, shape (n,)
        Frequencies that were fitted, rad/s.
    model : ndarray of complex, shape (n_f,)
        The fitted model at every measured frequency.

    Example
    -------
    >>> import flightid as fid
    >>> omega = [1.0, 2.0, 4.0, 8.0]
    >>> model = fid.load_model("rate_integrator")
    >>> data = fid.FrequencyResponse.from_values(omega, model.frequency_response(omega),
    ...     inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"})
    >>> fid.identify(model, data).responses[0].name
    'p/tau_phi'
    """

    name: str
    cost: float
    measured: PairResponse
    omega_rad_s: NDArray[np.float64]
    model: NDArray[np.complex128]

    @property
    def band_rad_s(self) -> tuple[float, float]:
        """Lowest and highest fitted frequency, rad/s."""
        return float(self.omega_rad_s[0]), float(self.omega_rad_s[-1])

    def to_dict(self) -> dict[str, object]:
        """Plain values without the curves."""
        low, high = self.band_rad_s
        return {
            "cost": self.cost,
            "band_rad_s": [low, high],
            "n_frequencies": len(self.omega_rad_s),
        }


@dataclass(frozen=True)
class LocalMinimum:
    """A minimum that one or more starts found.

    Attributes
    ----------
    objective : float
        What was minimised, there.
    count : int
        Number of starts that ended there.
    values : mapping of str to float
        Free parameters there.
    termination : str
        Why the iteration ended.

    Example
    -------
    >>> LocalMinimum(12.5, 3, {"K": 2.0}, "cost").count
    3
    """

    objective: float
    count: int
    values: Mapping[str, float]
    termination: str


@dataclass(frozen=True, repr=False, eq=False)
class Fit:
    """Result of `flightid.identify`.

    Attributes
    ----------
    model : TransferFunctionModel or StateSpaceModel
        The model with the estimates as values.
    parameters : mapping of str to Estimate
        All parameters, in the model's order.
    cost, average_cost : float
        Σ J_l and its average over the responses; guide: average at most 100, below 50 nearly
        indistinguishable. On records: sum and average of the outputs' costs.
    costs : mapping of str to float
        J_l by response. On records, by output: percent of the output's variance that the model
        leaves in the residuals.
    names : tuple of str
        Parameters of `covariance` and `correlation`: free and not at a bound.
    covariance : ndarray, shape (n, n), or None
        Of the estimates over repeated flights; None where the errors of the data are not known.
    correlation : ndarray, shape (n, n)
        Of the inverse Hessian of the cost; guide: at most 0.98 in size.
    responses : tuple of FittedResponse
    minima : tuple of LocalMinimum
        What the starts found, best first.
    objective : float
        What was minimised: equal to `cost` for ``cost="coherence"``; on records the negative
        logarithm of the likelihood, without its constant.
    termination : str
        Why the iteration ended.
    iterations : int
    intervals_from : str
        ``"response covariance"``, ``"random error"`` (approximate), ``"coloured residuals"`` or
        ``"nothing"``.
    findings : tuple of Finding
    provenance : mapping
        Hash of the data, options, version of flightid, seed.
    records : tuple of FittedRecord
        In the time domain: measured and modelled outputs, initial states and biases.
    noise_covariance : ndarray, shape (n_outputs, n_outputs), or None
        R of the residuals, in the time domain.

    Example
    -------
    >>> import flightid as fid
    >>> omega = [1.0, 2.0, 4.0, 8.0]
    >>> model = fid.load_model("rate_integrator").with_fixed(tau=0.02)
    >>> data = fid.FrequencyResponse.from_values(omega, 2 * model.frequency_response(omega),
    ...     inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"})
    >>> fit = fid.identify(model, data)
    >>> fit
    Fit('Roll rate, integrator', 1 free of 2 parameters, 1 response, average cost 0.00)
    >>> round(fit.parameters["Ltphi"].value, 6)
    200.0
    """

    model: GreyBoxModel
    parameters: Mapping[str, Estimate]
    cost: float
    average_cost: float
    costs: Mapping[str, float]
    names: tuple[str, ...]
    covariance: NDArray[np.float64] | None
    correlation: NDArray[np.float64]
    responses: tuple[FittedResponse, ...]
    minima: tuple[LocalMinimum, ...]
    objective: float
    termination: str
    iterations: int
    intervals_from: str
    findings: tuple[Finding, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)
    records: tuple[FittedRecord, ...] = ()
    noise_covariance: NDArray[np.float64] | None = None

    def linear_system(self) -> LinearSystem:
        """The linear system of the fitted model; ModelError with the reason where there is none."""
        return self.model.linear_system()

    def __repr__(self) -> str:
        """Size and average cost on one line."""
        free = sum(p.status in ("free", "at bound") for p in self.parameters.values())
        counts = {"response": len(self.responses), "record": len(self.records)}
        seen = [f"{n} {word}{'' if n == 1 else 's'}" for word, n in counts.items() if n]
        unit = "" if self.responses else " %"
        return (
            f"Fit({self.model.name!r}, {free} free of {len(self.parameters)} parameters, "
            f"{', '.join(seen)}, average cost {self.average_cost:.2f}{unit})"
        )

    def summary(self) -> Table:
        """Table of the parameters, with costs and findings below.

        Returns
        -------
        Table
        """
        columns = (
            Column("parameter"),
            Column("value", digits=5),
            Column("unit"),
            Column("95 % low"),
            Column("95 % high"),
            Column("Cramér–Rao", "%", 3),
            Column("insensitivity", "%", 3),
            Column("status"),
        )
        rows: list[tuple[Cell, ...]] = []
        for p in self.parameters.values():
            low, high = p.interval95 if p.interval95 is not None else (None, None)
            bounds = (p.cramer_rao_percent, p.insensitivity_percent)
            rows.append((p.name, p.value, p.unit, low, high, *bounds, p.status))
        costs = ", ".join(f"{name} {cost:.3g}" for name, cost in self.costs.items())
        meaning = (
            "(guide: at most 100)"
            if self.responses
            else "% of the outputs' variance left unexplained"
        )
        formulas = map(str, self.model.responses if self.responses else ())
        notes = (
            # Formulas of transfer functions; other responses are named with their costs below.
            *(text for text in formulas if text not in self.model.response_names),
            f"Average cost {self.average_cost:.3g} {meaning}; {costs}.",
            f"Intervals from: {self.intervals_from}.",
            *map(str, self.findings),
        )
        return Table(f"Fit of {self.model.name}", columns, tuple(rows), notes)

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key."""
        return {
            "schema": SCHEMA,
            "model": self.model.to_dict(),
            "parameters": {name: p.to_dict() for name, p in self.parameters.items()},
            "cost": self.cost,
            "average_cost": self.average_cost,
            "costs": dict(self.costs),
            "names": list(self.names),
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "correlation": self.correlation.tolist(),
            "responses": {each.name: each.to_dict() for each in self.responses},
            "records": [each.to_dict() for each in self.records],
            "noise_covariance": (
                None if self.noise_covariance is None else self.noise_covariance.tolist()
            ),
            "minima": [
                {
                    "objective": each.objective,
                    "count": each.count,
                    "values": dict(each.values),
                    "termination": each.termination,
                }
                for each in self.minima
            ],
            "objective": self.objective,
            "termination": self.termination,
            "iterations": self.iterations,
            "intervals_from": self.intervals_from,
            "findings": [finding.to_dict() for finding in self.findings],
            "provenance": dict(self.provenance),
        }

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()

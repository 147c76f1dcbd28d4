"""An equivalent system of low order: its numbers, how well it fits, and the levels they give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import STANDARD_GRAVITY_M_S2
from flightid.dynamics.handling_qualities.rating import Rating, normal_draws, rate
from flightid.dynamics.handling_qualities.rating_charts_reading import rating_chart
from flightid.dynamics.lower_order.structures import structure_of
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.models import TransferFunctionModel
from flightid.responses import FrequencyResponse
from flightid.result import Result
from flightid.table import Table
from flightid.uncertainty.estimate import Estimate, Reading, estimate_table
from flightid.uncertainty.quantiles import shown
from flightid.uncertainty.uncertain import LOST, Uncertain
from flightid.uncertainty.uneven import drawn_estimate
from flightid.validation.verification.muad import Mismatch

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class LowerOrder(
    Result,
    schema="flightid.lower_order/1",
    untold={"uncertain": "the covariance that quantities carry", "response": "the data"},
):
    """Result of `lower_order`.

    Attributes
    ----------
    kind, output, input : str
        Structure, and the pair that it stands for.
    fit : Fit
        The equivalent system fitted to the response.
    names : tuple of str
        Parameters that were fitted, in the order of `uncertain`.
    uncertain : Uncertain
        Their values and covariance.
    response : FrequencyResponse
        What was fitted: measured, or the model's.
    band_rad_s : tuple of float
        Band of the fit, rad/s.
    mismatch_cost : float
        (20/n) Σ [(Δ dB)² + 0.01745 (Δ phase in degrees)²]; guide: at most 10.
    mismatch : Mismatch
        Equivalent system over response in the envelopes of unnoticed added dynamics.
    airspeed_m_s, n_alpha : float or None
        Airspeed, and n/α in g/rad where it is known otherwise: for the short period.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> fid.lower_order(fid.load_model("rate_first_order"), kind="roll")
    LowerOrder(roll, p/tau_phi, mismatch 0.0)
    """

    kind: str
    output: str
    input: str
    fit: Fit
    names: tuple[str, ...]
    uncertain: Uncertain[NDArray[np.float64]]
    response: FrequencyResponse
    band_rad_s: tuple[float, float]
    mismatch_cost: float
    mismatch: Mismatch
    airspeed_m_s: float | None = None
    n_alpha: float | None = None
    findings: tuple[Finding, ...] = field(default=())

    @property
    def model(self) -> TransferFunctionModel:
        """The equivalent system."""
        assert isinstance(self.fit.model, TransferFunctionModel)
        return self.fit.model

    @property
    def name(self) -> str:
        """``"output/input"``."""
        return f"{self.output}/{self.input}"

    def value(self, name: str) -> float:
        """Value of a parameter or of a number derived from them; infinite where it never ends.

        Raises
        ------
        KeyError
            The structure has no such number, or it needs a speed that was not given.
        """
        return float(self._derived({n: np.array([v]) for n, v in self._values().items()})[name][0])

    def samples(self) -> dict[str, Array]:
        """Draws of all numbers together; empty without a covariance."""
        drawn = normal_draws(self.uncertain.numbers, self.uncertain.covariance)
        if drawn is None:
            return {}
        fixed = {
            name: np.full(drawn.shape[1], value)
            for name, value in self._values().items()
            if name not in self.names
        }
        return self._derived({**fixed, **dict(zip(self.names, drawn, strict=True))})

    def _values(self) -> dict[str, float]:
        return {name: each.value for name, each in self.fit.parameters.items()}

    def _derived(self, numbers: Mapping[str, Array]) -> dict[str, Array]:
        found = dict(numbers)
        if "zeta" in found:
            found["decay"] = found["zeta"] * found["omega"]
        if "spiral" in found:
            root = found["spiral"]
            grows = root > 0.0
            found["time_to_double"] = np.where(
                grows, np.log(2.0) / np.where(grows, root, 1.0), np.inf
            )
        if "inverse_T_theta2" in found:
            inverse = found["inverse_T_theta2"]
            found["T_theta2"] = 1.0 / inverse
            if self.n_alpha is not None:
                found["n_alpha"] = np.full_like(inverse, self.n_alpha)
            elif self.airspeed_m_s is not None:
                found["n_alpha"] = self.airspeed_m_s / STANDARD_GRAVITY_M_S2 * inverse
            if "n_alpha" in found:
                found["cap"] = found["omega"] ** 2 / found["n_alpha"]
        return found

    @property
    def quantities(self) -> tuple[Reading, ...]:
        """Parameters and derived numbers with their 95 % intervals."""
        units = self.model.parameters.units
        notes = {name: each.note for name, each in self.model.parameters.items()}
        made = []
        for name in self.model.parameters:
            label = f"{name} ({notes[name]})" if notes[name] else name
            if name in self.names:
                made.append(self.uncertain.number(self.names.index(name), label, units[name]))
            else:
                fixed = self._values()[name]
                made.append(Estimate(label, fixed, units[name], None, "not fitted"))
        drawn = self.samples()
        for name, label, unit in DERIVED:
            try:
                value = self.value(name)
            except KeyError:
                continue
            made.append(
                _derived_quantity(label, value, unit, drawn.get(name), self.uncertain.reason)
            )
        return tuple(made)

    def ratings(
        self, *, category: str = "A", aircraft_class: str = "I", path: str | None = None
    ) -> tuple[Rating, ...]:
        """Levels of the numbers, as far as the structure and what is known give them.

        Parameters
        ----------
        category : {"A", "B", "C"}
            Of the flight phase: precise and rapid, gradual, terminal.
        aircraft_class : {"I", "II", "II-L", "II-C", "III", "IV"}
            Light, medium (land, carrier), heavy, highly manoeuvrable.
        path : str, optional
            Chart file of your own.

        Returns
        -------
        tuple of Rating
        """
        drawn = self.samples()
        made = []
        for key, numbers in structure_of(self.kind).rated.items():
            chart = rating_chart(key, path=path, category=category, **{"class": aircraft_class})
            try:
                values = {quantity: self.value(name) for quantity, name in numbers.items()}
            except KeyError:
                continue
            samples = {quantity: drawn[name] for quantity, name in numbers.items()} if drawn else {}
            made.append(rate(chart, values, samples, subject=self.name))
        return tuple(made)

    def __repr__(self) -> str:
        """Kind, pair and mismatch on one line."""
        return f"LowerOrder({self.kind}, {self.name}, mismatch {self.mismatch_cost:.1f})"

    def summary(self, *, level: float | None = None) -> Table:
        """Table of the numbers with intervals at a level."""
        level = shown(level)
        low, high = self.band_rad_s
        inside = self.mismatch.inside_percent[0]
        notes = [
            str(self.model.responses[0]),
            f"Mismatch cost {self.mismatch_cost:.3g} between {low:.3g} and {high:.3g} rad/s "
            "(guide: at most 10).",
        ]
        if inside is not None:
            notes.append(f"{inside:.0f} % inside the envelopes of unnoticed added dynamics.")
        title = f"{structure_of(self.kind).title}: equivalent system of {self.name}"
        return estimate_table(
            title, self.quantities, (*notes, *map(str, self.findings)), level=level
        )

    def _computed(self) -> dict[str, object]:
        return {
            "model": self.model,
            "quantities": {each.name: each for each in self.quantities},
        }


DERIVED = (
    ("T_theta2", "T_θ2", "s"),
    ("decay", "ζω", "rad/s"),
    ("time_to_double", "time to double of the spiral", "s"),
    ("n_alpha", "n/α", "g/rad"),
    ("cap", "control anticipation parameter", "1/(g s²)"),
)


def _derived_quantity(
    label: str, value: float, unit: str, drawn: Array | None, reason: str
) -> Reading:
    if not np.isfinite(value):
        return Estimate(label, None, unit, None, "the spiral is stable and never doubles")
    if drawn is None:
        return Estimate(label, value, unit, None, reason)
    return drawn_estimate(label, value, unit, drawn, LOST, "inverted_cdf")

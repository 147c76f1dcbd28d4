"""The level of an estimate, and how sure it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Light
from flightid.dynamics.handling_qualities.rating_charts import RatingChart
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.uneven import drawn_estimate

DRAWS = 4000
DOUBT = 0.025
"""Probability of a level above which it is named: the share beyond one end of a 95 % interval."""
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Rating:
    """Level of one estimate on one chart.

    Attributes
    ----------
    chart : RatingChart
    values : mapping of str to float
        The estimate, by the chart's quantities.
    level : int
        At the estimate; one more than the chart has levels where none holds.
    probabilities : tuple of float, or None
        Of level 1, 2, … and of none of them; None where the estimate has no covariance.
    at_best : bool
        The estimate lies beyond the stored part of a boundary: the level may be worse.
    samples : mapping of str to ndarray
        Draws of the quantities, for pictures; empty where there is no covariance.
    subject : str
        What was rated, for example ``"phi/lat"``.

    Example
    -------
    >>> from flightid.dynamics.handling_qualities.rating_charts_reading import rating_chart
    >>> chart = rating_chart("equivalent_delay")
    >>> rating = rate(chart, {"delay": 0.095}, {"delay": np.linspace(0.085, 0.105, 400)})
    >>> rating
    Rating(Equivalent time delay: Level 1–2)
    >>> rating.probabilities[:2]
    (0.75, 0.25)
    """

    chart: RatingChart
    values: Mapping[str, float]
    level: int
    probabilities: tuple[float, ...] | None
    at_best: bool = False
    samples: Mapping[str, Array] = field(default_factory=dict)
    subject: str = ""

    @property
    def possible(self) -> tuple[int, ...]:
        """Levels that the 95 % interval does not rule out, best first."""
        if self.probabilities is None:
            return (self.level,)
        likely = {place + 1 for place, share in enumerate(self.probabilities) if share > DOUBT}
        return tuple(sorted(likely | {self.level}))

    @property
    def text(self) -> str:
        """For example ``"Level 1"``, ``"Level 1–2"``, ``"at best Level 2"``."""
        levels, inside = self.possible, len(self.chart.regions)
        best, worst = levels[0], levels[-1]
        if best == worst:
            words = self.chart.level_name(best)
        elif worst <= inside:
            words = f"Level {best}–{worst}"
        else:
            words = f"{self.chart.level_name(best)} or worse"
        return f"at best {words}" if self.at_best else words

    @property
    def quantities(self) -> tuple[Reading, ...]:
        """The chart's quantities with their 95 % intervals."""
        return tuple(
            _quantity(self.chart, name, value, self.samples.get(name))
            for name, value in self.values.items()
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The level as a verdict."""
        light = Light.AMBER
        if self.possible == (1,) and not self.at_best:
            light = Light.GREEN
        elif self.level > 2 or self.level > len(self.chart.regions):
            light = Light.RED
        shown = ", ".join(f"{each.name} {_shown(each)}" for each in self.quantities)
        subject = f"{self.subject}: " if self.subject else ""
        text = f"{subject}{self.text} by {self.chart.standard} ({self.chart.title}; {shown})"
        action = "" if self.possible == (1,) else _advice(self)
        return (Finding(f"level-{self.chart.key.replace('_', '-')}", light, text, action),)

    def __repr__(self) -> str:
        """Chart and level on one line."""
        return f"Rating({self.chart.title}: {self.text})"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "chart": self.chart.to_dict(),
            "subject": self.subject,
            "values": {
                name: value if np.isfinite(value) else None for name, value in self.values.items()
            },
            "level": self.level,
            "text": self.text,
            "probabilities": None if self.probabilities is None else list(self.probabilities),
            "at_best": self.at_best,
        }


def rate(
    chart: RatingChart,
    values: Mapping[str, float],
    samples: Mapping[str, ArrayLike] | None = None,
    *,
    subject: str = "",
) -> Rating:
    """Level of an estimate on a chart, with the probability of each.

    Parameters
    ----------
    chart : RatingChart
    values : mapping of str to float
        The estimate, by quantity; those that the chart does not need are passed over.
    samples : mapping of str to array_like, optional
        Draws of the quantities together, shape (n,) each.
    subject : str
        What is rated.

    Raises
    ------
    DataError
        A value that is not a number.
    UnknownNameError
        A quantity of the chart is missing.

    Example
    -------
    >>> from flightid.dynamics.handling_qualities.rating_charts_reading import rating_chart
    >>> rate(rating_chart("phugoid"), {"damping": 0.02, "time_to_double": np.inf}).text
    'Level 2'
    """
    needed = {name: float(values[name]) for name in chart.labels if name in values}
    if any(np.isnan(value) for value in needed.values()):
        raise DataError(f"{chart.title}: a value is not a number", found=needed)
    point = {name: np.array([value]) for name, value in needed.items()}
    level = int(chart.levels(point)[0])
    drawn = {
        name: np.asarray(samples[name], dtype=np.float64)
        for name in chart.labels
        if samples is not None and name in samples
    }
    shares = None
    if drawn:
        found = chart.levels(drawn)
        shares = tuple(float(np.mean(found == k)) for k in range(1, len(chart.regions) + 2))
    at_best = not bool(chart.within(point)[0])
    return Rating(chart, needed, level, shares, at_best, drawn, subject)


def normal_draws(values: ArrayLike, covariance: ArrayLike | None, seed: int = 0) -> Array | None:
    """Seeded draws of a normal estimate, shape (k, n); None without a covariance of all of it."""
    if covariance is None or not np.all(np.isfinite(covariance)):
        return None
    centre = np.asarray(values, dtype=np.float64)
    sizes, directions = np.linalg.eigh(np.asarray(covariance, dtype=np.float64))
    factor = directions * np.sqrt(np.maximum(sizes, 0.0))
    noise = np.random.default_rng(seed).standard_normal((len(centre), DRAWS))
    return np.asarray(centre[:, None] + factor @ noise)


def _quantity(chart: RatingChart, name: str, value: float, drawn: Array | None) -> Reading:
    label, unit = chart.labels[name], chart.units[name]
    if not np.isfinite(value):
        return Estimate(label, None, unit, None, "without end")
    if drawn is None:
        return Estimate(label, value, unit, None, "no covariance")
    return drawn_estimate(
        label, value, unit, drawn, "without end within its uncertainty", "inverted_cdf"
    )


def _shown(quantity: Reading) -> str:
    if quantity.value is None:
        return quantity.reason
    return f"{quantity.value:.3g}" + (f" {quantity.unit}" if quantity.unit != "1" else "")


def _advice(rating: Rating) -> str:
    if rating.at_best:
        return "give the whole boundary in a chart file of your own"
    if len(rating.possible) > 1:
        return "the 95 % interval crosses a boundary: more data, or count on the worse level"
    return rating.chart.doubt

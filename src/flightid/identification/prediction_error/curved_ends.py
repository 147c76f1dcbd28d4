"""How far the cost of an output error lets each coefficient go, where it is no parabola.

Bars to first order take the errors of the fit for linear in the coefficients. Those of F bend them:
over the bars of a short record the errors turn away from their slopes, and the cost rises slower on
one side. Both ends are then looked for on the cost itself, the other coefficients fitted again.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.prediction_error.coloured_errors import answers
from flightid.identification.prediction_error.part_blocks import errors_at
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.estimate import Estimate, Interval

Array = NDArray[np.float64]
BENT = 0.2
"""Share of a bar's length, in standard errors, that errors bend over it from which ends are sought:
below it ends lie within some percent of those to first order."""
SAID, FAR = 1.5, 2.0
"""Times a bar to first order from which the bend is worth a word, and is amber."""
FARTHEST = 4.0
"""Times a bar to first order within which an end is sought."""
STEPS, REFITS, NEAR = 6, 4, 0.03
"""Secant steps towards an end, Gauss-Newton steps of the others in each, and how near is enough."""
RUNAWAY = 1e6
"""Times the output that errors, and times its start that a mode in a record, may grow to."""
HALVINGS, SETTLED = 4, 1e-3
"""Of a step that raises the cost; and how many of a sample's squares a step gains that ends it."""
ENDLESS = (
    "the cost sets no end to a coefficient within four bars to first order: its bar stops there"
)


@dataclass(frozen=True)
class CurvedEnds:
    """Ends that the cost sets, at other levels by bends in proportion to the distance.

    Attributes
    ----------
    even : Estimate
        With its value and its bars to both sides alike.
    below, above : float
        Distance of the 95 % ends over that of the even ones.

    Example
    -------
    >>> round(CurvedEnds(Estimate("f1", 0.0, "1", 1.0), 1.0, 1.5)(0.95)[1], 2)
    2.94
    """

    even: Estimate
    below: float
    above: float

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        half, usual = self.even.half(level), self.even.half()
        if half is None or usual is None:
            return None
        low, high = (1.0 + half / usual * (side - 1.0) for side in (self.below, self.above))
        return self.even.value - half * low, self.even.value + half * high


def curve_findings(reach: Array | None) -> list[Finding]:
    """What the cost makes of bars to first order: a note, amber from twice their length on.

    Parameters
    ----------
    reach : ndarray, shape (n, 2), or None
        Of `reaches`.

    Example
    -------
    >>> curve_findings(None)
    []
    """
    action = "take longer records or more amplitude, or lower the order"
    most = 1.0 if reach is None else float(np.max(reach))
    if most >= FARTHEST:
        return [Finding("curved-cost", Light.AMBER, ENDLESS, action)]
    if most < SAID:
        return []
    said = (
        f"the cost is no parabola over the bars: intervals of coefficients reach up to {most:.2g} "
        "times as far as to first order; those of poles and gains are longer by the mean of all"
    )
    if most < FAR:
        return [Finding("curved-cost", Light.GREEN, said)]
    return [Finding("curved-cost", Light.AMBER, said, action)]


@dataclass(frozen=True, eq=False)
class _Cost:
    """Errors of a structure on records, and their slopes; both in units of the errors' size."""

    structure: PolynomialStructure
    data: SampledChannels
    memory: list[list[float]]
    skip: int

    def errors(self, theta: Array) -> Array | None:
        """Errors of all samples, records after records; None where the model runs away."""
        counts = np.cumsum([*self.structure.nb, *self.structure.degrees_of_f])
        longest = max(self.data.lengths)
        for below in np.split(theta, counts[:-1])[len(self.structure.nb) :]:
            fastest = float(np.max(np.abs(np.roots([1.0, *below])), initial=0.0))
            if longest * math.log(max(fastest, 1.0)) > math.log(RUNAWAY):
                return None
        found = errors_at(self.structure, self.data, self.memory, theta)
        most = RUNAWAY * float(np.max(np.abs(self.data.output)))
        return found if np.isfinite(found).all() and np.max(np.abs(found)) < most else None

    def counted(self, errors: Array) -> Array:
        """Errors that count."""
        return np.concatenate([errors[span][self.skip :] for span in self.data.spans])

    def squares(self, errors: Array | None) -> float:
        """Sum of squares that count; infinite where the model runs away."""
        if errors is None:
            return math.inf
        rows = self.counted(errors)
        return float(rows @ rows)

    def slopes(self, theta: Array, errors: Array) -> Array:
        """How outputs answer to coefficients, beside what each record fits of its own."""
        # `answers` are in units of the root mean square of all errors.
        size = math.sqrt(errors @ errors / errors.size)
        blocks = [
            RecordBlock.of(shared[None], own[None], rest[None])
            for shared, own, rest in answers(self.structure, self.data, theta, errors, self.skip)
        ]
        return size * np.concatenate([each.projected.reshape(-1, theta.size) for each in blocks])


def reaches(
    structure: PolynomialStructure,
    data: SampledChannels,
    theta: Array,
    memory: list[list[float]],
    skip: int,
    bars: Array,
) -> Array | None:
    """How far ends lie that the cost sets, over those to first order; None where it is a parabola.

    An end is where the cost, the other coefficients fitted again, has risen by as much as it would
    at the bar's end to first order. Colour and whatever else made bars longer stay in them.

    Parameters
    ----------
    structure : PolynomialStructure
        An output error: no A, C, D.
    data : SampledChannels
    theta : ndarray, shape (n,)
        Estimates, at a minimum of the cost.
    memory : list of list of float
        The past of each record, where it was given.
    skip : int
        First errors of each record that do not count.
    bars : ndarray, shape (n,)
        Half widths of the 95 % intervals to first order.

    Returns
    -------
    ndarray, shape (n, 2), or None
        Below and above, at least one; infinite where no end is found within `FARTHEST` bars.

    Reference
    ---------
    Bates & Watts (1988), *Nonlinear Regression Analysis and Its Applications*, section 6.1
    (profile t functions).
    """
    cost = _Cost(structure, data, memory, skip)
    errors = cost.errors(theta)
    if errors is None or not cost.squares(errors) > 0.0:
        return None
    slopes = cost.slopes(theta, errors)
    back = np.linalg.pinv(slopes)
    known = back @ back.T
    paths = known / np.diag(known)
    # Of the cost's root at each bar's end to first order.
    rises = bars / np.sqrt(np.diag(known))
    sides = [_sides(cost, theta, bars[i] * paths[:, i]) for i in range(theta.size)]
    bends = [_bend(cost, pair, errors) / rises[i] for i, pair in enumerate(sides)]
    if max(bends) < BENT:
        return None
    found = np.ones((theta.size, 2))
    for i in np.flatnonzero(np.array(bends) >= BENT):
        costs = [cost.squares(each) for each in sides[i]]
        # Where the cost rises slower on one side it rises faster on the other.
        for side in np.argsort(costs):
            step = (2.0 * side - 1.0) * bars[i] * paths[:, i]
            found[i, side] = max(1.0, _reach(cost, theta, int(i), step, rises[i]))
            if found[i, side] > 1.0:
                break
    return found


def _sides(cost: _Cost, theta: Array, step: Array) -> tuple[Array | None, Array | None]:
    """Errors a step below and above."""
    return cost.errors(theta - step), cost.errors(theta + step)


def _bend(cost: _Cost, sides: tuple[Array | None, Array | None], errors: Array) -> float:
    """Size of what errors on both sides have in common: none where they are linear."""
    below, above = sides
    if below is None or above is None:
        return math.inf
    rows = cost.counted(below + above - 2.0 * errors) / 2.0
    return float(np.sqrt(rows @ rows))


def _reach(cost: _Cost, theta: Array, place: int, step: Array, wanted: float) -> float:
    """Steps at which the cost, with this coefficient held, has risen by a square."""
    least = cost.squares(cost.errors(theta))
    at, moved, last, height = 1.0, theta + step, 0.0, 0.0
    for _ in range(STEPS):
        moved, squares = _refitted(cost, moved, place)
        risen = math.sqrt(max(squares - least, 0.0))
        if abs(risen - wanted) <= NEAR * wanted:
            return at
        if not math.isfinite(risen) or risen <= height * (at > last):
            return math.inf
        ahead = at + (wanted - risen) * (at - last) / (risen - height)
        ahead = min(ahead, 2.0 * at)
        if not 0.0 < ahead <= FARTHEST:
            return math.inf
        last, height, moved, at = at, risen, moved + (ahead - at) * step, ahead
    return at


def _refitted(cost: _Cost, theta: Array, place: int) -> tuple[Array, float]:
    """The other coefficients fitted again, by slopes at the beginning, and the sum of squares."""
    others = np.arange(theta.size) != place
    errors = cost.errors(theta)
    squares = cost.squares(errors)
    if errors is None or not math.isfinite(squares):
        return theta, squares
    slopes = cost.slopes(theta, errors)
    gain = np.zeros((theta.size, len(slopes)))
    gain[others] = np.linalg.pinv(slopes[:, others])
    for _ in range(REFITS):
        change = gain @ cost.counted(errors)
        for halving in range(HALVINGS):
            moved = theta + 0.5**halving * change
            there = cost.errors(moved)
            below = cost.squares(there)
            if there is not None and below < squares:
                break
        else:
            return theta, squares
        fallen, theta, errors, squares = squares - below, moved, there, below
        if fallen < SETTLED * squares / len(slopes):
            break
    return theta, squares

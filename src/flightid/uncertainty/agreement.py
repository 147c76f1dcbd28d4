"""Whether parts of the data agree on one estimate, and the bars that follow where they do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.parts import (
    RecordParts,
    chance_alike,
    chance_where_seen,
    larger,
    scatter,
    told_alone,
)
from flightid.uncertainty.quantiles import LEVEL, half_width
from flightid.uncertainty.unseen_scatter import ComparedRecords, compared_records

Array = NDArray[np.float64]
FALSE_ALARM = 0.005
"""Share of sound data that fails each of the two tests: halves, and records."""
CERTAIN = 1.0 - 1e-15
"""Chance that counts as certain: its complement has a logarithm."""
DOUBT = 0.1
"""Chance below which scatter between records is carried on: what is not proven may be there."""
TELLING = 2.0
"""Degrees of freedom from which scatter in doubt has its own: below, towards a pair or where one
record tells most, Student's interval is up to 6.5 times as long, and gives way to the noise's."""
AS_LONG = 1e-9
"""Share by which lengths may differ by rounding."""
FEWEST_RECORDS = 3
"""Records whose scatter tells enough of the others for their mean to be used."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """What parts of the data say of each other.

    Attributes
    ----------
    n_records : int
    halves, records : float or None
        Chance that halves of the records, and records, of one vehicle differ by as much; None
        where that cannot be tested.
    by_noise : ndarray, shape (n,)
        Standard errors of the estimates by the noise within records.
    by_scatter : ndarray, shape (n,), or None
        Standard errors by how far the parts lie apart; None where nothing speaks for that.
    freedom : ndarray, shape (n,), or None
        Degrees of freedom of `by_scatter`; None for halves.
    told_once : int
        Estimates that one of several records tells alone, so that nothing is compared.
    reach : ndarray, shape (2, n), or None
        Half-widths of 95 % intervals by the noise within records, and as they stand; None where
        nothing is carried on.
    compared : ComparedRecords or None
        What tells scatter that records do not show; None where they are not compared.

    Example
    -------
    >>> Agreement(1, 0.2, None, np.ones(1)).agree
    True
    """

    n_records: int
    halves: float | None
    records: float | None
    by_noise: Array
    by_scatter: Array | None = None
    freedom: Array | None = None
    told_once: int = 0
    reach: Array | None = None
    compared: ComparedRecords | None = None

    @property
    def tested(self) -> bool:
        """Whether any parts could be compared."""
        return self.halves is not None or self.records is not None

    @property
    def agree(self) -> bool:
        """Whether all parts that were compared agree."""
        return not (self.halves_differ or self.records_differ)

    @property
    def halves_differ(self) -> bool:
        """Whether halves of a record differ by more than their noise."""
        return _differ(self.halves)

    @property
    def records_differ(self) -> bool:
        """Whether records differ by more than their noise."""
        return _differ(self.records)

    @property
    def factor(self) -> float:
        """Largest ratio of a 95 % interval, as it stands, to that by noise; one at least."""
        if self.reach is None:
            return 1.0
        return float(max(1.0, np.max(self.reach[1] / self.reach[0], initial=1.0)))

    def apart_percent(self, values: Array) -> float | None:
        """How far the parts lie apart: 95 % half-width, as it stands, over the estimate, percent.

        The largest among estimates that noise alone tells from zero, and whose bar at least
        doubles; zero where there is none, None where no scatter is carried on.

        Example
        -------
        >>> reach = np.array([[0.02, 0.02], [0.1, 0.02]])
        >>> apart = Agreement(1, 1e-6, None, np.array([0.01, 0.01]), reach=reach)
        >>> round(apart.apart_percent(np.array([-5.0, 1.0])), 1)
        2.0
        """
        if self.reach is None:
            return None
        noise, stated = self.reach
        size = np.maximum(np.abs(values), np.finfo(float).tiny)
        counts = (size > noise) & (stated > 2.0 * noise)
        return float(np.max(100.0 * stated / size, where=counts, initial=0.0))

    def without_bars(self) -> Agreement:
        """What parts say of each other; what their scatter does to bars goes with the bars."""
        return replace(self, by_scatter=None, freedom=None, reach=None)

    def of(self, count: int) -> Agreement:
        """The same of the first parameters alone."""
        return Agreement(
            self.n_records,
            self.halves,
            self.records,
            self.by_noise[:count],
            None if self.by_scatter is None else self.by_scatter[:count],
            None if self.freedom is None else self.freedom[:count],
            min(self.told_once, count),
            None if self.reach is None else self.reach[:, :count],
            None if self.compared is None else self.compared.of(count),
        )

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "n_records": self.n_records,
            "halves_p": self.halves,
            "records_p": self.records,
            "stderr_by_noise": self.by_noise.tolist(),
            "stderr_by_scatter": None if self.by_scatter is None else self.by_scatter.tolist(),
            "freedom_of_scatter": None if self.freedom is None else self.freedom.tolist(),
            "factor": self.factor,
            "told_once": self.told_once,
        }


def _differ(chance: float | None) -> bool:
    return chance is not None and chance < FALSE_ALARM


@dataclass(frozen=True, eq=False)
class AgreementTest:
    """Covariance and degrees of freedom that stand after parts were compared.

    `growth` is how many times as long standard errors are as by noise of one power throughout,
    where errors were found to grow with the signal.
    """

    covariance: Array
    freedom: Array
    agreement: Agreement
    growth: Array | None = None

    @property
    def most_growth(self) -> float:
        """The largest growth; one where there is none."""
        return 1.0 if self.growth is None else float(np.max(self.growth, initial=1.0))


def compare_parts(
    flights: Sequence[RecordParts],
    solve: Array,
    covariance: Array,
    freedom: Array,
    rest: RecordParts | None = None,
    *,
    by_halves: bool = True,
    by_records: bool = True,
) -> AgreementTest:
    """Test halves and records against their noise; carry on the larger covariance.

    Parameters
    ----------
    flights : sequence of RecordParts
        Records with two halves each.
    solve : ndarray, shape (n, n)
        What turns scores into changes of the estimates.
    covariance : ndarray, shape (n, n)
        By the noise within records.
    freedom : ndarray, shape (n,)
        Degrees of freedom of its diagonal.
    rest : RecordParts, optional
        One more part that is neither compared nor halved: what was fitted beside the records.
    by_halves, by_records : bool
        Whether the noise of halves, and of records, is known well enough to compare them.

    Returns
    -------
    AgreementTest
        With several records that differ: covariance by leaving out one after the other, where it
        is larger, and Student's degrees of freedom. With halves that differ: by leaving out halves.

    Assumes
    -------
    Records of vehicles drawn from one fleet, whose mean is asked. One record does not tell how far
    flights differ.
    """
    whole = [flight.whole for flight in flights]
    level = float(np.median(freedom)) if len(freedom) else np.inf
    by_records = by_records and len(whole) > 1
    compared = flights if by_halves else ()
    halves = _combined([chance_alike([flight], level) for flight in compared])
    records = chance_where_seen(whole, level) if by_records else None
    once = int(np.sum(told_alone(whole, solve, covariance))) if by_records else 0
    by_noise = np.sqrt(np.diag(covariance))
    apart = None if records is None else compared_records(whole, solve, covariance)
    plain = Agreement(len(flights), halves, records, by_noise, told_once=once, compared=apart)
    if plain.agree and not (records is not None and records < DOUBT):
        return AgreementTest(covariance, freedom, plain)
    parts = whole if by_records else _halved(flights[0])
    found = scatter([*parts, *([] if rest is None else [rest])], solve, covariance)
    lies = np.sqrt(np.diag(found.covariance))
    student = found.freedom if by_records else None
    if student is not None and not _differ(records):
        student = _in_doubt(student, freedom)
    both = larger(covariance, found.covariance)
    stderr = np.sqrt(np.diag(both))
    stated = freedom if student is None else _of_wider(stderr, freedom, lies, student)
    reach = np.array([_lengths(by_noise, freedom), _lengths(stderr, stated)])
    agreement = replace(plain, by_scatter=lies, freedom=student, reach=reach)
    return AgreementTest(both, stated, agreement)


def _in_doubt(student: Array, freedom: Array) -> Array:
    """Degrees of freedom of scatter that may be noise's: below two they rise to those of noise.

    Bars reach as far as records lie apart; how far they should, noise tells better than one pair.
    In steps of 1/f between the two: weights that differ by a hair from those of three records alike
    change nothing at once.
    """
    share = np.clip((student - 1.0) / (TELLING - 1.0), 0.0, 1.0)
    with np.errstate(divide="ignore"):  # Noise that is known has freedom without end.
        eased = 1.0 / (share / TELLING + (1.0 - share) / freedom)
    return np.where(student < TELLING, np.maximum(student, eased), student)


def _lengths(stderr: Array, freedom: Array) -> Array:
    """Half-widths of 95 % intervals."""
    return np.array(
        [half_width(LEVEL, f) * s for s, f in zip(stderr, map(float, freedom), strict=True)]
    )


def _combined(chances: Sequence[float | None]) -> float | None:
    """Least chance of several independent tests, for their number (Šidák)."""
    known = [each for each in chances if each is not None]
    return None if not known else float(-np.expm1(len(known) * np.log1p(-min(*known, CERTAIN))))


def _halved(flight: RecordParts) -> list[RecordParts]:
    return [
        RecordParts(
            flight.scores[k : k + 1],
            flight.information[k : k + 1],
            flight.noise[k : k + 1, :, k : k + 1],
        )
        for k in range(len(flight.scores))
    ]


def _of_wider(stderr: Array, freedom: Array, apart: Array, student: Array) -> Array:
    """Degrees of freedom with which errors reach as far as they do by noise, or as scatter does.

    Student's factor is of the scatter alone: noise beside it is known as well as before.
    """
    wanted = _lengths(apart, student) / stderr
    return np.array(
        [
            _freedom_of(float(width), float(least), float(most))
            for width, least, most in zip(wanted, student, freedom, strict=True)
        ]
    )


def _freedom_of(width: float, least: float, most: float) -> float:
    """Degrees of freedom of a half-width in standard errors, between two."""
    if most <= least or width >= half_width(LEVEL, least) * (1.0 - AS_LONG):
        return least
    if width <= half_width(LEVEL, most):
        return most
    low, high = 1.0 / most, 1.0 / least
    while high - low > AS_LONG * high:
        middle = 0.5 * (low + high)
        if half_width(LEVEL, 1.0 / middle) < width:
            low = middle
        else:
            high = middle
    return 2.0 / (low + high)

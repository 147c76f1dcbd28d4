"""The nearest simpler structure of a black box whose orders are too high for errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.identify import identify
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.polynomial.structure import PolynomialStructure

MOST_LEFT_OUT = 3
"""Poles that are left out at most: a structure further off is another question."""
NO_WORSE = 1.02
"""Ratio of free-run errors on the records of the fit that chance explains."""
CLEAR = 6.0
"""Gain of AICc that says a structure is better: odds of 1 to 20."""
OTHER_CAUSES = ("errors-not-white", "inputs-in-errors", "nothing-told", "not-refined")
"""Findings of fits whose errors fewer coefficients do not give back."""
Structure = PolynomialStructure | SubspaceStructure


@dataclass(frozen=True, eq=False)
class SimplerFit:
    """A fit whose errors are known in place of one whose errors are not.

    Attributes
    ----------
    fit : Fit
    reason : str
        Which structure was taken, in place of which, and why.
    """

    fit: Fit
    reason: str


def simpler_fit(fit: Fit) -> SimplerFit | None:
    """The nearest simpler structure that has a covariance and predicts as well; None without one.

    Where an order is too high a pole and a zero lie at the same place, which the data leave open:
    the first-order covariance of such coefficients means nothing, and there is none. With the pair
    left out the others are as well known as if it had never been asked for.

    Parameters
    ----------
    fit : Fit
        Of a polynomial or subspace structure; of any other there is nothing simpler here.

    Returns
    -------
    SimplerFit or None
        With the fewest poles left out, at most three. Its inputs foretell no errors, its evidence
        is not red, and on the records of the fit its AICc is at most 6 above, or its free run errs
        by at most 2 % more. None where the fit has its covariance, where its errors say that
        dynamics are missing, or where no structure qualifies.

    Assumes
    -------
    The mode that is left out is not in the vehicle, or not in its answer to these inputs: data with
    other inputs may show it. Intervals do not hold what choosing among a few structures adds.

    Reference
    ---------
    Söderström & Stoica, *System Identification* (1989), sections 6.4 and 11.5 (parsimony; loss of
    identifiability where all polynomials share a factor).

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> r = np.random.default_rng(4)
    >>> u, y = np.repeat(r.choice([-1.0, 1.0], 200), 5), np.zeros(1000)
    >>> for k in range(1, 1000):
    ...     y[k] = 0.7 * y[k - 1] + 0.3 * u[k - 1]
    >>> y += 0.03 * r.standard_normal(1000)
    >>> record = fid.Record.from_arrays(np.arange(1000) / 10, inputs={"u": u},
    ...                                 outputs={"y": y}, hold="zero")
    >>> rich = fid.identify(fid.PolynomialModel.oe("u", "y", nb=2, nf=2), record)
    >>> rich.covariance is None
    True
    >>> simpler_fit(rich).fit.structure
    PolynomialStructure(OE, 'y' from u, nb 1, nf 1, nk 1)
    """
    if fit.carried is not None or not fit.records:
        return None
    if any(each.code in OTHER_CAUSES for each in fit.findings):
        return None
    asked = _asked(fit)
    if asked is None:
        return None
    records = [each.measured for each in fit.records]
    told: dict[str, Any] = dict(fit.provenance.get("told", {}))  # type: ignore[call-overload]
    for structure in _simpler(asked):
        try:
            made = identify(structure, records, **told)
        except FlightidError:
            continue
        if _serves(made, fit):
            return SimplerFit(made, _reason(asked, structure, fit))
    return None


def _asked(fit: Fit) -> Structure | None:
    """Structure of the fit, its order as the data chose it."""
    if isinstance(fit.structure, SubspaceStructure):
        return replace(fit.structure, order=int(fit.model.order))
    return fit.structure if isinstance(fit.structure, PolynomialStructure) else None


def _simpler(asked: Structure) -> Iterator[Structure]:
    """Structures with fewer coefficients, those that leave out fewest poles first."""
    if isinstance(asked, SubspaceStructure):
        states = asked.order or 1
        for order in range(states - 1, max(states - 1 - MOST_LEFT_OUT, 0), -1):
            yield replace(asked, order=order)
        return
    level = [asked]
    for _ in range(MOST_LEFT_OUT):
        level = list(dict.fromkeys(fewer for each in level for fewer in _poles_fewer(each)))
        yield from level
    yield from _noise_fewer(asked)


def _poles_fewer(asked: PolynomialStructure) -> Iterator[PolynomialStructure]:
    """One pole fewer in A or in F, with its zeros in all that it multiplies."""
    bare = replace(asked, start=())
    if asked.na > 1 and min(asked.nb) > 1:
        nb = tuple(count - 1 for count in asked.nb)
        yield replace(bare, na=asked.na - 1, nb=nb, nc=max(asked.nc - 1, 0))
    places = [range(len(asked.nf))] if asked.is_common else [[k] for k in range(len(asked.nf))]
    for which in places:
        if all(asked.nf[k] > 1 and asked.nb[k] > 1 for k in which):
            nb = tuple(count - (k in which) for k, count in enumerate(asked.nb))
            nf = tuple(count - (k in which) for k, count in enumerate(asked.nf))
            yield replace(bare, nb=nb, nf=nf)


def _noise_fewer(asked: PolynomialStructure) -> Iterator[PolynomialStructure]:
    """The vehicle as it was asked for, with less of a noise model."""
    bare = replace(asked, start=())
    if asked.nc:
        yield replace(bare, nc=asked.nc - 1)
    if asked.nd > 1 or (asked.nd and asked.nc):
        yield replace(bare, nd=asked.nd - 1)


def _serves(made: Fit, rich: Fit) -> bool:
    """Whether its errors are known and its free run is as good."""
    if made.carried is None or any(each.code in OTHER_CAUSES for each in made.findings):
        return False
    return _predicts_as_well(made, rich) and made.evidence.light is not Light.RED


def _predicts_as_well(made: Fit, rich: Fit) -> bool:
    """Whether free runs err alike, or the information criterion does not miss what was left out.

    Where a noise model is too small the richer structure gains by describing noise; where noise is
    slow a spare pole follows it in free run. What the vehicle lacks is seen by both.
    """
    least, known = (each.details.criteria.aicc for each in (rich, made))
    if None not in (least, known) and known <= least + CLEAR:
        return True
    ours, theirs = _free_run(made), _free_run(rich)
    return all(ours[name] <= NO_WORSE * theirs[name] for name in theirs)


def _free_run(fit: Fit) -> dict[str, float]:
    """Sum of squared free-run errors on the records of the fit, by output, as a root."""
    errors = {
        name: [each.residual(name) for each in fit.records] for name in fit.records[0].outputs
    }
    return {name: sum(float(e @ e) for e in rows) ** 0.5 for name, rows in errors.items()}


def _reason(asked: Structure, taken: Structure, fit: Fit) -> str:
    return (
        f"{taken.kind} with {taken.orders_text} in place of {asked.orders_text}, whose errors are "
        f"not known ({fit.withheld}); it predicts the records of the fit as well"
    )

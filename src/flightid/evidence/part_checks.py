"""Whether parts of the data agree: the light of a comparison of halves and records."""

from __future__ import annotations

from dataclasses import replace

from flightid.conventions import Light
from flightid.evidence.evidence import AGREEMENT, Check
from flightid.uncertainty.agreement import FEWEST_RECORDS, Agreement

ONE = "One record does not tell how far flights differ: what is known is of that flight alone"
HALVES_ACTION = (
    "do not use one set of numbers: look for a vehicle, trim or wind that changed, for a faulty "
    "stretch, or for dynamics that the model lacks, and fit the parts by themselves"
)
RECORDS_ACTION = (
    "the estimates are of the mean vehicle: fit the records by themselves and look for what sets "
    "them apart (mass, trim, condition)"
)


def agreement_check(found: Agreement) -> Check:
    """The light of a comparison.

    Red where halves of a record differ, or two records do. Amber where three or more records
    differ: their scatter tells how well the mean of such vehicles is known.

    Example
    -------
    >>> import numpy as np
    >>> check = agreement_check(Agreement(1, 0.4, None, np.ones(1)))
    >>> print(check.finding)
    [green] halves of the record agree (p = 0.4)
    >>> check.limit
    'One record does not tell how far flights differ: what is known is of that flight alone'
    """
    return replace(_compared(found), limit="" if found.n_records > 1 else ONE)


def _compared(found: Agreement) -> Check:
    if not found.tested:
        what = (
            "parts of the data cannot be compared: no two hold the same frequencies and parameters"
        )
        return Check(AGREEMENT, Light.UNKNOWN, what, "fly longer, or repeat the manoeuvre")
    several = found.n_records > 1
    widened = ""
    if found.factor > 1.0:
        apart = "intervals are widened by how far they lie apart"
        widened = f"; {apart}, up to {found.factor:.2g} times"
    if found.agree:
        return Check(AGREEMENT, Light.GREEN, _alike(found) + widened)
    if found.halves_differ:
        whose = "a record" if several else "the record"
        what = f"halves of {whose} differ by more than noise (p = {found.halves:.2g}){widened}"
        return Check(AGREEMENT, Light.RED, what, HALVES_ACTION)
    what = f"{found.n_records} records differ by more than noise (p = {found.records:.2g}){widened}"
    light = Light.AMBER if found.n_records >= FEWEST_RECORDS else Light.RED
    return Check(AGREEMENT, light, what, RECORDS_ACTION)


def _alike(found: Agreement) -> str:
    tests = []
    if found.records is not None:
        tests.append(f"{found.n_records} records agree (p = {found.records:.2g})")
    if found.halves is not None:
        whose = "each record" if found.n_records > 1 else "the record"
        tests.append(f"halves of {whose} agree (p = {found.halves:.2g})")
    return "; ".join(tests)

"""Whether parts of the data agree: the light of a comparison of halves and records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.evidence.evidence import AGREEMENT, Check
from flightid.uncertainty.agreement import FEWEST_RECORDS, Agreement
from flightid.uncertainty.foretold import MATERIAL_PERCENT
from flightid.uncertainty.unseen_scatter import FLOWN_APART, UnseenScatter

ONE = "One record does not tell how far flights differ: what is known is of that flight alone"
ALONE = (
    "{} of {} estimates are told by one record alone, and known of that flight: repeat each "
    "manoeuvre to show whether flights differ"
)
DOUBT = (
    "{} records agree, but not beyond doubt (p = {:.2g}): intervals are up to {:.2g} times as long "
    "as by noise alone"
)
UNSEEN = (
    "{} records agree, as {} of 100 such sets of flights {:.2g} % apart would: what is known is of "
    "these flights alone, and intervals of their kind would be up to {:.2g} times as long"
)
EXCLUDED = 0.05
"""Chance below which records as alike as these are not of flights that differ."""
HIDDEN = 1.1
"""Factor of bars that scatter would ask for, from which it is said: they would hold 93 %."""
DOUBLED = 2.0
"""The same from which the light is amber: they would hold 67 %."""
SHOWN = 1.05
"""Factor from which longer bars are said."""
ONCE = "flown once: nothing shows whether a second flight would agree"
AGAIN = "repeat the manoeuvre in a second record or segment"
ALL_AGAIN = "repeat what moves all inputs, and hand in each repetition as one record or segment"
HALVES_ACTION = (
    "do not use one set of numbers: look for a vehicle, trim or wind that changed, for a faulty "
    "stretch, or for dynamics that the model lacks, and fit the parts by themselves"
)
UNSEEN_ACTION = (
    "fly the manoeuvre once or twice more, or take the intervals as those of these flights alone"
)
RECORDS_ACTION = (
    "the estimates are of the mean vehicle: fit the records by themselves and look for what sets "
    "them apart (mass, trim, condition)"
)
DISTURBED = "; noise on the states, which the residuals hold, makes parts differ so by itself"
DISTURBED_ACTION = "compare parts by a method that knows that noise (method='filter_error')"


LOOPED = "; the closed loop bends each by its own noise, which alone may set them apart"


def agreement_check(
    found: Agreement,
    values: NDArray[np.float64] | None = None,
    unseen: UnseenScatter | None = None,
) -> Check:
    """The light of a comparison.

    Red where halves of a record differ, or two records do, unless the intervals, widened by that,
    still lie within `MATERIAL_PERCENT` of the estimates: a quiet record tells halves apart that
    are alike for every use. Amber where three or more records differ: their scatter tells how
    well the mean of such vehicles is known. Records that agree are amber, too, where flights that
    differ by a few percent would look as alike (5 % or more of them), and bars be half as long as
    they need: a line beside the light says so from 1.1 times on.

    Parameters
    ----------
    found : Agreement
    values : ndarray, optional
        Estimates, in the order of its standard errors.
    unseen : UnseenScatter, optional
        What records that agree cannot exclude.

    Example
    -------
    >>> import numpy as np
    >>> check = agreement_check(Agreement(1, 0.4, None, np.ones(1)))
    >>> print(check.finding)
    [green] halves of the record agree (p = 0.4)
    >>> check.limit
    'One record does not tell how far flights differ: what is known is of that flight alone'
    """
    apart = None if values is None else found.apart_percent(values)
    # Where nothing was compared, the reason says as much.
    limit = ONE if found.tested and needs_another(found.n_records) else ""
    if found.tested and found.told_once:
        limit = ALONE.format(found.told_once, len(found.by_noise))
    check, hidden, limits = _compared(found, apart), _hidden(found, unseen), [limit, _doubt(found)]
    if check.light is Light.GREEN and unseen is not None and _is_open(unseen, DOUBLED):
        check = replace(check, light=Light.AMBER, what=hidden, action=UNSEEN_ACTION)
    else:
        limits.append(hidden)
    return replace(check, limit=". ".join(filter(None, limits)))


def _doubt(found: Agreement) -> str:
    """What longer bars of records that agree are for, beside the light."""
    if not found.agree or found.records is None or found.factor < SHOWN:
        return ""
    return DOUBT.format(found.n_records, found.records, found.factor)


def _hidden(found: Agreement, unseen: UnseenScatter | None) -> str:
    """What flights that these records cannot exclude would ask for."""
    if unseen is None or not found.agree or not _is_open(unseen, HIDDEN):
        return ""
    share, apart = round(100.0 * unseen.chance), 100.0 * FLOWN_APART
    return UNSEEN.format(unseen.n_records, share, apart, unseen.longer)


def _is_open(unseen: UnseenScatter, factor: float) -> bool:
    """Whether flights that differ would look as alike, and need bars longer by so much."""
    return unseen.chance >= EXCLUDED and unseen.longer > factor


def beside_disturbances(check: Check) -> Check:
    """A comparison of parts whose residuals hold noise on the states: that moves parts too.

    Example
    -------
    >>> apart = agreement_check(Agreement(2, None, 0.001, np.ones(1)))
    >>> apart.light.value, beside_disturbances(apart).light.value
    ('red', 'unknown')
    """
    if check.light not in (Light.RED, Light.AMBER):
        return check
    return replace(check, light=Light.UNKNOWN, what=check.what + DISTURBED, action=DISTURBED_ACTION)


def beside_loop(check: Check, loop: Check | None) -> Check:
    """A comparison of parts that a closed loop bends: one vehicle differs from part to part.

    Parameters
    ----------
    check : Check
        Of the parts.
    loop : Check or None
        Amber or red where a loop bends estimates.

    Example
    -------
    >>> apart = agreement_check(Agreement(2, None, 0.001, np.ones(1)))
    >>> beside_loop(apart, Check("loop", Light.AMBER, "loop closed", "inject")).action
    'inject'
    """
    bends = loop is not None and loop.light in (Light.RED, Light.AMBER)
    if loop is None or not bends or check.light not in (Light.RED, Light.AMBER):
        return check
    return replace(check, what=check.what + LOOPED, action=loop.action)


def needs_another(n_records: int) -> bool:
    """Whether a second record is wanted, whoever asks: one alone cannot show what chance does."""
    return n_records < 2


def _compared(found: Agreement, apart: float | None) -> Check:
    if not found.tested:
        # Longer alone does not help: a longer sweep passes each frequency once all the same.
        what, action = ONCE, AGAIN
        if not needs_another(found.n_records):
            what = "records are not compared: not each holds all inputs and frequencies by itself"
            action = ALL_AGAIN
        return Check(AGREEMENT, Light.UNKNOWN, what, action)
    several = found.n_records > 1
    widened = ""
    if found.factor > 1.0:
        reach = f" and to ±{apart:.2g} %" if apart and not found.agree else ""
        how = "intervals are widened by how far they lie apart"
        widened = f"; {how}, up to {found.factor:.2g} times{reach}"
    if found.agree:
        return Check(AGREEMENT, Light.GREEN, _alike(found) + widened)
    if found.halves_differ:
        whose = "a record" if several else "the record"
        so = f", and so do records (p = {found.records:.2g})" if found.records_differ else ""
        what = f"halves of {whose} differ by more than noise (p = {found.halves:.2g}){so}{widened}"
        small = apart is not None and apart < MATERIAL_PERCENT
        return Check(AGREEMENT, Light.AMBER if small else Light.RED, what, HALVES_ACTION)
    what = f"{found.n_records} records differ by more than noise (p = {found.records:.2g}){widened}"
    known = found.n_records >= FEWEST_RECORDS or (apart is not None and apart < MATERIAL_PERCENT)
    light = Light.AMBER if known else Light.RED
    return Check(AGREEMENT, light, what, RECORDS_ACTION)


def _alike(found: Agreement) -> str:
    tests = []
    if found.records is not None:
        tests.append(f"{found.n_records} records agree (p = {found.records:.2g})")
    if found.halves is not None:
        whose = "each record" if found.n_records > 1 else "the record"
        tests.append(f"halves of {whose} agree (p = {found.halves:.2g})")
    return "; ".join(tests)

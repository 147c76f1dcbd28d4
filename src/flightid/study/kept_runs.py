"""A manoeuvre that was flown again and kept back: whether the two agree, its prediction tells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from flightid.conventions import Light
from flightid.evidence import Check
from flightid.evidence.evidence import AGREEMENT, PREDICTION
from flightid.evidence.part_checks import AGAIN, ONE, needs_another
from flightid.identification import Fit
from flightid.inspection import Inspection
from flightid.inspection.axes import axes_of
from flightid.inspection.carried import is_swept
from flightid.record import Record
from flightid.study.proposal.swept import reached
from flightid.validation import Verification

NEAR = 1.25
"""Factor by which what was injected may end short of a band: chirps fade in and out."""


def agreement_of_kept(
    fit: Fit,
    unseen: Mapping[str, Verification],
    checks: Iterable[Check],
    inspection: Inspection | None = None,
) -> tuple[Check, ...]:
    """What runs that verify say of agreement, where one was fitted; none where parts were compared.

    A run that was injected as the fitted one was is a second flight of the manoeuvre: it agrees
    as far as the prediction of it says. Without any, the plan of another is named.

    Parameters
    ----------
    fit : Fit
    unseen : mapping of str to Verification
        Free runs through records that the fit has not seen, by name.
    checks : iterable of Check
        With that of the prediction.
    inspection : Inspection, optional
        Of the log that all comes from.
    """
    own, found = fit.evidence.check(AGREEMENT), fit.agreement
    if own is None or found is None or found.tested or not needs_another(found.n_records):
        return ()
    predicted = next((each for each in checks if each.name == PREDICTION), None)
    again = [run for run in unseen.values() if _is_again(run, fit)]
    if predicted is None or not again:
        return _planned(fit, own, inspection)
    kept = "the second was" if len(again) == 1 else f"{len(again)} more were"
    said = f"one run was fitted, {kept} kept to verify"
    if predicted.light is not Light.GREEN:
        what = f"{said}: whether they agree is in doubt as the prediction is"
        return (replace(own, what=what, action=predicted.action),)
    each = {name: value for run in again for name, value in run.fit_percent.items()}
    least, value = min(each.items(), key=lambda pair: pair[1])
    told = "" if len(each) * len(again) == 1 else "at least "
    what = f"{said}: the model predicts {told}{value:.3g} % of {least} there"
    return (Check(AGREEMENT, Light.GREEN, what, limit=ONE),)


def _is_again(run: Verification, fit: Fit) -> bool:
    """Whether what was injected in a record reaches all of the band that was fitted.

    What was cut off the fitted run reaches a part of it alone.
    """
    band = fit.evidence.band_rad_s
    records = [each.measured for each in run.predictions]
    return band is not None and all(_covers(each, band) for each in records)


def _covers(record: Record, band: tuple[float, float]) -> bool:
    moved = [name for name in record.excitations if np.ptp(record[name]) > 0.0]
    ends = [reached(record[name], record.sample_rate_hz) for name in moved]
    return any(low <= NEAR * band[0] and NEAR * high >= band[1] for low, high in ends)


def _planned(fit: Fit, own: Check, inspection: Inspection | None) -> tuple[Check, ...]:
    """The check of one manoeuvre with how its log's autopilot flies more of it."""
    if inspection is None:
        return ()
    known = axes_of(inspection.vehicle).items()
    axes = [axis for axis, each in known if each.command in fit.model.inputs]
    swept = [axis for axis in axes if is_swept(inspection, axis)]
    if not swept:
        return ()
    plan = f"flightid plan {inspection.name} --axes {','.join(swept)}"
    return (replace(own, action=f"{AGAIN}: {plan}"),)

"""What a fit leaves unexplained of the records that it was made of: no prediction can do better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.simulation import metrics

AS_MUCH = 1.2
"""Largest ratio of two errors that a few hundred coloured samples do not tell apart."""


def left_by_fit(source: object, explained: float) -> dict[str, float]:
    """Error of the fitted model in its own records, by output, where it explains those.

    Parameters
    ----------
    source : object
        Anything that can be verified; only a fit to records has records of its own.
    explained : float
        Largest Theil coefficient with which a model is said to explain a record.

    Returns
    -------
    dict of str to float
        Root mean square of measured minus model, in the output's unit.
    """
    if not isinstance(source, Fit) or not source.records:
        return {}
    found = {}
    for name in source.records[0].outputs:
        parts = [(each.measured[name], each.modelled[name]) for each in source.records]
        measured, modelled = (np.concatenate([part[side] for part in parts]) for side in (0, 1))
        if float(metrics.theil(measured - measured.mean(), modelled - measured.mean())) > explained:
            continue
        found[name] = float(metrics.rms_error(measured, modelled))
    return found


def weighed(
    findings: Sequence[Finding], code: str, errors: Mapping[str, float], own: Mapping[str, float]
) -> tuple[Finding, ...]:
    """Verdicts on a prediction, none red for an error that the fit itself shows.

    Where no output is predicted worse than the fit explains its own records, a poor share of the
    measured motion says that the record hardly rises above what the fit leaves (noise, or what
    the structure lacks), not that the model is worse here.

    Parameters
    ----------
    findings : sequence of Finding
    code : str
        Of the findings that weigh errors by the motion.
    errors, own : mapping of str to float
        Error by output: of the prediction, and of the fit in its own records.
    """
    if not errors or any(error > AS_MUCH * own.get(name, 0.0) for name, error in errors.items()):
        return tuple(findings)
    said = "; the error is no larger than in the records of the fit: little here rises above it"
    action = "verify on a record that moves the output more"
    return tuple(
        replace(each, light=Light.AMBER, message=each.message + said, action=action)
        if each.code == code and each.light is Light.RED
        else each
        for each in findings
    )

"""The records that a fit was made of: what it leaves of them, and whether they come again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.filter_error.gusts import candidates
from flightid.identification.fit import Fit
from flightid.identification.prediction.remembered import provenance_entry, training_digests
from flightid.identification.records.held_model import LinearPoint
from flightid.identification.uncertain_of import evidence_behind
from flightid.models import StateSpaceModel
from flightid.record import Record
from flightid.simulation import metrics
from flightid.simulation.noise import sampled_noise

Array = NDArray[np.float64]
SEEN = "training-data"
"""Of a record, or a part of one, that the model was fitted to."""
GUST_STEPS = 100
"""Parts of a run over which the variance that process noise makes is averaged."""
GUSTS = "what the fit's process noise makes of any free run, which no input tells"
AS_MUCH = 1.2
"""Largest ratio of two errors that a few hundred coloured samples do not tell apart."""


def own_errors(source: object, explained: float) -> dict[str, float]:
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


def gust_errors(source: object, model: object, durations_s: Sequence[float]) -> dict[str, float]:
    """What the process noise and the gust that a fit found make of free runs, by output.

    A run starts where it is known, the gust at its own variance. A fit whose run would grow is not
    excused by that: its roots are moved left until none grows by more than e over the run.

    Parameters
    ----------
    source : object
        A fit by filter error, or the model in its file; others have no process noise.
    model : object
        Its model, linear.
    durations_s : sequence of float
        Length of each run, s, over which the variance is averaged.

    Returns
    -------
    dict of str to float
        Root mean square in the output's unit, of all runs together.

    Reference
    ---------
    Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., section 5.2.
    """
    found, gust = (provenance_entry(source, key) for key in ("process_noise", "gust"))
    if not isinstance(found, Mapping) or not isinstance(model, StateSpaceModel):
        return {}
    if not model.is_linear:
        return {}
    a, _, c, _, _ = model.state_space()
    density = np.array([float(found.get(name, 0.0)) ** 2 for name in model.states])
    start = np.zeros(density.size)
    if isinstance(gust, Mapping):
        felt = _with_gust(model, gust, density)
        if felt is None:
            return {}
        (a, c, density), start = felt, np.append(start, float(gust["deviation"]) ** 2)
    power = sum(t * _power(a, c, np.diag(density), np.diag(start), t) for t in durations_s)
    errors = np.sqrt(power / sum(durations_s))
    return dict(zip(model.outputs, map(float, errors), strict=True))


def _with_gust(
    model: StateSpaceModel, gust: Mapping[str, Any], white: Array
) -> tuple[Array, Array, Array] | None:
    """A, C and densities of a model with the gust of its fit; None where nothing feels it."""
    point = LinearPoint.of(model, model.parameters.independent_values())
    scales, time_s = np.ones(len(model.states)), float(gust["time_s"])
    seen = [name in gust["outputs"] for name in model.outputs]
    for each in candidates(point, scales, time_s, time_s):
        if list(model.states)[each.state] == gust["state"] and list(each.seen) == seen:
            sizes = [gust["deviation"] / each.deviation_scale, time_s / each.time_scale_s]
            logs = np.log(np.maximum(sizes, np.finfo(float).tiny))
            whole = each.added(point, logs)
            return whole.a[0], whole.c[0], each.process(white, logs)
    return None


def _power(a: Array, c: Array, density: Array, start: Array, duration_s: float) -> Array:
    """Mean variance of outputs over a run, shape (n_outputs,)."""
    fastest = float(np.max(np.linalg.eigvals(a).real, initial=0.0))
    a = a - max(fastest - 1.0 / duration_s, 0.0) * np.eye(len(a))
    phi, pushed = sampled_noise(a, density, duration_s / GUST_STEPS)
    covariance, power = start, np.zeros(len(c))
    for _ in range(GUST_STEPS):
        covariance = phi @ covariance @ phi.T + pushed
        power += np.diag(c @ covariance @ c.T) / GUST_STEPS
    return power


def weighed(
    verdicts: Mapping[str | None, Finding],
    errors: Mapping[str, float],
    own: Mapping[str, float],
    said: str = "in the records of the fit: little here rises above it",
) -> dict[str | None, Finding]:
    """Verdicts on a prediction, none red for an error that the fit itself shows.

    Where no output is predicted worse than the fit explains its own records, a poor share of the
    measured motion says that the record hardly rises above what the fit leaves (noise, or what
    the structure lacks), not that the model is worse here.

    Parameters
    ----------
    verdicts : mapping of str or None to Finding
        That weigh errors by the motion, by output; None: of all together.
    errors, own : mapping of str to float
        Error by output: of the prediction, and of the fit in its own records.
    said : str
        Where the latter stands.
    """
    if not errors or any(error > AS_MUCH * own.get(name, 0.0) for name, error in errors.items()):
        return dict(verdicts)
    said = f"; the error is no larger than {said}"
    action = "verify on a record that moves the output more"
    return {
        name: replace(each, light=Light.AMBER, message=each.message + said, action=action)
        if each.light is Light.RED
        else each
        for name, each in verdicts.items()
    }


def fit_findings(source: object) -> tuple[Finding, ...]:
    """That the fit behind a model's file is red: a piece of record that it runs well is no more.

    A fit that is at hand shows its evidence itself.
    """
    examined = None if isinstance(source, Fit) else evidence_behind(source)
    if examined is None or examined.verdict.light is not Light.RED:
        return ()
    verdict = examined.verdict
    said = f"the model is of a fit that is red: {verdict.message}"
    return (Finding("source-evidence", Light.AMBER, said, verdict.action),)


def seen_findings(
    source: object, records: Sequence[Record], outputs: Sequence[str]
) -> tuple[Finding, ...]:
    """A warning for each record that a model was fitted to, whole or in part.

    By the digests that a fit, or the file of its model, keeps of its records. Samples that were
    changed since (filtered, resampled, moved, in other units) are not known again.

    Parameters
    ----------
    source : object
        Anything that can be verified.
    records : sequence of Record
    outputs : sequence of str
        What is compared.
    """
    known = training_digests(source)
    findings = []
    for record in records:
        shares = {each.name: each.shared(record, outputs) for each in known}
        name = max(shares, key=lambda each: shares[each], default="")
        if not shares.get(name):
            continue
        part = "" if shares[name] == 1.0 else "a part of "
        said = (
            f"{record.name}: the model was fitted to {part}these samples (record {name!r}), "
            "which the run explains and does not predict"
        )
        findings.append(Finding(SEEN, Light.AMBER, said, "verify on a record that no fit has seen"))
    return tuple(findings)

"""Whether inputs foretell the error of a free run: what gusts make of it, no input tells.

A free run holds the whole answer to gusts, which grows with slow modes: it is large where the model
is right. A wrong model errs by a function of the inputs. Both are told apart as in a prediction
error with a model of its noise: what the error's own past of all outputs does not foretell is asked
of the past inputs. That holds in a closed loop too, where inputs answer gusts, for they answer past
ones alone. Both pasts are asked on coarser and coarser grids, for noisy sensors hide a gust's past
from few samples of a fine one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.prediction.request import FREE_RUN
from flightid.identification.prediction.result import Prediction
from flightid.uncertainty.several_tests import holm_adjusted

Array = NDArray[np.float64]
LONGEST_PAST, SHORTEST_PAST = 6, 3
"""Past samples of every channel on the finest grid, and fewest on the coarsest."""
SAMPLES_A_NUMBER = 5
"""Samples of a grid for each number that is estimated on it."""
LEVEL = 0.003
"""Chance below which inputs foretell an error. Pasts are finite, so of right models in gusts that
noisy sensors measure about three times as many are called wrong."""
CALM = "verify on a record in calmer air, or with larger inputs: this one cannot tell"
WRONG = "look for what this output lacks: an input's gain, lag or delay"
FIRST = "look first for what {} lacks: an input's gain, lag or delay"
NO_NOISE = 1e-8
"""Share of an error that its past leaves below which no noise made it, and so no gust."""
RESOLVED = 1e-10
"""Share of an input's past that something else leaves of it below which it tells nothing more."""


def foretold_chances(errors: Sequence[Array], inputs: Sequence[Array]) -> Array | None:
    """Chance, by output, that past inputs add as much to what the errors' own past foretells.

    Parameters
    ----------
    errors, inputs : sequence of ndarray, each shape (n_channels, n_samples)
        One array for each record.

    Returns
    -------
    ndarray, shape (n_outputs,), or None
        Over all grids (Bonferroni) and among the outputs (Holm): of right models, the least of
        them is below a level with that chance at most. None where records are too short to tell.

    Reference
    ---------
    Granger, *Econometrica* 37 (1969); Ljung, *System Identification*, 2nd ed., section 13.4; Holm,
    A simple sequentially rejective multiple test procedure, *Scandinavian J. Statistics* 6 (1979).

    Example
    -------
    >>> rng = np.random.default_rng(0)
    >>> u, e = rng.standard_normal((2, 1, 600))
    >>> gust = scipy.signal.lfilter([1.0], [1.0, -0.98], e)
    >>> wrong = gust + scipy.signal.lfilter([0.0, 0.3], [1.0, -0.9], u)
    >>> other = scipy.signal.lfilter([1.0], [1.0, -0.9], rng.standard_normal((1, 600)))
    >>> (foretold_chances([np.vstack([wrong, other])], [u]) < LEVEL).tolist()
    [True, False]
    """
    changing = np.any([np.ptp(rows, axis=1) > 0.0 for rows in errors], axis=0)
    moved = np.any([np.ptp(rows, axis=1) > 0.0 for rows in inputs], axis=0)
    pairs = [(e[changing], u[moved]) for e, u in zip(errors, inputs, strict=True)]
    channels = int(np.sum(changing) + np.sum(moved))
    if not np.any(moved) or not np.any(changing):
        return None
    whole = sum(e.shape[1] for e, _ in pairs)
    chances = []
    step = 1
    while (past := _past(whole // step, channels)) >= SHORTEST_PAST:
        found = _chances([(_coarser(e, step), _coarser(u, step)) for e, u in pairs], past)
        if found is not None:
            chances.append(found)
        step *= 2
    if not chances:
        return None
    every = np.ones(len(changing))
    every[changing] = holm_adjusted(len(chances) * np.min(chances, axis=0))
    return every


def unless_gusts(
    verdicts: Mapping[str | None, Finding],
    made: Sequence[Prediction],
    innovations: Sequence[Array] = (),
) -> dict[str | None, Finding]:
    """Verdicts on free runs, none red for an error that no input foretells.

    Each output is judged by its own error, all together by whether any poor one is foretold. An
    output within its guide whose error is foretold beside others' gusts is amber.

    Parameters
    ----------
    verdicts : mapping of str or None to Finding
        That weigh the error, by output; None: of all together.
    made : sequence of Prediction
    innovations : sequence of ndarray, optional
        As in `chances_by_output`.
    """
    whole = all(each.horizon == FREE_RUN and each.diverged_at is None for each in made)
    if not whole or all(each.light is not Light.RED for each in verdicts.values()):
        return dict(verdicts)
    by_output = chances_by_output(made, innovations)
    if not by_output:
        return dict(verdicts)
    poor = [
        by_output[name]
        for name, each in verdicts.items()
        if name is not None and each.light in (Light.AMBER, Light.RED)
    ]
    together = min(poor, default=min(by_output.values()))
    wrong = [name for name, chance in by_output.items() if chance < LEVEL]
    return {
        name: _weighed(each, together if name is None else by_output[name], wrong)
        for name, each in verdicts.items()
    }


def chances_by_output(
    made: Sequence[Prediction], innovations: Sequence[Array] = ()
) -> dict[str, float]:
    """`foretold_chances` of free runs, by output; none where records are too short to tell.

    Parameters
    ----------
    made : sequence of Prediction
    innovations : sequence of ndarray, shape (n_outputs, n_samples), optional
        What a filter leaves of the last samples of each record, asked in place of the run's error:
        they are new at each sample, where few past samples of an error in noise, or of one that
        grows, do not foretell all that inputs which answer gusts know.
    """
    errors = [np.array([each.residual(name) for name in each.outputs]) for each in made]
    inputs = [each.predicted.matrix(each.predicted.inputs) for each in made]
    if innovations:
        errors = list(innovations)
        inputs = [u[:, -e.shape[1] :] for u, e in zip(inputs, errors, strict=True)]
    chances = foretold_chances(errors, inputs)
    if chances is None:
        return {}
    return dict(zip(made[0].outputs, map(float, chances), strict=True))


def _weighed(finding: Finding, chance: float, wrong: Sequence[str]) -> Finding:
    """A verdict with the chance that inputs foretell as much of its error.

    `wrong` are the outputs whose errors inputs foretell: what such a record shows is not of gusts
    alone.
    """
    foretold = chance < LEVEL
    if foretold and finding.light in (Light.GREEN, Light.UNKNOWN):
        said = (
            f"; yet inputs foretell some of the error (p = {chance:.2g}): the model is wrong there"
        )
        return replace(finding, light=Light.AMBER, message=finding.message + said, action=WRONG)
    if foretold or finding.light is not Light.RED:
        return finding
    said = "; beyond its own past inputs foretell no more of the error than chance does "
    said += f"(p = {chance:.2g}): "
    others = ", ".join(wrong)
    if wrong:
        said += f"it may follow from what is wrong in {others}, or be gusts"
    else:
        said += "gusts alone could make it, and this record does not tell them from a wrong model"
    action = FIRST.format(others) if wrong else CALM
    return replace(finding, light=Light.AMBER, message=finding.message + said, action=action)


def _past(samples: int, channels: int) -> int:
    return min(LONGEST_PAST, samples // (SAMPLES_A_NUMBER * channels))


def _coarser(rows: Array, step: int) -> Array:
    """Means of neighbouring samples."""
    kept = rows.shape[1] // step * step
    return np.asarray(rows[:, :kept].reshape(len(rows), -1, step).mean(axis=2))


def _chances(pairs: Sequence[tuple[Array, Array]], past: int) -> Array | None:
    """Fisher's F of the inputs' past beside that of the errors, by error; None: too short.

    Each record has a constant of its own. Errors without noise are no gusts': chance 0.
    """
    kept = [pair for pair in pairs if pair[0].shape[1] > past]
    if not kept:
        return None
    aims, own, asked = (
        np.concatenate(rows, axis=1)
        for rows in zip(*(_rows(e, u, past) for e, u in kept), strict=True)
    )
    place = np.repeat(np.arange(len(kept)), [e.shape[1] - past for e, _ in kept])
    own = np.concatenate([own, np.equal.outer(np.arange(len(kept)), place)])
    basis = _basis(own, own)
    left, fresh = (rows - (rows @ basis) @ basis.T for rows in (aims, asked))
    further = _basis(fresh, asked)
    free = aims.shape[1] - basis.shape[1] - further.shape[1]
    if not further.shape[1] or free < further.shape[1]:
        return None
    gain = np.sum((left @ further) ** 2, axis=1)
    # What rounding leaves of an error that is foretold whole: no number overflows over it.
    least = np.maximum(np.finfo(float).eps * gain, np.finfo(float).tiny)
    rest = np.maximum(np.sum(left**2, axis=1) - gain, least)
    f = gain / further.shape[1] / (rest / free)
    quiet = np.sum(left**2, axis=1) < NO_NOISE * np.sum(aims**2, axis=1)
    found = np.asarray(scipy.special.fdtrc(further.shape[1], free, f))
    return np.where(quiet, 0.0, found)


def _rows(errors: Array, inputs: Array, past: int) -> tuple[Array, Array, Array]:
    """Errors from the first that has a past on, their pasts, and those of the inputs."""
    return errors[:, past:], _lagged(errors, past), _lagged(inputs, past)


def _lagged(rows: Array, past: int) -> Array:
    n = rows.shape[1]
    return np.concatenate([rows[:, past - lag : n - lag] for lag in range(1, past + 1)])


def _basis(rows: Array, whole: Array) -> Array:
    """Orthonormal columns of rows, each counted by its size in a whole, (n_samples, n_kept)."""
    size = np.sqrt(np.sum(whole**2, axis=1, keepdims=True))
    scaled = rows / np.where(size > 0.0, size, 1.0)
    directions, spread, _ = np.linalg.svd(scaled.T, full_matrices=False)
    return np.asarray(directions[:, spread > np.sqrt(RESOLVED)])

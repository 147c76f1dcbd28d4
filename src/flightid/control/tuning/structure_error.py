"""What parameters do not hold: how far the model itself was from its data, as plants of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.identification.answers_of_records import by_size_of
from flightid.identification.fit import Fit
from flightid.identification.model_error import MOST, SHOWN, ModelErrorBound, with_size

Band = tuple[float, float]
Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Multiples of it, modulo one, fill the circle evenly however many are taken."""
BESIDE = float(np.sqrt(2.0))
"""By which each pair's turns are faster than those of the one before, in its own."""


def errors_of(source: object) -> dict[str, ModelErrorBound]:
    """Errors of a fit's structure by ``"output/input"``, from the fit or from its model's file."""
    if isinstance(source, Fit):
        # Responses hold it in theirs; of records it is asked where gains need it.
        sized = by_size_of(source) if source.left is None else {}
        known = source.model_errors.items()
        return {name: with_size(bound, sized.get(name)) for name, bound in known}
    found = getattr(source, "model_errors", None)
    if found is not None:
        return dict(found)
    kept = getattr(getattr(source, "estimated", None), "model_errors", {})
    return {name: ModelErrorBound.from_dict(values) for name, values in kept.items()}


def identified_band(
    source: object,
    errors: Mapping[str, ModelErrorBound],
    pairs: Sequence[str],
    given: Band | None,
) -> Band | None:
    """Where the model of some pairs was shown to hold, rad/s; None where that is not known.

    What all of these have in common: the band that the caller gives, the bands that were fitted,
    and those in which the model's error against its data stays small.
    """
    known = getattr(source, "estimated", None)
    fitted = dict(known.bands) if known is not None else {}
    bands: list[Band | None] = [] if given is None else [given]
    for name in pairs:
        if name in errors:
            bands.append(errors[name].band_rad_s)
        elif given is None:
            bands.append(fitted.get(name))
    if not bands or None in bands:
        return None
    lows, highs = zip(*(band for band in bands if band is not None), strict=True)
    return (max(lows), min(highs)) if max(lows) < min(highs) else None


def no_band(errors: Mapping[str, ModelErrorBound], pairs: Sequence[str]) -> DataError:
    """Why there is no band, and what to do."""
    far = [f"{name} {100.0 * errors[name].bound.min():.0f} %" for name in pairs if name in errors]
    if far:
        return DataError(
            "the model was nowhere shown to hold, so no gains are made from it",
            found=f"least error against its data: {', '.join(far)}",
            needed=f"at most {100.0 * SHOWN:.0f} % over some band",
            action="add the dynamics that the model lacks, or fly a sweep with more amplitude",
        )
    return DataError(
        "no gains are made without an identified band",
        found="nothing says up to which frequency the model was identified",
        needed="a fit of responses or records, or band_rad_s",
        action="give band_rad_s, so that the crossover stays inside",
    )


def perturbed(
    errors: Mapping[str, ModelErrorBound],
    outputs: Sequence[str],
    inputs: Sequence[str],
    omega_rad_s: Array,
    count: int,
    *,
    turn: float,
    size: float = 1.0,
) -> Complex:
    """Factors 1 + Δ of plants with |Δ| at the bound, each in a direction of its own.

    Below the band Δ grows up to `SHOWN` and turns to the real axis in proportion to frequency: the
    response of a vehicle and of its model is real at zero frequency, so no error goes on turning
    the phase down to it.

    Parameters
    ----------
    errors : mapping of str to ModelErrorBound
    outputs, inputs : sequence of str
    omega_rad_s : ndarray, shape (n_f,)
    count : int
        Number of plants; the first is the estimate, whose factor is one.
    turn : float
        Share of a turn that all directions are moved by.
    size : float
        Multiple of the bound.

    Returns
    -------
    ndarray of complex, shape (count, n_outputs, n_inputs, n_f)

    Reference
    ---------
    Skogestad & Postlethwaite, *Multivariable Feedback Control*, 2nd ed., section 7.4
    (multiplicative uncertainty with complex perturbations).
    """
    made = np.ones((count, len(outputs), len(inputs), len(omega_rad_s)), dtype=np.complex128)
    place = 0
    for i, output in enumerate(outputs):
        for j, name in enumerate(inputs):
            known = errors.get(f"{output}/{name}")
            if known is not None:
                # Pairs turn at rates of their own, so that all combinations come about.
                shares = turn + GOLDEN * (1.0 + BESIDE * place) * np.arange(1, count)
                angle = 2.0 * np.pi * shares[:, None]
                band = known.band_rad_s
                aside = 1.0 if band is None else np.minimum(omega_rad_s / band[0], 1.0)
                directions = np.cos(angle) + 1j * np.sin(angle) * aside
                made[1:, i, j] += directions * np.minimum(size * known.at(omega_rad_s), MOST)
            place += 1
    return made

"""How far light modes outside a band may move a response before the band would have shown them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.mode_slack import MOST_MOVED_DB, Side
from flightid.identification.model_error import ModelErrorBound

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
LEAST_DAMPING = 0.01
"""Damping ratio that no mode has less of; MIL-A-8870C asks 0.015 (g = 0.03) of flutter modes."""
DAMPINGS = LEAST_DAMPING, 0.05, 0.25
"""Of modes that are tried: more of it hides a larger one, whose flank reaches further."""
AWAY = 1.0, 1.05, 1.15, 1.4, 2.0
"""Frequencies of modes that are tried, in those where the response is asked for, outwards."""
FARTHEST, PLACES = 4.0, 17
"""Ratio to the band's end beyond which a band shows nothing, and places up to it."""
PARTS = 1.5, 2.0, 3.0, 4.0, 8.0, np.inf
"""Ratios to the band's end up to which points are taken: what any part refutes is refuted."""
COARSEST, FINEST = 0.36, 0.036
"""Half the width of a Hann window at −3 dB, 0.72 bins, of frequencies of two and twenty cycles."""
LEAST_ERROR, MOST_ERROR = 0.01, 0.9
"""Relative errors that no estimator passes below, and beyond which a point tells nothing."""
RIDGE = 1e-12
"""Share of two axes' mean that keeps what a part cannot tell apart from being divided by."""
SMALL = 0.1
"""Share of the largest below which a direction of parameters is another's curvature."""


def most_moved_db(
    omega_rad_s: Array,
    band_rad_s: tuple[float, float] | None,
    bound: ModelErrorBound | None = None,
    slopes: Callable[[Array], Complex] | None = None,
    coarsest_rad_s: float | None = None,
) -> Array:
    """By how much a mode may move a response at frequencies outside a band, dB.

    Parameters
    ----------
    omega_rad_s : ndarray, shape (n_f,)
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.
    bound : ModelErrorBound, optional
        How far the model was from its data; left out, nothing limits a mode but its size.
    slopes : callable, optional
        From frequencies, shape (n,), to relative moves of the model by its free parameters,
        complex, (n_moves, n), of any size and number: what they make up for, the band does not
        show.
    coarsest_rad_s : float, optional
        Half-width of the longest window; left out, that of one with two cycles of the bound's
        lowest frequency.

    Returns
    -------
    ndarray, shape (n_f,)
        At most `MOST_MOVED_DB`; inside the band it says nothing.

    Assumes
    -------
    One mode on either side, of at least `LEAST_DAMPING`, whose peak (or the dip of its zeros)
    moves the response by at most `MOST_MOVED_DB`.

    Notes
    -----
    Truth over model is 1 + m + J θ, m = (α x² + jβ x)/(1 − x² + 2jζx) with x = ω/ω₀: a mode whose
    residue has any phase, J θ what parameters and a constant make up for. Its mean over half an
    octave is known to lie within the bound at every point, so the weighted mean square over any
    part of the band is at most one, an ellipsoid of (α, β, θ). What that allows at a frequency
    outside is its extent in that direction, and the least of all parts counts. A zero is a pole of
    model over truth, which errs by e/(1 − e). A window shows a mode over its own width: it is
    read at jω + δ, which is its mean under a Lorentz bell of half-width δ.

    Reference
    ---------
    Goodwin, Gevers & Ninness, *IEEE Trans. Automatic Control* 37 (1992), 913–928 (model error
    bounds); Ewins, *Modal Testing*, 2nd ed., section 4.4 (residual terms of modes out of range).
    """
    omega = np.asarray(omega_rad_s, dtype=np.float64)
    moved = np.full(omega.shape, MOST_MOVED_DB)
    if band_rad_s is None or bound is None or slopes is None:
        return moved
    sides: tuple[tuple[Side, float], ...] = (("below", band_rad_s[0]), ("above", band_rad_s[1]))
    for side, end in sides:
        beyond = omega / end if side == "above" else end / omega
        near = (beyond > 1.0) & (beyond < FARTHEST)
        if not near.any():
            continue
        at = np.geomspace(1.0, FARTHEST, PLACES)
        at = end * at if side == "above" else (end / at)[::-1]
        bins = np.fmax(
            FINEST * bound.omega_rad_s, coarsest_rad_s or COARSEST * bound.omega_rad_s[0]
        )
        found = _of_side(side, end, at, bound, slopes, bins)
        moved[near] = np.interp(np.log(omega[near]), np.log(at), found)
    return moved


def _of_side(
    side: Side,
    end: float,
    at: Array,
    bound: ModelErrorBound,
    slopes: Callable[[Array], Complex],
    bins: Array,
) -> Array:
    """Of one side at its own frequencies, dB; `bins`: half-widths of windows at the bound's."""
    omega, error = bound.omega_rad_s, np.maximum(bound.bound, LEAST_ERROR)
    known = error < MOST_ERROR
    if side == "below":
        error = error / np.maximum(1.0 - error, 1.0 - MOST_ERROR)
    outwards = np.array(AWAY) if side == "above" else 1.0 / np.array(AWAY)
    centre, damping = (
        each.ravel() for each in np.meshgrid((at[:, None] * outwards).ravel(), DAMPINGS)
    )
    here = np.tile(np.repeat(np.arange(len(at)), len(AWAY)), len(DAMPINGS))
    fixed, outside = _independent(slopes(omega), slopes(at), error, known)
    seen = bound.averaged(_modes(omega - 1j * bins, centre, damping))
    kept = bound.averaged(fixed)
    own = _modes(at[here, None], centre, damping)[..., 0]
    extent = np.full(len(centre), np.inf)
    for ratio in PARTS:
        part = known & ((omega > end / ratio) if side == "above" else (omega < end * ratio))
        if np.count_nonzero(part) >= len(fixed):
            weight = 1.0 / (error[part] * np.sqrt(np.count_nonzero(part)))
            of_part = seen[..., part] * weight, kept[:, part] * weight
            extent = np.minimum(extent, _extent(*of_part, own, outside[:, here].T))
    most = np.zeros(len(at))
    np.maximum.at(most, here, np.minimum(extent, _ordinary(side, at[here] / centre, damping)))
    return np.asarray(np.minimum(20.0 * np.log10(1.0 + most), MOST_MOVED_DB))


def _modes(omega: Array | Complex, centre: Array, damping: Array) -> Complex:
    """x²/D and jx/D of each mode, D = 1 − x² + 2jζx: (n_modes, 2, n)."""
    x = omega / centre[:, None]
    below = 1.0 - x**2 + 2j * damping[:, None] * x
    return np.stack([x**2 / below, 1j * x / below], axis=1)


def _ordinary(side: Side, x: Array, damping: Array) -> Array:
    """What a mode of ordinary size moves beside its peak."""
    flank = np.maximum(1.0, x) * (x if side == "above" else 1.0)
    peak = 10.0 ** (MOST_MOVED_DB / 20.0) - 1.0
    return np.asarray(2.0 * damping * peak * flank / np.abs(1.0 - x**2 + 2j * damping * x))


def _independent(
    inside: Complex, outside: Complex, error: Array, known: NDArray[np.bool_]
) -> tuple[Complex, Complex]:
    """A constant and the model's moves as directions that the band tells apart, here and there."""
    here, there = (np.vstack([np.ones((1, e.shape[-1])), e]) for e in (inside, outside))
    weighted = here[:, known] / error[known]
    size = np.linalg.norm(weighted, axis=1, keepdims=True)
    size[size == 0.0] = np.inf
    turned, large, _ = np.linalg.svd(_real(weighted / size), full_matrices=False)
    mix = turned[:, large > SMALL * large[0]].T / size.T
    return np.asarray(mix @ here), np.asarray(mix @ there)


def _extent(modes: Complex, fixed: Complex, own: Complex, outside: Complex) -> Array:
    """Largest move at one frequency outside of each mode, beside what parameters move there.

    Parameters
    ----------
    modes, fixed : ndarray of complex, shapes (n_modes, 2, n) and (n_fixed, n)
        Over the bound of their mean square, inside the band.
    own, outside : ndarray of complex, shapes (n_modes, 2) and (n_modes, n_fixed)
        Where it is asked for.
    """
    axes, scale = np.linalg.qr(_real(fixed).T)
    stacked = _real(modes)
    shared = stacked @ axes
    rest = stacked - shared @ axes.T
    alone = rest @ np.swapaxes(rest, 1, 2)
    alone += RIDGE * np.trace(alone, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    through = np.linalg.solve(scale.T, outside.T).T
    clear = own - np.einsum("ck,cak->ca", through, shared)
    two = np.stack([clear.real, clear.imag], axis=1)
    spread = two @ np.linalg.inv(alone) @ np.swapaxes(two, 1, 2)
    moved = np.stack([through.real, through.imag], axis=1)
    spread += moved @ np.swapaxes(moved, 1, 2)
    return np.asarray(np.sqrt(np.linalg.eigvalsh(spread)[:, -1]))


def _real(values: Complex) -> Array:
    return np.concatenate([values.real, values.imag], axis=-1)

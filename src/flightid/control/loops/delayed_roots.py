"""Roots of loops with delays: x' = A x + B w, z = C x + D w, w_i(t) = z_i(t − τ_i).

They solve det F(s) = 0 with F(s) = s − A − B K(s) C, K(s) = E (I − D E)⁻¹, E = diag e^(−s τ).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
STEPS = 40
SAME = 1e-7
"""Distance over size below which two roots are one."""
TURN_RAD = 0.35
"""Largest turn of the determinant between two points of the contour."""
POINTS = 200_000
"""Most points of the contour."""


def refined_roots(
    a: Array, b: Array, c: Array, d: Array, delays_s: Array, seeds: Complex
) -> Complex:
    """Roots that Newton's method reaches from some seeds, each once.

    Parameters
    ----------
    a, b, c, d : ndarray
        Shapes (n, n), (n, k), (k, n), (k, k).
    delays_s : ndarray, shape (k,)
        s.
    seeds : ndarray of complex
        rad/s.

    Returns
    -------
    ndarray of complex
        rad/s.

    Reference
    ---------
    Guettel & Tisseur, "The nonlinear eigenvalue problem", *Acta Numerica* 26 (2017), section 4.1:
    Newton's method on the determinant, by the trace of F⁻¹F'.
    """
    roots: list[complex] = []
    # Infinitely many roots lie far left; seeds there are artefacts of the approximation.
    for root in newton_roots(a, b, c, d, delays_s, seeds):
        if root is None or any(abs(root - each) < SAME * max(1.0, abs(root)) for each in roots):
            continue
        roots.append(root)
        if abs(root.imag) > SAME * max(1.0, abs(root)):
            twin = root.conjugate()
            if all(abs(twin - each) >= SAME * max(1.0, abs(root)) for each in roots):
                roots.append(twin)
    return np.array(roots, dtype=np.complex128)


def newton_roots(
    a: Array, b: Array, c: Array, d: Array, delays_s: Array, seeds: Complex
) -> list[complex | None]:
    """The roots that Newton's method reaches from some seeds, all at once; None where from none.

    Parameters
    ----------
    a, b, c, d, delays_s, seeds : ndarray
        As for `refined_roots`.
    """
    s = np.array(seeds, dtype=np.complex128)
    found: list[complex | None] = [None] * len(s)
    twins = _twins(s)
    going = np.array([place for place in range(len(s)) if place not in twins], dtype=np.intp)
    for _ in range(STEPS):
        if not len(going):
            break
        traces, is_root = _traces(a, b, c, d, delays_s, s[going])
        for place in going[is_root]:
            found[place] = complex(s[place])
        lasts = ~is_root & np.isfinite(traces) & (traces != 0.0)
        going, steps = going[lasts], 1.0 / traces[lasts]
        s[going] -= steps
        lasts = np.isfinite(s[going])
        going, steps = going[lasts], steps[lasts]
        size = np.maximum(1.0, np.abs(s[going]))
        settled = np.abs(steps) < 1e-13 * size
        for place in going[settled]:
            found[place] = _off_the_axis(complex(s[place]))
        going = going[~settled]
    for place, other in twins.items():
        root = found[other]
        found[place] = root if root is None or root.imag == 0.0 else root.conjugate()
    return found


def _twins(seeds: Complex) -> dict[int, int]:
    """Places of seeds below the real axis, and of their conjugates, whose steps mirror theirs."""
    above = {complex(seed): place for place, seed in enumerate(seeds) if seed.imag > 0.0}
    below = ((place, complex(seed).conjugate()) for place, seed in enumerate(seeds))
    return {place: above[seed] for place, seed in below if seed in above}


def _off_the_axis(s: complex) -> complex:
    return complex(s.real, 0.0) if abs(s.imag) < 1e-10 * max(1.0, abs(s)) else s


def _traces(
    a: Array, b: Array, c: Array, d: Array, delays: Array, s: Complex
) -> tuple[Complex, NDArray[np.bool_]]:
    """Trace of F⁻¹F' at some places, and where F has no inverse: those are roots."""
    try:
        f, slopes = _pencils(a, b, c, d, delays, s)
        return _solved(f, slopes)
    except np.linalg.LinAlgError:
        if len(s) == 1:
            return np.ones(1, dtype=np.complex128), np.ones(1, dtype=bool)
    parts = [_traces(a, b, c, d, delays, s[k : k + 1]) for k in range(len(s))]
    return np.concatenate([each[0] for each in parts]), np.concatenate([each[1] for each in parts])


def _solved(f: Complex, slopes: Complex) -> tuple[Complex, NDArray[np.bool_]]:
    """Traces where F has an inverse, all at once; one elsewhere."""
    traces, roots = np.ones(len(f), dtype=np.complex128), np.zeros(len(f), dtype=bool)
    try:
        solved = np.linalg.solve(f, slopes)
    except np.linalg.LinAlgError:
        roots = np.linalg.slogdet(f)[0] == 0.0
        solved = np.linalg.solve(f[~roots], slopes[~roots])
    traces[~roots] = np.trace(solved, axis1=1, axis2=2)
    return traces, roots


def _pencils(
    a: Array, b: Array, c: Array, d: Array, delays: Array, s: Complex
) -> tuple[Complex, Complex]:
    """F and F' at some places, shapes (n_s, n, n)."""
    one = np.eye(len(a))
    apart = np.multiply.outer(s.real, delays)
    late = np.exp(np.clip(-apart, -200.0, 200.0) - 1j * np.multiply.outer(s.imag, delays))
    if d.any():
        inner = np.eye(len(delays))
        left = np.linalg.inv(inner - late[:, :, None] * d)
        right = np.linalg.inv(inner - d * late[:, None, :])
        onward = b @ (left * late[:, None, :])
        slope = b @ ((left * (-delays * late)[:, None, :]) @ right)
    else:  # what goes around inside has no direct part: both inverses are one
        onward, slope = b * late[:, None, :], b * (-delays * late)[:, None, :]
    f = s[:, None, None] * one - a - onward @ c
    return np.asarray(f), np.asarray(one - slope @ c, dtype=np.complex128)


def line_right_of_axis(a: Array, delays_s: Array) -> float:
    """Real part, rad/s, up to which a pole is taken to stand on the imaginary axis."""
    fastest = max(float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0)), 1.0)
    return 1e-9 * max(fastest, float(np.max(1.0 / delays_s)))


def count_right(
    a: Array, b: Array, c: Array, d: Array, delays_s: Array, line_rad_s: float
) -> int | None:
    """Number of roots right of a line beside the imaginary axis, by the argument principle.

    Parameters
    ----------
    a, b, c, d, delays_s : ndarray
        As for `refined_roots`.
    line_rad_s : float
        Real part of the line, above zero.

    Returns
    -------
    int or None
        None where the determinant turns too fast to be followed, or where a direct path around
        the delays has a gain of one or more.

    Reference
    ---------
    Stepan, *Retarded Dynamical Systems* (1989), section 2.2.
    """
    direct = float(np.linalg.norm(d, 2)) if d.size else 0.0
    if direct >= 1.0:
        return None
    # Beyond the last point all loops together have a gain below one, so nothing can turn there.
    weight = float(np.linalg.norm(b, 2) * np.linalg.norm(c, 2))
    top = 1.5 * (float(np.linalg.norm(a, 2)) + weight / (1.0 - direct)) + 1.0
    omega = np.concatenate([[0.0], np.geomspace(line_rad_s, top, 600)])
    parts = (a, b, c, d, delays_s)
    values = _determinants(*parts, line_rad_s, omega)
    while True:
        turns = np.abs(np.angle(values[1:] / values[:-1]))
        jumps = np.abs(np.log(np.abs(values[1:] / values[:-1])))
        hidden = (np.diff(omega) * np.max(delays_s) > 0.5) & (np.abs(values[1:] - 1.0) > 0.2)
        coarse = np.flatnonzero((turns > TURN_RAD) | (jumps > 1.0) | hidden)
        if not len(coarse):
            break
        if len(omega) + len(coarse) > POINTS:
            return None
        middle = 0.5 * (omega[coarse] + omega[coarse + 1])
        values = np.insert(values, coarse + 1, _determinants(*parts, line_rad_s, middle))
        omega = np.insert(omega, coarse + 1, middle)
    last = np.linalg.eigvals(_around(*parts, line_rad_s, omega[-1:])[0])
    # A real system: what happens below zero mirrors what happens above.
    turned = 2.0 * float(np.sum(np.angle(values[1:] / values[:-1])))
    turned -= 2.0 * float(np.sum(np.angle(1.0 - last)))
    turns_whole = turned / (2.0 * np.pi)
    count = int(np.sum(np.linalg.eigvals(a).real > line_rad_s)) - round(turns_whole)
    return count if abs(turns_whole - round(turns_whole)) < 0.05 and count >= 0 else None


def _around(
    a: Array, b: Array, c: Array, d: Array, delays: Array, line: float, omega: Array
) -> Complex:
    """G(s) E(s) along the line, shape (n_f, k, k)."""
    s = line + 1j * omega
    pencil = s[:, None, None] * np.eye(len(a)) - a
    inner = c @ np.linalg.solve(pencil, np.broadcast_to(b.astype(complex), (len(s), *b.shape))) + d
    return np.asarray(inner * np.exp(-s[:, None] * delays)[:, None, :])


def _determinants(
    a: Array, b: Array, c: Array, d: Array, delays: Array, line: float, omega: Array
) -> Complex:
    """det(I − G(s) E(s)) along the line."""
    around = _around(a, b, c, d, delays, line, omega)
    return np.asarray(np.linalg.det(np.eye(len(delays)) - around))

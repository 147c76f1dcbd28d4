"""Multistep inputs (doublet, 3-2-1-1 and kin) with their exact energy spectra."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from flightid.errors import ShapeError
from flightid.excitation.checks import require_not_negative, require_positive, whole_samples
from flightid.excitation.excitation import Excitation
from flightid.table import Cell


class Steps(NamedTuple):
    """A shape of steps.

    Attributes
    ----------
    widths, levels : tuple of float
        Lengths in steps, and levels; the largest becomes the amplitude.
    peak : float
        Frequency of most energy (of its second lobe where the first holds the mean), times the
        length of a step.
    label : str
        Kind of the excitation.
    """

    widths: tuple[float, ...]
    levels: tuple[float, ...]
    peak: float
    label: str


MULTISTEPS = {
    "doublet": Steps((1.0, 1.0), (1.0, -1.0), 2.331, "doublet"),
    "3211": Steps((3.0, 2.0, 1.0, 1.0), (1.0, -1.0, 1.0, -1.0), 1.584, "multistep 3-2-1-1"),
    "modified_3211": Steps((3.0, 2.0, 1.0, 1.0), (0.8, -1.2, 1.1, -1.1), 1.584, "modified 3-2-1-1"),
}
"""Shapes by the name that designs, shapes of inputs and commands take: a further one is a line."""


def doublet(
    *,
    amplitude: float,
    step_s: float,
    sample_rate_hz: float,
    lead_s: float = 1.0,
    tail_s: float = 5.0,
    name: str = "u",
    unit: str = "1",
) -> Excitation:
    """Doublet: one step up, one step down. For a mode at omega choose a step of 2.3 / omega.

    Parameters
    ----------
    amplitude : float
        Level of the steps, in `unit`.
    step_s : float
        Length of one step, s.
    sample_rate_hz : float
        Samples per second, Hz.
    lead_s, tail_s : float
        Trim before, and free response after, s.
    name, unit : str
        Label of the input.

    Raises
    ------
    OptionError
        A length that is not positive or not a whole number of samples.

    Reference
    ---------
    Jategaonkar, Flight Vehicle System Identification, section 2.3.

    Example
    -------
    >>> doublet(amplitude=0.1, step_s=0.5, sample_rate_hz=50.0).kind
    'doublet'
    """
    widths, levels, _, label = MULTISTEPS["doublet"]
    return _build(
        widths, levels, amplitude, step_s, sample_rate_hz, lead_s, tail_s, name, unit, label
    )


def multistep(
    *,
    amplitude: float,
    step_s: float,
    sample_rate_hz: float,
    widths: Sequence[float] = MULTISTEPS["3211"].widths,
    levels: Sequence[float] | None = None,
    lead_s: float = 1.0,
    tail_s: float = 5.0,
    name: str = "u",
    unit: str = "1",
) -> Excitation:
    """Multistep input; the default is the 3-2-1-1.

    Parameters
    ----------
    amplitude : float
        Largest level, in `unit`; the others follow in proportion.
    step_s : float
        Length of a width of one, s. For a mode at omega choose 1.6 / omega for the 3-2-1-1.
    sample_rate_hz : float
        Samples per second, Hz.
    widths : sequence of float
        Lengths in steps.
    levels : sequence of float, optional
        Levels; default: alternating 1 and -1.
    lead_s, tail_s : float
        Trim before, and free response after, s.
    name, unit : str
        Label of the input.

    Raises
    ------
    OptionError
        A length that is not positive or not a whole number of samples.
    ShapeError
        Not as many levels as widths.

    Reference
    ---------
    Jategaonkar, Flight Vehicle System Identification, section 2.3.

    Example
    -------
    >>> multistep(amplitude=0.1, step_s=0.2, sample_rate_hz=50.0).duration_s
    7.4
    """
    given = tuple(float(width) for width in widths)
    alternating = tuple((-1.0) ** index for index in range(len(given)))
    chosen = alternating if levels is None else tuple(float(level) for level in levels)
    if len(chosen) != len(given) or not given:
        raise ShapeError("levels do not fit widths", found=len(chosen), needed=len(given) or 1)
    label = "-".join(f"{width:g}" for width in given)
    return _build(
        given,
        chosen,
        amplitude,
        step_s,
        sample_rate_hz,
        lead_s,
        tail_s,
        name,
        unit,
        f"multistep {label}",
    )


def modified_3211(
    *,
    amplitude: float,
    step_s: float,
    sample_rate_hz: float,
    lead_s: float = 1.0,
    tail_s: float = 5.0,
    name: str = "u",
    unit: str = "1",
) -> Excitation:
    """3-2-1-1 with levels in proportion 0.8, -1.2, 1.1, -1.1, which nearly cancels its mean.

    The vehicle drifts less far from trim than under equal levels, and less energy lies at zero.

    Parameters
    ----------
    amplitude : float
        Largest level, in `unit`; the others follow in proportion.
    step_s : float
        Length of a width of one, s. For a mode at omega choose 1.6 / omega.
    sample_rate_hz : float
        Samples per second, Hz.
    lead_s, tail_s : float
        Trim before, and free response after, s.
    name, unit : str
        Label of the input.

    Raises
    ------
    OptionError
        A length that is not positive or not a whole number of samples.

    Reference
    ---------
    Jategaonkar, Flight Vehicle System Identification, section 2.3.

    Example
    -------
    >>> modified_3211(amplitude=0.12, step_s=0.2, sample_rate_hz=50.0).signals[0, 50]
    np.float64(0.08)
    """
    widths, levels, _, label = MULTISTEPS["modified_3211"]
    return _build(
        widths, levels, amplitude, step_s, sample_rate_hz, lead_s, tail_s, name, unit, label
    )


def multistep_energy(
    omega_rad_s: ArrayLike,
    *,
    widths: Sequence[float],
    levels: Sequence[float],
    step_s: float,
    amplitude: float = 1.0,
) -> NDArray[np.float64]:
    """Exact energy spectrum |U(omega)|² of a multistep in continuous time.

    ``U = sum_k a_k (exp(-j w t_k) - exp(-j w t_{k+1})) / (j w)``, the transform of the steps
    themselves, with no sampling.

    Parameters
    ----------
    omega_rad_s : array_like
        Frequencies, rad/s; zero is allowed.
    widths : sequence of float
        Lengths in steps.
    levels : sequence of float
        Levels over the amplitude.
    step_s : float
        Length of a width of one, s.
    amplitude : float
        Factor on the levels.

    Returns
    -------
    ndarray
        Energy, unit² s², the shape of `omega_rad_s`.

    Raises
    ------
    ShapeError
        Not as many levels as widths.

    Reference
    ---------
    Jategaonkar, Flight Vehicle System Identification, section 2.3.2.

    Example
    -------
    >>> multistep_energy([0.0], widths=[1, 1], levels=[1, -1], step_s=0.5)
    array([0.])
    """
    if len(levels) != len(widths):
        raise ShapeError("levels do not fit widths", found=len(levels), needed=len(widths))
    omega = np.asarray(omega_rad_s, dtype=np.float64)
    starts = np.concatenate(([0.0], np.cumsum(widths)[:-1])) * step_s
    lengths = np.asarray(widths, dtype=np.float64) * step_s
    middle = starts + lengths / 2
    pulses = lengths * np.sinc(omega[..., None] * lengths / (2 * np.pi))
    transform = np.sum(np.asarray(levels) * pulses * np.exp(-1j * omega[..., None] * middle), -1)
    return np.asarray(amplitude**2 * np.abs(transform) ** 2)


def multistep_band(
    *, widths: Sequence[float], levels: Sequence[float], step_s: float
) -> tuple[float, float, float]:
    """Frequencies at which a multistep's energy peaks and has fallen to half on either side.

    Parameters
    ----------
    widths, levels : sequence of float
        Lengths in steps, and levels.
    step_s : float
        Length of a width of one, s.

    Returns
    -------
    tuple of float
        Lower half-energy frequency (zero where the mean alone holds half), peak, and upper
        half-energy frequency, rad/s.

    Raises
    ------
    ShapeError
        Not as many levels as widths.

    Reference
    ---------
    Jategaonkar, Flight Vehicle System Identification, section 2.3.2.

    Example
    -------
    >>> low, peak, high = multistep_band(widths=[1, 1], levels=[1, -1], step_s=1.0)
    >>> print(f"{low:.2f} {peak:.3f} {high:.2f}")
    1.14 2.331 3.65
    """

    def energy(x: float) -> float:
        return float(multistep_energy(x, widths=widths, levels=levels, step_s=1.0))

    # The shortest step bounds the main lobe at 2 pi; half that spacing of the whole finds it.
    grid = np.linspace(0.0, 2 * np.pi / min(widths), 64 * max(4, math.ceil(sum(widths))))
    values = multistep_energy(grid, widths=widths, levels=levels, step_s=1.0)
    top = int(np.argmax(values))
    around = (grid[max(top - 1, 0)], grid[min(top + 1, grid.size - 1)])
    found = scipy.optimize.minimize_scalar(
        lambda x: -energy(x), bounds=around, options={"xatol": 1e-10}
    )
    peak = float(found.x) if top > 0 else 0.0
    half = 0.5 * energy(peak)
    below = np.flatnonzero(values[:top] < half)
    above = top + np.flatnonzero(values[top:] < half)
    low = 0.0
    if below.size:
        low = scipy.optimize.brentq(
            lambda x: energy(x) - half, grid[below[-1]], grid[below[-1] + 1]
        )
    high = scipy.optimize.brentq(lambda x: energy(x) - half, grid[above[0] - 1], grid[above[0]])
    return float(low) / step_s, peak / step_s, float(high) / step_s


def _build(
    widths: Sequence[float],
    levels: Sequence[float],
    amplitude: float,
    step_s: float,
    sample_rate_hz: float,
    lead_s: float,
    tail_s: float,
    name: str,
    unit: str,
    kind: str,
) -> Excitation:
    require_positive(amplitude=amplitude, step_s=step_s, sample_rate_hz=sample_rate_hz)
    require_not_negative(lead_s=lead_s, tail_s=tail_s)
    largest = max(abs(level) for level in levels)
    require_positive(largest_level=largest)
    pieces = [np.zeros(round(lead_s * sample_rate_hz))]
    for width, level in zip(widths, levels, strict=True):
        count = whole_samples(width * step_s, sample_rate_hz, f"a step of width {width:g}")
        pieces.append(np.full(count, amplitude * level / largest))
    pieces.append(np.zeros(max(1, round(tail_s * sample_rate_hz))))
    low, _, high = multistep_band(widths=widths, levels=levels, step_s=step_s)
    options: dict[str, Cell] = {
        "amplitude": amplitude,
        "step_s": step_s,
        "widths": " ".join(f"{width:g}" for width in widths),
        "levels": " ".join(f"{level:g}" for level in levels),
        "lead_s": lead_s,
        "tail_s": tail_s,
    }
    signal = np.concatenate(pieces)[None, :]
    return Excitation(signal, 1 / sample_rate_hz, (name,), unit, kind, (low, high), options)

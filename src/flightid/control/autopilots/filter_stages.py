"""The filters of a controller one by one, each in its discrete form."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

import numpy as np

from flightid.control.autopilots.filters import (
    Omega,
    Response,
    Section,
    one_pole_section,
    sections_response,
)
from flightid.frozen import dataclass

FilterPath = Literal["gyro", "error", "derivative", "target", "output"]

LIKE_ZERO_RAD_S = 0.01


@dataclass(frozen=True)
class FilterStage:
    """One filter of a controller in its discrete form.

    Attributes
    ----------
    name : str
        What it is, with its parameter.
    settings : str
        Kind and frequencies.
    path : {"gyro", "error", "derivative", "target", "output"}
        Where it stands: all of the feedback passes gyro, error and output, D alone the
        derivative's, the set-point alone the target's.
    rate_hz : float
        Rate at which it runs, Hz.
    sections : tuple of Section
        In series; none where it is off.

    Example
    -------
    >>> import numpy as np
    >>> from flightid.control.autopilots.filters import one_pole_section
    >>> stage = FilterStage("D filter", "one pole at 20 Hz", "derivative", 400.0,
    ...     (one_pole_section(20.0, 400.0),))
    >>> round(stage.phase_deg(2 * np.pi * 5.0))
    -14
    """

    name: str
    settings: str
    path: FilterPath
    rate_hz: float
    sections: tuple[Section, ...]

    def response(self, omega: Omega) -> Response:
        """Of a tone sampled at the filter's rate."""
        return sections_response(self.sections, omega, self.rate_hz)

    def phase_deg(self, omega_rad_s: float) -> float:
        """Sum of the sections' phases at a frequency, degrees; negative is lag."""
        at = np.array([omega_rad_s])
        each = (sections_response([one], at, self.rate_hz)[0] for one in self.sections)
        return float(sum(np.angle(value, deg=True) for value in each))

    @property
    def delay_s(self) -> float:
        """Of slow signals, s."""
        slow = LIKE_ZERO_RAD_S
        return -math.radians(self.phase_deg(slow)) / slow


def pole_stage(
    name: str, cutoff_hz: float, path: FilterPath, rate_hz: float, order: int = 1
) -> FilterStage:
    """One-pole low-passes in series; off at 0 Hz."""
    sections = (one_pole_section(cutoff_hz, rate_hz),) * order if cutoff_hz > 0.0 else ()
    poles = "one pole" if order == 1 else f"{order} poles"
    return FilterStage(name, f"{poles} at {cutoff_hz:.4g} Hz", path, rate_hz, sections)


def notch_stage(
    name: str, path: FilterPath, rate_hz: float, sections: Iterable[Section | None]
) -> FilterStage:
    """Notches in series, those that are off left out."""
    kept = tuple(section for section in sections if section is not None)
    centres = ", ".join(f"{centre_hz(section, rate_hz):.3g}" for section in kept)
    word = "notch" if len(kept) == 1 else "notches"
    return FilterStage(name, f"{word} at {centres} Hz", path, rate_hz, kept)


def centre_hz(notch: Section, rate_hz: float) -> float:
    """Frequency of a notch: its zeros and its poles turn by the same angle."""
    _, b1, _, _, a2 = notch
    return float(np.arccos(-b1 / (1.0 + a2)) * rate_hz / (2.0 * np.pi))


def gyro_stages(
    notches: tuple[Section, ...], low_pass: Section | None, name: str, cutoff: float, rate_hz: float
) -> tuple[FilterStage, FilterStage]:
    """Notches and the two-pole low-pass of the gyro."""
    kept = () if low_pass is None else (low_pass,)
    return (
        notch_stage("gyro notches", "gyro", rate_hz, notches),
        FilterStage(name, f"two poles at {cutoff:.4g} Hz", "gyro", rate_hz, kept),
    )

"""Windows from the damping that a fit finds: which it asks for, and a second pass with them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from flightid.conventions import Light
from flightid.errors import FlightidError, ModelError, SingularError
from flightid.evidence.gather import WINDOWS_LENGTHENED, WINDOWS_SHORT
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.models import GreyBoxModel
from flightid.record.history import Step
from flightid.responses import FrequencyResponse
from flightid.responses.windows.defaults import CYCLES_AT_LOWEST, windows_up_to
from flightid.version import VERSION

Pass = TypeVar("Pass")
DIES_OUT = 3.0
"""Time constants after which a mode has."""
LESS = 0.8
"""Of the window that is wanted and that records have room for, below which one is short."""


@dataclass(frozen=True)
class LongerWindows:
    """Windows that the slowest light mode of a fit asks for.

    Attributes
    ----------
    mode_rad_s : float
        Natural frequency of the mode.
    dies_out_s : float
        What it takes.
    before_s : float
        Longest window of the estimate that was fitted.
    room_s : float
        Half of the longest record: windows have no more.
    band_rad_s : tuple of float
        Of that estimate.
    """

    mode_rad_s: float
    dies_out_s: float
    before_s: float
    room_s: float
    band_rad_s: tuple[float, float]

    @property
    def longest_s(self) -> float:
        """The window to take."""
        return min(self.dies_out_s, self.room_s)

    @property
    def outlasts(self) -> bool:
        """Whether the mode needs more than there is room for."""
        return self.dies_out_s > self.room_s

    @property
    def mode(self) -> str:
        """The mode, and what it needs, in words."""
        takes = f"takes {self.dies_out_s:.2g} s to die out"
        if self.outlasts:
            takes = "outlasts half the record"
        return f"the mode at {self.mode_rad_s:.3g} rad/s {takes}"

    def estimate(
        self, estimate: Callable[..., FrequencyResponse], asked: Mapping[str, Any]
    ) -> FrequencyResponse:
        """The response once more, which says what its windows come from.

        Parameters
        ----------
        estimate : callable
            The same estimate as before, by its options.
        asked : mapping of str to object
            Options as they were given; without ``band_rad_s`` the band begins at two cycles in the
            longest window.
        """
        low, high = self.band_rad_s
        wide = min(low, CYCLES_AT_LOWEST * 2.0 * np.pi / self.longest_s), high
        lengths = windows_up_to(self.longest_s, high)
        band = asked.get("band_rad_s") or wide
        found = estimate(**{**asked, "window_s": lengths, "band_rad_s": band})
        if not found.window_s:
            return found
        records = "; a fit of the records themselves (output_error) would tell it better"
        said = (
            f"windows of up to {max(found.window_s):.3g} s, by default {self.before_s:.3g} s: "
            f"{self.mode}, as a first fit told{records if self.outlasts else ''}"
        )
        told = {"mode_rad_s": _rounded(self.mode_rad_s), "dies_out_s": _rounded(self.dies_out_s)}
        return replace(
            found,
            findings=(*found.findings, Finding(WINDOWS_LENGTHENED, Light.GREEN, said)),
            history=(*found.history, Step("windows_from_damping", told, VERSION)),
        )


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def longer_windows(
    model: GreyBoxModel, data: FrequencyResponse, lowest_rad_s: float = 0.0
) -> LongerWindows | None:
    """The windows that a fitted model asks for; None where those of the estimate do.

    Parameters
    ----------
    model : GreyBoxModel
        With the estimates.
    data : FrequencyResponse
        As it was estimated.
    lowest_rad_s : float
        Modes below do not count.
    """
    found = slowest_mode(model, data, lowest_rad_s)
    return None if found is None or found.before_s >= LESS * found.longest_s else found


def slowest_mode(
    model: GreyBoxModel, data: FrequencyResponse, lowest_rad_s: float = 0.0
) -> LongerWindows | None:
    """What the slowest light mode needs, as `longer_windows`, whether or not windows are short."""
    if data.linear is None or not data.window_s:
        return None
    try:
        poles = model.linear_system().poles()
    except (ModelError, SingularError):
        # A fit may end at a delay below zero, or where equations do not give every derivative: that
        # is said elsewhere, and there is no mode to speak of here.
        return None
    size = np.abs(poles)
    seen = (poles.imag > 0.0) & (poles.real < 0.0)
    seen &= (size >= lowest_rad_s) & (size < data.omega_rad_s[-1])
    if not seen.any():
        return None
    slowest = poles[seen][np.argmax(poles[seen].real)]
    record_s = max(u.shape[1] for u in data.linear.input_records) * data.linear.sample_time_s
    return LongerWindows(
        float(abs(slowest)),
        DIES_OUT / -float(slowest.real),
        max(data.window_s),
        0.5 * record_s,
        (float(data.omega_rad_s[0]), float(data.omega_rad_s[-1])),
    )


def judge_windows(model: GreyBoxModel, data: FrequencyResponse) -> list[Finding]:
    """Windows that are short beside what a mode of the fit needs to die out, and what to do.

    Leakage is taken out all the same; coherence, and with it the band, is lost to it. Windows that
    a first fit made longer are said as well.
    """
    said = [each for each in data.findings if each.code == WINDOWS_LENGTHENED]
    wanted = longer_windows(model, data)
    if wanted is None or said:
        return said
    longer = "" if wanted.outlasts else f"window_s={wanted.dies_out_s:.3g} or "
    return [
        Finding(
            WINDOWS_SHORT,
            Light.GREEN,
            f"{wanted.mode}, the longest window has {wanted.before_s:.3g} s:"
            f" {longer}a fit of the records themselves (output_error) would tell it better",
        )
    ]


def second_pass(
    first: Pass,
    models: Iterable[GreyBoxModel],
    data: FrequencyResponse,
    again: Callable[[LongerWindows], Pass],
    *,
    banded: bool,
) -> Pass:
    """What `again` makes with the windows that a first pass asks for, once; else the first pass.

    Parameters
    ----------
    first : object
        Whatever the first pass gave.
    models : iterable of GreyBoxModel
        Fitted in it: the one that asks for most counts, so that all see the same data.
    data : FrequencyResponse
        What they were fitted to, estimated with automatic windows.
    again : callable
    banded : bool
        Their band was chosen: modes an octave below it do not count.
    """
    lowest = 0.5 * float(data.omega_rad_s[0]) if banded else 0.0
    found = (longer_windows(each, data, lowest) for each in models)
    asked = [wanted for wanted in found if wanted is not None]
    if not asked:
        return first
    try:
        return again(max(asked, key=lambda each: each.longest_s))
    except FlightidError:
        # Longer windows are fewer: where they do not suffice, the first pass stands with its word.
        return first

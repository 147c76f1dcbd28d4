"""Margins that are read where no model was shown to hold: outside the band of its fit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.gain_limits import everywhere, loop_numbers, measured_up
from flightid.control.margins.loop_metrics import READ_AT
from flightid.control.margins.loop_source import BrokenLoop
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass

MOST_RAISED_DB = 20.0
"""By which no mode raises a response that damping and share leave ordinary: ten times."""
TO_SEE_IT = 1.3
"""Band beyond the frequency of a margin from which the model is known about it."""
BEYOND = "read above the band to which the model was shown to hold"
PLACES = READ_AT | {
    "phase_crossover_rad_s": "phase_crossover_rad_s",
    "gain_reduction_rad_s": "gain_reduction_rad_s",
    "modulus_margin": "sensitivity_peak_rad_s",
}
"""Numbers of a loop, and the fields that say at which frequency each is read."""
SAID_BELOW = {
    "phase_margin_deg": "phase margin",
    "delay_margin_s": "delay margin",
    "gain_margin_db": "gain margin",
    "gain_reduction_margin_db": "gain-reduction margin",
    "sensitivity_peak": "sensitivity peak",
}


@dataclass(frozen=True)
class MarginBeyond:
    """One loop with a margin that what lies above the band may take.

    Attributes
    ----------
    loop : str
    omega_rad_s : float
        Highest frequency at which one is read, rad/s: above the band, or inside it.
    room_db : float
        By how much a resonance above the band may raise the response before the loop passes one.
    """

    loop: str
    omega_rad_s: float
    room_db: float

    @property
    def words(self) -> str:
        """What may go wrong there."""
        if self.room_db <= 0.0:
            return f"there the loop passes one again, by {-self.room_db:.2g} dB in the model alone"
        return (
            f"a resonance there that raises the response by {self.room_db:.2g} dB may make it "
            "unstable"
        )


def room_above(loop: NDArray[np.complex128]) -> float:
    """By how much a resonance may raise a loop's response, of any shape, before it passes one, dB.

    Example
    -------
    >>> room_above(np.array([0.1j, 0.01]))
    20.0
    """
    return float(-20.0 * np.log10(np.max(np.abs(loop))))


def beyond_findings(
    found: Iterable[MarginBeyond], band_rad_s: tuple[float, float] | None
) -> list[Finding]:
    """Amber for each that a resonance may pass: what stands there is the model's word alone."""
    top = np.inf if band_rad_s is None else band_rad_s[1]
    return [
        Finding(
            "margin-beyond-band",
            Light.AMBER if _is_near(each, top) else Light.GREEN,
            f"{each.loop}: margins are read up to {each.omega_rad_s:.3g} rad/s, "
            f"{_limit(each, top)}",
            "sweep to higher frequencies, and identify up to "
            f"{TO_SEE_IT * max(each.omega_rad_s, top):.3g} rad/s or further",
        )
        for each in found
    ]


def _is_near(each: MarginBeyond, top_rad_s: float) -> bool:
    """Whether a margin is read where a resonance of ordinary size would pass one.

    Read inside the band it is the table that does not promise it: of 128 green gains of rigs and
    hovers with modes above their bands (docs/tuning.md) none was broken.
    """
    return each.omega_rad_s > top_rad_s and each.room_db < MOST_RAISED_DB


def _limit(each: MarginBeyond, top_rad_s: float) -> str:
    shown = f"the {top_rad_s:.3g} rad/s to which the model was shown to hold"
    if each.omega_rad_s > top_rad_s:
        return f"above {shown}: {each.words}, and nothing is promised of those margins"
    return (
        f"but nothing is known above {shown}: {each.words}, and no gain margin or peak is promised"
    )


@dataclass(frozen=True)
class OutsideBand:
    """Numbers of a loop that are read outside the band of its fit, with where, rad/s.

    Attributes
    ----------
    above, below : mapping of str to float
        By name of the number, as `LoopMetrics` and `loop_numbers` have it.

    Example
    -------
    >>> OutsideBand({}, {"phase_margin_deg": 0.2}).below
    {'phase_margin_deg': 0.2}
    """

    above: Mapping[str, float]
    below: Mapping[str, float]


def outside_band(loop: BrokenLoop) -> OutsideBand:
    """Which numbers of a loop are read outside the band; none where no band is known."""
    band = loop.uncertain.valid_rad_s
    if band is None:
        return OutsideBand({}, {})
    omega = measured_up(loop)[0]
    values = loop_numbers(loop, omega, [loop.uncertain.value], [*PLACES.values()])[0][0]
    places = dict(zip(PLACES, map(float, values), strict=True))
    return OutsideBand(
        {name: at for name, at in places.items() if at > band[1]},
        {name: at for name, at in places.items() if at < band[0]},
    )


def outside_band_findings(loop: BrokenLoop, found: OutsideBand) -> Iterator[Finding]:
    """What is not promised above the band, and what rests on the model's form below it."""
    band = loop.uncertain.valid_rad_s
    if band is None:
        return
    if found.above:
        omega = measured_up(loop)[0]
        whole = everywhere(loop, omega)
        omega = np.append(omega if whole is None else whole, list(found.above.values()))
        values = loop.of(loop.uncertain.value, np.unique(omega[omega > band[1]]))
        beyond = MarginBeyond(loop.name, max(found.above.values()), room_above(values))
        yield from beyond_findings([beyond], band)
    if named := [said for name, said in SAID_BELOW.items() if name in found.below]:
        lowest = min(found.below[name] for name in SAID_BELOW if name in found.below)
        yield Finding(
            "margin-below-band",
            Light.UNKNOWN,
            f"{loop.name}: {', '.join(named)} down to {lowest:.3g} rad/s, below the {band[0]:.3g} "
            "rad/s from which the model was shown to hold: they rest on its form there",
            "sweep from lower, where they matter",
        )

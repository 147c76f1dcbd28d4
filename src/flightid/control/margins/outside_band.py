"""Margins that are read where no model was shown to hold: outside the band of its fit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.gain_limits import everywhere, loop_numbers, measured_up
from flightid.control.margins.loop_metrics import READ_AT
from flightid.control.margins.loop_source import BrokenLoop
from flightid.control.margins.mode_slack import MOST_MOVED_DB, ModeSlack
from flightid.control.margins.rigid_vehicle import rigid_declared
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Reading

TO_SEE_IT = 1.3
"""Band beyond the frequency of a margin from which the model is known about it."""
SAMPLES_IN_CYCLE = 16.0
"""Rows of a log in a period of the highest frequency that is swept."""
BEYOND = "read above the band to which the model was shown to hold"
RESTING = "no gain margin or peak is promised, and phase and delay margin rest on no such mode"
LESS = "lower the loop by filters or gains"
LOWER = f"put a notch on what spectra of the gyro show there, or {LESS}"
PLACES = READ_AT | {
    "phase_crossover_rad_s": "phase_crossover_rad_s",
    "gain_reduction_rad_s": "gain_reduction_rad_s",
    "modulus_margin": "sensitivity_peak_rad_s",
    "disturbance_peak_db": "sensitivity_peak_rad_s",
}
"""Numbers of a loop, and the fields that say at which frequency each is read."""
ABOVE = ModeSlack("above")
"""Nothing lies above."""
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
    slack : ModeSlack
        What a resonance above the band leaves of the loop.
    clear_rad_s : float
        Where the loop is so low that no resonance beyond it leaves less than is asked, rad/s.
    taken : str
        What a resonance that passes one takes, in words.
    asked : bool
        Whether a margin that may be taken is required: a check that was not made.
    instead : str
        What else to do than sweep, where there is something.
    """

    loop: str
    omega_rad_s: float
    slack: ModeSlack
    clear_rad_s: float = 0.0
    taken: str = RESTING
    asked: bool = False
    instead: str = ""

    @property
    def is_near(self) -> bool:
        """Whether a resonance that may be there would pass one."""
        return self.slack.passes_one

    @property
    def words(self) -> str:
        """What may go wrong there."""
        room, moved = self.slack.room_db, self.slack.moved_db
        if room <= 0.0:
            return f"there the loop lies above one, by {-room:.2g} dB in the model alone"
        if not self.slack.has_mode:
            return f"there the loop comes as near to one as {room:.2g} dB in the model alone"
        if not self.is_near:
            return (
                f"a resonance there that raises the response by {moved:.2g} dB may leave "
                f"{self.slack.left_db:.2g} dB of gain margin"
            )
        return f"a resonance there that raises the response by {room:.2g} dB may make it unstable"


def beyond_findings(
    found: Iterable[MarginBeyond], band_rad_s: tuple[float, float] | None
) -> list[Finding]:
    """Amber for each that a resonance may pass: what stands there is the model's word alone."""
    top = np.inf if band_rad_s is None else band_rad_s[1]
    return [
        Finding(
            "margin-beyond-band",
            Light.AMBER if each.is_near or each.asked else Light.GREEN,
            f"{each.loop}: margins are read up to {each.omega_rad_s:.3g} rad/s, "
            f"{_limit(each, top)}",
            f"sweep to higher frequencies, and identify up to {_up_to(each, top)} or further"
            + (f"; or {LOWER}" if each.is_near or (each.asked and each.slack.has_mode) else "")
            + (f"; {each.instead}" if each.instead else ""),
        )
        for each in found
    ]


def held_by(omega_rad_s: float) -> str:
    """A frequency, rad/s, and which log holds it.

    Example
    -------
    >>> held_by(1150.0)
    '1150 rad/s (a log of 2930 rows a second or more holds it)'
    """
    rows = 10.0 * np.ceil(SAMPLES_IN_CYCLE * omega_rad_s / (20.0 * np.pi))
    shown = float(f"{omega_rad_s:.3g}")
    return f"{shown:g} rad/s (a log of {rows:.0f} rows a second or more holds it)"


def _up_to(each: MarginBeyond, top_rad_s: float) -> str:
    return held_by(max(TO_SEE_IT * max(each.omega_rad_s, top_rad_s), each.clear_rad_s))


def _limit(each: MarginBeyond, top_rad_s: float) -> str:
    shown = f"the {top_rad_s:.3g} rad/s to which the model was shown to hold"
    taken = each.taken if each.is_near else "no gain margin or peak is promised"
    if each.omega_rad_s > top_rad_s:
        said = f"above {shown}: {each.words}, and nothing is promised of those margins"
        return f"{said}: {taken}" if each.is_near or (each.asked and each.slack.has_mode) else said
    return f"but nothing is known above {shown}: {each.words}, and {taken}"


@dataclass(frozen=True)
class OutsideBand:
    """Numbers of a loop that are read outside the band of its fit, with where, rad/s.

    Attributes
    ----------
    above, below : mapping of str to float
        By name of the number, as `LoopMetrics` and `loop_numbers` have it.
    highest_rad_s : float
        Highest frequency at which any is read.
    room : ModeSlack
        What a resonance above the band leaves of the others.

    Example
    -------
    >>> OutsideBand({}, {"phase_margin_deg": 0.2}).below
    {'phase_margin_deg': 0.2}
    """

    above: Mapping[str, float]
    below: Mapping[str, float]
    highest_rad_s: float = 0.0
    room: ModeSlack = ABOVE

    @property
    def is_at_one_below(self) -> bool:
        """Whether the loop passes one below the band."""
        return "crossover_rad_s" in self.below or "delay_margin_s" in self.below

    def promised(self, number: Reading, of: str, least_db: float) -> Reading:
        """A number as far as it can be promised.

        Without an interval where it is read above the band, or where a resonance there may leave
        less than a gain margin of `least_db`; with one that reaches what a resonance may leave.

        Parameters
        ----------
        number : Estimate
        of : str
            Its name in `LoopMetrics`.
        least_db : float
            Gain margin that is asked for.
        """
        if number.value is not None and of in self.above:
            return Estimate(number.name, number.value, number.unit, None, BEYOND)
        return self.room.reached(number, of, least_db)


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
        float(np.nanmax(values, initial=0.0)),
        _room(loop, np.append(omega, values[values > band[1]]), band[1]),
    )


def _room(loop: BrokenLoop, omega: NDArray[np.float64], top_rad_s: float) -> ModeSlack:
    """What lies above the band of a fit, over all frequencies of a model's loop."""
    whole = everywhere(loop, omega)
    omega = omega if whole is None else np.append(whole, omega)
    above = np.unique(omega[omega > top_rad_s])
    if not above.size:
        return ABOVE
    moved_db = 0.0 if loop.rigid else MOST_MOVED_DB
    return ModeSlack.above(loop.of(loop.uncertain.value, above), moved_db)


def outside_band_findings(
    loop: BrokenLoop, found: OutsideBand, least_db: float
) -> Iterator[Finding]:
    """What is not promised above the band, and what rests on the model's form below it.

    Parameters
    ----------
    loop : BrokenLoop
    found : OutsideBand
    least_db : float
        Gain margin that is asked for.
    """
    band = loop.uncertain.valid_rad_s
    yield from rigid_declared(loop.rigid, band)
    if band is None:
        return
    if found.above or found.room.left_db < least_db:
        beyond = MarginBeyond(loop.name, found.highest_rad_s, found.room)
        yield from beyond_findings([beyond], band)
    if named := [said for name, said in SAID_BELOW.items() if name in found.below]:
        lowest = min(found.below[name] for name in SAID_BELOW if name in found.below)
        taken = ": intervals of this loop rest on its form there"
        if not loop.rigid:
            taken += ", and a light mode, such as a pendulum, may take margins and stability"
        yield Finding(
            "margin-below-band",
            Light.AMBER if found.is_at_one_below else Light.UNKNOWN,
            f"{loop.name}: {', '.join(named)} down to {lowest:.3g} rad/s, below the {band[0]:.3g} "
            "rad/s from which the model was shown to hold"
            + (taken if found.is_at_one_below else ": they rest on its form there"),
            f"sweep from {lowest / TO_SEE_IT:.2g} rad/s or lower",
        )

"""The noun: coupled axes with all their loops closed, however each was designed."""

from __future__ import annotations

from collections.abc import Iterator

from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass

MOST = 0.95
"""Share of the fresh plants that have to keep what was required."""


@dataclass(frozen=True)
class ClosedAxis:
    """What gains that were designed alone are worth with all loops closed.

    Attributes
    ----------
    axis : str
    worst_cases : tuple of WorstCase
    kept_plants, n_plants : int
        Of the fresh plants, how many meet every requirement.

    Example
    -------
    >>> ClosedAxis("roll", (), 20, 21).is_kept
    True
    """

    axis: str
    worst_cases: tuple[WorstCase, ...]
    kept_plants: int
    n_plants: int

    @property
    def is_kept(self) -> bool:
        """Whether nearly every plant meets every requirement."""
        return self.kept_plants >= MOST * self.n_plants

    @property
    def finding(self) -> Finding:
        """The verdict."""
        count = f"{self.kept_plants} of {self.n_plants} fresh plants"
        if self.is_kept:
            said = f"{self.axis}, designed alone, keeps what was required with all loops closed"
            return Finding("coupling-stood", Light.GREEN, f"{said}: {count}")
        broken = "; ".join(_broken(each) for each in self.worst_cases if not each.met)
        return Finding(
            "coupling-ignored",
            Light.RED,
            f"{self.axis} was designed alone; with all loops closed {count} keep what was "
            f"required: {broken}",
            "design the axes together, other_loops='closed'",
        )

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {**vars(self), "worst_cases": [each.to_dict() for each in self.worst_cases]}


@dataclass(frozen=True)
class Together:
    """Loops of coupled axes, all closed.

    Attributes
    ----------
    axes : tuple of str
    stable_plants, n_plants : int
        Of the fresh plants, how many are stable, by the poles of the whole.
    disk_margin, worst_disk_margin : float or None
        α of the least disk of simultaneous gains and phases at all outputs that is not stood, at
        the estimate and at the worst plant; None where that is unstable.
    gain_db, phase_deg : float or None
        What all outputs may gain or lose at once, at the worst plant.
    flown_disk_margin : float or None
        With the flown gains, at the estimate.
    coupling : float or None
        Largest closed-loop gain from one axis' rate set-point to another axis' rate.
    flown_stable_plants : int
        Of the same plants, how many the flown gains hold stable.
    closed : tuple of ClosedAxis
        Where each axis was designed with the others' loops open: what its gains are worth with all
        loops closed; empty where they were designed so.

    Example
    -------
    >>> Together(("roll", "pitch"), 300, 300, 0.9, 0.8, 7.4, 43.6, 1.1, 0.2, 300).all_stable
    True
    """

    axes: tuple[str, ...]
    stable_plants: int
    n_plants: int
    disk_margin: float | None
    worst_disk_margin: float | None
    gain_db: float | None
    phase_deg: float | None
    flown_disk_margin: float | None
    coupling: float | None
    flown_stable_plants: int
    closed: tuple[ClosedAxis, ...] = ()

    @property
    def all_stable(self) -> bool:
        """Whether every plant is stable."""
        return self.stable_plants == self.n_plants

    def findings(self) -> Iterator[Finding]:
        """Verdicts on the loops together."""
        names = " and ".join(self.axes)
        if not self.all_stable:
            bad = self.n_plants - self.stable_plants
            yield Finding(
                "together-unstable",
                Light.RED,
                f"{names} closed together: {bad} of {self.n_plants} plants are unstable",
                "do not fly these gains; identify the coupling better",
            )
        elif self.gain_db is not None and self.phase_deg is not None:
            yield Finding(
                "together",
                Light.GREEN,
                f"{names} closed together: all plants stable; every output may change at once by "
                f"±{self.gain_db:.1f} dB or ±{self.phase_deg:.0f}° at the worst plant",
            )
        yield from (each.finding for each in self.closed)

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        plain = {key: list(v) if isinstance(v, tuple) else v for key, v in vars(self).items()}
        return plain | {"closed": [each.to_dict() for each in self.closed]}


def _broken(number: WorstCase) -> str:
    """A requirement that is not kept, in words."""
    least, _ = number.shown_worst
    worst = "none" if least is None else f"{least:.{number.digits}g}"
    unit = "" if number.unit == "1" else f" {number.unit}"
    return f"{number.loop}, {number.name} {worst}{unit} at the worst plant ({number.required})"

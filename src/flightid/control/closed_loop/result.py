"""What closing a loop gives: poles with intervals, broken loops, and a verdict."""

from __future__ import annotations

import math

from flightid.control.loops.interconnection import Interconnection
from flightid.control.loops.same_wires import with_part
from flightid.control.margins.margins import Margins, margins
from flightid.errors import UnknownNameError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import interval_words, shown
from flightid.uncertainty.uncertain import Uncertain

PLANT = 0
"""Place of the vehicle among the blocks of a closed loop."""


@dataclass(frozen=True)
class ClosedPole:
    """One pole of a closed loop, or a pair.

    Attributes
    ----------
    real, imaginary, frequency : Estimate
        rad/s; of a sampled loop, of ln z/T.
    damping : Estimate
    """

    real: Reading
    imaginary: Reading
    frequency: Reading
    damping: Reading


@dataclass(frozen=True, eq=False, repr=False)
class ClosedLoop(
    Result, schema="flightid.closed_loop/1", untold={"uncertain": "the loops with their covariance"}
):
    """A controller closed around a model.

    Made by `flightid.close_loop`.

    Attributes
    ----------
    name : str
    loops : Interconnection
        All signals at the estimate: outputs of the model and ``"<input>_total"``.
    actuators : tuple of str
        Inputs of the model that the controller moves.
    uncertain : Uncertain of Interconnection
        The loops over the uncertainty of the model.
    poles : tuple of ClosedPole
        The slowest, as many as there are states.
    draws, unstable_draws : int
        Vehicles that were drawn from the uncertainty, and those that are unstable.
    findings : tuple of Finding
    reason : str
        Why there are no intervals.

    Example
    -------
    >>> import flightid as fid
    >>> yaw = fid.LinearSystem([[-0.4]], [[2.0]], [[1.0]], [[0.0]], ("ped",), ("r",))
    >>> closed = fid.close_loop(yaw, {"ped": {"r": 1.0}})
    >>> closed.poles[0].real
    Estimate(real part = -2.4 rad/s)
    >>> round(closed.broken_at("ped").frequency_response([0.0]).real.item(), 9)
    5.0
    """

    name: str
    loops: Interconnection
    actuators: tuple[str, ...]
    uncertain: Uncertain[Interconnection]
    poles: tuple[ClosedPole, ...]
    draws: int
    unstable_draws: int
    findings: tuple[Finding, ...]
    reason: str = ""

    @property
    def is_stable(self) -> bool:
        """Stability at the estimate."""
        return self.loops.is_stable

    def broken_at(self, actuator: str) -> Interconnection:
        """The loop broken at an actuator, the others closed; negative feedback.

        Parameters
        ----------
        actuator : str
            One of `actuators`.

        Raises
        ------
        UnknownNameError
            The controller does not move it.
        """
        return self.loops.broken_at(self._total(actuator))

    def margins(self, *, band_rad_s: tuple[float, float] | None = None) -> dict[str, Margins]:
        """Margins of the loop broken at each actuator, with 95 % intervals, the others closed.

        Parameters
        ----------
        band_rad_s : tuple of float, optional
            As for `flightid.margins`.

        Returns
        -------
        dict of str to Margins
        """
        found = {}
        for name in self.actuators:
            found[name] = margins(self._broken(name), band_rad_s=band_rad_s)
        return found

    def _broken(self, actuator: str) -> Uncertain[Interconnection]:
        """The loop broken at an actuator over the uncertainty: cut once, for every vehicle."""
        cut = self.broken_at(actuator)
        broken = self.uncertain.then(lambda loops: with_part(cut, PLANT, loops.blocks[PLANT].part))
        return broken.about(self._closed_by(actuator))

    def _closed_by(self, actuator: str) -> list[str]:
        """Responses that the loop at an actuator closes, ``"output/input"``: what it feeds back."""
        plant, *others = self.loops.blocks
        wanted, size = {actuator, f"{actuator}_controller"}, 0
        while len(wanted) > size:
            size = len(wanted)
            wanted |= {
                name
                for block in others
                if wanted.intersection(block.outputs)
                for name in block.inputs
            }
        return [f"{name}/{actuator}" for name in plant.outputs if name in wanted]

    def _total(self, actuator: str) -> str:
        if actuator not in self.actuators:
            raise UnknownNameError(
                "the controller does not move this input", found=repr(actuator),
                needed=f"one of {', '.join(self.actuators)}",
            )  # fmt: skip
        return f"{actuator}_total"

    def __repr__(self) -> str:
        """Actuators, verdict and slowest pole on one line."""
        n = len(self.actuators)
        verdict = "stable" if self.is_stable else "not stable"
        slowest = max((p.real.value for p in self.poles if p.real.value is not None), default=None)
        pole = "" if slowest is None else f", slowest pole {slowest:.4g} rad/s"
        names = ", ".join(self.actuators)
        return f"ClosedLoop({n} actuator{'' if n == 1 else 's'} [{names}], {verdict}{pole})"

    def summary(self, *, level: float | None = None) -> Table:
        """Table of the poles with intervals.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        level = shown(level)
        words = interval_words(level)
        columns = (
            Column("real", "rad/s"),
            Column(f"real, {words}"),
            Column("imaginary", "rad/s"),
            Column("frequency", "rad/s"),
            Column("in Hz"),
            Column(f"frequency, {words}"),
            Column("damping", digits=3),
            Column(f"damping, {words}"),
        )
        rows = tuple(
            (
                *(each.real.value, each.real.range_words(level), each.imaginary.value),
                each.frequency.value,
                None if each.frequency.value is None else each.frequency.value / math.tau,
                each.frequency.range_words(level),
                *(each.damping.value, each.damping.range_words(level)),
            )
            for each in self.poles
        )
        notes = [str(finding) for finding in self.findings]
        if self.draws:
            notes.append(f"{self.unstable_draws} of {self.draws} drawn vehicles are unstable.")
        if self.reason:
            notes.append(f"No intervals: {self.reason}.")
        return Table(f"Poles of {self.name}", columns, rows, tuple(notes)).without_empty_columns()

    def _computed(self) -> dict[str, object]:
        return {"stable": self.is_stable}

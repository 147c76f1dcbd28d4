"""Poles and stability of closed loops, delays inside them treated exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.loops.delayed_roots import (
    count_right,
    line_right_of_axis,
    refined_roots,
)
from flightid.control.loops.linear_core import Core
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Column, Table

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]
Parts = tuple[Array, Array, Array, Array, Array]
SEEDS_A_DELAY = 4
"""Poles looked for beside those of the states, for each delay."""
NEUTRAL = 1e-9
"""Real part over size below which a pole stands still on the imaginary axis."""


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Result, schema="flightid.loop_stability/1"):
    """Whether closed loops are stable, by their poles and by a count that knows no poles.

    Attributes
    ----------
    poles : ndarray of complex
        rad/s; of a sampled loop in the z plane. With delays inside the loops there are infinitely
        many: these are the ones that an approximation of order 6 leads to, each then made exact.
    sample_time_s : float or None
    n_unstable : int
        Poles right of the imaginary axis or outside the unit circle, counted by the argument
        principle where there are delays inside.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.connect([fid.loops.transfer("e", "y", [2.0], [1.0, 0.0], delay_s=0.1),
    ...                     fid.loops.sum_of("e", "r", "-y")], inputs=["r"], outputs=["y"])
    >>> loop.stability()
    Stability(stable, 4 poles, slowest -2.592 rad/s)
    """

    poles: Complex
    sample_time_s: float | None
    n_unstable: int
    findings: tuple[Finding, ...] = ()

    @property
    def is_stable(self) -> bool:
        """No pole on the right, none on the axis."""
        return not self.n_unstable and not np.any(self._neutral)

    @property
    def _size(self) -> NDArray[np.float64]:
        """How fast each pole's mode grows, per s."""
        if self.sample_time_s is None:
            return np.asarray(self.poles.real)
        return np.asarray(np.log(np.maximum(np.abs(self.poles), 1e-300)) / self.sample_time_s)

    @property
    def _neutral(self) -> NDArray[np.bool_]:
        scale = np.maximum(np.abs(self.poles), 1.0) if self.sample_time_s is None else 1.0
        return np.asarray(np.abs(self._size) <= NEUTRAL * scale)

    def __repr__(self) -> str:
        """Verdict and the pole that decides on one line."""
        verdict = "stable" if self.is_stable else f"{self.n_unstable} unstable"
        if not self.is_stable and not self.n_unstable:
            verdict = "neutral"
        slowest = "" if not len(self.poles) else f", slowest {self._size.max():.4g} rad/s"
        return f"Stability({verdict}, {len(self.poles)} poles{slowest})"

    def summary(self) -> Table:
        """Table of the poles, the least stable first."""
        equivalent: Complex = self.poles
        if self.sample_time_s is not None:
            equivalent = np.asarray(np.log(self.poles + 1e-300) / self.sample_time_s)
        order = np.argsort(-equivalent.real)
        rows = [
            (float(s.real), float(s.imag), float(abs(s)), float(-s.real / abs(s)) if s else None)
            for s in equivalent[order]
            if s.imag >= 0.0
        ]
        columns = (
            Column("real", "rad/s"), Column("imaginary", "rad/s"), Column("frequency", "rad/s"),
            Column("damping"),
        )  # fmt: skip
        return Table(
            "Poles of the closed loops", columns, tuple(rows), tuple(map(str, self.findings))
        )

    def _computed(self) -> dict[str, object]:
        return {"stable": self.is_stable}


def by_poles(poles: Complex, sample_time_s: float | None) -> Stability:
    """Stability of a system without delays inside, from its poles alone."""
    if sample_time_s is None:
        scale = np.maximum(np.abs(poles), 1.0)
        unstable = poles.real > NEUTRAL * scale
    else:
        unstable = np.abs(poles) > 1.0 + NEUTRAL
    return Stability(_sorted(poles), sample_time_s, int(unstable.sum()))


def delayed_parts(core: Core, inputs: tuple[str, ...]) -> Parts:
    """A, B, C, D and delays of what goes around inside: x' = A x + B w, z = C x + D w, w late z."""
    inside = core.delayed_inside(inputs)
    delays = np.array([core.rows[k].delay_s for k in inside])
    reads = core.places(core.rows[k].carrier for k in inside)
    return core.a, core.b[:, inside], core.c[reads], core.d[np.ix_(reads, inside)], delays


def with_delays(parts: Parts, seeds: Complex) -> Stability:
    """Stability with delays inside: poles found, and counted without finding them.

    Parameters
    ----------
    parts : tuple of ndarray
        Of `delayed_parts`.
    seeds : ndarray of complex
        Poles of an approximation, rad/s.
    """
    # The approximation's fastest poles are its own, and take longest to lead anywhere.
    kept = seeds[np.argsort(-seeds.real)][: len(parts[0]) + SEEDS_A_DELAY * len(parts[4])]
    poles = refined_roots(*parts, seeds=kept)
    line = line_right_of_axis(parts[0], parts[4])
    counted = count_right(*parts, line)
    found = int(np.sum(poles.real > line))
    findings = []
    if counted is None:
        findings.append(
            Finding(
                "stability-not-counted",
                Light.AMBER,
                "poles on the right could not be counted by the argument principle; those found "
                "are counted instead",
                "look at the broken loop's response",
            )
        )
    elif counted != found:
        findings.append(
            Finding(
                "poles-missing",
                Light.AMBER,
                f"{counted} poles lie on the right, {found} of them were found",
                "the count decides; look at the broken loop's response",
            )
        )
    return Stability(_sorted(poles), None, found if counted is None else counted, tuple(findings))


def _sorted(poles: Complex) -> Complex:
    return np.asarray(poles[np.lexsort((poles.imag, poles.real))], dtype=np.complex128)

"""Approximate modes beside those of the full model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.dynamics.modes.approximations import ALIASES, RIGID, RULES, Elements, Rule, rigid
from flightid.dynamics.modes.modes import modes
from flightid.dynamics.modes.result import Mode, Modes
from flightid.dynamics.modes.state_matrix import StateMatrix, read_states
from flightid.errors import ModelError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.uncertain_of import source_findings
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.quantiles import shown
from flightid.uncertainty.uncertain import Uncertain
from flightid.units import convert, same_dimension

HOVER_M_S = 5.0
"""Trim speed below which the formulas of hover are meant, not those of forward flight."""
OWN = 0.5
"""Least participation of a formula's states in the mode that it is compared with."""
POOR_PERCENT = 25.0
"""Difference of the frequency from which an approximation is called poor."""


@dataclass(frozen=True)
class ApproximateMode:
    """One approximation beside the full model's mode.

    Attributes
    ----------
    name, formula, source : str
    root : complex
        rad/s.
    natural_frequency : Estimate
        rad/s; of a real root its signed value.
    damping_ratio : Estimate
        None for a real root.
    full : Mode or None
        The full model's; None where it has no such mode.
    reason : str
        Why there is no full mode.

    Example
    -------
    >>> import flightid as fid
    >>> found = fid.approximate_modes(fid.load_model("short_period"))
    >>> round(found.mode("short period").difference_percent, 9) + 0.0
    0.0
    """

    name: str
    formula: str
    source: str
    root: complex
    natural_frequency: Reading
    damping_ratio: Reading
    full: Mode | None
    reason: str = ""

    @property
    def difference_percent(self) -> float | None:
        """Frequency, or real root, against the full model's, percent of the full model's."""
        if self.full is None or not self.full.root:
            return None
        if self.root.imag:
            return 100.0 * (abs(self.root) / abs(self.full.root) - 1.0)
        return 100.0 * (self.root.real / self.full.root.real - 1.0)

    @property
    def damping_difference(self) -> float | None:
        """Damping ratio less the full model's."""
        mine = self.damping_ratio.value
        theirs = None if self.full is None else self.full.damping_ratio.value
        return None if mine is None or theirs is None else mine - theirs

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "name": self.name,
            "formula": self.formula,
            "source": self.source,
            "root": [self.root.real, self.root.imag],
            "natural_frequency": self.natural_frequency.to_dict(),
            "damping_ratio": self.damping_ratio.to_dict(),
            "full": None if self.full is None else self.full.to_dict(),
            "difference_percent": self.difference_percent,
            "damping_difference": self.damping_difference,
            "reason": self.reason,
        }


@dataclass(frozen=True, repr=False, eq=False)
class ApproximateModes(Result, schema="flightid.approximate_modes/1"):
    """Result of `flightid.approximate_modes`.

    Attributes
    ----------
    name : str
        The model's.
    flight : {"forward", "hover"}
        Whose formulas were taken.
    approximations : tuple of ApproximateMode
    full : Modes
        Of the whole model.
    quasi_static : tuple of str
        States that the formulas do not know.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> fid.approximate_modes(fid.load_model("fixed_wing_longitudinal"))
    ApproximateModes('Fixed wing, longitudinal': 3 approximations, worst frequency 21.7 %)
    """

    name: str
    flight: str
    approximations: tuple[ApproximateMode, ...]
    full: Modes
    quasi_static: tuple[str, ...]
    findings: tuple[Finding, ...]

    def mode(self, name: str) -> ApproximateMode:
        """The approximation of a name.

        Parameters
        ----------
        name : str

        Raises
        ------
        ModelError
            There is no such approximation.
        """
        for each in self.approximations:
            if each.name == name:
                return each
        raise ModelError(
            "there is no such approximation",
            found=repr(name),
            needed=", ".join(each.name for each in self.approximations),
        )

    def summary(self, *, level: float | None = None) -> Table:
        """Table of the approximations beside the full modes, formulas and sources below.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        level = shown(level)
        columns = (
            Column("approximation"),
            Column("ω_n or root", "rad/s"),
            Column("±", "rad/s", 2),
            Column("ζ", digits=3),
            Column("±", digits=2),
            Column("full ω_n or root", "rad/s"),
            Column("full ζ", digits=3),
            Column("difference", "%", 3),
            Column("of ζ", digits=2),
        )
        rows = tuple(_row(each, level) for each in self.approximations)
        notes = [f"{e.name}: {e.formula}; {e.source}." for e in self.approximations]
        notes += [f"{e.name}: {e.reason}." for e in self.approximations if e.reason]
        if self.quasi_static:
            notes.append(f"Taken as quasi-static: {', '.join(self.quasi_static)}.")
        notes.append("Derivatives are those of the state matrix: what left sides add is in them.")
        notes += map(str, self.findings)
        title = f"Approximate modes of {self.name}"
        return Table(title, columns, rows, tuple(notes)).without_empty_columns()

    def __repr__(self) -> str:
        """Count and worst difference on one line."""
        apart = [abs(e.difference_percent) for e in self.approximations if e.difference_percent]
        worst = f", worst frequency {max(apart):.1f} %" if apart else ""
        n = len(self.approximations)
        return f"ApproximateModes({self.name!r}: {n} approximation{'' if n == 1 else 's'}{worst})"


def approximate_modes(
    source: object, *, states: Mapping[str, str] | None = None, flight: str | None = None
) -> ApproximateModes:
    """Textbook approximations of a model's modes, and how far off they are.

    Short period, phugoid, Dutch roll, spiral and roll in forward flight; the hovering cubics, heave
    and yaw in hover. Derivatives are read off the state matrix by the states' conventional names,
    so that the model's own parameters may be called anything.

    Parameters
    ----------
    source : Fit, model or LinearSystem
        Continuous, with states u, v or beta, w or alpha, p, q, r, phi, theta, as it has them.
    states : mapping of str to str, optional
        Conventional names of states that the model calls something else.
    flight : {"forward", "hover"}, optional
        Whose formulas; left out: hover where the trim speed (w' by q) is below 5 m/s.

    Raises
    ------
    ModelError
        A sampled model, or one with no set of states that a formula knows.

    Assumes
    -------
    What each formula leaves out; the difference from the full model says how much that is. States
    beyond the rigid body (flapping, inflow, actuators) are quasi-static: poor where they are slow.

    Reference
    ---------
    Nelson, *Flight Stability and Automatic Control*, 2nd ed., sections 4.4 and 5.4; Etkin & Reid,
    *Dynamics of Flight*, 3rd ed., section 6.8; Johnson, *Helicopter Theory*, section 15-3.

    Example
    -------
    >>> import flightid as fid
    >>> found = approximate_modes(fid.load_model("fixed_wing_lateral"))
    >>> round(found.mode("Dutch roll").natural_frequency.value, 2)
    2.17
    """
    read = read_states(source, states or {})
    if read.system.is_discrete:
        raise ModelError(
            "approximations speak of derivatives, which a sampled model has none of",
            found=f"T = {read.system.sample_time_s:g} s",
            action="convert it with to_continuous, and name its states",
        )
    known = {ALIASES.get(name, name) for name in read.states}
    chosen = flight or _flight(read)
    rules = [r for r in RULES if r.flight == chosen and known.issuperset(r.states)]
    if not rules:
        raise ModelError(
            "no approximation fits the states of the model",
            found=", ".join(read.states),
            needed="for example w or alpha and q; v or beta and r; u, q and theta in hover",
            action='name them: states={"x1": "q"}',
        )
    full = modes(source, states=states)
    found = tuple(_approximate(read, rule, full) for rule in rules)
    findings = (*_judge(found), *source_findings(source))
    fast = tuple(name for name in read.states if ALIASES.get(name, name) not in RIGID)
    return ApproximateModes(read.name, chosen, found, full, fast, findings)


def _flight(read: StateMatrix) -> str:
    """By the trim speed, which is what w' takes of q; a flow angle means forward flight."""
    elements = dict(zip(read.states, range(len(read.states)), strict=True))
    if {"alpha", "beta"} & set(read.states):
        return "forward"
    pairs = [("w", "q"), ("v", "r")]
    for speed, rate in pairs:
        if speed in elements and rate in elements:
            value = abs(float(np.asarray(read.system.a)[elements[speed], elements[rate]]))
            unit = read.units[speed]
            metres = convert([value], unit, "m/s")[0] if same_dimension(unit, "m/s") else value
            return "hover" if metres < HOVER_M_S else "forward"
    return "hover"


def _approximate(read: StateMatrix, rule: Rule, full: Modes) -> ApproximateMode:
    def numbers(a: NDArray[np.float64]) -> list[float]:
        elements: Elements = rigid(a, read.states)
        root = complex(np.nan, np.nan)
        if np.all(np.isfinite(elements.a)):
            root = rule.root(elements)
        size = abs(root) if rule.pair else root.real
        return [root.real, root.imag, size, -root.real / abs(root) if rule.pair else math.nan]

    found = read.carried(numbers)
    root = complex(*found.numbers[:2])
    missing = "the formula gives no such root here"
    size = found.number(2, "natural frequency" if rule.pair else "root", "rad/s", missing)
    damping = _damping(found, rule, missing)
    mode, reason = _match(rule, root, full, read)
    return ApproximateMode(rule.name, rule.formula, rule.source, root, size, damping, mode, reason)


def _damping(found: Uncertain[NDArray[np.float64]], rule: Rule, missing: str) -> Reading:
    if not rule.pair:
        return Estimate("damping ratio", None, "1", None, "real root")
    return found.number(3, "damping ratio", "1", missing)


def _match(rule: Rule, root: complex, full: Modes, read: StateMatrix) -> tuple[Mode | None, str]:
    """The nearest mode of the same kind in which the formula's states take part most."""
    if not np.isfinite(root):
        return None, "the formula gives no such root here"
    own = dict(zip(read.states, read.system.states, strict=True))
    carriers = [own[name] for name in read.states if ALIASES.get(name, name) in rule.carriers]
    alike = [
        mode for mode in full if mode.is_pair == rule.pair and sum(map(mode.share, carriers)) >= OWN
    ]
    if not alike:
        kind = "oscillation" if rule.pair else "aperiodic mode"
        return None, f"the full model has no {kind} of {', '.join(carriers)}"
    return min(alike, key=lambda mode: abs(mode.root - root)), ""


def _row(each: ApproximateMode, level: float) -> tuple[Cell, ...]:
    full = each.full
    theirs: tuple[Cell, ...] = (None, None)
    if full is not None and full.is_pair:
        theirs = (abs(full.root), full.damping_ratio.value)
    elif full is not None:
        theirs = (full.root.real, None)
    mine = (each.natural_frequency, each.damping_ratio)
    cells = [cell for q in mine for cell in (q.value, q.half(level))]
    return (each.name, *cells, *theirs, each.difference_percent, each.damping_difference)


def _judge(found: tuple[ApproximateMode, ...]) -> Iterator[Finding]:
    for each in found:
        apart = each.difference_percent
        if apart is not None and abs(apart) > POOR_PERCENT:
            yield Finding(
                "poor-approximation",
                Light.AMBER,
                f"{each.name}: {apart:+.0f} % from the full model's",
                "do not argue with this formula for this vehicle",
            )

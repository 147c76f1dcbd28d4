"""The reduction: every step from a full structure to one whose parameters the data determine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.reduction.growth import growth_findings, poles_of
from flightid.identification.reduction.rules import ReductionLimits, choose
from flightid.result import Result
from flightid.table import Cell, Column, Table


@dataclass(frozen=True, eq=False)
class ReductionStep:
    """One parameter that was dropped, or was tried and had to stay.

    Attributes
    ----------
    name : str
        Parameter.
    value : float
        At which it was fixed, in its unit: zero, or what the note explains.
    reason : str
        Why it was chosen: the guide it breaks, or ``"by hand"``.
    cost_before, cost_after : float or None
        Average cost without and with the step; None where the smaller model has no fit.
    accepted : bool
        Whether the parameter is out.
    fit : Fit or None
        Of the smaller model.
    note : str
        Why it had to stay, or why it was not fixed at zero.
    explained : float
        Rise of the average cost that the random error of the parameter explains.
    changes_growth : bool
        Whether it had to stay for what grows, not for the cost.

    Example
    -------
    >>> ReductionStep("Lu", 0.0, "insensitivity 31 %", 20.0, 20.1, True).rise_percent
    0.5
    """

    name: str
    value: float
    reason: str
    cost_before: float
    cost_after: float | None
    accepted: bool
    fit: Fit | None = None
    note: str = ""
    explained: float = 0.0
    changes_growth: bool = False

    @property
    def rise_percent(self) -> float | None:
        """Rise of the average cost, percent; None where it has no meaning."""
        if self.cost_after is None or self.cost_before == 0.0:
            return None
        return round(100.0 * (self.cost_after / self.cost_before - 1.0), 9)

    def to_dict(self) -> dict[str, object]:
        """Plain values; the fit as its parameters."""
        shown = {k: v for k, v in vars(self).items() if k != "fit"}
        values = None
        if self.fit is not None:
            values = {name: p.to_dict() for name, p in self.fit.parameters.items()}
        return {**shown, "rise_percent": self.rise_percent, "parameters": values}


@dataclass(frozen=True, repr=False, eq=False)
class Reduction(Result, schema="flightid.reduction/1", untold={"data": "responses or records"}):
    """Result of `flightid.reduce`.

    Attributes
    ----------
    start : Fit
        The fit that was reduced.
    path : tuple of ReductionStep
        Every step in order, those that were undone among them.
    stopped : str
        Why it ended.
    limits : ReductionLimits
    keep : tuple of str
        Parameters that had to stay.
    at : mapping of str to float
        Values other than zero at which parameters are fixed.
    after_rise : str
    options : mapping
        Options of the fits.
    data : FrequencyResponse, or Record or sequence of Record
        What was fitted.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.load_model("rate_first_order").with_values({"Lp": -6.0, "tau": 0.0})
    >>> omega = np.geomspace(1.0, 30.0, 50)
    >>> data = fid.FrequencyResponse.from_values(omega, truth.frequency_response(omega),
    ...     inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"})
    >>> fit = fid.identify(fid.load_model("rate_first_order"), data)
    >>> found = fid.reduce(fit, data, drop=["tau"])
    >>> found
    Reduction('Roll rate, first order', 3 to 2 free parameters in 1 step, average cost 0.00)
    """

    start: Fit
    path: tuple[ReductionStep, ...]
    stopped: str
    limits: ReductionLimits
    keep: tuple[str, ...] = ()
    at: Mapping[str, float] = field(default_factory=dict)
    after_rise: str = "stop"
    options: Mapping[str, object] = field(default_factory=dict)
    data: object = None

    @property
    def fit(self) -> Fit:
        """The fit of the reduced model, with the path's findings beside its own."""
        return self.fit_after(len(self.path))

    def fit_after(self, step: int) -> Fit:
        """The fit that stood after some steps of the path; 0 is the start.

        Raises
        ------
        OptionError
            The path has fewer steps.
        """
        if not 0 <= step <= len(self.path):
            raise OptionError(
                "the path has no such step", found=step, needed=f"0 to {len(self.path)}"
            )
        fits = [each.fit for each in self.path[:step] if each.accepted and each.fit is not None]
        return fits[-1] if fits else self.start

    @property
    def dropped(self) -> dict[str, float]:
        """Parameters that are out, with the values at which they are fixed."""
        return {each.name: each.value for each in self.path if each.accepted}

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdict on the path, and those on the reduced fit."""
        return (*self.path_findings, *self.fit.findings)

    @cached_property
    def path_findings(self) -> tuple[Finding, ...]:
        """Verdict on the path alone."""
        found = [self._verdict()]
        if self.dropped:
            found += growth_findings(poles_of(self.start), poles_of(self.fit))
        found += [
            Finding("reduction-held", Light.AMBER, f"{each.name}: {each.note}")
            for each in self.path
            if each.accepted and each.note
        ]
        stay = [each for each in self.path if not each.accepted]
        if stay:
            names, last = ", ".join(each.name for each in stay), stay[-1]
            found.append(
                Finding(
                    "reduction-stays",
                    Light.AMBER,
                    f"staying though they break a guide: {names}; {last.name} last "
                    f"({last.reason}): {last.note}",
                    "judge their intervals",
                )
            )
        open_ = self.untried
        if open_:
            found.append(
                Finding(
                    "reduction-ended",
                    Light.AMBER,
                    f"the path ended there; not tried, though they break a guide: "
                    f"{', '.join(open_)}",
                    'try them: after_rise="next"',
                )
            )
        return tuple(found)

    @property
    def untried(self) -> tuple[str, ...]:
        """Parameters that break a guide, and that the path did not come to."""
        stay = {*self.keep, *(each.name for each in self.path)}
        found: list[str] = []
        while (each := choose(self.fit, self.limits, {*stay, *found})) is not None:
            found.append(each.name)
        return tuple(found)

    def _verdict(self) -> Finding:
        """What is out, and whether the cost and the guides are kept."""
        before, after = self.start.average_cost, self.fit.average_cost
        out = ", ".join(self.dropped) or "nothing"
        said = f"dropped {out}; average cost {before:.4g} to {after:.4g}; {self.stopped}"
        explained = [each.explained for each in self.path if each.accepted]
        allowed = self.limits.total_allowed(before, explained)
        if after > self.limits.negligible_cost and after - before > allowed:
            action = "keep what the cost needs, or judge the predictions of unseen records"
            most = f"{self.limits.maximum_total_cost_rise_percent:g} %"
            said += f"; that is a rise by more than {most} and than random error explains"
            return Finding("reduction", Light.RED, said, action)
        left = choose(self.fit, self.limits, ())
        return Finding("reduction", Light.GREEN if left is None else Light.AMBER, said)

    def __repr__(self) -> str:
        """Parameters before and after, steps and average cost on one line."""
        sizes = [len(fit.model.parameters.free) for fit in (self.start, self.fit)]
        n = len(self.path)
        return (
            f"Reduction({self.start.model.name!r}, {sizes[0]} to {sizes[1]} free parameters in {n} "
            f"step{'' if n == 1 else 's'}, average cost {self.fit.average_cost:.2f})"
        )

    def summary(self) -> Table:
        """Table of the path: what was dropped, why, and what it cost."""
        columns = (
            Column("step"),
            Column("parameter"),
            Column("why"),
            Column("fixed at"),
            Column("cost", digits=5),
            Column("rise", "%", 3),
            Column("insensitivity", "%", 3),
            Column("Cramér–Rao", "%", 3),
            Column("out"),
        )
        percents = worst_percents(self.start)
        first = (0, "", "start", None, self.start.average_cost, None, *percents, None)
        rows: list[tuple[Cell, ...]] = [first]
        for number, each in enumerate(self.path, 1):
            percents = (None, None) if each.fit is None else worst_percents(each.fit)
            row = (number, each.name, each.reason, each.value, each.cost_after)
            rows.append((*row, each.rise_percent, *percents, each.accepted))
        remarks = (
            f"Step {number}, {each.name}: {each.note.removesuffix('.')}."
            for number, each in enumerate(self.path, 1)
            if each.note
        )
        legend = "Average cost, and the worst percentages of all parameters, after the step."
        notes = (f"Ended: {self.stopped}.", legend, *remarks, *map(str, self.findings))
        return Table(f"Reduction of {self.start.model.name}", columns, tuple(rows), notes)

    def _computed(self) -> dict[str, object]:
        return {
            "fit": self.fit,
            "findings": self.findings,
        }


def worst_percents(fit: Fit) -> tuple[float | None, float | None]:
    """Largest insensitivity and largest Cramér–Rao bound of a fit, percent."""
    known = [fit.parameters[name] for name in fit.names]
    slack = [p.insensitivity_percent for p in known if p.insensitivity_percent is not None]
    bounds = [p.cramer_rao_percent for p in known if p.cramer_rao_percent is not None]
    return max(slack, default=None), max(bounds, default=None)

"""Which parameter a reduction of the structure drops next, and when a cost has risen too far."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import scipy

from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import (
    CORRELATION_GUIDE,
    CRAMER_RAO_GUIDE_PERCENT,
    INSENSITIVITY_GUIDE_PERCENT,
)
from flightid.options import Options, option
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import half_width

COST_RISE_PERCENT = 2.0
TOTAL_COST_RISE_PERCENT = 5.0
NEGLIGIBLE_COST = 1e-3
"""Average cost of responses that exact data leave: percent of less have no meaning."""
EXPLAINED_LEVEL = 0.997
"""Of what random error explains: a path tries many parameters, and one in twenty would stay."""


@dataclass(frozen=True)
class ReductionLimits(Options):
    """Guides that a reduction works towards; see `flightid.reduce`."""

    maximum_insensitivity_percent: float = option(
        INSENSITIVITY_GUIDE_PERCENT, unit="%", above=0.0, doc="Largest insensitivity."
    )
    maximum_cramer_rao_percent: float = option(
        CRAMER_RAO_GUIDE_PERCENT, unit="%", above=0.0, doc="Largest Cramér–Rao bound."
    )
    maximum_correlation: float = option(
        CORRELATION_GUIDE, above=0.0, doc="Largest correlation of two parameters."
    )
    maximum_cost_rise_percent: float = option(
        COST_RISE_PERCENT, unit="%", above=0.0, doc="Largest rise of the cost in one step."
    )

    maximum_total_cost_rise_percent: float = option(
        TOTAL_COST_RISE_PERCENT, unit="%", above=0.0, doc="Largest rise of the cost by all steps."
    )
    negligible_cost: float = option(
        NEGLIGIBLE_COST, minimum=0.0, doc="Average cost of responses that stands for none."
    )

    def excess(
        self, start: float, before: float, after: float, explained: float, so_far: Sequence[float]
    ) -> str:
        """Why a step's rise of the average cost is too much; empty where it is not.

        Parameters
        ----------
        start, before, after : float
            Average cost at the start of the path, and before and after the step.
        explained : float
            Rise by this step that the random error of its parameter explains.
        so_far : sequence of float
            The same of every earlier step.
        """
        if after <= self.negligible_cost:
            return ""
        if after - before > max(explained, self.maximum_cost_rise_percent / 100.0 * before):
            return f"by {_percent_of(before, after)} in one step"
        if after - start > self.total_allowed(start, (*so_far, explained)):
            return f"by {_percent_of(start, after)} from the start"
        return ""

    def total_allowed(self, start: float, explained: Sequence[float]) -> float:
        """Largest rise of the average cost by all steps, of which random error explains some.

        Squares of several estimates add up to less than the sum of what each may be alone.
        """
        limit = self.maximum_total_cost_rise_percent / 100.0 * start
        if not explained:
            return limit
        together = scipy.special.chdtri(
            len(explained), 1.0 - EXPLAINED_LEVEL
        ) / scipy.special.chdtri(1, 1.0 - EXPLAINED_LEVEL)
        return max(limit, float(together * np.mean(explained)))


def _percent_of(before: float, after: float) -> str:
    return f"{100.0 * (after / before - 1.0):.3g} %" if before > 0.0 else "any percentage"


def explained_rise(fit: Fit, name: str) -> float:
    """Rise of the average cost that the random error of a parameter explains, 997 of 1000 times.

    A parameter that is truly what it is fixed at is estimated beside it by its standard error σ;
    without it the cost rises by its square over (JᵀJ)⁻¹, which is twice the Cramér–Rao bound
    squared.

    Parameters
    ----------
    fit : Fit
        To responses, before the step.
    name : str

    Returns
    -------
    float
        Zero where no random error is known, and of records, whose cost is no sum of squares.
    """
    parameter = fit.parameters[name]
    percent, value, stderr = parameter.cramer_rao_percent, parameter.value, parameter.stderr
    if not fit.responses or not percent or not value or stderr is None:
        return 0.0
    bound = percent / 100.0 * abs(value)
    return float(
        (half_width(EXPLAINED_LEVEL) * stderr) ** 2 / (2.0 * bound**2) / len(fit.responses)
    )


@dataclass(frozen=True)
class Candidate:
    """A parameter to be dropped, and why."""

    name: str
    reason: str


def choose(fit: Fit, limits: ReductionLimits, keep: Collection[str]) -> Candidate | None:
    """The parameter that the guides would drop next, None where all are met.

    The largest insensitivity above its guide; else the largest Cramér–Rao bound above its guide;
    else, of the most correlated pair, the one to which the cost is less sensitive.

    Parameters
    ----------
    fit : Fit
    limits : ReductionLimits
    keep : collection of str
        Parameters that must stay.

    Returns
    -------
    Candidate or None

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., §12.3.4 and §13.7.

    Example
    -------
    >>> import flightid as fid
    >>> omega = [1.0, 2.0, 4.0, 8.0]
    >>> model = fid.load_model("rate_integrator").with_fixed(tau=0.02)
    >>> data = fid.FrequencyResponse.from_values(omega, model.frequency_response(omega),
    ...     inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"})
    >>> choose(fid.identify(model, data), ReductionLimits(), keep=()) is None
    True
    """
    open_ = [fit.parameters[name] for name in fit.names if name not in keep]
    for kind, limit in (
        ("insensitivity", limits.maximum_insensitivity_percent),
        ("cramer_rao", limits.maximum_cramer_rao_percent),
    ):
        worst = max(open_, key=lambda p: _percent(p, kind), default=None)
        if worst is not None and _percent(worst, kind) > limit:
            word = "insensitivity" if kind == "insensitivity" else "Cramér–Rao bound"
            return Candidate(worst.name, f"{word} {_percent(worst, kind):.3g} %")
    return _correlated(fit, limits, keep)


def _percent(parameter: Estimate, kind: str) -> float:
    """Percent of the value; an estimate of exactly zero is all uncertainty."""
    value = getattr(parameter, f"{kind}_percent")
    return np.inf if value is None else float(value)


def _correlated(fit: Fit, limits: ReductionLimits, keep: Collection[str]) -> Candidate | None:
    size = np.triu(np.abs(fit.correlation), k=1)
    while size.size and size.max() > limits.maximum_correlation:
        i, j = np.unravel_index(int(np.argmax(size)), size.shape)
        size[i, j] = 0.0
        pair = [name for name in (fit.names[i], fit.names[j]) if name not in keep]
        if pair:
            name = max(pair, key=lambda each: _percent(fit.parameters[each], "insensitivity"))
            other = fit.names[j] if name == fit.names[i] else fit.names[i]
            return Candidate(name, f"correlated by {fit.correlation[i, j]:+.3f} with {other}")
    return None

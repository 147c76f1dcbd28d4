"""Which parameter a reduction of the structure drops next, and when a cost has risen too far."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from flightid.identification.fit import Fit
from flightid.identification.fit_findings import (
    CORRELATION_GUIDE,
    CRAMER_RAO_GUIDE_PERCENT,
    INSENSITIVITY_GUIDE_PERCENT,
)
from flightid.options import Options, option
from flightid.uncertainty.estimate import Estimate

COST_RISE_PERCENT = 2.0
NEGLIGIBLE_COST_RISE = 0.1
"""Rise of the average cost of responses that no eye sees in a plot: a hundredth of a weighted dB²
at each of 20 points. Below it a rise in percent of a cost near zero has no meaning."""


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

    def is_marked(self, before: Fit, after: Fit) -> bool:
        """Whether the cost has risen markedly from one fit to the next."""
        allowed = self.maximum_cost_rise_percent / 100.0 * before.average_cost
        if before.responses:
            allowed = max(allowed, NEGLIGIBLE_COST_RISE)
        return after.average_cost - before.average_cost > allowed


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

"""The verb: drop what the data do not determine, one parameter at a time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any

from flightid.errors import DataError, FitError, ModelError, OptionError
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.identify import identify
from flightid.identification.reduction.growth import FittedPole, changed_growth, poles_of
from flightid.identification.reduction.result import Reduction, ReductionStep
from flightid.identification.reduction.rules import (
    Candidate,
    ReductionLimits,
    choose,
    explained_rise,
)
from flightid.identification.shared_work import shared_work
from flightid.models import GreyBoxModel
from flightid.progress import progress
from flightid.record import Record
from flightid.responses import FrequencyResponse
from flightid.threads import on_one_thread

BY_HAND = "by hand"
AFTER_RISE = ("stop", "next")


@on_one_thread
def reduce(
    fit: Fit,
    data: FrequencyResponse | Record | Sequence[Record],
    *,
    maximum_insensitivity_percent: float = ReductionLimits.maximum_insensitivity_percent,
    maximum_cramer_rao_percent: float = ReductionLimits.maximum_cramer_rao_percent,
    maximum_correlation: float = ReductionLimits.maximum_correlation,
    maximum_cost_rise_percent: float = ReductionLimits.maximum_cost_rise_percent,
    maximum_total_cost_rise_percent: float = ReductionLimits.maximum_total_cost_rise_percent,
    negligible_cost: float = ReductionLimits.negligible_cost,
    keep: Iterable[str] = (),
    drop: Iterable[str] = (),
    at: Mapping[str, float] | None = None,
    after_rise: str = "stop",
    **options: object,
) -> Reduction:
    """Reduce the structure of a fitted model to parameters that the data determine.

    The parameter with the largest insensitivity above its guide is dropped first; where there is
    none, the one with the largest Cramér–Rao bound above its guide; then one of each pair that is
    too correlated. The rest is fitted again from where it stood. A step whose average cost rises
    markedly, by itself or with the steps before it, is undone; so is one that takes away a motion
    that grows for certain, or brings one about, and the next is tried. A rise is not marked where
    the random error of the parameter explains it: one that is truly zero costs that much.

    Parameters
    ----------
    fit : Fit
        Result of `flightid.identify`.
    data : FrequencyResponse, or Record or sequence of Record
        What it was fitted to.
    maximum_insensitivity_percent, maximum_cramer_rao_percent, maximum_correlation : float
        Guides; a parameter that meets all of them stays.
    maximum_cost_rise_percent : float
        Rise of the average cost by one step that counts as marked.
    maximum_total_cost_rise_percent : float
        Rise of the average cost from the start, after what is dropped by hand, that counts as
        marked.
    negligible_cost : float
        Average cost of responses that stands for none, as fits of exact data leave.
    keep : iterable of str
        Parameters that stay whatever the guides say.
    drop : iterable of str
        Parameters that are dropped first, in this order, whatever the cost.
    at : mapping of str to float, optional
        Values, in the parameters' units, at which parameters are fixed instead of zero.
    after_rise : {"stop", "next"}
        After a marked rise: end there, or keep that parameter and try the next.
    **options
        Options of `flightid.identify` other than those of the fit.

    Returns
    -------
    Reduction
        The whole path with a fit at each step; ``.fit`` is the last that stood, and `resume`
        goes on from any step.

    Raises
    ------
    UnknownNameError
        `keep`, `drop` or `at` names no parameter of the model.
    OptionError
        A parameter is to be dropped that is not free; a limit or option without a meaning.
    DataError
        The fit was made from other data.
    FitError, ModelError
        A model without a parameter of `drop` cannot be fitted.

    Assumes
    -------
    Guides of a convention, not tests: the cost need not be a likelihood. A parameter whose 95 %
    interval is narrow may break them and still be known: `keep` it. Biased towards small
    structures where the band leaves out the motion that a parameter governs.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., §12.3.4 and §13.7.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.load_model("rate_motor_lag").with_values({"Lp": -0.001})
    >>> omega = np.geomspace(1.0, 50.0, 100)
    >>> data = fid.FrequencyResponse.from_values(
    ...     omega, truth.frequency_response(omega), inputs=["tau_phi"], outputs=["p"],
    ...     units={"p": "rad/s"})
    >>> found = fid.reduce(fid.identify(fid.load_model("rate_motor_lag"), data), data)
    >>> found.dropped
    {'Lp': 0.0}
    """
    if not isinstance(getattr(fit, "model", None), GreyBoxModel):
        raise ModelError(
            "only named parameters of a fit are dropped one by one",
            found=type(getattr(fit, "model", fit)).__name__,
            needed="a fit of a state-space or transfer-function model",
            action="choose the orders of a black box by scan_orders",
        )
    limits = ReductionLimits(
        maximum_insensitivity_percent,
        maximum_cramer_rao_percent,
        maximum_correlation,
        maximum_cost_rise_percent,
        maximum_total_cost_rise_percent,
        negligible_cost,
    )
    if after_rise not in AFTER_RISE:
        raise OptionError(
            "after_rise is not known", found=repr(after_rise), needed=" or ".join(AFTER_RISE)
        )
    walk = _ReductionPath(data, fit, _options(fit, options), tuple(keep), dict(at or {}))
    for name in (*walk.keep, *walk.at):
        _ = fit.model.parameters[name]
    # All fits are to the same data: what is chosen of these is chosen once.
    with shared_work(), progress(None, "reducing the structure") as advance:
        for name in drop:
            walk.force(name)
            advance()
        stopped = walk.follow(limits, after_rise, advance)
    return Reduction(
        fit, tuple(walk.path), stopped, limits, walk.keep, walk.at, after_rise, dict(options), data
    )


def resume(
    reduction: Reduction,
    step: int | None = None,
    *,
    keep: Iterable[str] = (),
    drop: Iterable[str] = (),
    at: Mapping[str, float] | None = None,
    **changes: object,
) -> Reduction:
    """Go on from any step of a reduction's path, with other choices.

    Parameters
    ----------
    reduction : Reduction
    step : int, optional
        Steps of the path that stay; default: all of them. 0 begins again.
    keep, drop, at
        As of `flightid.reduce`, added to what was asked before.
    **changes
        Other options of `flightid.reduce` than before.

    Returns
    -------
    Reduction
        With the steps that stayed and the new ones.

    Raises
    ------
    OptionError
        The path has no such step.
    """
    last = len(reduction.path) if step is None else step
    given: dict[str, object] = {
        **vars(reduction.limits),
        "after_rise": reduction.after_rise,
        **reduction.options,
        **changes,
    }
    again = reduce(
        reduction.fit_after(last),
        reduction.data,  # type: ignore[arg-type]  # what reduce was given
        keep=(*reduction.keep, *keep),
        drop=drop,
        at={**reduction.at, **(at or {})},
        **given,  # type: ignore[arg-type]
    )
    path = (*reduction.path[:last], *again.path)
    return Reduction(**{**vars(again), "start": reduction.start, "path": path})


def _options(fit: Fit, given: Mapping[str, object]) -> dict[str, Any]:
    """Options of the fit as `identify` takes them, one start from where it stands."""
    before = fit.provenance.get("options")
    used = dict(before) if isinstance(before, Mapping) else {}
    if not fit.responses:
        used["method"] = fit.method
    if "starts" in used:
        used["starts"] = 1
    return used | dict(given)


@dataclass
class _ReductionPath:
    """A reduction under way: the fit that stands and the steps so far."""

    data: Any
    fit: Fit
    options: Mapping[str, Any]
    keep: tuple[str, ...]
    at: Mapping[str, float]
    path: list[ReductionStep] = field(default_factory=list)

    def force(self, name: str) -> None:
        """Drop a parameter by hand."""
        if not self.fit.model.parameters[name].free:
            raise OptionError(
                f"parameter {name} cannot be dropped",
                found=self.fit.model.parameters[name].status,
                needed="a free parameter",
            )
        model, value, note = _without(self.fit.model, name, self.at)
        found = self._refit(model)
        self._accept(ReductionStep(name, value, BY_HAND, *self._costs(found), True, found, note))

    def follow(self, limits: ReductionLimits, after_rise: str, advance: Any) -> str:  # noqa: ANN401
        """Drop what the guides say; why it ended."""
        stay, start = set(self.keep), self.fit.average_cost
        # Beside the first fit: what grows may go faint in one step and be gone in the next.
        poles = poles_of(self.fit)
        while (candidate := choose(self.fit, limits, stay)) is not None:
            step = self._attempt(candidate, limits, start, poles)
            advance()
            if step.accepted:
                self._accept(step)
                continue
            self.path.append(step)
            stay.add(step.name)
            if step.cost_after is not None and after_rise == "stop" and not step.changes_growth:
                return f"dropping {step.name} raises the cost markedly"
        return "no other parameter that may go breaks a guide"

    def _attempt(
        self,
        candidate: Candidate,
        limits: ReductionLimits,
        start: float,
        poles: Sequence[FittedPole],
    ) -> ReductionStep:
        name = candidate.name
        model, value, note = _without(self.fit.model, name, self.at)
        try:
            found = self._refit(model)
        except (FitError, ModelError) as error:
            cost = self.fit.average_cost
            return ReductionStep(name, value, candidate.reason, cost, None, False, None, str(error))
        explained = explained_rise(self.fit, name)
        costs = self._costs(found)
        step = ReductionStep(name, value, candidate.reason, *costs, True, found, note, explained)
        so_far = [each.explained for each in self.path if each.accepted]
        excess = limits.excess(start, *costs, explained, so_far)
        word = (
            f"the average cost would rise to {found.average_cost:.4g}, {excess}" if excess else ""
        )
        grown = "" if excess else changed_growth(poles, poles_of(found))
        if not (word or grown):
            return step
        return replace(
            step, accepted=False, note=word or grown, explained=0.0, changes_growth=bool(grown)
        )

    def _refit(self, model: GreyBoxModel) -> Fit:
        found: Fit = identify(model, self.data, **self.options)
        if found.provenance.get("data_sha256") != self.fit.provenance.get("data_sha256"):
            raise DataError(
                "the fit was made from other data",
                needed="the data that identify was given",
                action="pass the same response or records to reduce",
            )
        return found

    def _costs(self, found: Fit) -> tuple[float, float]:
        return self.fit.average_cost, found.average_cost

    def _accept(self, step: ReductionStep) -> None:
        self.path.append(step)
        if step.fit is not None:
            self.fit = step.fit


def _without(
    model: GreyBoxModel, name: str, at: Mapping[str, float]
) -> tuple[GreyBoxModel, float, str]:
    """The model with a parameter fixed, the value, and a note where it is neither zero nor asked.

    Raises
    ------
    ModelError
        A value of `at` lies outside the parameter's bounds.
    """
    parameter = model.parameters[name]
    if name in at:
        return model.with_fixed(**{name: at[name]}), at[name], ""
    if parameter.minimum <= 0.0 <= parameter.maximum:
        return model.with_fixed(**{name: 0.0}), 0.0, ""
    value = float(parameter.value or 0.0)
    note = f"held at {value:.5g} {parameter.unit}, for its bounds leave out zero"
    return model.with_fixed(**{name: value}), value, note

"""The search for a minimum: from each start, and once more another way where all ends are poor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.fit_findings import EXCELLENT_COST
from flightid.identification.frequency_domain.error_model import ErrorModel, whitening
from flightid.identification.frequency_domain.known_minimum import KnownMinimum
from flightid.identification.frequency_domain.model_curves import curves_at
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.identification.multistart import DenseEnd, collect, draw_starts
from flightid.identification.shared_work import Itself, shared
from flightid.models import GreyBoxModel
from flightid.uncertainty.response_errors import DECIBEL, DEGREE

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
LIGHT = 0.1
"""Factor of the decibels' residuals while the phase leads."""
LEADING_ITERATIONS = 10
NEARBY = 9
"""Starts around the model's values that are tried beside those asked for, where a fit leaves
something: without the estimator inside they take next to no time."""
EARLY_ITERATIONS, PROMISING = 8, 4.0
"""Steps after which a nearby start is given up, where its cost is still so many times the best: of
110 fits 24 had a lower minimum, and all 24 were found so, 13 states 20 times sooner."""
LARGE = 250_000
"""Points times squared parameters from which some of the points tell first which nearby starts are
hopeless: 13 states and 31 responses spent two thirds of a fit on starts that came to nothing."""
FAR, FIRST_STEPS, HOPELESS = 300.0, 3, 100.0
"""How many times the best a start may cost by these points, and how many after its first steps.
Of 224 fits of several responses 12 had a lower minimum that was found, from starts below 50."""
POINTS, POINTS_OF_PARAMETER = 10, 4
"""Points of each response, and of all for each parameter, that such a look leaves."""
LEAVES, LOWER = 1.0, 1e-3
"""Average cost from which on a fit leaves something, and the share that makes a lower minimum. That
random errors explain as much says nothing: of 150 fits of two modes within 25 s, 43 had a lower
minimum then, which these starts found."""


@dataclass(frozen=True)
class _Descent:
    """From starts towards a minimum of the cost.

    Attributes
    ----------
    model : GreyBoxModel
    selected : sequence of SelectedResponse
    white : list of tuple
        Whitening of the errors by run, a matrix or one row of weights; empty for weighted dB and
        degrees.
    """

    model: GreyBoxModel
    selected: Sequence[SelectedResponse]
    white: list[tuple[int, int, Array]]

    def follow(
        self, begin: Array, steps: int, light: float = 1.0, *, slopes: bool = True
    ) -> list[DenseEnd | str]:
        """Where so many steps lead from each start, or why nowhere; decibels weigh by `light`.

        Without slopes an end after that many steps has no residuals and no Jacobian.
        """
        if not len(begin):
            return []
        measured = self._measured
        if light != 1.0:
            measured = [(omega, found, light * db, deg) for omega, found, db, deg in measured]
        parameters = self.model.parameters
        low = np.array([parameter.minimum for parameter in parameters.free])
        high = np.array([parameter.maximum for parameter in parameters.free])
        values, places = parameters.independent_values(), parameters.free_indices
        where = begin, low, high, steps, slopes
        found = self.model.native.fit(values, places, measured, self.white, *where)
        return [each if isinstance(each, str) else DenseEnd.of_native(each) for each in found]

    def lower(self, near: Array, best: float, maximum_iterations: int) -> list[DenseEnd]:
        """Ends of nearby starts that are minima below the best cost."""
        n_free = near.shape[1]
        points = sum(len(each.places) for each in self.selected)
        if points * n_free**2 >= LARGE:
            some = self._thinned(points // (POINTS_OF_PARAMETER * n_free))
            near = near[some._costs(near) < FAR * best]
            near = near[some._costs_after(near, FIRST_STEPS) < HOPELESS * best]
        looks = self._ends(near, EARLY_ITERATIONS, slopes=False)
        early = [end.x for end in looks if end.cost < PROMISING * best]
        around = self._ends(np.ascontiguousarray(early), maximum_iterations)
        return [end for end in around if end.cost < best * (1.0 - LOWER)]

    def by_errors(self, drawn: Array, best: DenseEnd, maximum_iterations: int) -> list[DenseEnd]:
        """Ends below the best one that begin where the least relative complex errors lie.

        Decibels and degrees of a response hold it back where it has to pass zero: the sign of an
        effect that starts wrong, or a zero on the wrong side of the axis, stays. The complex error
        passes it straight, so that signs come right; the cost itself then goes on from there.
        """
        leading = replace(self, white=[*map(_relative, range(len(self.selected)), self.selected)])
        led = leading._apart(np.vstack([best.x, drawn]), [], maximum_iterations)
        begin = np.ascontiguousarray([end.x for end in led])
        ends = self._apart(begin, [best], maximum_iterations)
        return [end for end in ends if end.cost < best.cost * (1.0 - LOWER)]

    def _apart(self, begin: Array, known: list[DenseEnd], steps: int) -> list[DenseEnd]:
        """Ends of starts that after their first steps are at no minimum that is known or found.

        The first start goes ahead: most of the others come to its end. The first step alone takes
        most of those there that begin near.
        """
        found: list[DenseEnd] = []
        for wave in (begin[:1], begin[1:]):
            minima = KnownMinimum.all_of([*known, *found]) if len(wave) else []
            if not minima:
                found += self._ends(wave, steps)
                continue
            elsewhere, _ = self._elsewhere(wave, minima, 1, slopes=False)
            _, others = self._elsewhere(elsewhere, minima, min(FIRST_STEPS, steps))
            further = [end.x for end in others if not end.is_converged]
            found += [end for end in others if end.is_converged]
            found += self._ends(np.ascontiguousarray(further), max(steps - FIRST_STEPS, 1))
        return found

    def _elsewhere(
        self, begin: Array, minima: Sequence[KnownMinimum], steps: int, *, slopes: bool = True
    ) -> tuple[Array, list[DenseEnd]]:
        """Starts that so many steps take to none of the minima, and where these steps end."""
        kept = [
            (start, end)
            for start, end in zip(begin, self.follow(begin, steps, slopes=slopes), strict=True)
            if not isinstance(end, str) and not any(each.holds(end.x) for each in minima)
        ]
        return np.ascontiguousarray([start for start, _ in kept]), [end for _, end in kept]

    def _costs(self, starts: Array) -> Array:
        """Weighted dB and degrees at each start; infinite where it has no response."""
        measured = np.concatenate([each.response for each in self.selected])
        weight_db = np.concatenate([each.weight_db for each in self.selected])
        weight_deg = np.concatenate([each.weight_deg for each in self.selected])
        grids = [each.omega_rad_s for each in self.selected]
        curves = shared(
            lambda: (
                "nearby",
                Itself(self.model),
                starts.tobytes(),
                *(each.tobytes() for each in grids),
            ),
            lambda: curves_at(self.model, starts, grids),
        )
        with np.errstate(all="ignore"):
            ratio = curves / measured
            gain, phase = DECIBEL * np.log(np.abs(ratio)), DEGREE * np.angle(ratio)
            costs = gain**2 @ weight_db + phase**2 @ weight_deg
        return np.where(np.isfinite(costs), costs, np.inf)

    def _costs_after(self, starts: Array, steps: int) -> Array:
        ends = self.follow(starts, steps, slopes=False)
        return np.array([np.inf if isinstance(end, str) else end.cost for end in ends])

    @cached_property
    def _measured(self) -> list[tuple[Array, Complex, Array, Array]]:
        """Frequencies, values and square roots of both weights of each response."""
        return [
            (each.omega_rad_s, each.response, np.sqrt(each.weight_db), np.sqrt(each.weight_deg))
            for each in self.selected
        ]

    def _ends(
        self, begin: Array, steps: int, light: float = 1.0, *, slopes: bool = True
    ) -> list[DenseEnd]:
        found = self.follow(begin, steps, light, slopes=slopes)
        return [end for end in found if not isinstance(end, str)]

    def _thinned(self, stride: int) -> _Descent:
        """The same cost by the points that are so far apart."""
        return replace(self, selected=[_thinned(each, stride) for each in self.selected])


def _relative(place: int, response: SelectedResponse) -> tuple[int, int, Array]:
    """Weights of a response's complex errors, as decibels of small ones weigh."""
    weight = DECIBEL * np.sqrt(response.weight_db) / np.abs(response.response)
    return place, 1, np.concatenate([weight, weight])[None]


def _thinned(response: SelectedResponse, stride: int) -> SelectedResponse:
    count = len(response.places)
    kept = slice(None, None, max(min(stride, count // POINTS), 1))
    places = response.places[kept]
    share = count / len(places)
    weights = share * response.weight_db[kept], share * response.weight_deg[kept]
    return SelectedResponse(response.name, response.measured, places, *weights)


def minimise(
    model: GreyBoxModel,
    selected: Sequence[SelectedResponse],
    errors: ErrorModel,
    *,
    starts: int,
    seed: int,
    cost: str,
    maximum_iterations: int,
) -> list[DenseEnd]:
    """Minimise the cost from several starts.

    Where the best end of the weighted dB and degrees is still poor, each start is followed again
    with the phase in the lead for a few steps: poles and delays find their places before gains can
    settle around wrong ones. Before that a few starts around the given values are tried, and of
    several responses what complex errors lead to, and kept where one ends lower.

    Parameters
    ----------
    model : GreyBoxModel
    selected : sequence of SelectedResponse
    errors : ErrorModel
    starts, seed, cost, maximum_iterations
        See `flightid.identify`.

    Returns
    -------
    list of End
        Best first.

    Raises
    ------
    FitError
        No start led anywhere, or a likelihood without known errors.
    """
    free = model.parameters.free
    descent = _Descent(model, selected, whitening(errors) if cost == "likelihood" else [])
    drawn = draw_starts(free, starts, seed)
    outcomes = descent.follow(drawn, maximum_iterations)
    known = [end for end in outcomes if not isinstance(end, str)]
    best = min((end.cost for end in known), default=np.inf)
    settled = [end for end in known if end.cost == best and end.is_converged]
    if settled and cost != "likelihood" and best > LEAVES * len(selected):
        near = shared(
            lambda: ("starts", Itself(model), NEARBY, seed),
            lambda: draw_starts(free, NEARBY, seed)[1:],
        )
        lower = descent.lower(near, best, maximum_iterations)
        if lower:
            lowest = min(lower, key=lambda end: end.cost)
            outcomes, best = [*outcomes, lowest], lowest.cost
    if cost == "likelihood" or best <= LEAVES * len(selected):
        return collect(outcomes)
    if best > EXCELLENT_COST * len(selected):
        led = [end.x for end in descent._ends(drawn, LEADING_ITERATIONS, LIGHT, slopes=False)]
        outcomes = [*outcomes, *descent.follow(np.array(led), maximum_iterations)]
    if len(selected) > 1:
        ends = [end for end in outcomes if not isinstance(end, str)]
        if ends:
            lowest = min(ends, key=lambda end: end.cost)
            outcomes = [*outcomes, *descent.by_errors(drawn, lowest, maximum_iterations)]
    return collect(outcomes)

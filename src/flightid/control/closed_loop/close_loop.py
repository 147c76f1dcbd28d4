"""A known controller closed around an identified model, with the model's uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flightid.control.closed_loop.controller_blocks import (
    beside,
    controller_blocks,
    moved_by,
    require_channels,
)
from flightid.control.closed_loop.result import PLANT, ClosedLoop, ClosedPole
from flightid.control.loops.block import Block, Equations
from flightid.control.loops.connect import connect
from flightid.control.loops.elements import sum_of, system
from flightid.control.loops.interconnection import Interconnection
from flightid.control.loops.same_wires import with_part
from flightid.control.loops.stability_over import followed_poles, unstable_count
from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.identification.uncertain_of import uncertain_of
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import linear_system
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.uncertain import Uncertain

DRAWS = 200


def close_loop(
    source: object,
    controller: object,
    *,
    outside: Sequence[str] = (),
    draws: int = DRAWS,
    seed: int = 0,
    name: str = "closed loop",
) -> ClosedLoop:
    """Close a controller around a model, in series with what already moves its inputs.

    The controller reads the model's outputs by name; a model's input among its readings is the
    stick, before the controller adds to it; any other name that a block reads is a set-point from
    outside, and one that a mapping reads has to be declared in `outside`. What the controller gives
    under the name of a model's input is added to that input: input ``lon`` becomes
    ``lon_total = lon + lon_controller``, and the loop is broken at ``lon_total``.

    Parameters
    ----------
    source : fit, model or LinearSystem
        The vehicle. A fit's covariance gives intervals.
    controller : mapping, Block, sequence of blocks, model, LinearSystem or Interconnection
        A mapping of gains by input and output, ``{"lon": {"q": 3.0}}``, is negative feedback:
        lon_controller = −3 q. Anything else adds what it gives, with its own signs.
    outside : sequence of str
        What a mapping reads that is no channel of the model: set-points.
    draws : int
        Vehicles drawn from the fit's uncertainty to be tried for stability.
    seed : int
        Seed of the draws.
    name : str

    Raises
    ------
    UnknownNameError
        The controller gives nothing that the model takes, or reads nothing of it; a mapping names
        what is neither a channel of the model nor declared in `outside`.
    ModelError, UnitError
        As `connect`.
    OptionError
        A negative number of draws.

    Assumes
    -------
    Motion about the trim of the model. The intervals are those of a fit that does not know of the
    controller; limits and rate limits count as one.

    Reference
    ---------
    Stevens, Lewis & Johnson, *Aircraft Control and Simulation*, 3rd ed., section 4.4: stability
    augmentation.

    Example
    -------
    >>> import flightid as fid
    >>> roll = fid.LinearSystem([[-1.0]], [[4.0]], [[1.0]], [[0.0]], ("lat",), ("p",), [0.05])
    >>> closed = close_loop(roll, {"lat": {"p": 0.5}})
    >>> closed
    ClosedLoop(1 actuator [lat], stable, slowest pole -3.367 rad/s)
    >>> closed.margins()["lat"].phase_margin.value.__round__(1)
    115.0
    """
    if draws < 0:
        raise OptionError("the number of draws", found=draws, needed="0 or more")
    uncertain: Uncertain[Any] = uncertain_of(source)
    model = uncertain.value
    vehicle = linear_system(model)
    # Telling whether a model is linear takes longer than everything else about it.
    linear = not isinstance(system(model).part, Equations)
    if isinstance(controller, Mapping):
        require_channels(controller, vehicle.inputs, vehicle.outputs, outside)
    around = controller_blocks(controller, vehicle.units)
    moved = tuple(moved_by(around, vehicle.inputs, vehicle.outputs))

    estimate = _closed(vehicle if linear else model, vehicle, around, moved, name)

    def closed(model: object) -> Interconnection:
        part = linear_system(model) if linear else system(model).part
        return with_part(estimate, PLANT, part)

    drawn = uncertain.then(closed)
    # Poles and the margins at each actuator are read off the same loops; draws but once.
    loops = drawn.kept()
    poles, propagated = _poles(loops, estimate)
    tried = drawn.draws(draws, seed) if draws and drawn.known else []
    unstable = sum(unstable_count(each) > 0 for each in tried)
    findings = (*uncertain.findings, *_findings(estimate, len(tried), unstable))
    return ClosedLoop(
        name, estimate, moved, loops, poles, len(tried), unstable, findings,
        propagated.reason,
    )  # fmt: skip


def _closed(
    model: object,
    vehicle: LinearSystem,
    around: Sequence[Block],
    moved: tuple[str, ...],
    name: str,
) -> Interconnection:
    plant = system(model, rename={each: f"{each}_total" for each in moved})
    sums = [sum_of(f"{each}_total", each, f"{each}_controller") for each in moved]
    adding = beside(around, moved)
    given = {n for block in (plant, *sums, *adding) for n in block.outputs}
    read = [n for block in (plant, *adding, *sums) for n in block.inputs if n not in given]
    outside = tuple(dict.fromkeys([*(n for n in vehicle.inputs), *read]))
    shown = (*vehicle.outputs, *(f"{each}_total" for each in moved))
    return connect([plant, *sums, *adding], inputs=outside, outputs=shown, name=name)


def _poles(
    loops: Uncertain[Interconnection], estimate: Interconnection
) -> tuple[tuple[ClosedPole, ...], Uncertain[np.ndarray[Any, np.dtype[np.float64]]]]:
    stability = estimate.stability()
    count = max(1, estimate.order)
    step = stability.sample_time_s
    poles = stability.poles
    # A pole at the origin of the z plane is a pure delay.
    growth = poles.real if step is None else np.abs(poles)
    order = np.argsort(-growth)[:count]
    kept = poles[[k for k in order if poles[k].imag >= 0.0 and (step is None or growth[k] > 1e-6)]]

    def numbers(thing: Interconnection) -> np.ndarray[Any, np.dtype[np.float64]]:
        found = followed_poles(thing, kept)
        s = found if step is None else np.log(found) / step
        size = np.abs(s)
        damping = np.where(size > 0.0, -s.real / np.where(size > 0.0, size, 1.0), np.nan)
        return np.concatenate([s.real, s.imag, size, damping])

    carried = loops.carried(numbers)
    n = len(kept)

    def quantity(row: int, kind: int, what: str, unit: str) -> Reading:
        return carried.number(kind * n + row, what, unit, "the pole is lost over the uncertainty")

    found = tuple(
        ClosedPole(
            quantity(row, 0, "real part", "rad/s"),
            quantity(row, 1, "imaginary part", "rad/s"),
            quantity(row, 2, "frequency", "rad/s"),
            quantity(row, 3, "damping", "1"),
        )
        for row in range(n)
    )
    return found, carried


def _findings(estimate: Interconnection, tried: int, unstable: int) -> tuple[Finding, ...]:
    found = list(estimate.findings)
    if not estimate.is_stable:
        found.append(
            Finding(
                "closed-loop-unstable", Light.RED, "the closed loop is not stable",
                "look at the poles that grow, and at the signs of the controller",
            )
        )  # fmt: skip
    elif unstable:
        share = 100.0 * unstable / tried
        found.append(
            Finding(
                "unstable-within-uncertainty", Light.RED if share > 5.0 else Light.AMBER,
                f"{unstable} of {tried} vehicles ({share:.2g} %) that the data allow are unstable "
                "with this controller",
                "lower the gains, or fly more to know the vehicle better",
            )
        )  # fmt: skip
    return tuple(found)

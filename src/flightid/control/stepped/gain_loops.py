"""Loops that an autopilot's or a PID's gains close around a model, broken at its inputs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.margins.loop_source import BrokenLoop
from flightid.control.stepped.gain_controller import GainController
from flightid.control.tuning.axis_tuning import JUDGED_POINTS
from flightid.control.tuning.controller_paths import has_angle_loop, loop_responses, standing
from flightid.control.tuning.evidence import hold_in_model
from flightid.control.tuning.sampled_plants import SampledPlants, loop_grid, sample_plants
from flightid.frozen import dataclass
from flightid.identification.uncertain_of import uncertain_of
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import linear_system
from flightid.uncertainty.uncertain import Uncertain

KEPT = 4096
"""Plants of which samples are kept: every loop and every crossing asks for them again."""


@dataclass(frozen=True, eq=False)
class UncertainPlant:
    """A model as gains see it: linear, with its covariance.

    Attributes
    ----------
    uncertain : Uncertain of LinearSystem
    hold_in_model : bool
        Whether the model's delay holds the half sample of the output hold.
    """

    uncertain: Uncertain[LinearSystem]
    hold_in_model: bool

    @classmethod
    def of(cls, source: object) -> UncertainPlant:
        """The plant of a fit or model."""
        return cls(uncertain_of(source).then(linear_system), hold_in_model(source))


def gain_loops(plant: UncertainPlant, law: GainController) -> Mapping[str, BrokenLoop]:
    """Loops of each controller alone, by name: ``"p / tau_phi, rate loop"``.

    Sampled, exact, with the autopilot's own filters and delays; where there is an angle loop it is
    the whole loop broken at the input too.

    Parameters
    ----------
    plant : UncertainPlant
    law : GainController
        Made for its channels.
    """
    made = {}
    for moved, loop in law.loops.items():
        rate = law.measured[moved][0]
        inner, whole = _loops(plant, loop, rate, moved)
        made[inner.name] = inner
        if has_angle_loop(loop) and loop.angle_gain_1_s:
            made[whole.name] = whole
    return made


def _loops(
    plant: UncertainPlant, loop: AxisLoop, rate: str, moved: str
) -> tuple[BrokenLoop, BrokenLoop]:
    """The inner loop, and the whole one."""
    step_s = 1.0 / loop.loop_rate_hz

    @lru_cache(maxsize=KEPT)
    def sampled(system: LinearSystem) -> SampledPlants:
        return sample_plants(
            (system,), [rate], [moved], step_s, hold_in_model=plant.hold_in_model
        )  # fmt: skip

    def broken(system: Any, omega: NDArray[np.float64], *, angle: bool) -> NDArray[np.complex128]:  # noqa: ANN401
        rates, angles = loop_responses(sampled(system), omega, [loop], "filtered")
        feedback, outer = standing(loop, omega, "filtered")
        inner = feedback * rates[0, 0, 0]
        return np.asarray(inner + outer * angles[0, 0, 0] if angle else inner)

    centre = sampled(plant.uncertain.value)
    omega = loop_grid(step_s, JUDGED_POINTS, centre.resonances())
    end = float(np.pi / step_s)

    def named(what: str, *, angle: bool) -> BrokenLoop:
        return BrokenLoop(
            f"{rate} / {moved}, {what}", plant.uncertain, omega,
            lambda system, at: broken(system, at, angle=angle),
            int(centre.unstable[0]), end_rad_s=end,
        )  # fmt: skip

    return named(loop.inner, angle=False), named("whole loop", angle=True)

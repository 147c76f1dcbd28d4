"""What a controller without an integrator leaves of a step of the set-point for good."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.pid_loop import PidLoop
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.models.linear.linear_system import LinearSystem

AT_ZERO, ON_AXIS = 1e-6, 1e-9
"""Shares of the largest pole within which one is at zero, or on the real axis."""
MOST = 0.10
"""Share of a step beyond which a set-point is not followed, argued: what a step still moves by
where it counts as settled."""


def slow_gain(system: LinearSystem, output: str, input: str) -> tuple[float, int, int]:
    """Gain at rest without integrators, how many of those there are, and unstable real poles.

    Returns
    -------
    gain : float
        Of (jω)ⁿ G(jω) towards zero frequency, n integrators.
    integrators, unstable : int
    """
    chosen = system.select(outputs=[output], inputs=[input])
    poles = np.linalg.eigvals(np.asarray(chosen.a))
    step = chosen.sample_time_s
    if step is not None:
        poles = np.log(np.where(np.abs(poles) > 0.0, poles, 1e-300).astype(complex)) / step
    scale = max(float(np.abs(poles[np.abs(poles) < np.inf]).max(initial=0.0)), 1e-3)
    integrators = np.abs(poles) < AT_ZERO * scale
    real = (np.abs(poles.imag) < ON_AXIS * scale) & ~integrators
    low, count = np.array([AT_ZERO * scale]), int(integrators.sum())
    held = chosen.frequency_response(low)[0, 0, 0] * (1j * low[0]) ** count
    return float(held.real), count, int((real & (poles.real > 0.0)).sum())


def standing_errors(
    loop: PidLoop, plants: Iterable[LinearSystem], output: str, input: str
) -> NDArray[np.float64]:
    """Share of a step of the set-point that stays, 1 − b Kp G(0) / (1 + Kp G(0)), of each plant.

    Zero behind an integrator, the controller's or the plant's; negative where the output ends
    beyond the set-point, as a plant does that falls away by itself.

    Reference: Åström & Hägglund, *Advanced PID Control* (2006), section 3.2.
    """
    made = list(plants)
    if loop.values.get("i", 0.0) > 0.0:
        return np.zeros(len(made))
    gain = loop.values.get("p", 0.0) * (-1.0 if loop.direct else 1.0)
    weight = loop.values.get("b", 1.0)
    found = []
    for plant in made:
        steady, integrators, _ = slow_gain(plant, output, input)
        around = gain * steady
        found.append(1.0 - weight * (1.0 if integrators else around / (1.0 + around)))
    return np.asarray(found)


def judge_standing(
    loop: PidLoop, estimate: LinearSystem, drawn: Iterable[LinearSystem], output: str, input: str
) -> list[Finding]:
    """What stays of a step, of the estimate and at worst; nothing of a controller with I."""
    if loop.values.get("i", 0.0) > 0.0:
        return []
    first, *others = standing_errors(loop, [estimate, *drawn], output, input)
    worst = max((first, *others), key=abs)
    beyond = "short of" if first >= 0.0 else "beyond"
    said = f"a step of the set-point ends {100.0 * abs(first):.0f} % {beyond} it, and stays there"
    if others:
        said += f" (worst plant {100.0 * abs(worst):.0f} %)"
    if abs(worst) <= MOST:
        return [Finding("standing-error", Light.GREEN, said)]
    said += ": the controller has no integrator, and the plant none that makes up for it"
    action = "take a form with I (controller='pi'), its gain above zero, or give the plant the "
    action += "input that holds the set-point beside the controller's"
    return [Finding("standing-error", Light.AMBER, said, action)]

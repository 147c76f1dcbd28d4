"""Coupled axes closed together: which fresh plants are stable, and what all outputs stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.gyro import Gyro
from flightid.control.margins.disk_geometry import gain_limits, phase_limit_deg
from flightid.control.margins.disk_margin import alphas_of
from flightid.control.margins.stability_count import unstable_poles
from flightid.control.tuning.axis_tuning import PlantSet, Setting
from flightid.control.tuning.controller_paths import ControllerPaths, has_angle_loop, standing
from flightid.control.tuning.sampled_plants import AxisLoops, whole_loop
from flightid.control.tuning.together import Together

Complex = NDArray[np.complex128]
LOOKED_AT = 40
"""Frequencies about its largest singular value at which a plant's disk margin is taken."""
WORST = 8
"""Plants of the largest such values whose disk margin is taken."""
LOWEST_RAD_S = 0.1
"""Frequency above which margins of loops together are judged, rad/s."""


def _matrix(plants: PlantSet, loops: list[AxisLoop], gyro: Gyro) -> Complex:
    """Loop transfer matrix at the outputs, (n, n_f, n_axes, n_axes)."""
    pairs = [standing(loop, plants.omega_rad_s, gyro) for loop in loops]
    closed = AxisLoops(*(np.array(each) for each in zip(*pairs, strict=True)))
    return whole_loop(plants.rate, plants.angle, closed)


def judge_together(
    setting: Setting, loops: list[AxisLoop], flown: list[AxisLoop], axes: list[str]
) -> Together:
    """Stability and disk margins of fresh plants with the loops of all axes closed.

    Parameters
    ----------
    setting : Setting
    loops, flown : list of AxisLoop
        All axes with their new gains, and as flown.
    axes : list of str
    """
    plants = setting.judged
    matrix, before = (_matrix(plants, each, setting.gyro) for each in (loops, flown))
    stable, steady = (_held(plants, each) for each in (matrix, before))
    kept = plants.omega_rad_s > LOWEST_RAD_S
    alphas = _least_alphas(matrix[:, kept])
    worst = min(alphas) if bool(stable.all()) else None
    return Together(
        tuple(axes),
        int(stable.sum()),
        len(stable),
        alphas[0] if bool(stable[0]) else None,
        worst,
        None if worst is None else float(20.0 * np.log10(gain_limits(worst)[1])),
        None if worst is None else float(phase_limit_deg(worst)),
        _least_alphas(before[:1, kept])[0] if bool(steady[0]) else None,
        _coupling(plants, loops, setting.gyro),
        int(steady.sum()),
    )


def _held(plants: PlantSet, matrices: Complex) -> NDArray[np.bool_]:
    """Which plants are stable with all loops closed."""
    determinants = np.linalg.det(np.eye(matrices.shape[-1]) + matrices)
    counted = unstable_poles(plants.omega_rad_s, determinants, plants.sampled.unstable)
    return np.asarray(counted == 0)


def _least_alphas(matrices: Complex) -> list[float]:
    """Disk margins of the estimate and of the plants whose plain bound is least."""
    eye = np.eye(matrices.shape[-1])
    sensitivity = np.linalg.inv(eye + matrices)
    plain = np.linalg.norm(2.0 * sensitivity - eye, ord=2, axis=(2, 3))
    worst = np.argsort(-plain.max(axis=1), kind="stable")[:WORST]
    found = []
    for row in dict.fromkeys((0, *map(int, worst))):
        near = np.sort(np.argsort(-plain[row])[:LOOKED_AT])
        found.append(float(np.min(alphas_of(matrices[row, near], 0.0))))
    return found


def _coupling(plants: PlantSet, loops: list[AxisLoop], gyro: Gyro) -> float:
    """Largest closed-loop gain from one axis' rate set-point to another axis' rate."""
    omega = plants.omega_rad_s
    feedback, forward = [], []
    for loop in loops:
        paths = ControllerPaths(loop, gyro, has_angle_loop(loop))
        gains = paths.gains_of(loop)[: len(paths.feedback(omega))]
        terms = paths.forward(omega)
        feedback.append(gains @ paths.feedback(omega))
        forward.append(gains @ terms[:-1] + terms[-1])
    rates = np.moveaxis(plants.rate[0], -1, 0)
    inner = np.array(feedback).T[:, :, None] * rates
    answer = rates @ np.linalg.solve(
        np.eye(len(loops)) + inner, np.array(forward).T[:, :, None] * np.eye(len(loops))
    )
    sizes = np.abs(answer)
    sizes[:, np.arange(len(loops)), np.arange(len(loops))] = 0.0
    return float(sizes.max())

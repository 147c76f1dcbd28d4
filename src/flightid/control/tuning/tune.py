"""The verb for several axes: each with the others closed, in turn, and then all together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.autopilots.axis_loop import Gyro
from flightid.control.margins.disk_geometry import gain_limits, phase_limit_deg
from flightid.control.margins.disk_margin import alphas_of
from flightid.control.margins.stability_count import unstable_poles
from flightid.control.tuning.axis_tuning import AxisResult, PlantSet, Setting, axis_steps, tune_axis
from flightid.control.tuning.controller_paths import ControllerPaths, has_angle_loop, standing
from flightid.control.tuning.evidence import Verdicts, gather
from flightid.control.tuning.flown_gains import GainsOfAxes, flown_loop
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.result import Together, Tuning
from flightid.control.tuning.sampled_plants import AxisLoops, whole_loop
from flightid.control.tuning.structure_error import Band
from flightid.control.tuning.tune_pid import CHANNELS, DRAWS, design_of, make_setting, tune_pid
from flightid.errors import OptionError
from flightid.progress import progress

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
ROUNDS = 4
SETTLED = 0.02
"""Largest relative change of a gain from one round to the next that ends the rounds."""
LOOKED_AT = 40
"""Frequencies about its largest singular value at which a plant's disk margin is taken."""
WORST = 8
"""Plants of the largest such values whose disk margin is taken."""
LOWEST_RAD_S = 0.1


def tune(
    fits: Mapping[str, object],
    *,
    gains: GainsOfAxes,
    autopilot: str = "arducopter",
    requirements: TuningRequirements | Mapping[str, TuningRequirements] | None = None,
    gyro: Gyro = "filtered",
    angle_loop: bool = True,
    signs: Mapping[str, float] | None = None,
    band_rad_s: Band | None = None,
    verifications: Mapping[str, Verdicts | Iterable[Verdicts]] | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    nominal: bool = False,
    accept_red: bool = False,
) -> Tuning:
    """Gains of several axes; axes of one model are tuned with each other's loops closed.

    Where two axes have the same fit, each is tuned with the other's loops closed, in turn, until
    the gains settle; then all loops are closed together for plants that no search has seen, and
    the disk margin at all outputs at once is told.

    Parameters
    ----------
    fits : mapping of str to fit
        By axis: ``{"roll": fit, "pitch": fit, "yaw": other}``. One fit for two axes holds both
        commands and both rates.
    gains : mapping of str to AxisLoop, Log, or mapping of str to float
        As flown: by axis, the log of the flight, or all parameters by the autopilot's names.
    autopilot : str
        Of parameters given by name; a log tells its autopilot.
    requirements : TuningRequirements, or a mapping of them by axis, optional
    gyro, angle_loop, band_rad_s, draws, seed, nominal, accept_red : optional
        As for `flightid.tune_pid`.
    signs : mapping of str to int, optional
        −1 for an axis whose rate answers the command the other way round.
    verifications : mapping of str to Verification or several, optional
        Predictions of unseen records, by axis.

    Raises
    ------
    DataError
        The data do not support gains; see `flightid.tune_pid`.
    ModelError
        A rate answers its command the other way round.
    OptionError
        No axis, or one that is not known.

    Reference
    ---------
    Maciejowski, *Multivariable Feedback Design* (1989), section 4.2 (sequential loop closing);
    Seiler, Packard & Gahinet, *IEEE Control Systems Magazine* 40 (2020), 78–95 (disk margins).

    Example
    -------
    >>> import flightid as fid
    >>> from flightid.control.autopilots import axis_loop
    >>> plant = fid.load_model("rate_integrator", axis="yaw").with_values(
    ...     {"Ntpsi": 40.0, "tau": 0.03})
    >>> flown = {"yaw": axis_loop("arducopter", "yaw", loop_rate_hz=400.0)}
    >>> tuning = fid.tune({"yaw": plant}, gains=flown, nominal=True, angle_loop=False,
    ...     band_rad_s=(0.5, 60.0), requirements=fid.TuningRequirements(noise_growth=None))
    >>> tuning["yaw"].axis
    'yaw'
    """
    unknown = [axis for axis in fits if axis not in CHANNELS]
    if not fits or unknown:
        raise OptionError(
            "axes to tune", found=", ".join(unknown) or "none", needed=", ".join(CHANNELS)
        )
    loops = {axis: flown_loop(gains, autopilot, axis) for axis in fits}
    shared = {"band_rad_s": band_rad_s, "draws": draws, "seed": seed}
    shared |= {"nominal": nominal, "accept_red": accept_red}
    designs: dict[str, PidDesign] = {}
    together: list[Together] = []
    for axes in _groups(fits):
        checks = [each for axis in axes for each in _verdicts(verifications, axis)]
        needs = [_requirements(requirements, axis) for axis in axes]
        turned = [int((signs or {}).get(axis, 1)) for axis in axes]
        first = fits[axes[0]]
        if len(axes) == 1:
            designs[axes[0]] = tune_pid(
                first, gains=loops[axes[0]], requirements=needs[0], angle_loop=angle_loop,
                gyro=gyro, sign=turned[0], verification=checks, **shared,  # type: ignore[arg-type]
            )  # fmt: skip
            continue
        flown = [loops[axis] for axis in axes]
        pairs = [f"{CHANNELS[axis][1]}/{CHANNELS[axis][0]}" for axis in axes]
        evidence = gather(
            first, 1.0 / flown[0].loop_rate_hz, pairs, fresh=draws, verification=checks,
            needs_band=any(need.band_factor is not None for need in needs),
            **shared,  # type: ignore[arg-type]
        )  # fmt: skip
        setting = make_setting(
            evidence,
            flown,
            [CHANNELS[axis][1] for axis in axes],
            [CHANNELS[axis][0] for axis in axes],
            needs[0],
            gyro,
            angle_loop and all(map(has_angle_loop, flown)),
            turned,
            None,
        )
        made, whole = _coupled(setting, flown, needs, axes, seed)
        designs |= dict(zip(axes, made, strict=True))
        together.append(whole)
    return Tuning(tuple(designs[axis] for axis in fits), tuple(together))


def _requirements(
    given: TuningRequirements | Mapping[str, TuningRequirements] | None, axis: str
) -> TuningRequirements:
    if isinstance(given, Mapping):
        return given.get(axis, TuningRequirements())
    return given or TuningRequirements()


def _verdicts(
    given: Mapping[str, Verdicts | Iterable[Verdicts]] | None, axis: str
) -> Sequence[Verdicts]:
    found = (given or {}).get(axis, ())
    return tuple(found) if isinstance(found, Iterable) else (found,)


def _groups(fits: Mapping[str, object]) -> list[list[str]]:
    """Axes by the fit that they share, in order."""
    groups: list[list[str]] = []
    for axis, fit in fits.items():
        for group in groups:
            if fits[group[0]] is fit:
                group.append(axis)
                break
        else:
            groups.append([axis])
    return groups


def _coupled(
    setting: Setting,
    flown: list[AxisLoop],
    needs: list[TuningRequirements],
    axes: list[str],
    seed: int,
) -> tuple[list[PidDesign], Together]:
    """Each axis with the others closed, in turn, until the gains settle."""
    loops = list(flown)
    results: list[AxisResult] = []
    total = ROUNDS * sum(axis_steps(setting, loop) for loop in flown)
    with progress(total, f"tuning {' and '.join(axes)}") as advance:
        for _ in range(ROUNDS):
            before = list(loops)
            results = []
            for place in range(len(flown)):
                asked = replace(setting, requirements=needs[place])
                result = tune_axis(asked, loops, flown, place, advance)
                results.append(result)
                if result.found.exists:
                    loops[place] = result.loop
            if all(_settled(setting, *pair) for pair in zip(before, loops, strict=True)):
                break
    designs = [
        design_of(
            replace(setting, requirements=needs[place]),
            result,
            loops,
            place,
            flown,
            [],
            seed,
        )
        for place, result in enumerate(results)
    ]
    return designs, _together(setting, loops, flown, axes)


def _settled(setting: Setting, before: AxisLoop, after: AxisLoop) -> bool:
    paths = ControllerPaths(before, setting.gyro, setting.with_angle)
    old, new = paths.gains_of(before), paths.gains_of(after)
    return bool(np.all(np.abs(new - old) <= SETTLED * np.maximum(np.abs(old), 1e-9)))


def _matrix(plants: PlantSet, loops: list[AxisLoop], gyro: Gyro) -> Complex:
    """Loop transfer matrix at the outputs, (n, n_f, n_axes, n_axes)."""
    pairs = [standing(loop, plants.omega_rad_s, gyro) for loop in loops]
    closed = AxisLoops(*(np.array(each) for each in zip(*pairs, strict=True)))
    return whole_loop(plants.rate, plants.angle, closed)


def _together(
    setting: Setting, loops: list[AxisLoop], flown: list[AxisLoop], axes: list[str]
) -> Together:
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

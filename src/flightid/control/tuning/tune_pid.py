"""The verb: gains of an autopilot from an identified model, for every plant that the data allow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from flightid.control.autopilots import AxisLoop
from flightid.control.gyro import Gyro
from flightid.control.tuning.axis_tuning import (
    JUDGED_POINTS,
    SEARCH_POINTS,
    AxisResult,
    PlantSet,
    Setting,
    axis_steps,
    changes_of,
    stages_of,
    tune_axis,
)
from flightid.control.tuning.band_findings import band_findings
from flightid.control.tuning.controller_paths import ControllerPaths, has_angle_loop
from flightid.control.tuning.evidence import TuningEvidence, Verdicts, gather
from flightid.control.tuning.filter_choice import FilterChoice
from flightid.control.tuning.findings import low_coherence, remarks, verdict
from flightid.control.tuning.flown_gains import Gains, flown_loop, require_known
from flightid.control.tuning.options import DRAWS
from flightid.control.tuning.order_statistics import least_share
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.responses import ClosedPlants, response_bands
from flightid.control.tuning.sampled_plants import SampledPlants, sample_plants
from flightid.control.tuning.structure_error import Band, perturbed
from flightid.control.tuning.wider_band import wider_band
from flightid.errors import ModelError, OptionError
from flightid.models.linear.linear_system import LinearSystem
from flightid.progress import progress
from flightid.threads import on_one_thread
from flightid.version import VERSION

CHANNELS = {"roll": ("tau_phi", "p"), "pitch": ("tau_theta", "q"), "yaw": ("tau_psi", "r")}
"""Command and rate of each axis, as channel maps and library models name them."""
SHOWN, MOVED = 60, 12
"""Plants whose steps are shown, and whose loops move beside sliders of gains."""
SEARCHED_SIZE = 1.25
"""Errors of structure in the search over those that judge it, whose directions it has not met."""
ANSWER_S = 0.15
"""Time from a step of output in which a vehicle has turned the right way."""


@on_one_thread
def tune_pid(
    fit: object,
    *,
    gains: Gains,
    autopilot: str = "arducopter",
    axis: str = "roll",
    inputs: str | None = None,
    outputs: str | None = None,
    requirements: TuningRequirements | None = None,
    gyro: Gyro = "filtered",
    angle_loop: bool = True,
    sign: int = 1,
    band_rad_s: Band | None = None,
    verification: Verdicts | Iterable[Verdicts] | None = None,
    gyro_noise: float | tuple[ArrayLike, ArrayLike] | None = None,
    filters: FilterChoice | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    nominal: bool = False,
    accept_red: bool = False,
    by_hand: Mapping[str, float] | None = None,
    rigid: bool = False,
) -> PidDesign:
    """Gains of one axis that keep their margins for every plant that the data allow.

    The loop is the autopilot's own, sampled and exact: its filters and delays with the gains as
    parameters, around the identified model behind the output hold. Requirements hold for the rate
    loop alone, for both loops broken at the output, and for the angle loop, for each of many
    draws from the covariance of the fit; other draws, which the search has not seen, then tell what
    the gains promise.

    Parameters
    ----------
    fit : Fit, or with `nominal` a model
        From the autopilot's output (mixer command, torque set-point) to the rate.
    gains : AxisLoop, Log or mapping of str to float
        As flown: the axis of `flightid.control.autopilots`, the log of the flight, or parameters
        by name.
    autopilot, axis : str
        Of parameters given by name; a log tells its autopilot.
    inputs, outputs : str, optional
        Channels of the model; by default those of the axis.
    requirements : TuningRequirements, optional
    gyro : {"filtered", "raw"}
        Which rate the model ends at: behind the autopilot's gyro filters, as RATE and
        vehicle_angular_velocity log it, or ahead of them.
    angle_loop : bool
        Whether the angle gain is chosen too, where the axis has one.
    sign : int
        −1 for a model whose rate answers the command the other way round.
    band_rad_s : tuple of float, optional
        Identified band; by default that of the fit's responses.
    verification : Verification or several, optional
        Predictions of unseen records: red ones are refused.
    gyro_noise : float or tuple of array_like, optional
        Noise of the rate that the controller takes: rms of white samples, rad/s, or frequencies
        (rad/s) and density ((rad/s)²/Hz). Left out: output noise is told per unit of gyro noise.
    filters : FilterChoice, optional
        Filters to tune with, and the noise that bounds the output in place of its growth; default:
        those that flew.
    draws : int
        Plants drawn for the search, and as many again to judge its result by.
    seed : int
    nominal : bool
        Take a model without covariance, for its own margins alone.
    accept_red : bool
        Make gains where the data refuse them; each refusal is then a red finding.
    by_hand : mapping of str to float, optional
        Gains by the autopilot's names that are judged as they stand in place of a search; those
        that are not named stay as flown.
    rigid : bool
        Declare that nothing on the vehicle (sling load, fuel slosh, soft mounts or arms) swings or
        bends outside the model's band: no light mode is allowed for there, as promises then say.

    Returns
    -------
    PidDesign
        Where no gains meet the requirements it says so, with what cannot be met.

    Raises
    ------
    DataError
        The data do not support gains: no covariance, no band in which the model was shown to hold,
        a red fit or verification, too much that the model leaves unexplained.
    ModelError
        The rate answers the command the other way round.
    OptionError
        An option without meaning.
    UnknownNameError
        The model has no such channel.

    Assumes
    -------
    Small signals: no limits, square-root law, slew limiter or throttle scaling at work; a true
    attitude. Gains are biased where the model is: a band too narrow to hold the delay moves
    crossovers, which is why they stay below a third of its upper edge.

    Reference
    ---------
    Åström & Hägglund, *Advanced PID Control* (2006), chapters 4 and 7; Franklin, Powell & Workman,
    *Digital Control of Dynamic Systems*, 3rd ed., chapters 4 and 7; SAE AS94900 for 45° and 6 dB;
    Calafiore & Campi, *IEEE Trans. Automatic Control* 51 (2006), 742–753, for designs over draws.

    Example
    -------
    >>> import flightid as fid
    >>> from flightid.control.autopilots import axis_loop
    >>> plant = fid.load_model("rate_integrator", axis="roll").with_values(
    ...     {"Ltphi": 140.0, "tau": 0.03})
    >>> flown = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    >>> design = fid.tune_pid(plant, gains=flown, band_rad_s=(1.0, 100.0), nominal=True)
    >>> design.worst_case("rate loop", "phase margin").nominal > 45.0
    True
    """
    flown = flown_loop(gains, autopilot, axis)
    usual = CHANNELS[flown.axis]
    channels = ([outputs or usual[1]], [inputs or usual[0]])
    need = requirements or TuningRequirements()
    step = 1.0 / flown.loop_rate_hz
    evidence = gather(
        fit,
        step,
        [f"{channels[0][0]}/{channels[1][0]}"],
        draws=draws,
        fresh=draws,
        seed=seed,
        band_rad_s=band_rad_s,
        verification=verification,
        nominal=nominal,
        accept_red=accept_red,
        needs_band=need.band_factor is not None,
        rigid=rigid,
    )
    setting = make_setting(
        evidence,
        [flown],
        *channels,
        need,
        gyro,
        angle_loop and has_angle_loop(flown),
        [sign],
        noise_density(gyro_noise, step),
    )
    setting, start = with_filters(setting, flown, filters)
    require_known(by_hand or {}, [flown])
    setting = replace(setting, by_hand=by_hand or {})
    with progress(axis_steps(setting, start), f"tuning {flown.axis}") as advance:
        result = tune_axis(setting, [start], [flown], 0, advance)
    couplings = _couplings(evidence.estimate, channels[0][0])
    design = design_of(setting, result, [start], 0, [flown], couplings, seed)
    return naming_filters(design, filters)


def with_filters(
    setting: Setting, flown: AxisLoop, filters: FilterChoice | None
) -> tuple[Setting, AxisLoop]:
    """The setting with the noise of the flight, and the axis with the filters to tune with."""
    if filters is None or flown.axis not in filters.loops:
        return setting, flown
    noise = filters.spectra[flown.axis].behind(flown)
    (allowed,) = (each.noise_limit for each in filters.axes if each.axis == flown.axis)
    start = filters.loops[flown.axis]
    return replace(setting, noise=noise, noise_allowed=allowed), start


def naming_filters(design: PidDesign, filters: FilterChoice | None) -> PidDesign:
    """The design with the filters that it was tuned with."""
    if filters is None or not design.exists or design.axis not in filters.loops:
        return design
    return replace(design, filters=filters.changes_of(design.axis))


def make_setting(
    evidence: TuningEvidence,
    loops: list[AxisLoop],
    outputs: list[str],
    inputs: list[str],
    requirements: TuningRequirements,
    gyro: Gyro,
    with_angle: bool,
    signs: list[int],
    noise: tuple[np.ndarray, np.ndarray] | None,
) -> Setting:
    """Sample the plants and evaluate them on both grids.

    Raises
    ------
    ModelError
        A rate answers its command the other way round.
    OptionError
        A sign that is none.
    """
    step = 1.0 / loops[0].loop_rate_hz
    if any(sign not in (-1, 1) for sign in signs):
        raise OptionError("sign is not known", found=signs, needed="1 or -1")

    def sampled(sources: tuple[LinearSystem, ...]) -> SampledPlants:
        turned = [_turned(source, inputs, signs) for source in sources]
        return sample_plants(turned, outputs, inputs, step, hold_in_model=evidence.hold_in_model)

    searched = sampled(evidence.sources)
    if all(loop.inner == AxisLoop.inner for loop in loops):
        _require_right_way(searched.systems[0], searched, outputs)
    judged = sampled((evidence.estimate, *evidence.fresh))

    def plants(found: SampledPlants, points: int, turn: float, size: float) -> PlantSet:
        def factors(omega: np.ndarray) -> np.ndarray:
            asked = {"turn": turn, "size": size}
            return perturbed(evidence.errors, outputs, inputs, omega, len(found), **asked)

        return PlantSet.of(found, points, loops, gyro, factors)

    return Setting(
        evidence,
        plants(searched, SEARCH_POINTS, 0.0, SEARCHED_SIZE),
        plants(judged, JUDGED_POINTS, 0.5, 1.0),
        gyro,
        with_angle,
        requirements,
        noise,
    )


def design_of(
    setting: Setting,
    result: AxisResult,
    loops: list[AxisLoop],
    place: int,
    all_flown: list[AxisLoop],
    couplings: list[str],
    seed: int,
) -> PidDesign:
    """Put the result of one axis together; `loops` are all axes as they stand."""
    flown = all_flown[place]
    paths = ControllerPaths(flown, setting.gyro, setting.with_angle)
    exists, known = result.found.exists, bool(setting.evidence.draws)
    changes = changes_of(paths, result.loop)
    stages = (
        stages_of(setting, loops, place, changes, setting.requirements.step_limit) if exists else ()
    )
    new = [result.loop if k == place else loop for k, loop in enumerate(loops)]
    shown = setting.judged.sampled.take(list(range(min(SHOWN, len(setting.judged.sampled)))))
    held = result.flown_stable
    steady = all_flown if held is not None and bool(held[0]) else None
    closed = ClosedPlants(shown, place, setting.gyro)
    bands = response_bands(closed, new, steady) if exists else ()
    count = len(result.met)
    drawn, band = count + setting.evidence.left_out, setting.evidence.band_rad_s
    wider = wider_band(result.problem, result.found.gains, band)
    return PidDesign(
        flown,
        result.loop if exists else flown,
        exists,
        changes,
        setting.requirements,
        result.worst_cases,
        result.found.binding,
        bands,
        stages,
        least_share(count - 1, drawn - 1) if known else 0.0,
        least_share(int(result.met.sum()), drawn) if known else 0.0,
        count,
        result.problem,
        (
            verdict(
                *(result.found, result.met, drawn if known else 0, result.worst_cases),
                *(band, wider, result.problem.rigid),
            ),
            *remarks(result, flown, changes, stages, couplings, setting.gyro),
            *low_coherence(result, setting.measured_of(place)),
            *band_findings(result, band, wider),
            *setting.evidence.findings,
        ),
        {
            "method": "grid, then sequential linear programming over the active plants",
            "flightid": VERSION,
            "draws": len(setting.evidence.draws),
            "fresh_draws": len(setting.evidence.fresh),
            "seed": seed,
            "band_rad_s": band,
            "rigid": result.problem.rigid,
            "rate": setting.gyro,
            "hold_in_model": setting.evidence.hold_in_model,
            "left_out": setting.evidence.left_out,
        },
        closed=ClosedPlants(shown.take(list(range(min(MOVED, len(shown))))), place, setting.gyro),
        loops=tuple(new),
    )


def _turned(system: LinearSystem, inputs: list[str], signs: list[int]) -> LinearSystem:
    """The system with the commands in the autopilot's sense."""
    if all(sign == 1 for sign in signs):
        return system
    factors = np.ones(len(system.inputs))
    for name, sign in zip(inputs, signs, strict=True):
        if name in system.inputs:
            factors[system.inputs.index(name)] = sign
    return replace(system, b=np.asarray(system.b) * factors, d=np.asarray(system.d) * factors)


def _require_right_way(system: LinearSystem, plants: SampledPlants, outputs: list[str]) -> None:
    """Refuse a rate that answers a positive command with a negative turn."""
    a, b, c, d, _ = system.state_space()
    count = max(1, round(ANSWER_S / plants.sample_time_s))
    for k, name in enumerate(outputs):
        state = np.zeros(len(a))
        for _ in range(count):
            state = a @ state + b[:, k]
        if float(c[k] @ state + d[k, k]) <= 0.0:
            raise ModelError(
                f"{name} answers a positive command with a negative rate",
                found="negative feedback would become positive",
                needed="a command and a rate of the same sense",
                action="check the axes of model and log; signs=… turns a command that is reversed",
            )


def noise_density(
    given: float | tuple[ArrayLike, ArrayLike] | None, step: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Frequencies and one-sided density of the gyro noise."""
    if given is None:
        return None
    if isinstance(given, tuple):
        omega, density = (np.asarray(each, dtype=np.float64) for each in given)
        if omega.ndim != 1 or omega.shape != density.shape or np.any(density < 0.0):
            raise OptionError(
                "gyro_noise is no spectrum",
                found=f"shapes {omega.shape} and {density.shape}",
                needed="frequencies, and densities of at least 0",
            )
        return omega, density
    if not (np.isfinite(given) and given > 0.0):
        raise OptionError("gyro_noise has no meaning", found=given, needed="rad/s, positive")
    # White samples spread their variance over 0 to half the sample rate.
    return np.array([0.0, np.pi / step]), np.full(2, 2.0 * float(given) ** 2 * step)


def _couplings(system: LinearSystem, output: str) -> list[str]:
    """Other rates of axes that the model holds with their commands."""
    return [
        rate
        for command, rate in CHANNELS.values()
        if rate != output and rate in system.outputs and command in system.inputs
    ]

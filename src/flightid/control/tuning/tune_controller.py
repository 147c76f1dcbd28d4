"""The verb: gains of a PID controller for any identified model, without an autopilot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.parameter_table import GainRange
from flightid.control.autopilots.pid_loop import PidLoop
from flightid.control.tuning.axis_tuning import Setting, axis_steps, tune_axis
from flightid.control.tuning.controller_options import WEIGHTS, ControllerOptions
from flightid.control.tuning.evidence import TuningEvidence, Verdicts, gather
from flightid.control.tuning.options import DRAWS
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.responses import responses
from flightid.control.tuning.standing_error import judge_standing, slow_gain
from flightid.control.tuning.structure_error import Band
from flightid.control.tuning.tune_pid import SHOWN, design_of, make_setting, noise_density
from flightid.conventions import Light
from flightid.errors import DataError, ModelError, OptionError
from flightid.findings import Finding
from flightid.models import Model
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import model_of
from flightid.progress import progress
from flightid.threads import on_one_thread

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
TURN_DEG = -135.0
"""Phase at which a plant alone leaves a controller 45°: where its crossover is looked for."""
VEHICLE_RAD_S = 20.0
"""The same frequency of a vehicle's rate loop, whose search ranges are scaled to the plant's."""
FILTER_SHARE, TRACKING_SHARE = 0.1, 1.0
"""Of a derivative's filter and of tracking, in the time that the loop's frequency tells."""
FINE = 200.0
"""Samples of a continuous loop over that frequency's period, in radians."""
LOOKED_AT_RAD_S = (1e-4, 1e4)
"""Where the crossover of a plant alone is looked for, rad/s."""
POINTS = 4000
"""Frequencies of that search."""
BELOW = 1e-3
"""Share of the highest frequency from which on they stand, at the highest."""
WIDEST_P, LOWEST_I, HIGHEST_I, HIGHEST_D = (1e-3, 10.0), 1e-3, 50.0, 0.5
"""Ranges of P, over the gain that the plant's size tells; and of I and D, over P and time."""
WEIGHTS_TRIED = np.linspace(1.0, 0.0, 21)
"""Weights of the set-point, the liveliest first."""
LIVELY = 0.31
"""Overshoot of two poles damped by 0.35, the least of MIL-F-8785C's level 1."""
MOST_AGAINST = 0.05
"""Share of the plants drawn that may answer a steady input the other way."""


@on_one_thread
def tune_controller(
    fit: object,
    *,
    inputs: str | None = None,
    outputs: str | None = None,
    controller: ControllerOptions | None = None,
    requirements: TuningRequirements | None = None,
    band_rad_s: Band | None = None,
    verification: Verdicts | Iterable[Verdicts] | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    nominal: bool = False,
    by_hand: Mapping[str, float] | None = None,
    accept_red: bool = False,
    rigid: bool = False,
) -> PidDesign:
    """Gains of a PID controller that keep their margins for every plant that the data allow.

    The search, its requirements and its refusals are those of `flightid.tune_pid`; the loop is
    one controller around one output of any model. A sampled controller is exact with its hold; a
    continuous one is judged by its own transfer function.

    Parameters
    ----------
    fit : Fit, or with `nominal` a model
    inputs, outputs : str, optional
        Channels of the loop; may be left out where the model has one of each.
    controller : ControllerOptions, optional
        Structure, rate, filter, limits.
    requirements : TuningRequirements, optional
        Those of the rate loop are of this loop; growth of noise and steps have no meaning here,
        and firm asks for 4.5 dB and 30 deg.
    by_hand : mapping of str to float, optional
        Gains by name (Kp, Ki, Kd) that are judged as they stand in place of a search; those that
        are not named are zero.
    band_rad_s, verification, draws, seed, nominal, accept_red, rigid : optional
        As for `flightid.tune_pid`.

    Returns
    -------
    PidDesign
        Its `loop` is a `PidLoop`: forms, recursion; `flightid.export` writes it as C.

    Raises
    ------
    DataError
        The data do not support gains, or leave open which way the output answers.
    ModelError
        A sampled model whose samples are not those of the controller.
    OptionError
        An option without meaning, or channels that are not clear.

    Assumes
    -------
    The model is of the plant between the controller's samples: its delays hold no output hold.
    Where it was identified from signals whose hold nobody knows it may hold half a sample of the
    record, which the loop then has twice: margins are low, never high.

    Reference
    ---------
    Åström & Hägglund, *Advanced PID Control* (2006), chapters 3, 7 and 13; Morari & Zafiriou,
    *Robust Process Control* (1989), section 14.3: integral action needs the sign of the steady
    gain.

    Example
    -------
    >>> import flightid as fid
    >>> plant = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 10.0})
    >>> design = fid.tune_controller(plant, nominal=True, band_rad_s=(0.1, 60.0),
    ...     controller=fid.ControllerOptions(controller="pi", loop_rate_hz=100.0))
    >>> design.worst_case("loop", "phase margin").nominal > 45.0
    True
    """
    asked = controller or ControllerOptions()
    channels = _channels(fit, inputs, outputs)
    rate_hz = asked.loop_rate_hz or _own_rate(fit)
    sampled = rate_hz is not None
    need = (requirements or TuningRequirements()).of_own_controller()
    common = {"draws": draws, "fresh": draws, "seed": seed, "band_rad_s": band_rad_s,
              "verification": verification, "nominal": nominal, "accept_red": accept_red,
              "needs_band": need.band_factor is not None, "rigid": rigid}  # fmt: skip
    # A continuous model is drawn alike for any step; a sampled one knows its own rate.
    evidence = gather(fit, 1.0 / (rate_hz or 1.0), ["/".join(channels)], **common)  # type: ignore[arg-type]
    direct, evidence = _of_one_sign(evidence, *channels)
    turn = _turn(evidence, *channels, rate_hz, need)
    loop = _loop(asked, channels[0], rate_hz or FINE * turn, sampled, direct)
    loop = replace(loop, units=_units(fit, *channels))
    start = _scaled(loop, turn, _gain(evidence.estimate, *channels, np.array([turn]))[0])
    # Of a continuous loop the hold's half step is taken off again.
    evidence = replace(evidence, hold_in_model=not sampled)
    step = 1.0 / loop.loop_rate_hz
    setting = make_setting(
        evidence, [start], [channels[0]], [channels[1]], need, "filtered", False,
        [-1 if direct else 1], noise_density(asked.measurement_noise, step),
    )  # fmt: skip
    setting = replace(setting, by_hand=_gains_given(by_hand or {}, start))
    with progress(axis_steps(setting, start), f"tuning {start.axis}") as advance:
        result = tune_axis(setting, [start], [start], 0, advance)
    tuned = result.loop
    assert isinstance(tuned, PidLoop)
    made, excess = _weighted(asked, setting, _finished(tuned))
    design = design_of(setting, replace(result, loop=made), [start], 0, [start], [], seed)
    if design.exists:
        held = judge_standing(made, evidence.estimate, evidence.fresh, *channels)
        design = replace(design, findings=(*design.findings, *held))
    return replace(design, findings=(*design.findings, *excess))


def _weighted(
    asked: ControllerOptions, setting: Setting, made: PidLoop
) -> tuple[PidLoop, list[Finding]]:
    """The loop with its set-point weight, where that is chosen, and what is to be said of steps."""
    shown = setting.judged.sampled.take(list(range(min(SHOWN, len(setting.judged.sampled)))))
    given, _ = WEIGHTS.get(asked.controller, (1.0, 1.0))
    limit, how, instead = asked.overshoot, ", P without set-point", "ask for more phase margin"
    if given is not None:
        limit, how, instead = LIVELY, "", f"{instead}, or take the form two_dof"
    over = 0.0
    for weight in WEIGHTS_TRIED if given is None else (given,):
        made = made.with_gains(b=float(weight))
        steps = responses(shown, [made], 0, "filtered")["step"][1]
        over = float(steps.max() - 1.0)
        if over <= limit:
            return made, []
    said = f"a step of the set-point overshoots by up to {100.0 * over:.0f} %{how}"
    return made, [Finding("overshoot", Light.AMBER, said, instead)]


def _channels(fit: object, inputs: str | None, outputs: str | None) -> tuple[str, str]:
    """Output and input of the loop."""
    model = cast(Model, model_of(fit))
    found = []
    for what, given, known in (
        ("output", outputs, model.outputs), ("input", inputs, model.inputs),
    ):  # fmt: skip
        if (given is None and len(known) > 1) or (given is not None and given not in known):
            raise OptionError(
                f"the {what} of the loop is not clear",
                found=given or "none was named",
                needed=f"{what}s, one of {', '.join(known)}",
            )
        found.append(given or known[0])
    return found[0], found[1]


def _units(fit: object, output: str, input: str) -> tuple[str, ...]:
    """Of the measurement and of what is moved; none where the model does not know both."""
    known = getattr(model_of(fit), "units", {})
    return tuple(known[name] for name in (output, input)) if {output, input} <= {*known} else ()


def _own_rate(fit: object) -> float | None:
    """Of a sampled model, Hz."""
    step = getattr(model_of(fit), "sample_time_s", None)
    return 1.0 / float(step) if step else None


def _gain(system: LinearSystem, output: str, input: str, omega: Array) -> Complex:
    chosen = system.select(outputs=[output], inputs=[input])
    return np.asarray(chosen.frequency_response(omega)[0, 0])


def _of_one_sign(evidence: TuningEvidence, output: str, input: str) -> tuple[bool, TuningEvidence]:
    """Whether the controller subtracts its error, by the sign that integral action needs.

    And the evidence without the few plants drawn that need the other one: no gains hold both, so
    what is promised leaves them out, and its share says so.

    The constant term of the closed loop's polynomial is Ki times that of the plant's numerator:
    the sign of the steady gain, turned for each unstable real pole; s^n takes integrators out.
    """
    mine = _sign(evidence.estimate, output, input)

    def alike(plants: tuple[LinearSystem, ...]) -> tuple[LinearSystem, ...]:
        return tuple(each for each in plants if _sign(each, output, input) == mine)

    kept, drawn = alike(evidence.fresh), len(evidence.fresh)
    against = drawn - len(kept)
    said = f"another sign than the estimate's in {against} of {drawn} plants drawn"
    action = "identify from records with lower frequencies, or lower the order of the model"
    if against > MOST_AGAINST * drawn:
        raise DataError(
            f"the data leave open which way {output} answers a steady {input}",
            found=said,
            needed=f"at most {100.0 * MOST_AGAINST:.0f} %",
            action=action,
        )
    findings = evidence.findings
    if against:
        text = f"which way {output} answers a steady {input} is not certain: {said}, where "
        text += "integral action is unstable; margins are of the others"
        findings += (Finding("steady-sign", Light.AMBER, text, action),)
    return mine < 0.0, replace(
        evidence,
        corners=alike(evidence.corners),
        draws=alike(evidence.draws),
        fresh=kept,
        left_out=against,
        findings=findings,
    )


def _sign(system: LinearSystem, output: str, input: str) -> float:
    gain, _, unstable = slow_gain(system, output, input)
    return float(np.sign(gain) * (-1.0) ** unstable)


def _turn(
    evidence: TuningEvidence,
    output: str,
    input: str,
    rate_hz: float | None,
    need: TuningRequirements,
) -> float:
    """Where the estimate's phase leaves 45° to a controller, inside the band, rad/s."""
    bounds = [] if rate_hz is None else [np.pi * rate_hz / 3.0]
    if evidence.band_rad_s is not None and need.band_factor is not None:
        bounds.append(evidence.band_rad_s[1] / need.band_factor)
    top = min(bounds, default=LOOKED_AT_RAD_S[1])
    omega = np.geomspace(min(LOOKED_AT_RAD_S[0], BELOW * top), top, POINTS)
    plant = _gain(evidence.estimate, output, input, omega)
    phase = np.degrees(np.unwrap(np.angle(plant)))
    # Of a plant that answers the other way the first 180° are its sign.
    phase -= 180.0 * np.round((phase[0] + 45.0) / 180.0)
    late = np.flatnonzero(phase < TURN_DEG)
    if not (late.size or bounds):
        raise ModelError(
            "the model has no lag that would bound its gains",
            found=f"its phase stays above {TURN_DEG:g} deg",
            needed="a band that was identified, or the rate of the controller",
            action="give band_rad_s or loop_rate_hz",
        )
    return float(omega[late[0]]) if late.size else top


def _loop(
    asked: ControllerOptions, output: str, rate_hz: float, sampled: bool, direct: bool
) -> PidLoop:
    b, c = WEIGHTS.get(asked.controller, (1.0, 1.0))
    values = dict.fromkeys(asked.gains, 0.0)
    values |= {"b": 1.0 if b is None else b, "c": c}
    values |= {"filter_s": -1.0 if asked.filter_s is None else asked.filter_s, "tracking_s": 0.0}
    names = {role: f"K{role}" for role in asked.gains}
    names |= {"b": "b", "c": "c", "filter_s": "Tf", "tracking_s": "Tt"}
    return PidLoop(
        output, values, names, rate_hz, rate_hz, sampled=sampled, direct=direct,
        low=asked.output_low, high=asked.output_high, rate_per_s=asked.output_rate_per_s,
    )  # fmt: skip


def _scaled(loop: PidLoop, turn: float, gain: complex) -> PidLoop:
    """With ranges and the derivative's filter by the plant's own time and gain."""
    scale, size = VEHICLE_RAD_S / turn, 1.0 / abs(gain)
    low, high = (share * size for share in WIDEST_P)
    ranges = {
        "p": GainRange(low, high, loop.unit_told("p")),
        "i": GainRange(LOWEST_I * low / scale, HIGHEST_I * high / scale, loop.unit_told("i")),
        "d": GainRange(0.0, HIGHEST_D * high * scale, loop.unit_told("d")),
    }
    named = {loop.names[role]: each for role, each in ranges.items() if role in loop.names}
    values = dict(loop.values)
    if values["filter_s"] < 0.0:
        values["filter_s"] = float(f"{FILTER_SHARE / turn:.3g}")
    return replace(loop, values=values, ranges_by_name=named, time_scale=scale)


def _gains_given(by_hand: Mapping[str, float], loop: PidLoop) -> dict[str, float]:
    """Gains by hand of a loop, those that are not named as zero.

    Raises
    ------
    OptionError
        A name that is no gain, a value below zero, or no gain at all.
    """
    if not by_hand:
        return {}
    known = [loop.names[role] for role in "pid" if role in loop.names]
    bad = {n: v for n, v in by_hand.items() if n not in known or not 0.0 <= v < np.inf}
    if bad or not any(by_hand.values()):
        raise OptionError(
            f"by_hand of {loop.axis} holds no gains of its controller",
            found=", ".join(f"{name} = {value:g}" for name, value in (bad or by_hand).items()),
            needed=f"{', '.join(known)} of at least 0, one above",
            action="the sign belongs to the controller, which knows which way the output answers",
        )
    return dict.fromkeys(known, 0.0) | dict(by_hand)


def _finished(loop: PidLoop) -> PidLoop:
    """With the time in which the integral is driven back: √(Ti Td), Ti without derivative."""
    p, i, d = (loop.values.get(role, 0.0) for role in "pid")
    if not (i > 0.0 and p > 0.0):
        return loop
    ti, td = p / i, d / p
    tracking = TRACKING_SHARE * (np.sqrt(ti * td) if td else ti)
    return loop.with_gains(Tt=float(f"{max(tracking, 1.0 / loop.loop_rate_hz):.4g}"))

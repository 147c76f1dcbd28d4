"""The vehicle that is flown and the grey boxes that are fitted: the library's, rates alone.

Truth is the published table 3. The study measured rates, so attitude is no output here, and no
state: nothing depends on it but the autopilot.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import flightid as fid

COMMANDS = ("tau_phi", "tau_theta", "tau_psi")
RATES, ANGLES = ("p", "q", "r"), ("phi", "theta", "psi")
COUPLINGS = ("Lttheta", "Mtphi")
GUESS = {"Lp": -10.0, "Mq": -10.0, "Nr": -1.0} | dict.fromkeys(
    ("Ltphi", "Lttheta", "Mtphi", "Mttheta", "Ntpsi"), 0.0
)
"""Start values that know nothing: round dampings, and commands without effect."""
UNCOUPLED = dict.fromkeys(COUPLINGS, 0.0)


def vehicle() -> fid.StateSpaceModel:
    """Roll, pitch and yaw in one model: what flies, with the published values."""
    plain, yaw = (_plain(name) for name in ("roll_pitch", "yaw"))
    for key in ("states", "inputs", "outputs", "parameters", "equations"):
        plain[key] |= yaw[key]
    return fid.StateSpaceModel.from_dict(plain)


def truth(changes: Mapping[str, float] | None = None) -> dict[str, float]:
    """Published values by name, with some of them changed."""
    known = vehicle().parameters.items()
    return {name: float(each.value or 0.0) for name, each in known} | dict(changes or {})


def _plain(name: str) -> dict[str, Any]:
    plain = fid.load_model(f"quadrotor_{name}").to_dict()
    return {key: value for key, value in plain.items() if key not in ("schema", "responses")}


def grey_box(
    name: str, *, delay: bool = False, motor_lag: bool = False, start: bool = True
) -> fid.StateSpaceModel:
    """One of the two grey boxes with rates as outputs.

    Parameters
    ----------
    name : {"roll_pitch", "yaw"}
    delay : bool
        Whether all inputs share a free delay ``tau``, which the published structure lacks.
    motor_lag : bool
        Whether all inputs pass a free lag ``T_m``, which the published structure lacks.
    start : bool
        Start values of `GUESS` instead of the published ones.
    """
    plain = _plain(name)
    for angle in set(ANGLES) & set(plain["states"]):
        del plain["states"][angle], plain["outputs"][angle], plain["equations"][f"{angle}'"]
    if delay:
        plain["parameters"]["tau"] = {"value": 0.005, "min": 0.0, "max": 0.1, "unit": "s"}
        plain["delays"] = dict.fromkeys(plain["inputs"], "tau")
    if motor_lag:
        _add_lag(plain)
    model = fid.StateSpaceModel.from_dict(plain)
    known = {key: value for key, value in GUESS.items() if key in model.parameters}
    return model.with_values(known) if start else model


def _add_lag(plain: dict[str, Any]) -> None:
    """Put a first-order lag of thrust between each command and its moments."""
    plain["parameters"]["T_m"] = {"value": 0.05, "min": 0.005, "max": 0.15, "unit": "s"}
    for command in plain["inputs"]:
        state = command.replace("tau", "thrust")
        plain["states"][state] = "1"
        for rate in set(RATES) & set(plain["states"]):
            plain["equations"][f"{rate}'"] = plain["equations"][f"{rate}'"].replace(
                f"*{command}", f"*{state}"
            )
        plain["equations"][f"T_m*{state}'"] = f"{command} - {state}"

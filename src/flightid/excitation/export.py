"""Excitations out of flightid: samples as CSV, and settings as autopilots read them."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from flightid.errors import OptionError, UnknownNameError
from flightid.excitation.excitation import Excitation
from flightid.files import write_atomically

MAV_INT32, MAV_REAL32 = 6, 9
"""MAVLink's numbers for the types that a QGroundControl file names."""

PX4_IDENTIFICATION_LOG = 1 + 8 + 16
"""SDLOG_PROFILE bits: default, system identification, high rate."""
PX4_AMPLITUDE = (0.1, 6.0)
PX4_FREQUENCY_HZ = (0.1, 30.0)
PX4_TIME_S = (5.0, 120.0)

# Ranges that the autopilot documents; it would clip or refuse in flight, which is too late.
ARDUPILOT_RANGES = {
    "SID_F_START_HZ": (0.01, 100.0),
    "SID_F_STOP_HZ": (0.01, 100.0),
    "SID_T_FADE_IN": (0.0, 20.0),
    "SID_T_REC": (0.0, 255.0),
    "SID_T_FADE_OUT": (0.0, 5.0),
}
ARDUPILOT_RATE_AXES = {10: "RLL", 11: "PIT", 12: "YAW"}
MIXER_AXES = range(10, 14)


@dataclass(frozen=True)
class ParameterFile:
    """Parameters for an autopilot, with the notes that a pilot must read.

    Attributes
    ----------
    autopilot : {"ardupilot", "px4"}
        Whose names and file format.
    values : mapping of str to float or int
        Parameters in order; whole numbers where the autopilot wants them.
    notes : tuple of str
        What the file does not do by itself.

    Example
    -------
    >>> print(ParameterFile("ardupilot", {"SID_AXIS": 10}, ("Restore SID_AXIS,0.",)).to_text())
    # Restore SID_AXIS,0.
    SID_AXIS,10
    <BLANKLINE>
    """

    autopilot: Literal["ardupilot", "px4"]
    values: Mapping[str, float | int]
    notes: tuple[str, ...] = ()

    def to_text(self) -> str:
        """Content of the file: ``.param`` (ArduPilot) or ``.params`` (QGroundControl)."""
        lines = [f"# {note}" for note in self.notes]
        if self.autopilot == "ardupilot":
            lines += [
                f"{name},{value}" if isinstance(value, int) else f"{name},{value:.9g}"
                for name, value in self.values.items()
            ]
        else:
            lines += ["#", "# Vehicle-Id Component-Id Name Value Type"]
            lines += [
                f"1\t1\t{name}\t{value:.9g}\t{MAV_INT32 if isinstance(value, int) else MAV_REAL32}"
                for name, value in self.values.items()
            ]
        return "\n".join(lines) + "\n"

    def write(self, path: str | Path) -> Path:
        """Write the file whole or not at all.

        Parameters
        ----------
        path : str or Path
            ``.param`` for ArduPilot, ``.params`` for PX4.

        Raises
        ------
        OptionError
            The suffix belongs to the other autopilot.
        """
        suffix = ".param" if self.autopilot == "ardupilot" else ".params"
        if Path(path).suffix.lower() != suffix:
            raise OptionError(
                f"{self.autopilot} parameters have another suffix",
                found=Path(path).name,
                needed=f"a name that ends in {suffix}",
            )
        return write_atomically(path, self.to_text())

    def rollback(self, current: Mapping[str, float]) -> ParameterFile:
        """The file that undoes this one.

        Parameters
        ----------
        current : mapping of str to float
            Parameters as they are on the vehicle, for example ``Log.parameters``.

        Raises
        ------
        UnknownNameError
            A present value is not given; restoring a guess would be worse than none.

        Notes
        -----
        ArduPilot hides the settings of its sweep while SID_AXIS is 0. They do nothing then, so
        that SID_AXIS alone takes them back.

        Example
        -------
        >>> swept = ParameterFile("ardupilot", {"SID_AXIS": 10, "SID_MAGNITUDE": 0.1})
        >>> dict(swept.rollback({"SID_AXIS": 0.0}).values)
        {'SID_AXIS': 0}
        """
        idle = current.get("SID_AXIS") == 0
        restored = {
            name: value
            for name, value in self.values.items()
            if name in current or not (idle and name.startswith("SID_"))
        }
        missing = [name for name in restored if name not in current]
        if missing:
            raise UnknownNameError(
                "present values are needed to undo the settings",
                found=f"none for {', '.join(missing)}",
                action="take them from a log of this vehicle (Log.parameters)",
            )
        before = {
            name: type(value)(current[name]) if isinstance(value, int) else float(current[name])
            for name, value in restored.items()
        }
        return ParameterFile(self.autopilot, before, ("Undoes the identification settings.",))


def ardupilot_parameters(
    chirp: Excitation,
    *,
    integrator_off: bool = True,
    current: Mapping[str, float] | None = None,
) -> ParameterFile:
    """ArduPilot settings that fly a chirp, in the form that its ground stations load.

    Parameters
    ----------
    chirp : Excitation
        Made by `ardupilot_chirp`.
    integrator_off : bool
        For a mixer axis, zero the integrator of that rate loop, which otherwise fights the dwell.
    current : mapping of str to float, optional
        Parameters as they are on the vehicle: then the fast attitude bit is added to LOG_BITMASK,
        and the notes name the values to restore.

    Raises
    ------
    OptionError
        Another kind of excitation, or a setting outside the autopilot's range.

    Reference
    ---------
    ArduPilot, ArduCopter/mode_systemid.cpp (Copter 4.6); ArduPilot Methodic Configurator,
    parameter step "system identification for analytical PID optimization".

    Example
    -------
    >>> from flightid.excitation.sweep import ardupilot_chirp
    >>> chirp = ardupilot_chirp(magnitude=0.15, start_hz=0.05, stop_hz=5.0, record_s=130.0,
    ...                         fade_in_s=5.0, fade_out_s=5.0, axis=11)
    >>> ardupilot_parameters(chirp).values["ATC_RAT_PIT_I"]
    0.0
    """
    if chirp.kind != "ardupilot_chirp":
        raise OptionError(
            "ArduPilot can fly its own chirp only",
            found=chirp.kind,
            needed="an excitation made by ardupilot_chirp",
        )
    names = {
        "SID_AXIS": "axis",
        "SID_MAGNITUDE": "magnitude",
        "SID_F_START_HZ": "start_hz",
        "SID_F_STOP_HZ": "stop_hz",
        "SID_T_FADE_IN": "fade_in_s",
        "SID_T_FADE_OUT": "fade_out_s",
        "SID_T_REC": "record_s",
    }
    settings: dict[str, float | int] = {}
    for name, option in names.items():
        value = chirp.options[option]
        settings[name] = int(value) if name == "SID_AXIS" else float(value)  # type: ignore[arg-type]
    _require_ranges(settings)
    axis = int(settings["SID_AXIS"])
    values: dict[str, float | int] = {}
    before = {} if current is None else current
    scale = "as a share of full scale" if chirp.unit == "1" else f"in {chirp.unit}"
    notes = [f"System identification, SID_AXIS {axis}, magnitude {scale}."]
    if axis in MIXER_AXES:
        values["ATC_RATE_FF_ENAB"] = 0
        shaped = f"{before.get('ATC_RATE_FF_ENAB', 1):g}"
        notes.append(
            f"ATC_RATE_FF_ENAB,0 keeps command shaping out of the swept axis: restore {shaped}."
        )
    if axis in ARDUPILOT_RATE_AXES and integrator_off:
        integrator = f"ATC_RAT_{ARDUPILOT_RATE_AXES[axis]}_I"
        values[integrator] = 0.0
        own = f"{before[integrator]:.7g}" if integrator in before else "its value"
        notes.append(f"{integrator},0 is for the sweep only: restore {own} after the flight.")
    notes.append(_logging_note(values, current))
    return ParameterFile("ardupilot", {**values, **settings}, tuple(notes))


def px4_parameters(
    *,
    vehicle: Literal["multicopter", "fixed_wing"],
    amplitude: float | None = None,
    start_hz: float | None = None,
    stop_hz: float | None = None,
    duration_s: float | None = None,
) -> ParameterFile:
    """PX4 settings for identification: full-rate logs, and what its autotune can inject.

    A PX4 multicopter injects nothing but the autotune's own steps into the rate set-point; of an
    excitation only its amplitude can be set. A fixed wing injects a logarithmic sweep.

    Parameters
    ----------
    vehicle : {"multicopter", "fixed_wing"}
        Which module of the autopilot.
    amplitude : float, optional
        MC_AT_SYSID_AMP or FW_AT_SYSID_AMP, 0.1 to 6; left as it is when not given.
    start_hz, stop_hz, duration_s : float, optional
        Sweep of a fixed wing: 0.1 to 30 Hz, 5 to 120 s for each axis.

    Raises
    ------
    OptionError
        A vehicle that is not known, a range of the autopilot that is left, or a sweep asked of a
        multicopter.

    Reference
    ---------
    PX4-Autopilot, src/modules/logger/logged_topics.cpp, src/modules/mc_autotune_attitude_control
    and src/modules/fw_autotune_attitude_control.

    Example
    -------
    >>> px4_parameters(vehicle="multicopter", amplitude=1.0).values["SDLOG_PROFILE"]
    25
    """
    sweep = {"start_hz": start_hz, "stop_hz": stop_hz, "duration_s": duration_s}
    values: dict[str, float | int] = {"SDLOG_PROFILE": PX4_IDENTIFICATION_LOG}
    notes = ["Restart after loading: SDLOG_PROFILE is read once."]
    if vehicle == "multicopter":
        asked = [name for name, value in sweep.items() if value is not None]
        if asked:
            raise OptionError(
                "a PX4 multicopter cannot inject a sweep",
                found=", ".join(asked),
                needed="a fixed-wing vehicle, or no sweep",
                action="fly the sweep by stick or from a companion computer, and log it",
            )
        notes.append("PX4 injects only its autotune's steps into the rate set-point; for a sweep,")
        notes.append("fly it by stick or send rate set-points from a companion computer.")
        values["MC_AT_APPLY"] = 0
        prefix = "MC_AT_SYSID"
    elif vehicle == "fixed_wing":
        values["FW_AT_APPLY"] = 0
        prefix = "FW_AT_SYSID"
        limits = {
            "start_hz": ("F0", PX4_FREQUENCY_HZ),
            "stop_hz": ("F1", PX4_FREQUENCY_HZ),
            "duration_s": ("TIME", PX4_TIME_S),
        }
        values["FW_AT_SYSID_TYPE"] = 2
        for name, (suffix, limit) in limits.items():
            if (value := sweep[name]) is not None:
                _require_range(f"{prefix}_{suffix}", value, limit)
                values[f"{prefix}_{suffix}"] = float(value)
    else:
        raise OptionError(
            "vehicle is not known", found=vehicle, needed="'multicopter' or 'fixed_wing'"
        )
    notes.append("Gains found by the autotune are logged and not applied.")
    if amplitude is not None:
        _require_range(f"{prefix}_AMP", amplitude, PX4_AMPLITUDE)
        values[f"{prefix}_AMP"] = float(amplitude)
    return ParameterFile("px4", values, tuple(notes))


def write_csv(excitation: Excitation, path: str | Path) -> Path:
    """Write stamps and samples as comma-separated values, units in the headings.

    Parameters
    ----------
    excitation : Excitation
        What to write.
    path : str or Path
        File to write, whole or not at all.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    OSError
        The folder is missing or cannot be written.

    Reference
    ---------
    RFC 4180 (format of comma-separated values).

    Example
    -------
    >>> import tempfile
    >>> from flightid.excitation.multistep import doublet
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = doublet(amplitude=0.1, step_s=0.5, sample_rate_hz=50.0)
    ...     write_csv(made, Path(folder) / "doublet.csv").read_text().split()[0]
    'time_s,u'
    """
    sheet = io.StringIO()
    writer = csv.writer(sheet, lineterminator="\n")
    unit = "" if excitation.unit == "1" else f" [{excitation.unit}]"
    writer.writerow(["time_s", *(f"{name}{unit}" for name in excitation.names)])
    for stamp, samples in zip(excitation.time_s, excitation.signals.T, strict=True):
        writer.writerow([f"{stamp:.12g}", *(f"{sample:.12g}" for sample in samples)])
    return write_atomically(path, sheet.getvalue())


def _logging_note(values: dict[str, float | int], current: Mapping[str, float] | None) -> str:
    """Add the fast attitude bit where the present bits are known; say what to do otherwise."""
    if current is not None and "LOG_BITMASK" in current:
        values["LOG_BITMASK"] = int(current["LOG_BITMASK"]) | 1
        old = int(current["LOG_BITMASK"])
        return f"LOG_BITMASK has ATTITUDE_FAST set: restore {old} after the flight."
    return "Set bit 0 (ATTITUDE_FAST) of LOG_BITMASK, or responses end at a few hertz."


def _require_ranges(values: Mapping[str, float | int]) -> None:
    for name, limits in ARDUPILOT_RANGES.items():
        _require_range(name, float(values[name]), limits)


def _require_range(name: str, value: float, limits: tuple[float, float]) -> None:
    if not limits[0] <= value <= limits[1]:
        raise OptionError(
            f"{name} leaves the autopilot's range",
            found=value,
            needed=f"{limits[0]:g} to {limits[1]:g}",
        )

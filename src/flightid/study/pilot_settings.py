"""What a study says of a pilot's flight in real time: vehicle, law, delays, stick, rating."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightid.errors import OptionError, StudyError
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.reading import read_toml
from flightid.study.reading import TOP, TableReader, read_table

FAILURES = ("frozen", "zero", "biased")
MOST_DELAY_S, MOST_SEED = 0.5, 1 << 31
SLOWEST_RAD_S, FASTEST_RAD_S = 3.0, 100.0
"""Natural frequencies of a stick."""
MOST_TASK, MOST_COMMENT = 300, 4000


def ratings_left(
    controllable: bool, adequate: bool | None, satisfactory: bool | None
) -> tuple[int, ...]:
    """Ratings that the three questions of the decision tree leave.

    Reference
    ---------
    Cooper & Harper, NASA TN D-5153 (1969), figure 7.

    Example
    -------
    >>> ratings_left(True, True, False), ratings_left(False, None, None)
    ((4, 5, 6), (10,))
    """
    if not controllable:
        return (10,)
    if not adequate:
        return (7, 8, 9)
    return (1, 2, 3) if satisfactory else (4, 5, 6)


@dataclass(frozen=True)
class RatingSettings(Options):
    """A Cooper–Harper rating of a flight, by its decision tree: ``[pilot.rating]``."""

    controllable: bool = option(doc="Whether it was controllable.")
    rating: int = option(minimum=1, maximum=10, doc="Cooper–Harper rating that the answers leave.")
    adequate: bool | None = option(
        None, doc="Whether adequate performance was reached with a tolerable workload."
    )
    satisfactory: bool | None = option(None, doc="Whether it was satisfactory without improvement.")
    task: str = option("", doc="What was flown.")
    comment: str = option("", doc="What the pilot said of it.")

    def __post_init__(self) -> None:
        """Refuse a rating beside its answers."""
        super().__post_init__()
        left = ratings_left(self.controllable, self.adequate, self.satisfactory)
        if self.rating not in left:
            raise OptionError(
                "a rating does not fit its answers",
                found=self.rating,
                needed=" or ".join(map(str, left)),
            )
        for name, most in (("task", MOST_TASK), ("comment", MOST_COMMENT)):
            if len(getattr(self, name)) > most:
                raise OptionError(f"{name} is too long", needed=f"{most} letters at most")


@dataclass(frozen=True)
class PilotSettings(Options):
    """A flight in real time: the table ``[pilot]``, which `flightid fly` takes."""

    vehicle: str = option(doc="Vehicle of the library, or a model file, beside the study.")
    augmentation: bool = option(True, doc="Whether its law acts from the take-off.")
    gusts: bool = option(False, doc="Whether the air is gusty.")
    actuator_delay_s: float = option(
        0.0, unit="s", minimum=0.0, maximum=MOST_DELAY_S, doc="Between stick and vehicle."
    )
    display_delay_s: float = option(
        0.0, unit="s", minimum=0.0, maximum=MOST_DELAY_S, doc="Between vehicle and eye."
    )
    stick_rad_s: float | None = option(
        None,
        unit="rad/s",
        minimum=SLOWEST_RAD_S,
        maximum=FASTEST_RAD_S,
        doc="Natural frequency of the stick; default: a hand moves it at once.",
    )
    seed: int = option(0, minimum=0, maximum=MOST_SEED, doc="Of the air and of the sensors.")
    failures: Mapping[str, str] = option(
        default_factory=dict, doc="What the law hears of a sensor: frozen, zero or biased."
    )
    rating: RatingSettings | None = option(None, doc="What the pilot thought of it.")

    def __post_init__(self) -> None:
        """Refuse a failure that there is not."""
        super().__post_init__()
        for name, kind in self.failures.items():
            if kind not in FAILURES:
                raise OptionError(f"{name} cannot fail so", found=kind, needed=", ".join(FAILURES))


def read_pilot(reader: TableReader) -> PilotSettings:
    """Check the table ``[pilot]``.

    Raises
    ------
    StudyError
        A key is unknown, or a value does not fit.
    """
    return read_table(PilotSettings, reader)


def pilot_of(study: str | Path) -> PilotSettings | None:
    """What a study file says of a pilot's flight; None where it says nothing, or is no study.

    Parameters
    ----------
    study : str or Path
        TOML file; its other tables are not looked at. A model file is TOML too, without this table.

    Returns
    -------
    PilotSettings or None
        `vehicle` of a file is its path.

    Raises
    ------
    StudyError
        The file is no TOML, or the table does not fit.
    """
    path = Path(study)
    root = TableReader(read_toml(path, "the study file", StudyError), TOP)
    if "pilot" not in root:
        return None
    made = read_pilot(root.table("pilot"))
    beside = path.parent / made.vehicle
    return replace(made, vehicle=str(beside)) if beside.is_file() else made


def pilot_table(settings: PilotSettings) -> dict[str, Any]:
    """The table as plain values, what is as usual left out.

    Example
    -------
    >>> pilot_table(PilotSettings("ah64_hover", gusts=True))
    {'vehicle': 'ah64_hover', 'gusts': True}
    """
    usual = PilotSettings(settings.vehicle)
    told = {
        key: dict(value) if isinstance(value, Mapping) else value
        for key, value in vars(settings).items()
        if key == "vehicle" or value != getattr(usual, key)
    }
    if settings.rating is not None:
        told["rating"] = {k: v for k, v in vars(settings.rating).items() if v not in (None, "")}
    return told

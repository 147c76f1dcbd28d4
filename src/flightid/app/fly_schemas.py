"""What the page and the server tell each other of a flight in real time."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from flightid.app.schemas import Message
from flightid.study.pilot_settings import (
    FASTEST_RAD_S,
    MOST_COMMENT,
    MOST_DELAY_S,
    MOST_SEED,
    MOST_TASK,
    SLOWEST_RAD_S,
    ratings_left,
)

Fraction = Annotated[float, Field(ge=-1.0, le=1.0)]
SensorFailure = Literal["frozen", "zero", "biased"]
Hand = Literal["pitch", "roll", "yaw", "heave"]


class FlyInput(Message):
    """An input of a vehicle, and the axis of the hand that moves it."""

    hand: Hand
    name: str
    unit: str
    reach: float
    law_limit: float | None


class FlyChoice(Message):
    """A vehicle to fly; `name` is what `load_model` takes in the folder of the page."""

    name: str
    title: str
    note: str
    own: bool
    gusts: bool
    inputs: list[FlyInput]
    outputs: dict[str, str]
    law: str
    law_sensors: list[str]
    rate_hz: float


class OwnVehicles(Message):
    """Vehicles to fly of the folder, and why others of its models cannot be flown."""

    vehicles: list[FlyChoice]
    left_out: dict[str, str]


class FlyStart(Message):
    """Begin a flight; while one is flown, end it and begin anew."""

    do: Literal["start"] = "start"
    vehicle: str = Field(max_length=300)
    law: bool = True
    gusts: bool = False
    actuator_delay_s: float = Field(default=0.0, ge=0.0, le=MOST_DELAY_S)
    display_delay_s: float = Field(default=0.0, ge=0.0, le=MOST_DELAY_S)
    stick_rad_s: float | None = Field(default=None, ge=SLOWEST_RAD_S, le=FASTEST_RAD_S)
    seed: int = Field(default=0, ge=0, le=MOST_SEED)
    failures: dict[str, SensorFailure] = Field(default_factory=dict, max_length=16)


class FlySettings(Message):
    """A study of a flight, as text; `flight` names the kept one that it is of."""

    text: str = Field(max_length=1 << 20)
    flight: str | None = Field(default=None, max_length=100)


class FlyStick(Message):
    """Where the hand is; numbers rise, and come back with the frame that has flown it."""

    do: Literal["stick"] = "stick"
    number: int = Field(ge=0)
    stick: dict[Hand, Fraction]


class FlySwitch(Message):
    """Augmentation, gusts and sensors, in flight."""

    do: Literal["switch"] = "switch"
    law: bool
    gusts: bool
    failures: dict[str, SensorFailure] = Field(default_factory=dict, max_length=16)


class FlySweep(Message):
    """Add a sweep to an input; left out: end it."""

    do: Literal["sweep"] = "sweep"
    input: str | None = None
    amplitude: float = Field(default=0.1, gt=0.0, le=100.0)
    low_rad_s: float = Field(default=0.5, gt=0.0)
    high_rad_s: float = Field(default=15.0, gt=0.0)
    duration_s: float = Field(default=60.0, ge=2.0, le=300.0)


class FlyOrder(Message):
    """Pause, go on, end."""

    do: Literal["pause", "resume", "end"]


class FlyPose(Message):
    """Attitude, rad, and place, m, from the take-off and above the ground of the scenery."""

    phi: float
    theta: float
    psi: float
    north_m: float
    east_m: float
    height_m: float


class FlyFrame(Message):
    """An instant of a flight, as it is shown."""

    time_s: float
    pose: FlyPose
    number: int
    outputs: dict[str, float]
    driven: dict[str, float]
    added: dict[str, float]
    late_frames: int
    sweeping: bool
    swept_s: dict[str, float]
    """How long each input was swept so far, s."""


class CooperHarperRating(Message):
    """Handling qualities of a flight, by the decision tree.

    Each answer is one of its three questions; the rating lies in what they leave.
    """

    controllable: bool
    adequate: bool | None = None
    satisfactory: bool | None = None
    rating: int = Field(ge=1, le=10)
    task: str = Field(default="", max_length=MOST_TASK)
    comment: str = Field(default="", max_length=MOST_COMMENT)

    @model_validator(mode="after")
    def _in_the_tree(self) -> CooperHarperRating:
        if self.rating not in self.left:
            raise ValueError(f"these answers leave {self.left[0]} to {self.left[-1]}")
        return self

    @property
    def left(self) -> tuple[int, ...]:
        """Ratings that the answers leave."""
        return ratings_left(self.controllable, self.adequate, self.satisfactory)


class FlownItem(Message):
    """A flight of the workspace."""

    id: str
    vehicle: str
    title: str
    law: bool
    finished: bool
    path: str
    swept_s: dict[str, float] | None
    """How long each input was swept, s; None of a flight that is no record yet."""
    rating: CooperHarperRating | None


class FlownRecords(Message):
    """The set of records that holds a flight."""

    id: str


class FlyNews(Message):
    """What the socket tells: a frame, a state with its words, or a flight that was kept."""

    frame: FlyFrame | None = None
    state: Literal["ready", "flying", "paused", "ended", "refused"] | None = None
    words: str = ""
    kept: str | None = None

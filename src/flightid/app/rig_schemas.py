"""What page and server tell each other of records of a rig; numbers in SI but where a unit says."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from flightid.app.schemas import Job, Light, Message, ShownFinding


class RigItem(Message):
    """A set of record files."""

    id: str
    name: str
    files: int
    size: int
    has_study: bool


class RigColumn(Message):
    """A column as it stands in a file."""

    name: str
    unit: str
    samples: int
    least: float | None
    most: float | None


class RigFault(Message):
    """What was found in the samples of a channel, and where."""

    channel: str
    code: str
    light: Light
    message: str
    action: str
    spans_s: list[tuple[float, float]]
    deviations: float | None = None
    """Of spikes: threshold of outliers that bridges them and no other sample."""


class RigManoeuvre(Message):
    """A record that a file holds."""

    name: str
    start_s: float
    stop_s: float
    rate_hz: float
    channels: dict[str, str]
    faults: list[RigFault]


class RigFile(Message):
    """A file: its columns, and the manoeuvres in it or why none can be read."""

    name: str
    columns: list[RigColumn]
    notes: list[str]
    manoeuvres: list[RigManoeuvre]
    error: str = ""
    grid_s: float | None = None
    """Sample time of a grid for stamps that are not uniform; None where they are."""
    grid_column: str = ""
    """Column of these stamps."""
    grid_unit: str = ""
    """What they were read as; empty: s."""


class RigReading(Message):
    """How files are read, where they do not tell: as in `[defaults.record]` of a study."""

    time_column: str | None = None
    sample_time_s: float | None = Field(None, gt=0.0)
    resample_to_s: float | None = Field(None, gt=0.0)
    hold: Literal["zero", "first", "band_limited"] | None = None


class RigProposal(RigReading):
    """What `flightid new` is asked: roles of columns where their names do not tell.

    `model` is one of the library, in place of structures that are tried; `actuators` are rad/s.
    """

    inputs: list[str] = Field(default_factory=list, max_length=64)
    outputs: list[str] = Field(default_factory=list, max_length=64)
    excitations: list[str] = Field(default_factory=list, max_length=64)
    model: str | None = Field(None, pattern="^[a-z0-9_]{1,80}$")
    units: dict[str, str] = Field(default_factory=dict)
    actuators: dict[str, Annotated[float, Field(gt=0.0)]] = Field(default_factory=dict)
    conditioning: list[dict[str, Any]] = Field(default_factory=list, max_length=64)
    """Tables ``[[conditioning]]`` to keep; `records` are manoeuvres, ``FILE: MANOEUVRE``."""
    anew: bool = False
    """Whether what stands is known, and the text is to take its place: by `POST /api/studies`."""

    def units_of_roles(self) -> dict[str, str]:
        """Units that are said of columns with a role, or of any where none has one.

        Example
        -------
        >>> RigProposal(inputs=["u"], units={"u": "V", "T": "degC"}).units_of_roles()
        {'u': 'V'}
        >>> RigProposal(units={"u": "V", "T": ""}).units_of_roles()
        {'u': 'V'}
        """
        chosen = {*self.inputs, *self.outputs, *self.excitations}
        said = {name: unit for name, unit in self.units.items() if unit.strip()}
        return {name: unit for name, unit in said.items() if not chosen or name in chosen}


class RigScreen(Message):
    """A set of record files, and the roles that names and units tell."""

    id: str
    files: list[RigFile]
    inputs: list[str]
    outputs: list[str]
    untold: str
    time: str
    """Column that was read as the time; empty where none was."""
    time_unit: str
    """What its stamps were read as; empty: s."""
    left_out: list[str]
    """Files that were taken out of the set; they stay where they are."""
    jobs: list[Job]


class RigFileRequest(Message):
    """A file to take out of a set of records, or to put back."""

    name: str = Field(max_length=300)
    out: bool


class ProposedStudy(Message):
    """The study that `flightid new` writes for records; empty where they carry no model."""

    text: str
    models: list[str]
    said: list[str]
    findings: list[ShownFinding]

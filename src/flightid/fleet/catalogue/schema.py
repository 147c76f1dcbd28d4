"""Tables of the catalogue: their columns with types and units, under one version.

Every row begins with the same five columns, so that no question about vehicles needs a join.
Rows of one log appear whole or not at all; a log that gave nothing has its row in `logs` and, where
it failed, one in `failures`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flightid.frozen import dataclass

SCHEMA = "flightid.fleet/3"
"""Version of all tables: columns are added or changed under a new number only."""

TEXT = "VARCHAR"
NUMBER = "DOUBLE"
WHOLE = "BIGINT"
INSTANT = "TIMESTAMP"
TEXTS = "VARCHAR[]"
NUMBERS = "DOUBLE[]"

FITTED = "fitted"
REFUSED = "refused"
FAILED = "failed"
OUTCOMES = (FITTED, REFUSED, FAILED)
"""What became of a log: models with intervals, none that counts and why, or an error."""


@dataclass(frozen=True)
class FleetColumn:
    """One column of a table.

    Attributes
    ----------
    name : str
    kind : str
        Type by the name that SQL has for it.
    doc : str
        Meaning, in one sentence.
    unit : str
        Of numbers; empty where they have none, or where a column of the table names it.
    """

    name: str
    kind: str
    doc: str
    unit: str = ""


@dataclass(frozen=True)
class FleetTable:
    """One table: its columns in order.

    Example
    -------
    >>> TABLES["parameters"].names[:5]
    ('log', 'vehicle', 'type', 'flown_at', 'light')
    """

    name: str
    doc: str
    columns: tuple[FleetColumn, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(column.name for column in self.columns)

    def row(self, values: Mapping[str, object]) -> list[object]:
        """Values in the order of the columns; None for those that are not given."""
        return [values.get(name) for name in self.names]


def _table(name: str, doc: str, *columns: FleetColumn, of_model: bool = True) -> FleetTable:
    common = (*COMMON, MODEL) if of_model else COMMON
    return FleetTable(name, doc, (*common, *columns))


COMMON: tuple[FleetColumn, ...] = (
    FleetColumn("log", TEXT, "SHA-256 of the bytes of the log: what all its rows are keyed by."),
    FleetColumn("vehicle", TEXT, "Which one was flown; null where nobody says."),
    FleetColumn("type", TEXT, "Vehicle type, whose members are taken for draws of one population."),
    FleetColumn("flown_at", INSTANT, "Start of the log, UTC; null where nobody says."),
    FleetColumn("light", TEXT, "Verdict: of the model in a model's rows, of the log elsewhere."),
)
MODEL = FleetColumn("model", TEXT, "Name of the model in the study.")

LOGS = _table(
    "logs",
    "Every log that was looked at, refused and failed ones too: one row each.",
    FleetColumn("address", TEXT, "Path or address at which it was found first."),
    FleetColumn("bytes", WHOLE, "Size of the log.", "B"),
    FleetColumn("stamp", TEXT, "Time of change or ETag where it was found: unread if unchanged."),
    FleetColumn("id", TEXT, "Of the vehicle, before the table of vehicles gave it a name."),
    FleetColumn("told", TEXT, "Digest of what the tables of vehicles and flights say of it."),
    FleetColumn("outcome", TEXT, "fitted, refused or failed."),
    FleetColumn("reason", TEXT, "Code of what refused it, such as not-a-log; else null."),
    FleetColumn("message", TEXT, "The same in words; else null."),
    FleetColumn(
        "action", TEXT, "What to do about it, such as a setting of the logging; else null."
    ),
    FleetColumn("flown_at_from", TEXT, "Where the date comes from: table, log, name or file."),
    FleetColumn("autopilot", TEXT, "Kind of log, such as ardupilot or px4."),
    FleetColumn("firmware", TEXT, "As the log tells it."),
    FleetColumn("frame", TEXT, "As the log tells it."),
    FleetColumn("duration_s", NUMBER, "First to last stamp.", "s"),
    FleetColumn("models", WHOLE, "Models with intervals."),
    FleetColumn("processor_s", NUMBER, "Processor time; of this run, not of the log.", "s"),
    FleetColumn("memory_bytes", WHOLE, "Most memory of the process; of this run.", "B"),
    FleetColumn("attempts", WHOLE, "How often the log was tried."),
    FleetColumn("recorded_at", INSTANT, "When the record was written, UTC: the newest counts."),
    FleetColumn("recipe", TEXT, "Twelve digits for study, version of flightid and rules."),
    of_model=False,
)
PARAMETERS = _table(
    "parameters",
    "Estimates of the fit that counts, free ones and held ones, in SI units.",
    FleetColumn("name", TEXT, "Of the parameter."),
    FleetColumn("value", NUMBER, "Estimate; the held value where it is not free.", "unit"),
    FleetColumn("stderr", NUMBER, "Standard error; null where the fit gives no interval.", "unit"),
    FleetColumn("freedom", NUMBER, "Degrees of freedom behind stderr; null: normal.", "1"),
    FleetColumn("unit", TEXT, "Of value and stderr."),
    FleetColumn("status", TEXT, "free, fixed, at bound or another word of the fit."),
    FleetColumn(
        "position", WHOLE, "Place in covariances.names from 0; null where it is not there."
    ),
    FleetColumn("meaning", TEXT, "In words, as the model has it: roll damping; null without."),
)
COVARIANCES = _table(
    "covariances",
    "Covariance of a fit's free parameters: one row a model.",
    FleetColumn("names", TEXTS, "Parameters, in order."),
    FleetColumn(
        "lower", NUMBERS, "Lower triangle with diagonal, row by row: n (n + 1) / 2 numbers."
    ),
)
FITTED_MODELS = _table(
    "models",
    "Every fitted model as its file: structure, covariance, bands, evidence, model error.",
    FleetColumn("file", TEXT, "TOML that `load_model` reads; `flightid tune` pools them."),
)
RESPONSES = _table(
    "responses",
    "Measured responses at the points that a fit used, the bias of their estimator taken out.",
    FleetColumn("output", TEXT, "Channel that answers."),
    FleetColumn("input", TEXT, "Channel that drives."),
    FleetColumn("unit", TEXT, "Of the output."),
    FleetColumn("omega_rad_s", NUMBERS, "Frequencies.", "rad/s"),
    FleetColumn("real", NUMBERS, "Real part of output over input.", "unit"),
    FleetColumn("imag", NUMBERS, "Imaginary part.", "unit"),
    FleetColumn("random_error", NUMBERS, "Standard error of the magnitude, share of it.", "1"),
)
MODES = _table(
    "modes",
    "Modes of the fitted model with their standard errors.",
    FleetColumn("number", WHOLE, "Order by frequency, from 0."),
    FleetColumn("name", TEXT, "Where it has one, such as Dutch roll; else null."),
    FleetColumn("real_rad_s", NUMBER, "Real part of the pole.", "rad/s"),
    FleetColumn("imag_rad_s", NUMBER, "Imaginary part, never negative.", "rad/s"),
    FleetColumn("frequency_rad_s", NUMBER, "Distance of the pole from zero.", "rad/s"),
    FleetColumn("frequency_stderr", NUMBER, "Its standard error; else null.", "rad/s"),
    FleetColumn("damping", NUMBER, "Damping ratio; null for a pole at zero.", "1"),
    FleetColumn("damping_stderr", NUMBER, "Its standard error; else null.", "1"),
)
MARGINS = _table(
    "margins",
    "Margins of the loops with the gains that flew.",
    FleetColumn("axis", TEXT, "Axis or loop."),
    FleetColumn("name", TEXT, "Quantity, such as phase margin."),
    FleetColumn("value", NUMBER, "", "unit"),
    FleetColumn("stderr", NUMBER, "Standard error; null where there is no interval.", "unit"),
    FleetColumn("low", NUMBER, "Lower end of the interval, level 0.95; else null.", "unit"),
    FleetColumn("high", NUMBER, "Upper end; else null.", "unit"),
    FleetColumn("unit", TEXT, "Of all four."),
)
GAINS_FLOWN = _table(
    "gains_flown",
    "Gains with which the log was flown, by the autopilot's own names.",
    FleetColumn("axis", TEXT, "Axis or loop."),
    FleetColumn("name", TEXT, "The autopilot's own name."),
    FleetColumn("value", NUMBER, "In the autopilot's own unit."),
    of_model=False,
)
COVARIATES = _table(
    "covariates",
    "What may explain a difference between flights: battery, hover throttle, pilot, payload.",
    FleetColumn("name", TEXT, "What it is."),
    FleetColumn("value", NUMBER, "Where it is a number; else null.", "unit"),
    FleetColumn("text", TEXT, "Where it is a word; else null."),
    FleetColumn("unit", TEXT, "Of the value; 1 where it has none."),
    FleetColumn("source", TEXT, "log, or the table of flights."),
    of_model=False,
)
FINDINGS = _table(
    "findings",
    "Every verdict on log, models and residuals; its own light, not the log's.",
    FleetColumn("code", TEXT, "Stable name of the verdict."),
    FleetColumn("message", TEXT, "What was found, with numbers and units."),
    FleetColumn("action", TEXT, "What to do; empty where nothing is to be done."),
)
FAILURES = _table(
    "failures",
    "Logs that gave an error, ran out of time or memory, or killed their worker.",
    FleetColumn("kind", TEXT, "Class of the error, or time, memory, killed, record."),
    FleetColumn("message", TEXT, "What was found, what was needed, what to do."),
    FleetColumn("stage", TEXT, "address, naming, reading, study, process or record."),
    FleetColumn("signal", WHOLE, "Signal that ended the process; null where none did."),
    FleetColumn("elapsed_s", NUMBER, "Until it failed; of this run.", "s"),
    FleetColumn("memory_bytes", WHOLE, "Most memory until then; null where unknown.", "B"),
    of_model=False,
)

_ALL = (
    LOGS,
    PARAMETERS,
    COVARIANCES,
    FITTED_MODELS,
    RESPONSES,
    MODES,
    MARGINS,
    GAINS_FLOWN,
    COVARIATES,
    FINDINGS,
    FAILURES,
)
TABLES: Mapping[str, FleetTable] = {table.name: table for table in _ALL}
"""Every table by its name."""


def lower_triangle(matrix: Sequence[Sequence[float]]) -> list[float]:
    """A symmetric matrix as `covariances.lower` keeps it.

    Example
    -------
    >>> lower_triangle([[1.0, 2.0], [2.0, 3.0]])
    [1.0, 2.0, 3.0]
    """
    return [float(value) for i, row in enumerate(matrix) for value in row[: i + 1]]


def from_lower_triangle(lower: Sequence[float]) -> list[list[float]]:
    """The symmetric matrix of a lower triangle with its diagonal.

    Example
    -------
    >>> from_lower_triangle([1.0, 2.0, 3.0])
    [[1.0, 2.0], [2.0, 3.0]]
    """
    size = int((2 * len(lower)) ** 0.5)
    at = [[max(i, j) * (max(i, j) + 1) // 2 + min(i, j) for j in range(size)] for i in range(size)]
    return [[float(lower[k]) for k in row] for row in at]

"""The noun: gains of one axis, what they promise, and how to get there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from functools import partial
from itertools import chain
from pathlib import Path

from flightid.control.autopilots import AxisLoop, GainChange, write_parameters
from flightid.control.autopilots.pid_loop import PidLoop
from flightid.control.margins.rigid_vehicle import DECLARED
from flightid.control.tuning.gain_search_result import without_gains
from flightid.control.tuning.gain_steps import Stage, TunedGain
from flightid.control.tuning.loop_problem import LoopProblem
from flightid.control.tuning.pid_file import write_settings
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.responses import ClosedPlants, ResponseBand
from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light
from flightid.errors import DataError, UnknownNameError
from flightid.files import as_path
from flightid.findings import MOST_DIGITS, Finding, at_least, held
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.quantiles import interval_words, shown


@dataclass(frozen=True, eq=False)
class PidDesign(
    Result,
    schema="flightid.pid_design/1",
    untold={
        "problem": "the search: every plant at every frequency",
        **{"closed": "some of the plants", "loops": "controllers of all axes"},
    },
):
    """Result of `flightid.tune_pid`.

    Attributes
    ----------
    flown, loop : AxisLoop
        The axis as flown, and with the new gains (as flown where there are none).
    exists : bool
        Whether gains meet the requirements for the plants that the data allow.
    changes : tuple of TunedGain
    requirements : TuningRequirements
    worst_cases : tuple of WorstCase
        Margins and bandwidths with their spread, beside those of the flown gains; of the nearest
        gains where none meet the requirements.
    binding : tuple of str
        What keeps the gains from going further; where there are none, what cannot be met.
    responses : tuple of ResponseBand
        Steps and disturbances.
    stages : tuple of Stage
        Steps from the flown gains to the new ones, none larger than the limit.
    content : float
        Share of the plants that do at least as well as the worst promised, at 95 % confidence; 0
        where the uncertainty is not known.
    share_met : float
        Lower 95 % bound of the share of plants that meet every requirement.
    problem : LoopProblem
        The axis with the plants that the worst cases are for: what pictures are drawn from.
    n_plants : int
        Plants that the worst cases rest on, the search having seen none of them.
    findings : tuple of Finding
    provenance : mapping
    filters : tuple of GainChange
        Filters that were not flown and that the gains were tuned with: set with the first step.
    closed, loops : ClosedPlants or None, and tuple of AxisLoop
        Some of the plants and the controllers of all axes: to see other gains with.

    Example
    -------
    >>> import flightid as fid
    >>> from flightid.control.autopilots import axis_loop
    >>> plant = fid.load_model("rate_integrator", axis="roll").with_values(
    ...     {"Ltphi": 140.0, "tau": 0.03})
    >>> design = fid.tune_pid(plant, gains=axis_loop("arducopter", "roll", loop_rate_hz=400.0),
    ...     band_rad_s=(1.0, 100.0), nominal=True)
    >>> design.exists
    True
    """

    flown: AxisLoop
    loop: AxisLoop
    exists: bool
    changes: tuple[TunedGain, ...]
    requirements: TuningRequirements
    worst_cases: tuple[WorstCase, ...]
    binding: tuple[str, ...]
    responses: tuple[ResponseBand, ...]
    stages: tuple[Stage, ...]
    content: float
    share_met: float
    n_plants: int
    problem: LoopProblem
    findings: tuple[Finding, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)
    filters: tuple[GainChange, ...] = ()
    closed: ClosedPlants | None = None
    loops: tuple[AxisLoop, ...] = ()

    @property
    def axis(self) -> str:
        """Axis."""
        return self.flown.axis

    @property
    def gains(self) -> dict[str, float]:
        """New gains by the autopilot's names."""
        return {change.name: change.new for change in self.changes}

    @property
    def parameters(self) -> dict[str, float]:
        """All that is to be set: filters, then gains."""
        return {each.name: each.value for each in self.filters} | self.gains

    def worst_case(self, loop: str, name: str) -> WorstCase:
        """One number, for example ``worst_case("rate loop", "phase margin")``.

        Raises
        ------
        UnknownNameError
            There is no such number.
        """
        for each in self.worst_cases:
            if (each.loop, each.name) == (loop, name):
                return each
        known = ", ".join(f"{each.loop}: {each.name}" for each in self.worst_cases)
        raise UnknownNameError(
            "there is no such number of a loop", found=f"{loop}: {name}", needed=known
        )

    def response(self, name: str) -> ResponseBand:
        """One time response, for example ``response("rate step")``.

        Raises
        ------
        UnknownNameError
            There is no such response.
        """
        for each in self.responses:
            if each.name == name:
                return each
        known = ", ".join(each.name for each in self.responses)
        raise UnknownNameError("there is no such response", found=name, needed=known)

    def __repr__(self) -> str:
        """Axis, gains and the worst phase margin on one line."""
        if not self.exists:
            return f"PidDesign({self.axis}: no gains; {', '.join(self.binding)})"
        margins = [
            each.worst
            for each in self.worst_cases
            if each.name == "phase margin" and each.worst is not None
        ]
        gains = ", ".join(f"{name} {value:.4g}" for name, value in self.gains.items())
        promise = (
            f"worst phase margin {held(min(margins)):.3g} deg"
            if margins
            else "no phase margin promised"
        )
        return f"PidDesign({self.axis}: {gains}; {promise})"

    def gain_table(self) -> Table:
        """Gains before and after."""
        columns = (
            Column("parameter"),
            Column("flown"),
            Column("new"),
            Column("ratio", digits=3),
            Column("low"),
            Column("high"),
            Column("unit"),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                *(c.name, c.flown),
                *((c.new, c.ratio) if self.exists else (None, None)),
                *((c.low, c.high) if self.plain is None else (None, None)),
                c.unit,
            )
            for c in self.changes
        ]
        made = Table(f"Gains of {self.axis}", columns, tuple(rows), self._words())
        return made if self.flown.has_flown else made.without_empty_columns()

    def worst_case_table(self, *, level: float | None = None) -> Table:
        """Margins and bandwidths beside those of the flown gains.

        Parameters
        ----------
        level : float, optional
            Of the intervals; what the worst plant promises has its own confidence.
        """
        level = shown(level)
        words, told = interval_words(level), partial(Column, digits=MOST_DIGITS)
        columns = (
            Column("loop"),
            Column("quantity"),
            Column("required"),
            *(told("nominal"), told(f"{words} low"), told(f"{words} high"), told("worst")),
            *(Column("unit"), told("flown"), told("flown, worst")),
        )
        rows: list[tuple[Cell, ...]] = []
        for each in self.worst_cases:
            ends, (worst, flown) = each.estimate.interval(level), each.shown_worst
            spread = map(each.shown, (each.nominal, *(ends or (None, None))))
            asked = (each.loop, each.name, each.required)
            rows.append((*asked, *spread, worst, each.unit, each.shown(each.flown), flown))
        note = (
            f"Worst: of {self.n_plants} plants drawn from what the data allow; "
            f"{at_least(100.0 * self.content, 1)} % of such plants do at least as well "
            "(95 % confidence)."
            if self.content
            else "Of the model alone: its errors are not known."
        )
        title = f"What the {'new' if self.exists else 'nearest'} gains of {self.axis} promise"
        return Table(title, columns, tuple(rows), (note,)).without_empty_columns()

    def stage_table(self) -> Table:
        """Steps on the way to the new gains."""
        names = [change.name for change in self.changes]
        columns = (
            Column("step"),
            *(Column(name) for name in names),
            Column("least phase margin", "deg", 3),
            Column("least gain margin", "dB", 3),
            Column("stable"),
        )
        rows = tuple(
            (
                *(k, *(stage.gains[name] for name in names)),
                *(held(stage.phase_margin_deg), held(stage.gain_margin_db), stage.stable),
            )
            for k, stage in enumerate(self.stages, 1)
        )
        return Table(f"Steps for {self.axis}", columns, rows)

    def _words(self) -> tuple[str, ...]:
        binds = ", ".join(self.binding) or "nothing"
        bound = f"Binding: {binds}." if self.exists else f"Cannot be met together: {binds}."
        return (bound, *map(str, self.findings))

    def summary(self) -> Table:
        """Gains, with the verdicts below; `worst_case_table` has the margins."""
        return self.gain_table()

    def write(
        self, path: str | Path, *, overwrite: bool = False, accept_red: bool = False
    ) -> tuple[Path, ...]:
        """Write the gains as the autopilot's parameter files, and the flown ones to go back to.

        Those of a PID of its own are written as TOML, in every form (`flightid.export`: as C).

        One file for each step (``name-1.param``, … where there are several), each with a file
        ``….rollback.param`` of the flown values; QGroundControl's layout for PX4, lines for the
        command line for Betaflight.

        Parameters
        ----------
        path : str or Path
            Name of the file, usually ``*.param``, for PX4 ``*.params``, for Betaflight ``*.txt``.
        overwrite : bool
            Whether files that exist may be replaced.
        accept_red : bool
            Write in spite of red findings, which then stand at the top of every file.

        Returns
        -------
        tuple of Path
            What was written, step by step.

        Raises
        ------
        DataError
            There are no gains that meet the requirements, or a finding on them is red.
        OptionError
            A file is already there.
        OSError
            A file cannot be written.
        """
        return write_steps([self], self.findings, path, overwrite=overwrite, accept_red=accept_red)

    @property
    def plain(self) -> PidLoop | None:
        """The controller where it is a PID of its own, None where it is an autopilot's."""
        return self.loop if isinstance(self.loop, PidLoop) else None

    def _computed(self) -> dict[str, object]:
        return {
            "autopilot": self.flown.autopilot,
            "axis": self.axis,
            "gains": {
                c.name: {"flown": c.flown, "new": c.new if self.exists else None, "unit": c.unit}
                for c in self.changes
            },
        }

    def _tables(self) -> tuple[Table, ...]:
        forms = () if self.plain is None else (self.plain.form_table(),)
        return (self.gain_table(), *forms, self.worst_case_table())


def write_steps(
    designs: Sequence[PidDesign],
    findings: Iterable[Finding],
    path: str | Path,
    *,
    left: Sequence[str] = (),
    overwrite: bool = False,
    accept_red: bool = False,
) -> tuple[Path, ...]:
    """Write the steps of several axes together; an axis that arrives earlier stays there.

    Parameters
    ----------
    designs : sequence of PidDesign
    findings : iterable of Finding
        Verdicts beside those of the designs.
    path : str or Path
    left : sequence of str
        Axes that the files leave out, with the reason: written at their top.
    overwrite, accept_red : bool

    Raises
    ------
    DataError
        An axis has no gains, or a finding is red and that was not accepted.
    """
    accepted = [*left, *require_gains(designs, findings, accept_red=accept_red)]
    plain = [design.plain for design in designs if design.plain is not None]
    if plain:
        return write_settings(plain, as_path(path), accepted, overwrite=overwrite)
    final, count = Path(path), max(len(design.stages) for design in designs)
    written = []
    for k in range(count):
        changes = chain.from_iterable(
            _step_changes(each, min(k, len(each.stages) - 1)) for each in designs
        )
        name = final if count == 1 else final.with_name(f"{final.stem}-{k + 1}{final.suffix}")
        notes = [f"flightid: step {k + 1} of {count}; fly each before the next", *accepted]
        made = write_parameters(
            designs[0].flown.autopilot,
            {each.name: each for each in changes}.values(),
            name,
            notes=notes,
            overwrite=overwrite,
        )
        written += [each for each in (made.path, made.rollback) if each is not None]
    return tuple(written)


def require_gains(
    designs: Sequence[PidDesign], findings: Iterable[Finding] = (), *, accept_red: bool = False
) -> list[str]:
    """Refuse axes without gains, and red ones that nobody accepted; notes for the files.

    Raises
    ------
    DataError
        An axis has none, or a finding is red.
    """
    for design in designs:
        if not design.exists:
            why = without_gains(design.findings, design.binding)
            raise DataError(
                f"gains of {design.axis} do not meet the requirements, so none are written",
                found=why.message,
                action=why.action,
            )
    said = [*findings, *(finding for design in designs for finding in design.findings)]
    red = {finding.message: finding for finding in said if finding.light is Light.RED}
    if red and not accept_red:
        first = next(iter(red.values()))
        raise DataError(
            "a finding on the gains is red, so none are written",
            found=first.message,
            needed="gains without a red finding",
            action=f"{first.action or 'mend that'}; accept_red writes them all the same, with "
            "every red finding at the top of the file",
        )
    declared = {finding.message: None for finding in said if finding.code == DECLARED}
    return [*declared, *(f"RED, accepted by the user: {message}" for message in red)]


def _step_changes(design: PidDesign, step: int) -> list[GainChange]:
    flown = design.flown.gains
    return [
        *design.filters,
        *design.flown.beside_gains,
        *(
            GainChange(name, value, flown[name], f"{design.axis}")
            for name, value in design.stages[step].gains.items()
        ),
    ]

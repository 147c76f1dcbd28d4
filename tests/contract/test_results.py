"""Every result: values of all its fields, one table, one HTML, a picture or a reason for none."""

from __future__ import annotations

import dataclasses
import json
from importlib import import_module

import numpy as np
import pytest

import flightid as fid
from flightid.errors import OptionError
from flightid.plot.pictures import PICTURES
from flightid.result import Result, TableView
from flightid.table import Table
from tests.contract.source import PACKAGE, python_files, tree

# Kind of result -> why there is nothing to draw.
WITHOUT_PICTURE = {
    "ApproximateModes": "a table beside `modes`, which draws them",
    "AutotuneReview": "tables; the margins of each axis draw themselves",
    "CoherentPairs": "a table of names; the response draws them",
    "ConditionComparison": "ratios in a table; `pole_map` draws several conditions",
    "DerivativeTable": "a table",
    "Evidence": "lights with reasons",
    "ExportFiles": "files",
    "SweepPlan": "a card to print",
    "FleetDrift": "the page of the fleet draws the histories of its vehicles",
    "FleetRun": "numbers of logs",
    "FleetStatus": "numbers of logs",
    "FleetOutliers": "the page of the fleet draws vehicles beside their type",
    "Flight": "a simulated log, drawn from its records",
    "FilterChoice": "a table; the spectrum behind it is drawn by the flight review",
    "Inspection": "tables and lights",
    "Interpretation": "sentences; `pole_zero` draws the roots",
    "Log": "raw messages; its records draw themselves",
    "LogContents": "what a log holds",
    "LogTable": "raw messages",
    "NarxSearch": "a table of trials",
    "Population": "the page of the fleet draws vehicles beside their type",
    "RatingChart": "a rating on it is drawn by `level_chart`",
    "RotorPhysics": "a table",
    "Skew": "one number",
    "Stability": "a table of poles",
    "StructureComparison": "a table; its fits draw themselves",
    "Study": "its report holds the pictures",
    "StudyResults": "what the report of a study is made of",
    "UniformBase": "an account of a time base",
}
# Writes what a reader takes back, hence not from its fields.
OWN_VALUES = {"Record"}
OWN_HTML = {"result.py", "table.py", "models/state_space/model.py"}  # the last shows equations


def _kinds(base: type = Result) -> set[type]:
    below = {kind for kind in base.__subclasses__() if kind.__module__.startswith("flightid.")}
    return below.union(*(_kinds(kind) for kind in below))


@pytest.fixture(scope="module")
def kinds() -> dict[str, type[Result]]:
    for path in python_files():
        if "(Result" in (text := path.read_text("utf-8")) or "Result,\n" in text:
            import_module(".".join(("flightid", *path.relative_to(PACKAGE).with_suffix("").parts)))
    return {kind.__name__: kind for kind in _kinds()}


def _offences(kind: type[Result]) -> list[str]:
    found = [] if kind.schema.startswith("flightid.") else [f"{kind.__name__}: no schema"]
    if kind.to_dict is not Result.to_dict and kind.__name__ not in OWN_VALUES:
        found.append(f"{kind.__name__}: may lose fields in a to_dict of its own")
    names = (
        {each.name for each in dataclasses.fields(kind)} if dataclasses.is_dataclass(kind) else ()
    )
    found += [f"{kind.__name__}: {name} is no field" for name in kind.untold if name not in names]
    found += [
        f"{kind.__name__}: {name} without a reason" for name, why in kind.untold.items() if not why
    ]
    return found


def test_every_result_tells_all_its_fields_or_why_not(kinds: dict[str, type[Result]]) -> None:
    assert len(kinds) > 40
    assert not [line for kind in kinds.values() for line in _offences(kind)]


def test_what_shows_itself_as_a_table_is_a_result_or_a_model() -> None:
    items = [getattr(fid, name) for name in fid.__all__]
    shown = [item for item in items if isinstance(item, type) and hasattr(item, "summary")]
    assert len(shown) > 30
    assert not [item.__name__ for item in shown if not issubclass(item, TableView)]


def test_html_is_made_in_one_place() -> None:
    found = {
        str(path.relative_to(PACKAGE))
        for path in python_files()
        if "def _repr_html_(" in path.read_text("utf-8") and tree(path)
    }
    assert found == OWN_HTML


def test_every_result_has_a_picture_or_a_reason_for_none(kinds: dict[str, type[Result]]) -> None:
    drawn = {
        name for name, kind in kinds.items() if {each.__name__ for each in kind.mro()} & {*PICTURES}
    }
    assert set(PICTURES) <= set(kinds)
    assert set(kinds) - drawn == set(WITHOUT_PICTURE)


@pytest.fixture(scope="module")
def examples() -> list[Result]:
    model = fid.load_model("rate_first_order")
    time_s = 0.02 * np.arange(500)
    drive = np.sin(0.02 * np.arange(500.0) ** 1.6)
    name = model.inputs[0]
    inputs = fid.Record.from_arrays(
        time_s, inputs={name: drive}, units={name: model.units[name]}, hold="first"
    )
    record = fid.simulate(model, inputs)
    loop = model.linear_system()
    verification = fid.verify(model, record)
    return [
        record,
        fid.modes(model),
        verification,
        verification.predictions[0],
        fid.margins(loop),
        fid.estimate_response(record, window_s=4.0),
    ]


def test_examples_show_themselves(examples: list[Result]) -> None:
    for result in examples:
        assert "\n" not in repr(result)
        assert isinstance(result.summary(), Table)
        plain = result.to_dict()
        assert plain["schema"] == result.schema
        assert json.loads(json.dumps(plain, allow_nan=False)) == plain
        fields = dataclasses.fields(result) if dataclasses.is_dataclass(result) else ()
        lost = [f.name for f in fields if f.name not in plain and f.name not in result.untold]
        assert not lost
        assert "<table>" in result._repr_html_()
        assert type(result.plot()).__name__ == "PlotFigure"
        assert isinstance(result.findings, tuple)


@dataclasses.dataclass(frozen=True)
class _Lossy(Result, schema="planted", untold={"gone": "", "kept": "large"}):
    kept: float

    def summary(self) -> Table:
        return Table("Planted", (), ())

    def to_dict(self) -> dict[str, object]:
        return {}


def test_the_rules_can_fail() -> None:
    assert len(_offences(_Lossy)) == 4
    with pytest.raises(OptionError, match="_Lossy has no picture"):
        _Lossy(1.0).plot()

"""Records that somebody has edited: each costs itself, and the page names its log."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("duckdb")

from flightid.errors import DataError
from flightid.fleet import ask_fleet, type_models
from flightid.fleet.catalogue import record
from flightid.fleet.catalogue.compaction import compact
from flightid.fleet.catalogue.loose import AGAIN, REWRITE, loose_logs, loose_name
from flightid.fleet.catalogue.store import Store
from flightid.fleet.opening import current_store
from flightid.fleet.page import refused_table
from flightid.fleet.settings import read_fleet
from tests.fleet_types import fleet_of
from tests.fleet_workspace import write_fleet

EDITS: dict[str, tuple[str, str, Any]] = {
    "nan": ("parameters", "value", math.nan),
    "huge": ("parameters", "value", 1e200),
    "negative": ("parameters", "stderr", -0.1),
    "tiny": ("parameters", "stderr", 1e-200),
    "unfree": ("parameters", "freedom", 1e-3),
    "nameless": ("parameters", "name", None),
    "short": ("covariances", "lower", [0.01]),
    "infinite": ("covariances", "lower", [0.01, math.inf, 0.02]),
    "correlated": ("covariances", "lower", [0.01, 9.0, 0.02]),
    "backwards": ("covariances", "lower", [-0.01, 0.0, 0.02]),
    "covariate": ("covariates", "value", 1e308),
}


def edit(store: Store, log: str, table: str, column: str, value: object) -> str:
    """Change one value of a loose record as a hand would; the log's address."""
    values = json.loads(store.read(loose_name(log)))
    values["tables"][table][0][values["columns"][table].index(column)] = value
    store.write(loose_name(log), json.dumps(values).encode())
    return str(values["tables"]["logs"][0][values["columns"]["logs"].index("address")])


def fitted(store: Store) -> list[str]:
    return [log for log in loose_logs(store) if b'"fitted"' in store.read(loose_name(log))]


def test_an_edited_record_costs_itself_and_is_named(tmp_path: Path) -> None:
    """One NaN ended the whole report, and no word of it said in which log."""
    store = current_store(read_fleet(write_fleet(tmp_path, flights=5)))
    logs = fitted(store)
    broken = {edit(store, log, *how) for log, how in zip(logs, EDITS.values(), strict=False)}
    answers = ask_fleet(tmp_path / "fleet.toml")
    named = {e["address"] for e in answers.logs if e["reason"] == "record"}
    assert (named, len(broken)) == (broken, len(EDITS))
    counted = {flight for each in answers.types for flight in each.data.flights}
    assert len(counted) == len(logs) - len(EDITS)
    (row,) = (row for row in refused_table(answers.logs).rows if row[1] == "failed")
    assert (row[0], row[2], row[3]) == (len(EDITS), "damaged record", AGAIN)


def test_a_part_of_an_earlier_version_may_hold_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in (write_fleet(tmp_path, flights=2), fleet_of(tmp_path, "quad", name="types.toml")):
        store = current_store(read_fleet(path))
        log = fitted(store)[0]
        edit(store, log, *EDITS["nan"])
        with monkeypatch.context() as patch:
            patch.setattr(record, "flaw_of", lambda _: "")
            patch.setattr(math, "isfinite", lambda _: True)
            assert compact(store) is not None
        if path.name == "types.toml":
            with pytest.raises(DataError, match=log[:16]):
                type_models(path)
            continue
        (told,) = (each for each in ask_fleet(path).logs if each["log"] == log)
        assert (told["outcome"], told["reason"], told["action"]) == ("failed", "record", REWRITE)

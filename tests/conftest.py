"""Fixtures shared by all tests: where the shared real logs and records are, if they are."""

from __future__ import annotations

import gc
import linecache
import os
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from _pytest.doctest import DoctestModule
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import fleet_examples
from tests.examples import PROFILE

if TYPE_CHECKING:
    from flightid import Study

REPOSITORY = Path(__file__).parent.parent

# The same examples in every run, and no clock; more of them at night (`make test-nightly`), and
# `HYPOTHESIS_PROFILE=search` looks for new ones.
settings.register_profile("steady", derandomize=True, deadline=None, max_examples=15)
settings.register_profile("nightly", derandomize=True, deadline=None)
settings.register_profile("search", deadline=None, max_examples=2000)
settings.load_profile(PROFILE)


def pytest_configure(config: pytest.Config) -> None:
    """Collect garbage seldom: modules and trees of sources live as long as the run does.

    Files of tests need not outlive a power cut: 2,000 of them waited 5 ms each for the disk.
    """
    if not config.pluginmanager.has_plugin("fleet-examples"):
        config.pluginmanager.register(fleet_examples, "fleet-examples")
    gc.set_threshold(100_000, 20, 100)
    os.fsync = lambda _: None


@pytest.hookimpl(tryfirst=True)
def pytest_collection() -> None:
    """Draw once while there is little: the first draw of a process looks at all its objects."""
    given(st.none())(lambda _: None)()


def pytest_collection_finish() -> None:
    """Take what was collected out of every later look for garbage, or for changed sources."""
    gc.freeze()
    linecache.clearcache()


@pytest.hookimpl(wrapper=True)
def pytest_collect_file() -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
    """Tests hold no examples: doctests are those of the package."""
    return [each for each in (yield) if not isinstance(each, DoctestModule)]


def _shared_data() -> Path:
    named = os.environ.get("FLIGHTID_DATA")
    return Path(named) if named else REPOSITORY.parent / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real logs and records; the test is skipped where it is absent."""
    folder = _shared_data()
    if not folder.is_dir():
        pytest.skip("the shared data folder is not here (set FLIGHTID_DATA to name it)")
    return folder


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """Studies of this test write no report: it takes longer than most of their stages."""

    from flightid.study.output import SCHEMA  # noqa: PLC0415 - the process that hands out tests needs none

    def results_alone(_: Study, folder: Path) -> None:
        (folder / "results.json").write_text(f'{{"schema": "{SCHEMA}"}}', encoding="utf-8")

    monkeypatch.setattr("flightid.study.run._write", results_alone)


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the checkout."""
    return REPOSITORY

"""A few kills of the page; `python -m tests.stress.app_kills --kills 100` counts many."""

import pytest

from tests.reference.test_app_in_browser import REQUIRED, _missing
from tests.stress import app_kills


@pytest.mark.nightly
def test_what_was_finished_outlives_server_worker_and_browser() -> None:
    if missing := _missing():
        pytest.fail(missing) if REQUIRED else pytest.skip(missing)
    assert app_kills.main(["--kills", "4"]) == 0

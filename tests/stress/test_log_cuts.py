"""What `inspect` says of logs that were cut: nothing lost, nothing denied, nothing untyped."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.stress.log_cuts import said_of


@pytest.mark.nightly
def test_cut_logs_lose_no_axis_and_deny_nothing(shared_data: Path) -> None:
    """The sentences themselves: `python -m tests.stress.log_cuts FOLDER --places 50`."""
    found = said_of(shared_data / "logs", 50)
    assert found.inspected
    assert not found.lost
    assert not found.contradictions
    assert not found.untyped
    # What stays below a limit is not written as the limit.
    assert not [said for said in found.first.values() if "below 0.6 (largest 0.6" in said]

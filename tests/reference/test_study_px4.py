"""The study of the real PX4 log: it must refuse to over-claim."""

from __future__ import annotations

from pathlib import Path

import pytest

import flightid as fid
from flightid.conventions import Light


@pytest.mark.nightly
def test_a_log_without_a_flight_gives_no_model(
    shared_data: Path, repository: Path, tmp_path: Path
) -> None:
    study = fid.run_study(
        repository / "examples" / "px4_flight" / "study.toml",
        output=tmp_path / "out",
        log=shared_data / "logs" / "px4_quad_2016.ulg",
    )
    assert study.document.verdict is Light.RED
    assert study.inspection.verdict is Light.RED
    (item,) = study.identified
    assert item.fit.average_cost > 100
    assert any("loop seems to be closed" in finding.message for finding in item.response.findings)
    assert (study.output / "report.html").stat().st_size < 3_000_000

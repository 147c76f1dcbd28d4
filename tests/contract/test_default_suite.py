"""What every run pays for is counted: processes that tests start, and tests in all.

No test asserts a time: machines differ. A number here is raised on purpose, or a test becomes
`nightly` beside a shorter one, calls `run([...])` in its own process, or joins another.
"""

from __future__ import annotations

import re
from collections import Counter

import pytest

from tests.contract.source import ROOT

STARTS = re.compile(r"\bsubprocess\.(?:run|Popen|call|check_call|check_output)\(")
STARTED = {
    "compiled_model.py": 1,  # a compiler's
    "contract/test_new_method.py": 1,  # the table of methods with one line more
    "contract/test_public_surface.py": 3,
    "contract/test_site.py": 1,
    "contract/test_start_up.py": 2,
    "contract/test_stub.py": 1,
    "guide/test_examples.py": 1,
    "reference/test_report_in_browser.py": 1,
    "reference/test_app_seeds_in_browser.py": 1,  # the examples that fly; nightly
    "unit/test_app_watched.py": 1,  # a server, to be killed with all of its processes; slow
    "unit/test_cli_program.py": 3,
    "unit/test_commit_subject.py": 2,
    "unit/test_fleet_claims.py": 1,  # `sleep`, to be killed
    "unit/test_fleet_cluster.py": 3,  # a scheduler, clients to kill, two at once; nightly
    "unit/test_output_error_routes.py": 1,  # another number of threads
    "unit/test_plain_pid.py": 1,
    "unit/test_realtime.py": 1,
}
LONG_RUNS = ("fuzz", "stress", "strangers")
MOST_TESTS = 6_870
WHOLE = 3_000


def _starts(sources: dict[str, str]) -> Counter[str]:
    return Counter({name: len(STARTS.findall(text)) for name, text in sources.items()})


def test_places_that_start_processes_are_known() -> None:
    folder = ROOT / "tests"
    found = _starts(
        {
            str(path.relative_to(folder)): path.read_text("utf-8")
            for path in folder.rglob("*.py")
            if path.relative_to(folder).parts[0] not in LONG_RUNS
        }
    )
    assert +found == Counter(STARTED)


def test_a_start_is_seen() -> None:
    planted = "made = subprocess" + ".run([tool])\n"
    assert _starts({"unit/test_new.py": planted, "unit/test_old.py": ""})["unit/test_new.py"] == 1


def test_tests_are_no_more_than_said(request: pytest.FixtureRequest) -> None:
    count = len(request.session.items)
    if count < WHOLE:
        pytest.skip("counted where all tests run")
    assert count <= MOST_TESTS, f"{count} tests: join what says the same, or raise MOST_TESTS"

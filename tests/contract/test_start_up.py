"""Commands that answer at once load nothing that only long work needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from flightid.threads import LINEAR_ALGEBRA
from tests.sweep_log import SweepFlight

LOADED = (
    "import os, sys\nfrom flightid.cli.program import run\n"
    "run(sys.argv[1:])\ntold = [f'{name}={value}' for name, value in os.environ.items()]\n"
    "sys.stderr.write('\\n'.join([*sys.modules, *told]))"
)
HEAVY = frozenset({"plotly", "pint", "pyarrow", "h5py", "jinja2"})
HEAVY |= {
    f"scipy.{part}" for part in ("signal", "stats", "optimize", "special", "interpolate", "sparse")
}
HEAVY |= {f"flightid.{room}" for room in ("study", "identification", "control", "export")}


def loaded(*arguments: str) -> set[str]:
    """Modules that a command loaded, and the surroundings it left."""
    command = [sys.executable, "-c", LOADED, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(done.stderr.splitlines())


@pytest.mark.parametrize("flag", ["--help", "--version"])
def test_help_and_version_load_no_numbers(flag: str) -> None:
    assert not loaded(flag) & (HEAVY | {"numpy", "scipy"})


@pytest.mark.parametrize(("told", "threads"), [(None, "1"), ("2", "2")])
def test_linear_algebra_has_one_thread_unless_told(
    told: str | None, threads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two spun: a command took twice the processor time, and longer by the clock."""
    for name in LINEAR_ALGEBRA:
        monkeypatch.delenv(name, raising=False)
    if told:
        monkeypatch.setenv(LINEAR_ALGEBRA[0], told)
    assert f"{LINEAR_ALGEBRA[0]}={threads}" in loaded("--version")


@pytest.mark.parametrize("verb", ["run", "tune"])
def test_help_of_the_first_verbs_loads_options_alone(verb: str) -> None:
    """1.5 s of processor time before the first line, where 0.3 do."""
    found = loaded(verb, "--help")
    assert "flightid.study.proposal.options" in found
    heavy = HEAVY - {"flightid.study", "flightid.control"} | {"flightid.study.run"}
    assert not found & heavy


def test_inspect_loads_what_it_uses(tmp_path: Path) -> None:
    path = SweepFlight(sweep_s=8.0).write(tmp_path)
    found = loaded("--quiet", "inspect", str(path))
    assert "flightid.inspection.usable_band" in found
    assert not found & HEAVY


def test_a_run_does_without_what_loads_for_a_second(tmp_path: Path) -> None:
    path = SweepFlight(sweep_s=8.0).write(tmp_path)
    found = loaded("--quiet", "run", str(path), "--output", str(tmp_path / "made"))
    assert "flightid.identification.frequency_domain.fit" in found
    parts = ("signal", "stats", "optimize", "interpolate", "sparse", "spatial", "ndimage", "io")
    assert not found & {"pint", "h5py", *(f"scipy.{part}" for part in parts)}


def test_peaks_and_fleets_are_found_without_what_they_do_not_need() -> None:
    """SciPy's signals took 15 % of `run rig.csv`, all of fleets half a second of `tune`."""
    code = (
        "import sys\nfrom pathlib import Path\n"
        "import numpy as np\nfrom flightid.validation.spectra.spectra import _peaks\n"
        "from flightid.fleet.recognition import is_fleet\n"
        "w = np.arange(1.0, 9.0)\nassert _peaks(w, 1.0 + 99.0 * (w == 4.0), 0.9 * w, 1.1 * w)\n"
        "assert not is_fleet(Path('flight.bin'))\n"
        "sys.exit(bool({'scipy.signal', 'flightid.fleet.statistics'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

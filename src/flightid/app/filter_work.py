"""Filters tried on the noise of a flight, in a worker that keeps what a hand edits on."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.app.gain_schemas import GainFile
from flightid.app.overview import shown_finding
from flightid.app.plot_schemas import FilterAxis, FilterScreen, FilterValue
from flightid.app.work import KEPT, kept_log
from flightid.control.autopilots.parameter_files import parameter_suffix
from flightid.files import sha256_of_file
from flightid.review.edited_filters import HIGHEST_HZ, EditedAxis, FilterBench, filter_bench
from flightid.review.tried_filters import TriedFilters, tried_filters

MOST_POINTS = 300
QUIET_DB = -120.0
"""Below it nothing is drawn."""


def try_filters(path: Path, values: Mapping[str, float]) -> Mapping[str, Any]:
    """What the page shows of filters that a hand edits."""
    key = f"filters of {sha256_of_file(path)}"
    if key not in KEPT:
        KEPT[key] = filter_bench(kept_log(path))
    bench: FilterBench = KEPT[key]
    # A study may say what cannot be tried: the others are, so that the page can put it right.
    refused = bench.refused(values)
    values = {name: value for name, value in values.items() if name not in refused}
    tried = tried_filters(bench, values)
    axes = tried.axes
    frequency = axes[0].frequency_hz
    rows = np.unique(
        np.searchsorted(frequency, np.geomspace(max(frequency[0], 1.0), frequency[-1], MOST_POINTS))
    )
    rows = rows[rows < len(frequency)]
    known = bench.values
    return FilterScreen(
        values=[
            FilterValue(
                name=name, flown=flown, known=bench.knows(name),
                value=values.get(name, flown),
            )
            for name, flown in known.items()
        ],
        refused={name: _refusal(name, value, known) for name, value in refused.items()},
        highest=HIGHEST_HZ,
        suggested={} if bench.choice is None else dict(bench.choice.values),
        at_hz=bench.at_hz,
        measured=bench.measured,
        raw=bench.noise.gyro == "raw",
        seen_hz=bench.seen_hz,
        frequency_hz=[float(f"{each:.5g}") for each in frequency[rows]],
        axes=[_axis(each, rows) for each in axes],
        findings=[shown_finding(each) for each in tried.findings],
        files=_files(tried) if tried.is_flyable else [],
        python=_python(path, values),
    ).model_dump()  # fmt: skip


def _refusal(name: str, value: float, known: Mapping[str, float]) -> str:
    if name not in known:
        return f"{name} is no filter of this vehicle"
    return f"{name} may be 0 to {HIGHEST_HZ:g}, not {value:g}; {known[name]:g} flew"


def _axis(found: EditedAxis, rows: NDArray[np.intp]) -> FilterAxis:
    return FilterAxis(
        axis=found.axis,
        ahead=_decibels(found.ahead[rows]),
        flown=_decibels(found.flown[rows]),
        edited=_decibels(found.edited[rows]),
        phase_flown_deg=found.phase_flown_deg,
        phase_edited_deg=found.phase_edited_deg,
        noise_flown_percent=100.0 * found.noise_flown,
        noise_edited_percent=100.0 * found.noise_edited,
        stages=[f"{each.name}: {each.settings}" for each in found.stages],
    )


def _decibels(density: NDArray[np.float64]) -> list[float | None]:
    made = 10.0 * np.log10(np.maximum(density, 1e-30))
    return [float(f"{each:.5g}") if each >= QUIET_DB else None for each in made]


def _files(tried: TriedFilters) -> list[GainFile]:
    """The parameter file, and the way back."""
    with tempfile.TemporaryDirectory() as name:
        paths = tried.write(Path(name) / f"filters{parameter_suffix(tried.kind)}")
        return [GainFile(name=each.name, text=each.read_text("utf-8")) for each in paths]


def _python(path: Path, values: Mapping[str, float]) -> str:
    return (
        "import flightid as fid\n"
        "from flightid.review.tried_filters import tried_on\n\n"
        f"tried = tried_on(fid.read_log({path.name!r}), {dict(values)!r})\n"
        "print(tried.summary())\n"
    )

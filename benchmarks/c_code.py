"""A step of exported C beside NumPy's and python-control's, one system and one input."""

from __future__ import annotations

import ctypes
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import flightid as fid
from flightid.export.c_compiler import c_compiler, compile_library, library_suffix
from flightid.table import Cell, Column, Table

try:
    import control
except ImportError:
    control = None

N_SAMPLES = 20_000
STEP_S = 0.01
# The loop belongs to what is measured: a call from Python costs more than the step.
_LOOP = """
#include "vehicle.h"
__attribute__((visibility("default"))) int drive(const double *u, double *y, int count)
{
    vehicle_model model;
    int k, status = vehicle_init(&model);
    for (k = 0; k < count && status == vehicle_DONE; k++) {
        status = vehicle_step(&model, u + k * vehicle_N_INPUTS, y + k * vehicle_N_OUTPUTS);
    }
    return status;
}
"""


def _seconds(work: Callable[[], object]) -> float:
    times = []
    for _ in range(5):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return sorted(times)[2]


def _compiled(model: object, folder: Path, **options: object) -> ctypes.CDLL:
    fid.export(model, folder / "vehicle.c", sample_time_s=STEP_S, **options)
    (folder / "loop.c").write_text(_LOOP)
    library = folder / f"vehicle{library_suffix()}"
    return ctypes.CDLL(str(compile_library([folder / "vehicle.c", folder / "loop.c"], library)))


def _recursion(system: fid.LinearSystem, u: np.ndarray) -> np.ndarray:
    a, b, c, d, _ = system.sampled(STEP_S).state_space()
    x, rows = np.zeros(len(a)), np.empty((u.shape[1], len(c)))
    for k, now in enumerate(u.T):
        rows[k] = c @ x + d @ now
        x = a @ x + b @ now
    return rows


def _driven(library: ctypes.CDLL, u: np.ndarray, n_outputs: int) -> np.ndarray:
    given, found = np.ascontiguousarray(u.T), np.empty((u.shape[1], n_outputs))
    pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (given, found)]
    if library.drive(*pointers, u.shape[1]) != 0:
        raise RuntimeError("the exported code stopped")
    return found


def run() -> Table:
    columns = (
        Column("work"),
        Column("ns a step", digits=3),
        Column("peer ns a step", digits=3),
        Column("ratio", digits=3),
    )
    if c_compiler() is None:
        return Table("Exported C", columns, (), ("left out: no C compiler",))
    rows: list[tuple[Cell, ...]] = []
    rng = np.random.default_rng(0)
    model = fid.load_model("r50_hover").with_fixed(tau_ped=0.0)
    system = model.linear_system()
    u = 0.01 * rng.standard_normal((len(system.inputs), 2000))
    per_step = 1e9 / u.shape[1]
    with tempfile.TemporaryDirectory() as folder:
        library = _compiled(model, Path(folder))
        found = _driven(library, u, len(system.outputs))
        wanted = _recursion(system, u)
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())
        ours = _seconds(lambda: _driven(library, u, len(system.outputs))) * per_step
    theirs = _seconds(lambda: _recursion(system, u)) * per_step
    label = f"R-50, {system.order} states"
    rows.append((f"{label}: NumPy, sample by sample", ours, theirs, theirs / ours))
    if control is None:
        print("python-control is not installed: left out")
    else:
        there = system.to_control(sample_time_s=STEP_S)
        theirs = _seconds(lambda: control.forced_response(there, U=u)) * per_step
        rows.append((f"{label}: control.forced_response", ours, theirs, theirs / ours))
    quad = fid.load_model("quadrotor_6dof")
    trim = np.array([[quad.trim.get(name, 0.0)] for name in quad.inputs])
    u = trim + 0.001 * rng.standard_normal((len(quad.inputs), N_SAMPLES))
    time_s = np.arange(N_SAMPLES) * STEP_S
    record = fid.Record.from_arrays(time_s, inputs=dict(zip(quad.inputs, u, strict=True)))
    with tempfile.TemporaryDirectory() as folder:
        library = _compiled(quad, Path(folder), substeps=1)
        ours = _seconds(lambda: _driven(library, u, len(quad.outputs))) * 1e9 / N_SAMPLES
    native = _seconds(lambda: fid.simulate(quad, record, hold="zero", substeps=1)) * 1e9 / N_SAMPLES
    rows.append(("quadrotor, 6 degrees of freedom: simulate", ours, native, native / ours))
    return Table(
        "Exported C", columns, tuple(rows), ("compiled with -O2 by the system's compiler",)
    )


if __name__ == "__main__":
    print(run())

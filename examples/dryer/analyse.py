"""Check published black-box models against a record of a laboratory hair dryer.

The record (1000 samples of heater voltage and air temperature, 0.08 s apart) comes with several
textbooks and toolboxes and is not ours to ship. Give it as a text file with the input in the first
and the output in the second column:

    python examples/dryer/analyse.py dryer.dat

Samples 1 to 300 are fitted and 800 to 900 judge the delay; means are taken off, the past is at
rest. What is printed beside each model are the values to expect from that record.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import flightid as fid

SAMPLE_TIME_S = 0.08
P = fid.PolynomialModel
EXPECTED = {
    "OE": (
        P.oe("voltage", "temperature", nb=2, nf=2, nk=3, initial_state="zero"),
        {"b3": 0.06296, "b4": 0.05397, "f1": -1.24108, "f2": 0.36682},
        0.008795,
    ),
    "BJ": (
        P.bj("voltage", "temperature", nb=2, nc=2, nd=2, nf=2, nk=3, initial_state="zero"),
        {
            "b3": 0.06725, "b4": 0.03981, "f1": -1.31434, "f2": 0.43329,
            "c1": 0.6761, "c2": -0.0169, "d1": -0.2791, "d2": -0.5975,
        },
        0.0014736,
    ),
    "ARMAX": (
        P.armax("voltage", "temperature", na=2, nb=2, nc=2, nk=3, initial_state="zero"),
        {
            "a1": -1.30693, "a2": 0.42382, "b3": 0.06706, "b4": 0.04049,
            "c1": -0.33973, "c2": 0.09661,
        },
        0.0015357,
    ),
}  # fmt: skip


SINGULAR_VALUES = (69.8841, 14.9963, 3.6675, 1.9677, 0.3000, 0.2078)
"""PO-MOESP with 15 block rows on all samples, means left in."""


def print_subspace(record: fid.Record) -> None:
    structure = fid.InnovationsModel.subspace(
        "voltage", "temperature", 4, horizon=15, direct=True, offsets="none", refine=False
    )
    order = fid.identify(structure, record).details.order
    print("PO-MOESP singular values")
    for found, expected in zip(order.singular_values, SINGULAR_VALUES, strict=False):
        print(f"  {found:9.4f} (expected {expected:9.4f})")


def read(path: Path) -> fid.Record:
    columns = np.loadtxt(path, usecols=(0, 1), max_rows=100_000, delimiter=_delimiter(path)).T
    time_s = np.arange(columns.shape[1]) * SAMPLE_TIME_S
    return fid.Record.from_arrays(
        time_s,
        inputs={"voltage": columns[0]},
        outputs={"temperature": columns[1]},
        units={"voltage": "V", "temperature": "degC"},
        name=path.name,
    )


def _delimiter(path: Path) -> str | None:
    with path.open(encoding="utf-8") as file:
        return "," if "," in file.readline() else None


def part(record: fid.Record, first: int, last: int) -> fid.Record:
    """Samples first to last, counted from one as in the books."""
    keep = slice(first - 1, last)
    return fid.Record.from_arrays(
        record.time_s[keep],
        inputs={"voltage": record["voltage"][keep]},
        outputs={"temperature": record["temperature"][keep]},
        units={"voltage": "V", "temperature": "degC"},
        name=f"samples {first} to {last}",
    )


def main(path: Path) -> None:
    record = read(path)
    fitted, judged = part(record, 1, 300), part(record, 800, 900)
    print(fid.advise(fitted).summary(), end="\n\n")
    delays = fid.scan_orders(fitted, judged, kind="arx", na=2, nb=2, nk=range(1, 11))
    print(delays.summary(), end="\n\n")
    for name, (structure, expected, loss) in EXPECTED.items():
        fit = fid.identify(structure, fitted)
        print(f"{name}: loss {fit.details.criteria.loss:.6g}, expected {loss:.6g}")
        for key, parameter in fit.parameters.items():
            print(
                f"  {key} {parameter.value:9.5f} (expected {expected[key]:9.5f}, "
                f"standard error {parameter.stderr or 0.0:.5f})"
            )
        print()
    print_subspace(record)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))

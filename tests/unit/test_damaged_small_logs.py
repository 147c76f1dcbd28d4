"""Blackbox, telemetry and text logs, damaged at random: a log or a typed error."""

import contextlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.errors import LogFormatError

SEEDS = Path(__file__).parents[2] / "fuzz" / "seeds"
CHANGES = st.lists(st.tuples(st.integers(0, 10**6), st.binary(max_size=3)), max_size=8)


def _read(content: bytes, folder: Path) -> None:
    path = folder / "damaged"
    path.write_bytes(content)
    with contextlib.suppress(LogFormatError):
        log = fid.read_log(path)
        for name, info in log.messages.items():
            table = log.table(name)
            assert {values.shape[0] for values in table.arrays().values()} <= {info.count}
            if info.first_s is not None:
                assert len(table.time_s) == info.count
        assert all(event.text for event in log.events)
        assert all(finding.message for finding in log.findings)


@pytest.mark.parametrize(
    "name", ["blackbox/flight.bbl", "telemetry/link.tlog", "printed/flight.log"]
)
@given(changes=CHANGES, cut=st.integers(0, 10**6))
def test_damage_is_survived(
    name: str,
    changes: list[tuple[int, bytes]],
    cut: int,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    content = bytearray((SEEDS / name).read_bytes())
    for place, piece in changes:
        at = place % len(content)
        content[at : at + len(piece)] = piece
    _read(bytes(content[: max(cut % (2 * len(content)), 16)]), tmp_path_factory.getbasetemp())

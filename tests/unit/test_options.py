"""Options as data: ranges in words, errors, tables of a file, all from the fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from flightid.control.tuning.requirements import TuningRequirements
from flightid.errors import OptionError, StudyError
from flightid.options import Options, checked, option, options_of, read_options


@dataclass(frozen=True)
class Toy(Options):
    starts: int = option(1, minimum=1, doc="Starts.")
    weight: float = option(1.0, unit="1/dB", above=0.0, below=10.0, doc="Weight.")
    least: float | None = option(0.6, minimum=0.0, maximum=1.0, doc="Least coherence.")
    hold: str = option("first", choices=("first", "zero"), doc="Between samples.")
    freed: bool | str | Sequence[str] = option(True, doc="Channels.")
    band: tuple[float, float] | None = option(None, unit="rad/s", above=0.0, doc="Band.")
    start: str | Mapping[str, float] = option("trim", choices=("trim",), doc="Start.")


def test_good_values_are_taken_as_they_are() -> None:
    made = Toy(
        starts=np.int64(3), weight=2, least=None, hold="zero", freed=["a"], start={"q": 1.0}
    )  # fmt: skip
    assert made.to_dict() == {
        "starts": 3, "weight": 2, "least": None, "hold": "zero", "freed": ["a"], "band": None,
        "start": {"q": 1.0},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"starts": 0}, "starts is too small: found 0; needed a whole number from 1 on"),
        ({"starts": 1.5}, "starts has no meaning: found 1.5; needed a whole number from 1 on"),
        ({"starts": True}, "starts has no meaning: found True"),
        ({"weight": 0.0}, r"weight is too small.*a number above 0 and below 10 \[1/dB\]"),
        ({"weight": 10.0}, "weight is too large"),
        ({"weight": float("nan")}, "weight has no meaning"),
        ({"least": 1.5}, "least is too large: found 1.5; needed a number from 0 to 1 or none"),
        ({"hold": "tustin"}, "hold is not known: found 'tustin'; needed 'first' or 'zero'"),
        ({"freed": 1}, "freed has no meaning.*true or false or a word or a list of names"),
        (
            {"band": (1.0,)},
            r"band has no meaning.*two numbers, low and high above 0 \[rad/s\] or none",
        ),
        ({"band": (-1.0, 2.0)}, "band is too small"),
        ({"start": "rest"}, "start is not known: found 'rest'; needed 'trim' or numbers by name"),
        ({"start_": "rest"}, "this fit has no such option: found start_.*Next: write 'start'"),
    ],
)
def test_what_has_no_meaning_is_refused(given: dict[str, object], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        checked(Toy, given, "this fit")


def test_a_table_of_a_file_is_read() -> None:
    made = read_options(Toy, {"weight": 2, "band": [1, 2], "freed": ["a", "b"]}, "[toy]")
    assert (made.weight, made.band, made.freed) == (2.0, (1, 2), ("a", "b"))
    assert isinstance(made.weight, float)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"start_s": 1}, r"\[toy\]: there is no key 'start_s'.*Next: write 'starts'"),
        ({"starts": 0}, r"\[toy\]: starts is too small: found 0; needed a whole number from 1 on"),
        ({"hold": 3}, r"\[toy\]: hold has no meaning: found 3; needed 'first' or 'zero'"),
    ],
)
def test_faults_of_a_file_name_key_found_and_range(table: dict[str, object], words: str) -> None:
    with pytest.raises(StudyError, match=words):
        read_options(Toy, table, "[toy]", error=StudyError)


def test_a_key_without_default_must_be_given() -> None:
    @dataclass(frozen=True)
    class Needed(Options):
        name: str = option(doc="Name.")

    with pytest.raises(OptionError, match="name is missing"):
        read_options(Needed, {}, "[needed]")
    assert [each.name for each in options_of(Needed)] == ["name"]


@pytest.mark.parametrize("off", ["none", False])
def test_an_option_without_a_limit_can_be_switched_off_in_a_file(off: object) -> None:
    made = read_options(TuningRequirements, {"noise_growth": off}, "[tune]")
    assert made.noise_growth is None
    with pytest.raises(OptionError, match="step_limit has no meaning"):
        read_options(TuningRequirements, {"step_limit": off}, "[tune]")

"""A new option is one line: check, help, study key, provenance and page read it from the field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner
from tools import options_page
from tools.options_page import PAGE, page, section

import flightid as fid
from flightid.cli.equations import equations
from flightid.cli.option_fields import OptionsCommand, given_options
from flightid.cli.program import run
from flightid.errors import OptionError, StudyError
from flightid.identification import methods
from flightid.identification.regression.options import EquationErrorOptions
from flightid.models import StateSpaceModel
from flightid.options import Options, option
from flightid.study import fit_settings
from flightid.study.fit_settings import read_fit
from flightid.study.reading import TableReader
from flightid.surface import as_key, speaking, spoken


@dataclass(frozen=True)
class WithToy(EquationErrorOptions):
    """What a method's options are after one line more."""

    toy_gain: float = option(0.5, unit="1/s", above=0.0, below=2.0, doc="A toy.")


@pytest.fixture
def with_toy(monkeypatch: pytest.MonkeyPatch) -> None:
    table = tuple(
        replace(way, options=WithToy) if way.name == "equation_error" else way
        for way in methods.METHODS
    )
    for reader in (methods, fit_settings, options_page):
        monkeypatch.setattr(reader, "METHODS", table)


def _flown() -> tuple[StateSpaceModel, fid.Record]:
    model = (
        fid.ModelBuilder("roll")
        .state("p", "rad/s")
        .input("lat", "1")
        .parameter("Lp", -4.0, "1/s")
        .parameter("Llat", 20.0, "1/s^2")
        .equation("p'", "Lp*p + Llat*lat")
        .output("p")
        .build()
    )
    time_s = np.arange(400) * 0.02
    driven = fid.Record.from_arrays(time_s, inputs={"lat": 0.1 * np.sign(np.sin(3 * time_s))})
    return model, fid.simulate(model, driven, units={"p": "rad/s"})


@pytest.mark.usefixtures("with_toy")
def test_a_toy_option_is_checked_and_stands_in_the_provenance() -> None:
    model, record = _flown()
    fit = fid.identify(model, record, method="equation_error", toy_gain=0.75)
    assert fit.provenance["options"]["toy_gain"] == 0.75
    with pytest.raises(OptionError, match=r"toy_gain is too large: found 2.0; needed a number"):
        fid.identify(model, record, method="equation_error", toy_gain=2.0)


@pytest.mark.usefixtures("with_toy")
def test_a_toy_option_is_a_key_of_a_study() -> None:
    table = {"method": "equation_error", "toy_gain": 1}
    assert read_fit(TableReader(table, "[fit]")).options["toy_gain"] == 1.0
    with pytest.raises(StudyError, match=r"\[fit\]: toy_gain is too small: found 0; needed"):
        read_fit(TableReader(table | {"toy_gain": 0}, "[fit]"))
    with pytest.raises(StudyError, match="Next: write 'toy_gain'"):
        read_fit(TableReader(table | {"toy_gian": 1}, "[fit]"))


@pytest.mark.usefixtures("with_toy")
def test_a_toy_option_is_in_the_help_and_on_the_page() -> None:
    command = OptionsCommand("identify", fields_of=equations)
    shown = CliRunner().invoke(command, ["--help"]).output
    assert "--toy-gain" in shown
    assert "A toy. [1/s] (equation_error)" in " ".join(shown.split())
    assert "| `toy_gain` | `0.5` | a number above 0 and below 2 [1/s] | A toy. |" in page()


def test_the_page_of_options_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tools/options_page.py --write"
    assert "toy_gain" not in page()
    assert "| `toy_gain` |" in section("x", WithToy)


@dataclass(frozen=True)
class Shapes(Options):
    count: int = option(1, minimum=1, doc="Count.")
    freed: bool | str | Sequence[str] = option(True, doc="Freed.")
    start: str | Mapping[str, float | str] = option("trim", choices=("trim",), doc="Start.")
    band: tuple[float, float] | None = option(None, doc="Band.")
    turned: bool = option(False, doc="Turned.")


@pytest.mark.parametrize(
    ("words", "given"),
    [
        ([], {}),
        (["--count", "3", "--turned"], {"count": 3, "turned": True}),
        (["--freed", "a", "--freed", "b"], {"freed": ("a", "b")}),
        (["--freed", "none"], {"freed": False}),
        (["--start", "trim"], {"start": "trim"}),
        (["--start", "q=0.5", "--start", "w=estimate"], {"start": {"q": 0.5, "w": "estimate"}}),
        (["--band", "1", "2", "--no-turned"], {"band": (1.0, 2.0), "turned": False}),
    ],
)
def test_the_command_line_gives_what_the_fields_take(
    words: list[str], given: dict[str, object]
) -> None:
    seen: dict[str, object] = {}

    @click.command(cls=OptionsCommand, fields_of=lambda: {"shapes": Shapes})
    def command(**values: object) -> None:
        seen.update(given_options(Shapes, values, "shapes"))

    assert CliRunner().invoke(command, words).exit_code == 0
    assert seen == given
    Shapes(**seen)


def test_every_method_is_reached_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, record = _flown()
    noise = 0.002 * np.random.default_rng(1).standard_normal(record.n_samples)
    fid.write_model(model, tmp_path / "roll.toml")
    path = fid.write_records(record.replace({"p": record["p"] + noise}), tmp_path / "f.nc")
    words = ["identify", str(path), "--model", str(tmp_path / "roll.toml"), "--json", "--method"]
    given = {
        "output_error": ["--output-bias", "none", "--starts", "2"],
        "equation_error": ["--half-width", "3"],
        "fourier_regression": ["--band", "0.1", "20"],
        "fourier_output_error": ["--maximum-iterations", "40"],
        "filter_error": ["--process-noise", "p"],
    }
    for method, options in given.items():
        assert run([*words, method, *options]) in (0, 1), method
        assert f'"method": "{method}"' in capsys.readouterr().out
    assert run([*words, "output_error", "--half-width", "3"]) == 2
    assert "--half-width is no option of output_error" in capsys.readouterr().err


def test_held_parameters_are_told_as_a_file_has_them() -> None:
    with speaking(as_key):
        assert spoken("fix with model.with_fixed(Lp=..., tau=...)") == (
            "fix with free = false of Lp, tau in [model.parameters]"
        )
        assert spoken("fix one of a, b with model.with_fixed(NAME=VALUE), or excite them") == (
            spoken("fix one of a, b with model.with_fixed, or excite them")
        )
    assert spoken("fix with model.with_fixed(a=...)") == "fix with model.with_fixed(a=...)"


@dataclass(frozen=True, kw_only=True)
class Lists(Options):
    """Options that take several."""

    inputs: tuple[str, ...] = option((), doc="Names.")
    nb: tuple[float, ...] = option((), doc="Numbers.")
    units: Mapping[str, str] = option(default_factory=dict, doc="Words by name.")


def test_lists_are_repeated_or_have_commas(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text('time,u,"x,y"\n0,1,2\n1,3,4\n')

    @click.command(cls=OptionsCommand, fields_of=lambda: {"": Lists})
    @click.argument("file", type=click.Path(path_type=Path))
    def command(file: Path, **options: object) -> None:
        del file
        click.echo(str(sorted(given_options(Lists, options, "").items())))

    for given in ("--input u,v --input x,y --nb 1,2 --units u=V,v=rad/s {}",
                  "{} --inputs u --inputs v --inputs x,y --nb 1 --nb 2 --units u=V --units v=rad/s",
                  ):  # fmt: skip
        result = CliRunner().invoke(command, given.format(path).split())
        assert result.output == (
            "[('inputs', ('u', 'v', 'x,y')), ('nb', (1.0, 2.0)), "
            "('units', {'u': 'V', 'v': 'rad/s'})]\n"
        )

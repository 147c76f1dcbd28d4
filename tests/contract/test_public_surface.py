"""Public names: the same in the lists of `flightid/__init__.py`, each where it is said to be."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from types import ModuleType

import pytest

import flightid
from tests.contract.source import PACKAGE, tree

LOOPS = "flightid.control.loops"


def _names_for_the_type_checker() -> dict[str, str]:
    found: dict[str, str] = {}
    for node in tree(PACKAGE / "__init__.py").body:
        if isinstance(node, ast.If):
            for line in node.body:
                assert isinstance(line, ast.ImportFrom)
                for alias in line.names:
                    found[alias.asname or alias.name] = line.module or ""
    return found


def test_the_three_lists_agree() -> None:
    homes = flightid._HOMES
    expected = {
        name: home.rpartition(".")[0] if home in (f"flightid.{name}", LOOPS) else home
        for name, home in homes.items()
    }
    assert _names_for_the_type_checker() == expected
    assert sorted(flightid.__all__) == sorted([*homes, "__version__"])
    assert list(flightid.__all__) == sorted(flightid.__all__)


def _astray(module: object, names: list[str]) -> list[str]:
    listed = dir(module)
    return [name for name in names if getattr(module, name, None) is None or name not in listed]


def test_every_name_is_where_it_is_said_to_be() -> None:
    assert not _astray(flightid, list(flightid.__all__))
    assert _astray(flightid, ["identify", "nonsense"]) == ["nonsense"]


def _public_rooms() -> list[ModuleType]:
    made = [getattr(flightid, name) for name in flightid.__all__]
    return [each for each in made if isinstance(each, ModuleType)]


def test_public_rooms_list_their_public_names_and_no_files() -> None:
    rooms = _public_rooms()
    assert len(rooms) > 4
    stray = {each.__name__: {*dir(each)} ^ {*each.__all__} for each in (flightid, *rooms)}
    assert not any(stray.values()), stray


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        flightid.nonsense  # noqa: B018
    with pytest.raises(AttributeError, match="nearest: inspect_log"):
        flightid.inspect  # noqa: B018
    with pytest.raises(AttributeError, match=r"nearest: identify, identify_each$"):
        flightid.identfy  # noqa: B018


def test_a_room_that_is_imported_leaves_its_verb() -> None:
    rooms = [name for name, home in flightid._HOMES.items() if home.startswith(f"flightid.{name}.")]
    assert rooms
    for name in rooms:
        setattr(flightid, name, importlib.import_module(f"flightid.{name}"))
        assert callable(getattr(flightid, name)), name


@pytest.mark.nightly
def test_a_room_does_not_hide_a_verb_of_its_name() -> None:
    code = (
        "import importlib, flightid\n"
        "for home in sorted(set(flightid._HOMES.values())):\n"
        "    importlib.import_module(home)\n"
        "    importlib.import_module(home.rpartition('.')[0])\n"
        "for name, home in flightid._HOMES.items():\n"
        "    module = importlib.import_module(home)\n"
        "    meant = module if home == f'flightid.{name}' else getattr(module, name)\n"
        "    assert getattr(flightid, name) is meant, name\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_help_does_not_load_what_it_does_not_need() -> None:
    code = (
        "import sys\n"
        "from flightid.cli import main\n"
        "try:\n"
        "    main(['--help'])\n"
        "except SystemExit as leave:\n"
        "    assert leave.code == 0, leave.code\n"
        "heavy = {'xarray', 'pandas', 'plotly', 'scipy', 'pint', 'pyarrow', 'numpy'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_each_room_is_there_before_anything_else_is_asked_for() -> None:
    """`flightid.loops` was an error until something else had loaded it."""
    rooms = [each.__name__.rpartition(".")[2] for each in _public_rooms()]
    code = (
        "import sys\n"
        "for room in sys.argv[1:]:\n"
        "    ours = [n for n in sys.modules if n.startswith('flightid') and '_native' not in n]\n"
        "    [sys.modules.pop(n) for n in ours]\n"
        "    import flightid\n"
        "    assert getattr(flightid, room).__name__.endswith(room)\n"
    )
    subprocess.run([sys.executable, "-c", code, *rooms], check=True)

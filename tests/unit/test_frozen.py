"""Frozen classes whose methods are made late are those that `dataclasses` makes at once."""

from __future__ import annotations

import dataclasses
import inspect
import pickle
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid.frozen import _dataclass

Decorator = Callable[..., Any]
NUMBERS = st.one_of(st.integers(), st.text(max_size=3), st.floats(), st.tuples(st.integers()))


def _family(dataclass: Decorator) -> dict[str, type]:
    """The same classes by either decorator."""

    @dataclass(frozen=True)
    class Point:
        x: object
        y: object = 2
        seen: list[int] = dataclasses.field(default_factory=list, compare=False, repr=False)
        kind: ClassVar[str] = "point"

    @dataclass(frozen=True)
    class Named(Point):
        name: str = "p"

        def __post_init__(self) -> None:
            if self.name == "":
                raise ValueError("a point has a name")

        @cached_property
        def twice(self) -> object:
            return (self.x, self.x)

    @dataclass(frozen=True, kw_only=True, repr=False)
    class Keyed:  # noqa: PLW1641 — the decorator writes it
        a: int
        b: int = dataclasses.field(default=1, hash=False)

        def __eq__(self, other: object) -> bool:
            return isinstance(other, type(self)) and self.a == other.a

    @dataclass(frozen=True, eq=False)
    class Single:
        x: object = 0

        def __repr__(self) -> str:
            return "single"

    @dataclass
    class Open:
        x: int = 0

    return {each.__name__: each for each in (Point, Named, Keyed, Single, Open)}


LATE, ONCE = _family(_dataclass), _family(dataclasses.dataclass)


def _words(thing: object) -> str:
    return repr(thing).replace(f"{_family.__name__}.<locals>.", "")


def _done(make: Callable[[], object]) -> object:
    """What a call gives, or what it raises."""
    try:
        return make()
    except (TypeError, ValueError, dataclasses.FrozenInstanceError) as error:
        return type(error)


@given(x=NUMBERS, y=NUMBERS, name=st.sampled_from(["", "p", "q"]))
def test_values_are_shown_compared_and_counted_alike(x: object, y: object, name: str) -> None:
    for late, once in ((LATE[each], ONCE[each]) for each in ("Point", "Named")):
        made = [_done(lambda kind=kind: kind(x, y)) for kind in (late, once)]
        assert _words(made[0]) == _words(made[1])
        assert hash(made[0]) == hash(made[1])
        assert [each == dataclasses.replace(each, y=x) for each in made] == [x == y] * 2 or y != y
        assert made[0] != made[1]
        assert dataclasses.asdict(made[0]) == dataclasses.asdict(made[1]) or x != x or y != y
    either = [
        _done(lambda kind=kind: _words(kind["Named"](x, y, name=name))) for kind in (LATE, ONCE)
    ]
    assert either[0] == either[1]


@pytest.mark.parametrize("name", ["Point", "Named", "Keyed", "Single", "Open"])
def test_a_class_tells_and_refuses_the_same(name: str) -> None:
    late, once = LATE[name], ONCE[name]
    for each in (late, once):
        assert dataclasses.is_dataclass(each)
    assert inspect.signature(late) == inspect.signature(once)
    assert late.__match_args__ == once.__match_args__  # type: ignore[attr-defined]
    assert [f.name for f in dataclasses.fields(late)] == [f.name for f in dataclasses.fields(once)]
    calls: tuple[tuple[tuple[object, ...], dict[str, object]], ...] = (
        ((), {}),
        ((1,), {}),
        ((1, 2, [3], "n", 5), {}),
        ((), {"a": 1}),
        ((1,), {"none": 2}),
    )
    for args, keys in calls:
        told = [_done(lambda k=k: _words(k(*args, **keys))) for k in (late, once)]  # noqa: B023
        assert told[0] == told[1] or name == "Keyed"
    for change in (lambda it: setattr(it, "x", 1), lambda it: delattr(it, "x")):
        made = [
            _done(lambda k=k: k(**({"a": 1} if name == "Keyed" else {"x": 0})))
            for k in (late, once)
        ]
        assert _done(lambda: change(made[0])) == _done(lambda: change(made[1]))  # noqa: B023


def test_what_a_class_has_written_stays() -> None:
    assert repr(LATE["Single"]()) == "single"
    assert LATE["Single"]() != LATE["Single"]()
    keyed = LATE["Keyed"]
    assert keyed(a=1, b=2) == keyed(a=1, b=3)
    assert hash(keyed(a=1, b=2)) == hash(keyed(a=1, b=3)) == hash(ONCE["Keyed"](a=1, b=2))
    named = LATE["Named"](3)
    assert named.twice is named.twice


@_dataclass(frozen=True)
class Kept:
    """Known to pickle by its name."""

    x: int
    after: tuple[int, ...] = ()


def test_an_unused_class_is_unpickled_before_any_is_made() -> None:
    raw = pickle.dumps(Kept(3, (4,)))
    assert pickle.loads(raw) == Kept(3, (4,))


@pytest.mark.parametrize("base", [_dataclass, dataclasses.dataclass])
@pytest.mark.parametrize("heir", [_dataclass, dataclasses.dataclass])
def test_either_kind_inherits_from_the_other(base: Decorator, heir: Decorator) -> None:
    @base(frozen=True)
    class First:
        x: int = 1

    @heir(frozen=True)
    class Second(First):
        y: int = 2

    assert Second(3) == Second(3, 2) != Second(3, 3)
    assert _done(lambda: setattr(Second(), "x", 2)) is dataclasses.FrozenInstanceError
    assert _words(First()).endswith("First(x=1)")
    with pytest.raises(TypeError, match="frozen"):
        heir(frozen=False)(type("Third", (First,), {"__annotations__": {"z": "int"}}))
    with pytest.raises(TypeError, match="non-frozen"):
        heir(frozen=True)(type("Third", (LATE["Open"],), {"__annotations__": {}}))


def test_only_what_is_made_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loading compiles no method, which was the most of the time; the first instance does."""
    compiled: list[str] = []

    def counted(text: str, *scopes: dict[str, Any]) -> None:
        compiled.append(text)
        exec(text, *scopes)

    monkeypatch.setattr(dataclasses, "exec", counted, raising=False)

    @dataclasses.dataclass(frozen=True)
    class AtOnce:
        x: int = 0

    assert compiled
    compiled.clear()

    @_dataclass(frozen=True)
    class Late:
        x: int = 0

    assert compiled == []
    assert Late() == Late(0)
    assert sum("__init__" in text for text in compiled) == 1
    compiled.clear()
    assert Late(1) != Late(2)
    assert compiled == []

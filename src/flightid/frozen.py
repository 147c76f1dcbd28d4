"""Dataclasses whose methods are made when they are first used.

`dataclasses.dataclass` compiles five or six methods of every class that a module declares: of the
1.2 s in which the modules of a study were loaded, 0.7 s were that, for 600 classes of which a run
makes a quarter. Here only `__init__` is compiled, and only for a class that is made.
"""

from __future__ import annotations

import dataclasses
import inspect
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass

__all__ = ["dataclass"]
_GATHERING = threading.Lock()


def _dataclass(
    cls: type | None = None,
    /,
    *,
    frozen: bool = False,
    eq: bool = True,
    repr: bool = True,
    kw_only: bool = False,
) -> Any:  # noqa: ANN401
    """Do what `dataclasses.dataclass` does, later where the class is frozen.

    `dataclasses.fields`, `replace`, `asdict` and `is_dataclass` serve as ever, and classes of
    either kind inherit from each other.
    """

    def made(each: type) -> type:
        if not frozen:
            return dataclasses.dataclass(eq=eq, repr=repr, kw_only=kw_only)(each)
        return _frozen(each, eq=eq, shown=repr, kw_only=kw_only)

    return made if cls is None else made(cls)


if not TYPE_CHECKING:
    dataclass = _dataclass


def _frozen(cls: type, *, eq: bool, shown: bool, kw_only: bool) -> type:
    own = dict(vars(cls))
    with _open_bases(cls):
        dataclasses.dataclass(init=False, repr=False, eq=False, kw_only=kw_only)(cls)
    vars(cls)["__dataclass_params__"].frozen = True
    fields = dataclasses.fields(cls)
    methods: dict[str, object] = {"__setattr__": _kept, "__delattr__": _kept}
    if "__init__" not in own:
        methods |= {"__init__": _first_init(cls), "__signature__": _Signature()}
    if shown and "__repr__" not in own:
        methods["__repr__"] = _repr_of([each.name for each in fields if each.repr])
    if eq and "__eq__" not in own:
        methods["__eq__"] = _eq_of([each.name for each in fields if each.compare])
    # Python itself leaves None where a class has written `__eq__` alone.
    if eq and own.get("__hash__") is None:
        counted = [each for each in fields if (each.compare if each.hash is None else each.hash)]
        methods["__hash__"] = _hash_of([each.name for each in counted])
    for name, method in methods.items():
        setattr(cls, name, method)
    return cls


@contextmanager
def _open_bases(cls: type) -> Iterator[None]:
    """Bases that do not seem frozen: fields alone are gathered, which needs no frozen class."""
    bases = [vars(each) for each in cls.__mro__[1:] if "__dataclass_params__" in vars(each)]
    settings = [each["__dataclass_params__"] for each in bases]
    with _GATHERING:
        if not all(each.frozen for each in settings):
            raise TypeError("cannot inherit frozen dataclass from a non-frozen one")
        for each in settings:
            each.frozen = False
        try:
            yield
        finally:
            for each in settings:
                each.frozen = True


def _kept(_self: object, name: str, *_: object) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _repr_of(names: Sequence[str]) -> Callable[[object], str]:
    @recursive_repr()
    def told(self: object) -> str:
        values = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{type(self).__qualname__}({values})"

    return told


def _eq_of(names: Sequence[str]) -> Callable[[object, object], object]:
    values = _reader(names)

    def equal(self: object, other: object) -> object:
        if other.__class__ is not self.__class__:
            return NotImplemented
        return values(self) == values(other)

    return equal


def _hash_of(names: Sequence[str]) -> Callable[[object], int]:
    values = _reader(names)
    return lambda self: hash(values(self))


def _reader(names: Sequence[str]) -> Callable[[object], tuple[object, ...]]:
    """From a thing to the tuple of its fields."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda thing: tuple([getattr(thing, name) for name in names])


def _first_init(cls: type) -> Callable[..., None]:
    """The method that makes way for the true one when the first of its class is made."""

    def first(self: object, *args: object, **kwargs: object) -> None:
        _write_init(cls)
        vars(cls)["__init__"](self, *args, **kwargs)

    return first


def _write_init(cls: type) -> None:
    """Write `__init__` as `dataclasses` does, unless that was done."""
    if vars(cls)["__init__"].__name__ == "__init__":
        return
    told = [(each.name, each.type, _again(each)) for each in dataclasses.fields(cls)]
    after = {"__post_init__": None} if hasattr(cls, "__post_init__") else {}
    like = dataclasses.make_dataclass(
        cls.__name__, told, namespace=after, frozen=True, eq=False, repr=False
    )
    init = vars(like)["__init__"]
    init.__qualname__ = f"{cls.__qualname__}.__init__"
    cls.__init__ = init  # type: ignore[misc]


def _again(field: dataclasses.Field[Any]) -> Any:  # noqa: ANN401
    """A field as a class would declare it."""
    return dataclasses.field(
        default=field.default,
        default_factory=field.default_factory,
        init=field.init,
        kw_only=field.kw_only,
    )


class _Signature:
    """What `inspect.signature` is told of a class: the arguments of its `__init__`."""

    def __get__(self, _: object, owner: type) -> inspect.Signature:
        for each in owner.__mro__:
            if "__init__" in vars(each):
                if isinstance(vars(each).get("__signature__"), _Signature):
                    _write_init(each)
                break
        told = inspect.signature(owner.__init__)  # type: ignore[misc]
        return told.replace(parameters=list(told.parameters.values())[1:])

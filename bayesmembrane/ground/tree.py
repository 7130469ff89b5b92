"""Frozen values as a tree of JSON and a table of arrays, and back, to the last bit.

What the tree cannot say in JSON's own words is an object with the key `TAG`. Only classes of this package and
registered components are ever made from a tree: nothing else is imported, and nothing is executed.
"""

from __future__ import annotations

import importlib
import inspect
import math
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.registry import component, components

TAG = "!"
PACKAGE = __name__.partition(".")[0]
GROUPS = ("materials", "effects", "noise", "rigs")
"""Components that a result may hold, as a class or as an instance."""

_SPECIAL = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
_SCALARS = "biufU"


class Encoder:
    """Turns values into trees; ``arrays`` fills up on the way.

    An object that is met twice is written once, so that what was one object is one again when it is read.
    """

    def __init__(self, folder: Path) -> None:
        """``folder`` is where the tree will lie: paths beside it are written relative to it."""
        self.folder = folder
        self.arrays: dict[str, NDArray[Any]] = {}
        self._numbers: dict[int, int | str | None] = {}
        self._kept: list[object] = []  # an id is only good as long as its object lives

    def __call__(self, value: Any) -> Any:
        """The tree of ``value``; raises `TypeError` naming what cannot be stored: results must be values."""
        if value is None or type(value) in (bool, int, str):
            return value
        if type(value) is float:
            return value if math.isfinite(value) else {TAG: "float", "is": repr(value)}
        for kind, how in self._ways:
            if isinstance(value, kind):
                return how(value)
        return self._object(value)

    @cached_property
    def _ways(self) -> tuple[tuple[Any, Callable[[Any], Any]], ...]:
        return (
            (Enum, lambda v: {TAG: "enum", "class": _path(type(v)), "is": self(v.value)}),
            (np.ndarray, self._array),
            (np.generic, self._scalar),
            (list, lambda v: [self(e) for e in _exactly(list, v)]),
            (tuple, self._tuple),
            (frozenset | set, lambda v: {TAG: type(v).__name__, "is": [self(e) for e in sorted(v, key=repr)]}),
            (Mapping, self._mapping),
            (Path, self._place),
            (type, _class),
        )

    def _tuple(self, value: tuple[Any, ...]) -> Any:
        if hasattr(value, "_fields"):
            return {TAG: "named tuple", "class": _path(type(value)), "is": [self(e) for e in value]}
        return {TAG: "tuple", "is": [self(e) for e in _exactly(tuple, value)]}

    def _mapping(self, value: Mapping[Any, Any]) -> Any:
        _exactly(dict, value)
        if all(type(k) is str and k != TAG for k in value):
            return {k: self(v) for k, v in value.items()}
        return {TAG: "dict", "is": [[self(k), self(v)] for k, v in value.items()]}

    def _array(self, value: NDArray[Any]) -> Any:
        _exactly(np.ndarray, value)
        if value.dtype.hasobject:
            raise TypeError("an array of objects cannot be stored")
        if (known := self._numbers.get(id(value))) is None:
            known = f"a{len(self.arrays)}"
            self.arrays[known] = value
            self._remember(value, known)
        return {TAG: "array", "is": known} | ({} if value.flags.writeable else {"frozen": True})

    @staticmethod
    def _scalar(value: np.generic) -> Any:
        if value.dtype.kind not in _SCALARS or isinstance(value, np.longdouble):
            raise TypeError(f"a NumPy scalar of type {value.dtype} cannot be stored")
        item = value.item()
        text = repr(item) if isinstance(item, float) and not math.isfinite(item) else item
        return {TAG: "scalar", "type": "U" if value.dtype.kind == "U" else value.dtype.str, "is": text}

    def _place(self, value: Path) -> Any:
        here, there = self.folder.absolute().parent, value.absolute()
        if there == here or here in there.parents:
            return {TAG: "path", "beside": os.path.relpath(there, here)}
        return {TAG: "path", "is": str(value)}

    def _object(self, value: Any) -> Any:
        if (number := self._numbers.get(id(value), "new")) != "new":
            if number is None:
                raise TypeError(f"a {type(value).__name__} that holds itself cannot be stored")
            return {TAG: "same", "as": number}
        self._numbers[id(value)] = None
        tree = {TAG: "object", **_named(type(value)), **self._content(value)}
        number = len(self._kept)
        self._remember(value, number)
        return {**tree, "number": number}

    def _content(self, value: Any) -> dict[str, Any]:
        if hasattr(value, "to_stored"):
            return {"stored": self(value.to_stored())}
        if not is_dataclass(value):
            raise TypeError(f"a {type(value).__module__}.{type(value).__qualname__} is no value and cannot be stored")
        return {"fields": {f.name: self(getattr(value, f.name)) for f in fields(value)}}

    def _remember(self, value: object, number: int | str) -> None:
        self._numbers[id(value)] = number
        self._kept.append(value)


class Decoder:
    """Turns the trees of an `Encoder` back into values.

    Raises whatever a damaged tree leads to (`KeyError`, `TypeError`, `ValueError`, `AttributeError`, `ImportError`, or
    an error of the classes themselves): the caller makes a sentence of it.
    """

    def __init__(self, folder: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
        self.folder, self.arrays = folder, arrays
        self._made: dict[int, Any] = {}
        self._used: dict[str, NDArray[Any]] = {}

    def __call__(self, tree: Any) -> Any:
        """The value of ``tree``."""
        if isinstance(tree, list):
            return [self(e) for e in tree]
        if not isinstance(tree, dict):
            return tree
        if TAG not in tree:
            return {k: self(v) for k, v in tree.items()}
        return self._ways[tree[TAG]](tree)

    @cached_property
    def _ways(self) -> dict[str, Callable[[dict[str, Any]], Any]]:
        return {
            "float": lambda t: _SPECIAL[t["is"]],
            "enum": lambda t: _found(t["class"], Enum)(self(t["is"])),
            "array": self._array,
            "scalar": self._scalar,
            "tuple": lambda t: tuple(self(e) for e in t["is"]),
            "named tuple": lambda t: _found(t["class"], tuple)(*(self(e) for e in t["is"])),
            "set": lambda t: {self(e) for e in t["is"]},
            "frozenset": lambda t: frozenset(self(e) for e in t["is"]),
            "dict": lambda t: {self(k): self(v) for k, v in t["is"]},
            "path": self._place,
            "class": _registered,
            "same": lambda t: self._made[t["as"]],
            "object": self._object,
        }

    def _array(self, tree: dict[str, Any]) -> NDArray[Any]:
        name = tree["is"]
        if name not in self._used:
            self._used[name] = self.arrays[name]
            self._used[name].flags.writeable = not tree.get("frozen", False)
        return self._used[name]

    @staticmethod
    def _scalar(tree: dict[str, Any]) -> Any:
        kind = np.dtype(tree["type"])
        if kind.kind not in _SCALARS:
            raise ValueError(f"{kind} is no type of a number")
        return kind.type(tree["is"])

    def _place(self, tree: dict[str, Any]) -> Path:
        if "is" in tree:
            return Path(tree["is"])
        return Path(os.path.normpath(self.folder.parent / tree["beside"]))

    def _object(self, tree: dict[str, Any]) -> Any:
        kind = _registered(tree) if "group" in tree else _found(tree["class"], object)
        value = self._made[tree["number"]] = self._filled(kind, tree)
        return value

    def _filled(self, kind: type[Any], tree: dict[str, Any]) -> Any:
        if hasattr(kind, "from_stored"):
            return kind.from_stored(self(tree["stored"]))
        if not is_dataclass(kind):
            raise TypeError(f"{kind.__qualname__} is no class of values")
        wanted, given = [f.name for f in fields(kind)], list(tree["fields"])
        if sorted(wanted) != sorted(given):
            raise ValueError(f"{kind.__name__} has the fields {', '.join(wanted)}, not {', '.join(given)}")
        # As it was, and not as __init__ would make it: a frozen value was checked when it was made.
        value = object.__new__(kind)
        for name in given:
            object.__setattr__(value, name, self(tree["fields"][name]))
        # What hangs on classes that are not stored with it may be another one now.
        if hasattr(value, "check_restored"):
            value.check_restored()
        return value


def _exactly(kind: type, value: Any) -> Any:
    """``value``; raises `TypeError` for a subclass, which would not come back as what it was."""
    if type(value) is not kind:
        raise TypeError(f"a {type(value).__qualname__} cannot be stored; make it a {kind.__name__}")
    return value


def _class(value: type[Any]) -> dict[str, str]:
    named = _named(value)
    if "group" not in named:
        raise TypeError(f"the class {value.__qualname__} is no registered component and cannot be stored")
    return {TAG: "class", **named}


def _named(kind: type[Any]) -> dict[str, str]:
    """How a tree names a class: a component by group and name, one of this package by its place."""
    name = getattr(kind, "name", None)
    if isinstance(name, str):
        for group in GROUPS:
            if components(group).get(name) is kind:
                return {"group": group, "name": name}
    return {"class": _path(kind)}


def _path(kind: type[Any]) -> str:
    if kind.__module__.partition(".")[0] != PACKAGE:
        raise TypeError(f"a {kind.__module__}.{kind.__qualname__} cannot be stored: it is not of {PACKAGE}")
    if getattr(sys.modules[kind.__module__], kind.__qualname__, None) is not kind:
        raise TypeError(f"a {kind.__qualname__} cannot be stored: its module does not have it under this name")
    return f"{kind.__module__}:{kind.__qualname__}"


def _registered(tree: Mapping[str, str]) -> type[Any]:
    if tree["group"] not in GROUPS:
        raise ValueError(f"no component of {tree['group']} is stored")
    return component(tree["group"], tree["name"])


def _found(path: str, base: type[Any]) -> type[Any]:
    """The class at ``path``; raises `ValueError` unless it is one that this package itself defines."""
    module, _, name = path.partition(":")
    if module.partition(".")[0] != PACKAGE or not all(part.isidentifier() for part in module.split(".")):
        raise ValueError(f"{path} is not of {PACKAGE}")
    found = getattr(importlib.import_module(module), name)
    if not (inspect.isclass(found) and found.__module__ == module and issubclass(found, base)):
        raise ValueError(f"{path} is no class of {PACKAGE}")
    return found

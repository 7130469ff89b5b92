"""From the force curve of a clamped silicone film to a calibrated, compared and diagnosed hyperelastic model.

    import bayesmembrane as bm

    curve = bm.read("curve.csv", "curve.toml")
    found = bm.fit(curve, bm.hypothesis("yeoh"))

What stands in `__all__` is imported when it is first asked for: this import costs nothing, the first call seconds.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inspect import Signature

    from bayesmembrane.app.door import (
        as_dict,
        compare,
        diagnose,
        fit,
        hypothesis,
        joint,
        load,
        loop,
        population,
        predict,
        read,
        read_measurement,
        reconstruct,
        report,
        sample,
        valleys,
    )
    from bayesmembrane.ground.errors import BayesmembraneError, DataError, SettingsError, StorageError

__all__ = [
    "BayesmembraneError",
    "DataError",
    "SettingsError",
    "StorageError",
    "as_dict",
    "compare",
    "diagnose",
    "fit",
    "hypothesis",
    "joint",
    "load",
    "loop",
    "population",
    "predict",
    "read",
    "read_measurement",
    "reconstruct",
    "report",
    "sample",
    "valleys",
]

_ERRORS = {name for name in __all__ if name.endswith("Error")}
_ROOMS = {
    "report",
    "valleys",
}  # also packages, which are made callable: bm.valleys(...) and bayesmembrane.valleys.follow


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in _ROOMS:
        return importlib.import_module(f"{__name__}.{name}")
    found = _behind(name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*__all__, *(name for name in globals() if name.startswith("__"))])


def _behind(name: str) -> Any:
    home = "ground.errors" if name in _ERRORS else "app.door"
    return getattr(importlib.import_module(f"{__name__}.{home}"), name)


class _Door(ModuleType):
    """This module: a package of the same name as a verb is callable as soon as it is imported, by whomever."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _ROOMS and type(value) is ModuleType:
            value.__class__ = _Room
        super().__setattr__(name, value)


class _Room(ModuleType):
    """A package that is also the verb of its name."""

    def __call__(self, *given: Any, **named: Any) -> Any:
        """The verb; see its own documentation in `bayesmembrane.app.door`."""
        return self._verb(*given, **named)

    @property
    def __signature__(self) -> Signature:
        from inspect import signature

        return signature(self._verb)

    @property
    def _verb(self) -> Any:
        return _behind(self.__name__.rpartition(".")[2])


sys.modules[__name__].__class__ = _Door

"""Finds the components: one class a file in this package, plus entry points of other packages.

A component of a group ("materials", "effects", "noise", "rigs", "importers", "sections") is a class that derives from
an abstract class of the ``base.py`` of the group's folder, leaves nothing abstract, and has a ``name``. Writing its
file is enough; another package declares it under the entry point group ``bayesmembrane.<group>``.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import warnings
from collections.abc import Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType
from typing import TYPE_CHECKING, Any

from bayesmembrane.ground.errors import unknown_name

if TYPE_CHECKING:
    from bayesmembrane.physics.materials.base import Material

_PACKAGE = __name__.partition(".")[0]
_ROOMS = {"importers": "data", "sections": "report"}  # all others live in physics
_SINGULAR = {
    "materials": "material",
    "effects": "effect",
    "noise": "noise model",
    "rigs": "rig",
    "importers": "importer",
    "sections": "section of the report",
}


def materials() -> dict[str, type[Material]]:
    """Every strain energy by name, sorted by name."""
    return components("materials")


def ordinary_materials() -> dict[str, type[Material]]:
    """The strain energies that "all energies" means where none is named, sorted by name: those declared `ordinary`."""
    return {name: kind for name, kind in materials().items() if kind.ordinary}


def material(name: str) -> type[Material]:
    """The strain energy called ``name``; raises `SettingsError` with the nearest known names."""
    return component("materials", name)


def components(group: str) -> dict[str, type[Any]]:
    """Every component of a group by name, sorted by name; raises `SettingsError` for an unknown group.

    A component of another package that cannot be loaded, does not fit, or takes a name that is in use is left out
    with a warning; the first call of a group searches, later ones remember.
    """
    if group not in _SINGULAR:
        raise unknown_name("group of components", group, _SINGULAR)
    return dict(_discover(group))


def component(group: str, name: str) -> type[Any]:
    """The component of ``group`` called ``name``; raises `SettingsError` with the nearest known names."""
    known = components(group)
    if name not in known:
        raise unknown_name(_SINGULAR[group], name, known)
    return known[name]


@cache
def _discover(group: str) -> dict[str, type[Any]]:
    found = {c.name: c for c in _of_this_package(group)}
    for point in sorted(entry_points(group=f"{_PACKAGE}.{group}"), key=lambda e: (e.name, e.value)):
        fault, candidate = _load(point, group)
        if candidate is not None and found.setdefault(candidate.name, candidate) is not candidate:
            fault = f'its name "{candidate.name}" is taken by {found[candidate.name].__module__}'
        if fault:
            warnings.warn(
                f'the {_SINGULAR[group]} "{point.name}" ({point.value}) of another package is left out: {fault}; '
                "update or uninstall that package.",
                RuntimeWarning,
                stacklevel=3,
            )
    return dict(sorted(found.items()))


def _folder(group: str) -> str:
    return f"{_PACKAGE}.{_ROOMS.get(group, 'physics')}.{group}"


def _of_this_package(group: str) -> Iterator[type[Any]]:
    package = importlib.import_module(_folder(group))
    names = [m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_")]
    bases = _bases(group) if "base" in names else ()
    for name in sorted(set(names) - {"base"}):
        module = importlib.import_module(f"{package.__name__}.{name}")
        yield from (c for c in _classes(module) if _is_component(c, bases))


def _bases(group: str) -> tuple[type[Any], ...]:
    """The abstract classes of the group's base module: a group may have one per stage."""
    return tuple(c for c in _classes(importlib.import_module(f"{_folder(group)}.base")) if inspect.isabstract(c))


def _classes(module: ModuleType) -> list[type[Any]]:
    """The classes that a module defines, without those it imports."""
    return [c for c in vars(module).values() if inspect.isclass(c) and c.__module__ == module.__name__]


def _is_component(candidate: object, bases: tuple[type[Any], ...]) -> bool:
    if not (inspect.isclass(candidate) and issubclass(candidate, bases)) or inspect.isabstract(candidate):
        return False
    return isinstance(getattr(candidate, "name", None), str)


def _load(point: EntryPoint, group: str) -> tuple[str, type[Any] | None]:
    """(fault, class): one of them is empty. Whatever a foreign module raises must not stop this program."""
    try:
        candidate = point.load()
        if not _is_component(candidate, _bases(group)):
            return f"it is not a complete {_SINGULAR[group]} with a name", None
    except Exception as error:
        return f"loading it raised {type(error).__name__} ({error})", None
    return "", candidate

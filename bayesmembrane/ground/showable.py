"""What a result looks like at a prompt and in a notebook: as the report's section that shows its type says.

No lower floor imports the report for that: the section is found by the registry, when somebody looks.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, Protocol

import numpy as np

from bayesmembrane.ground.registry import components


class Shower(Protocol):
    """What `Showable` asks of a component of the group "sections"."""

    shows: type[Any] | None
    takes: tuple[type[Any], ...]

    def text(self, result: Any) -> str:
        """A result as plain text: a title and a few sentences."""

    def html(self, result: Any) -> str:
        """A result as a piece of HTML with its picture, for a notebook."""


class Showable:
    """Mixin of results: ``repr`` in words, and ``_repr_html_`` with the picture.

    A dataclass that takes it says ``@dataclass(frozen=True, repr=False)``, for else it gets the usual ``repr``. Where
    no section shows the type, a line with the class and its plain fields stands for it, and there is no HTML.
    """

    def __repr__(self) -> str:
        shower = shower_of(type(self))
        return outline(self) if shower is None else shower.text(self)

    def _repr_html_(self) -> str | None:
        shower = shower_of(type(self))
        return None if shower is None else shower.html(self)


def shower_of(kind: type[Any]) -> Shower | None:
    """The section that shows results of this type, or else one that takes them; None if there is none."""
    every = list(components("sections").values())
    known = {taken: section for section in every for taken in section.takes}
    known |= {section.shows: section for section in every}
    nearest = next((base for base in kind.__mro__ if base in known), None)
    return None if nearest is None else known[nearest]()


def outline(value: Any) -> str:
    """``Fit(loss='euclidean', force=array(10,), ...)``: the fields of a dataclass, arrays by shape, others by class."""
    told = [f"{f.name}={_short(getattr(value, f.name))}" for f in fields(value)] if is_dataclass(value) else []
    return f"{type(value).__name__}({', '.join(told)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"array{value.shape}"
    if isinstance(value, list | tuple | dict | set | frozenset):
        return f"{type(value).__name__} of {len(value)}"
    if value is None or isinstance(value, str | bool | int | float | np.generic):
        return repr(value)
    return value.__name__ if isinstance(value, type) else f"{type(value).__name__}(...)"

"""What a section of a report declares: the result that it shows, where it is stored, and what it makes of it.

One file, or one folder, is one section; the registry finds it, and another package adds its own under the entry points
``bayesmembrane.sections``. Everything that only this section needs, its tables and its pictures, stands there too.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from bayesmembrane.report.blocks import Block, Lead, Part
from bayesmembrane.report.render import fragment

Kind = TypeVar("Kind")


@dataclass(frozen=True)
class Glance:
    """A row of the general table, which comes first: what was computed, of which model and data, and what it found."""

    what: str
    about: str
    found: str


@dataclass(frozen=True)
class Subject:
    """What a page is about: the names of the films, a sentence below the title, and what kind of curve they gave."""

    films: tuple[str, ...]
    sentence: str
    curve: str = "force curve"


class Section(ABC):
    """A section of the page. ``results`` are all that the page has, of whatever type; a section takes what it knows.

    name : anchor on the page
    title : its heading
    order : places it among the sections, the smallest first
    shows : the type of result whose own section this is; None if it brings several together
    takes : further types that it knows
    aside : True if what it answers stands at the top only where no other section answers
    """

    name: ClassVar[str]
    title: ClassVar[str]
    order: ClassVar[float]
    shows: ClassVar[type[Any] | None] = None
    takes: ClassVar[tuple[type[Any], ...]] = ()
    aside: ClassVar[bool] = False

    def reads(self, folder: Path) -> Any | None:
        """The result stored in ``folder``, None if there is none; raises `StorageError` if it is damaged."""
        return None

    @abstractmethod
    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        """What is shown of all ``results`` that this section knows; nothing if there are none."""

    def parts(self, results: Sequence[Any]) -> Sequence[Part]:
        """The section with its title; several where each result has a heading of its own."""
        made = tuple(self.blocks(results))
        return (Part(self.name, self.title, made),) if made else ()

    def pieces(self, results: Sequence[Any]) -> Sequence[Callable[[], Part]]:
        """`parts` one by one, as calls that other processes can make; nothing where they are made together."""
        return ()

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        """Sentences for the top of the page: what to read if one reads nothing else."""
        return ()

    def lead(self, results: Sequence[Any]) -> Lead | None:
        """The first screen, if the page has one result that it is about; it stands for the section's `answer`."""
        return None

    def warnings(self, results: Sequence[Any]) -> Sequence[str]:
        """Sentences that must be seen before anything else; none if all is well."""
        return ()

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        """Rows of the general table."""
        return ()

    def subject(self, results: Sequence[Any]) -> Subject | None:
        """What the page is about, if this section can tell; the first that names films speaks for all."""
        return None

    # ---- one result alone: at a prompt, and in a notebook ------------------------------------------------------------

    def text(self, result: Any) -> str:
        """One result as plain text: the title, and what it answers."""
        return "\n".join([self.title, *self.answer([result])])

    def html(self, result: Any) -> str:
        """One result as a piece of HTML."""
        return fragment(self.blocks([result]))


def of_kind(results: Sequence[Any], kind: type[Kind]) -> list[Kind]:
    """Those of ``results`` that are of this type, in their order."""
    return [r for r in results if isinstance(r, kind)]

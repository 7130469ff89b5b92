"""What a page is made of: sections of texts, lists, tables and figures."""

from __future__ import annotations

from dataclasses import dataclass, field

from bayesmembrane.report.canvas import Picture
from bayesmembrane.report.tables import Table


@dataclass(frozen=True)
class Block:
    """One piece of a section; ``kind`` says which of the others is set."""

    kind: str
    text: str = ""
    lines: tuple[str, ...] = ()
    picture: Picture | None = None
    alt: str = ""
    caption: str = ""
    table: Table | None = None


@dataclass(frozen=True)
class Section:
    """A heading with its pieces; ``key`` is the anchor."""

    key: str
    title: str
    blocks: tuple[Block, ...] = field(default_factory=tuple)

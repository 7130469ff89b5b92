"""What a page is made of: parts with texts, points, headings, figures and tables. Values only; nothing here draws."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bayesmembrane.words.language import percent, three_digits, without_exponent

if TYPE_CHECKING:
    from bayesmembrane.words.brief import Brief

PLAIN = "three digits"
"""Form of a column: three digits without an exponent."""

Value = str | float | int | bool | None


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Points:
    """A list of sentences."""

    lines: tuple[str, ...]


@dataclass(frozen=True)
class Heading:
    """A title within a part."""

    text: str


@dataclass(frozen=True)
class Picture:
    """An encoded picture; ``kind`` is "svg" or "png"."""

    data: bytes
    kind: str

    @property
    def uri(self) -> str:
        """The picture as a data address for an HTML page."""
        mime = {"svg": "image/svg+xml", "png": "image/png"}[self.kind]
        return f"data:{mime};base64,{base64.b64encode(self.data).decode('ascii')}"


@dataclass(frozen=True)
class Figure:
    """A picture with what it shows for those who cannot see it (``alt``), and a caption with units."""

    picture: Picture
    alt: str
    caption: str


@dataclass(frozen=True)
class Column:
    """``key`` for programs, ``head`` for people (with the unit), and how numbers are printed."""

    key: str
    head: str
    form: str = ".4g"

    def text(self, value: Value) -> str:
        """A cell; a dash where there is nothing."""
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            return "-"
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, str):
            return value
        if self.form == "%":
            return percent(float(value))
        if self.form == PLAIN:
            return three_digits(float(value))
        if self.form == "p" and value < 1e-4:
            return "< 0.0001"
        return without_exponent(f"{value:{'.2g' if self.form == 'p' else self.form}}")


@dataclass(frozen=True)
class Table:
    """Rows of raw values under ``columns``; ``caption`` says what they are, with units."""

    name: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Value, ...], ...]

    def cells(self) -> list[list[str]]:
        """The rows as people read them."""
        return [[c.text(v) for c, v in zip(self.columns, row, strict=True)] for row in self.rows]

    def numeric(self) -> list[bool]:
        """Which columns hold numbers."""
        return [all(not isinstance(row[i], str) for row in self.rows) for i in range(len(self.columns))]

    def records(self) -> list[dict[str, Value]]:
        """The rows as programs read them: nan and infinity as None."""
        return [{c.key: _finite(v) for c, v in zip(self.columns, row, strict=True)} for row in self.rows]

    def without_empty(self) -> Table:
        """Without columns that hold nothing at all."""
        keep = [i for i in range(len(self.columns)) if any(row[i] is not None for row in self.rows)]
        rows = tuple(tuple(row[i] for i in keep) for row in self.rows)
        return Table(self.name, self.caption, tuple(self.columns[i] for i in keep), rows)


def _finite(value: Value) -> Value:
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class Lead:
    """The first screen of a page: what was tested, the answer with what it leaves, errors, what to do; one picture."""

    brief: Brief
    table: Table
    figure: Figure

    @property
    def lines(self) -> list[str]:
        """Its sentences."""
        return self.brief.lines

    @property
    def words(self) -> int:
        """How many words one reads, those of the table and below the picture among them."""
        cells = [self.table.caption, *(c.head for c in self.table.columns), *(c for r in self.table.cells() for c in r)]
        return len(" ".join([*self.lines, *cells, self.figure.caption]).split())


Block = Text | Points | Heading | Figure | Table | Lead


@dataclass(frozen=True)
class Part:
    """A titled piece of a page; ``key`` is its anchor."""

    key: str
    title: str
    blocks: tuple[Block, ...]


# ---- names and values ------------------------------------------------------------------------------------------------


def facts_table(name: str, caption: str, facts: Mapping[str, Any]) -> Table:
    """Names and values, nested mappings flattened."""
    rows = tuple((k, fact(v)) for k, v in _flat(facts).items())
    return Table(name, caption, (Column("name", "name"), Column("value", "value")), rows)


def fact(value: Any) -> str:
    """A setting as people read it."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "-"}[value]
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(fact(v) for v in value) or "-"
    return str(value)


def _flat(facts: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in facts.items():
        own = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, Mapping):
            out |= _flat(value, f"{own}: ")
        else:
            out[own] = value
    return out


def points(lines: Sequence[str]) -> list[Block]:
    """A list of sentences, or nothing where there are none."""
    return [Points(tuple(lines))] if lines else []

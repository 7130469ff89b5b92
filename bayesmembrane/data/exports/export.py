"""An export while it is being read: its columns, and all that is said of it on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from bayesmembrane.data.exports.blocks import Fact, NumberBlock
from bayesmembrane.data.exports.columns import PossibleColumn, Read, best, example, guess_of, read
from bayesmembrane.data.exports.hints import Guess, Hints
from bayesmembrane.ground.errors import DataError


@dataclass(eq=False)
class Export:
    """An export while it is being read: what was found, and all that is said about it on the way."""

    file: str
    hints: Hints
    block: NumberBlock
    found: list[PossibleColumn]
    rows: Sequence[int] = ()
    guesses: list[Guess] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)
    used: set[int] = field(default_factory=set)
    lengths: list[Fact] = field(default_factory=list)
    length: float | None = None

    def column(self, role: str, kind: str | None = None) -> Read | None:
        """The values of a role in SI, None if the export has none."""
        chosen = best(self.found, role, self.block, kind)
        if chosen is None:
            return None
        if chosen.column.at not in self.used:
            self.used.add(chosen.column.at)
            self.guesses += guess_of(role, chosen, self.hints)
        return read(self.block, chosen, self.rows, self.hints)

    def need(self, role: str) -> Read:
        """The same; raises `DataError` if there is none."""
        found = self.column(role)
        if found is None:
            shown = ", ".join(c.header for c in self.block.columns if c.header)
            raise DataError(
                f"there is no column of {role} among {shown}",
                self.block.place,
                f"name it, {example(len(self.block.columns))}",
            )
        return found

    @property
    def lines(self) -> list[int]:
        """(N,) line numbers of the rows."""
        return [self.block.sheet.lines[r] for r in self.rows]

    def contradict(self, sentence: str) -> None:
        """Keep a sentence about a contradiction, unless it is ""."""
        if sentence:
            self.contradictions.append(sentence)

    def guess(self, what: str, value: str, why: str, option: str = "") -> None:
        """Keep a guess."""
        self.guesses.append(Guess(what, value, why, option))

"""Valleys of the loss: films that fit nearly as well as the best one, over one range or several."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from bayesmembrane.ground.files import write_text, write_whole
from bayesmembrane.ground.plain import json_text
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Figure, Heading, Picture, Points
from bayesmembrane.report.sections.base import Glance, Section, Subject
from bayesmembrane.report.sections.valleys.beside import beside_picture
from bayesmembrane.report.sections.valleys.figures import valley_picture
from bayesmembrane.report.sections.valleys.tables import next_table, valley_table
from bayesmembrane.valleys.beside import Beside
from bayesmembrane.valleys.result import Valleys
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import listed
from bayesmembrane.words.seen import in_one_unit, seen_by_valley
from bayesmembrane.words.valleys import document, loss_of, sentences, up_to


class ValleysSection(Section):
    """A table of all valleys, then of each hypothesis the picture, the sentences, and what to measure next."""

    name = "valleys"
    title = "Valleys of the loss"
    order = 70
    shows = Valleys
    takes = (Beside,)
    aside = True

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "valleys")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        found = _valleys(results)
        each = [b for r in results if isinstance(r, Valleys | Beside) for b in _blocks(r)]
        return [*map(valley_table, in_one_unit(found, lambda f: seen_by_valley(f.ranges[0]))), *each]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [s for r in results if isinstance(r, Valleys | Beside) for s in sentences(r)[:1]]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [
            Glance(
                "valley",
                f"{spoken(v.hypothesis)}, {up_to(v)}",
                f"least loss {loss_of(v, v.best_loss, 3)}, {'open' if v.open_end else 'closed'}",
            )
            for found in _valleys(results)
            for v in found.ranges
        ]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        names = listed(dict.fromkeys(spoken(f.hypothesis) for f in _valleys(results)))
        return Subject((), f"Films that fit nearly as well as the best one: {names}.") if names else None


def _valleys(results: Sequence[Any]) -> list[Valleys]:
    """Of valleys with effects beside those without, both."""
    pairs = [
        (r.without, r.added) if isinstance(r, Beside) else (r,) for r in results if isinstance(r, Valleys | Beside)
    ]
    return [v for pair in pairs for v in pair]


def _blocks(found: Valleys | Beside) -> list[Block]:
    added = found.added if isinstance(found, Beside) else found
    out: list[Block] = [Heading(spoken(added.hypothesis))]
    if isinstance(found, Beside):
        caption = (
            "Valleys without and with the effects over the membrane parameters: floors, least losses (stars) and "
            "posterior draws (dots)."
        )
        alt = f"Valleys of {spoken(found.without.hypothesis)} alone and of {spoken(added.hypothesis)}, side by side"
        out.append(Figure(beside_picture(found), alt, caption))
    how = seen_by_valley(added.ranges[0])
    ends = ", ".join(how.place(v.end) for v in added.ranges)
    figure = Figure(
        valley_picture(added),
        alt=f"Valleys of the loss of {spoken(added.hypothesis)} over its parameters, fitted up to {ends}",
        caption="Films that fit nearly as well as the best one, over the membrane parameters; the loss is the "
        f"Euclidean norm of the residual ({how.load_scale[1]}), without convexity prior.",
    )
    return [*out, figure, Points(sentences(found)), *(next_table(v) for v in added.ranges if v.next_tests)]


def write_valleys(found: Valleys | Beside, out: Path, name: str = "valleys") -> tuple[Path, ...]:
    """Write ``valleys.json`` and ``valleys.png`` into ``out``, with effects also ``valleys_beside.png``.

    Of several answers in one folder each has a ``name`` of its own. Raises `StorageError` if that cannot be done.
    """
    added = found.added if isinstance(found, Beside) else found
    pictures: dict[str, Picture] = {f"{name}_beside.png": beside_picture(found)} if isinstance(found, Beside) else {}
    pictures[f"{name}.png"] = valley_picture(added)
    written = [write_text(out / f"{name}.json", json_text(document(found)), "the valleys")]
    for file, picture in pictures.items():
        written.append(write_whole(out / file, partial(_fill, picture), "the valleys"))
    return tuple(written)


def _fill(picture: Picture, path: Path) -> None:
    path.write_bytes(picture.data)

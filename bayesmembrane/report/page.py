"""The report: one HTML page that needs nothing else, and its tables as JSON. Reads results and solves nothing.

What stands on the page is up to the sections (`report.sections`); here they are found, asked, and written.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bayesmembrane.calibration.run import Run
from bayesmembrane.ground.errors import BayesmembraneError, SettingsError, StorageError
from bayesmembrane.ground.files import check_folder, write_text
from bayesmembrane.ground.jobs import Submit, Tell
from bayesmembrane.ground.plain import json_text
from bayesmembrane.ground.registry import components
from bayesmembrane.report.blocks import Block, Column, Lead, Part, Table, Text
from bayesmembrane.report.render import whole_page
from bayesmembrane.report.runs import Shown, read
from bayesmembrane.report.sections.base import Section, Subject
from bayesmembrane.words.language import listed

GENERATOR = "bayesmembrane report"
PAGE, TWIN = "index.html", "report.json"
FOOTER = "Bands hold what data and priors leave open if the material is right."


def warned(sentence: str) -> None:
    """The sentence as a warning of Python's."""
    warnings.warn(sentence, stacklevel=3)


def write_report(
    found: Sequence[Any],
    out: Path,
    title: str | None = None,
    tell: Callable[[str], None] = warned,
    submit: Submit | None = None,
) -> Path:
    """Write ``out/index.html`` and ``out/report.json`` about all that was ``found``, and return the page's path.

    Parameters
    ----------
    found : results of any kind that a section shows (runs, fits, comparisons, valleys, diagnoses, loops, ...), and
        folders: of a folder all that is stored in it and in those right under it
    out : folder; made if it is missing
    title : of the page; made of the specimens' names unless given
    tell : is told in a sentence of each stored answer that cannot be read; the page says so, too, and shows the others
    submit : has other processes draw what can be drawn side by side

    A report of an earlier time is replaced, any other file is not: `StorageError`. The same error names a folder that
    holds nothing to show, and says why if nothing of what is stored can be read; `SettingsError` says that there is
    nothing, or no section for it.
    """
    for name in (PAGE, TWIN):
        _refuse_foreign(out / name)
    gathering = gathered(found)
    for sentence in gathering.left_out:
        tell(sentence)
    content = compose(gathering.results, title, submit)
    twin = {
        "generator": GENERATOR,
        "title": content.title,
        "answer": content.answer,
        "warnings": content.warnings,
        "left_out": gathering.left_out,
        "tables": {t.name: t.records() for t in content.tables},
    }
    write_text(out / TWIN, json_text(twin, indent=1), "the report")
    around = {"generator": GENERATOR, "footer": FOOTER, "left_out": gathering.left_out}
    return write_text(out / PAGE, whole_page(**around, **vars(content)), "the report")


@dataclass(frozen=True)
class Content:
    """What a page says: its title, the sentences at its top, its parts; a ``lead`` is drawn in place of the answer."""

    title: str
    subtitle: str
    answer: list[str]
    warnings: list[str]
    parts: list[Part]
    lead: Lead | None = None

    @property
    def tables(self) -> list[Table]:
        """Every table, that of the first screen first."""
        blocks = [*([] if self.lead is None else [self.lead]), *(b for p in self.parts for b in p.blocks)]
        return [b.table if isinstance(b, Lead) else b for b in blocks if isinstance(b, Lead | Table)]


def sections() -> list[Section]:
    """Every section, in the order of the page."""
    return sorted((kind() for kind in components("sections").values()), key=lambda s: (s.order, s.name))


def compose(results: Sequence[Any], title: str | None = None, submit: Submit | None = None) -> Content:
    """What the sections make of ``results``, which are no folders."""
    every = sections()
    leading = next(((section, lead) for section in every if (lead := section.lead(results)) is not None), None)
    told = [s for section in every if not section.aside for s in section.answer(results)]
    subject = _subject([s for s in (section.subject(results) for section in every) if s is not None])
    verb = "say" if subject.curve.endswith("curves") else "says"
    about = f"What the {subject.curve}{' of ' if subject.films else ''}{listed(subject.films)} {verb}"
    parts = _parts(every, results, submit)
    plain = Content(
        title=title or about,
        subtitle=subject.sentence,
        answer=told or [s for section in every for s in section.answer(results)],
        warnings=[s for section in every for s in section.warnings(results)],
        parts=_named_once([*_general_table(every, results), *parts]),
    )
    if leading is None:
        return plain
    section, lead = leading
    others = _told_below([s for s in told if s not in section.answer(results)])
    # A page that begins with a first screen: what the other sections answer comes after it.
    parts = _named_once([*_general_table(every, results), *others, *parts])
    return replace(plain, subtitle="", answer=lead.lines, parts=parts, lead=lead)


def _parts(every: Sequence[Section], results: Sequence[Any], submit: Submit | None) -> list[Part]:
    """Those of all sections in their order; what others can draw is drawn by others meanwhile."""
    if submit is None:
        return [part for section in every for part in section.parts(results)]
    begun = [[submit(_drawn, piece) for piece in section.pieces(results)] for section in every]
    here = [[] if jobs else section.parts(results) for section, jobs in zip(every, begun, strict=True)]
    return [p for jobs, own in zip(begun, here, strict=True) for p in (*(job.result() for job in jobs), *own)]


def _drawn(piece: Callable[[], Part], tell: Tell) -> Part:
    return piece()


def _told_below(told: Sequence[str]) -> list[Part]:
    return [Part("answers", "What the calibrations say", tuple(map(Text, told)))] if told else []


def _subject(told: Sequence[Subject]) -> Subject:
    """The first that names the films; of a page without any, all that is told."""
    return next((s for s in told if s.films), Subject((), " ".join(s.sentence for s in told)))


def _general_table(every: Sequence[Section], results: Sequence[Any]) -> list[Part]:
    """A row for every result: the first thing after the answer."""
    rows = tuple((g.what, g.about, g.found) for section in every for g in section.glances(results))
    columns = (Column("what", "computed"), Column("about", "of"), Column("found", "found"))
    table = Table("glance", "All that this page is made of, one row for each answer.", columns, rows)
    return [Part("glance", "At a glance", (table,))] if rows else []


def _named_once(parts: Sequence[Part]) -> list[Part]:
    """Anchors and names of tables that occur twice get a number, so that none hides another."""
    keys: dict[str, int] = {}
    tables: dict[str, int] = {}

    def once(name: str, seen: dict[str, int], gap: str) -> str:
        seen[name] = seen.get(name, 0) + 1
        return name if seen[name] == 1 else f"{name}{gap}{seen[name]}"

    return [
        Part(
            once(p.key, keys, "-"),
            p.title,
            tuple(_renamed(b, lambda name: once(name, tables, " ")) for b in p.blocks),
        )
        for p in parts
    ]


def _renamed(block: Block, name: Callable[[str], str]) -> Block:
    """The same with its table under another name, if it has one."""
    if isinstance(block, Lead):
        return replace(block, table=replace(block.table, name=name(block.table.name)))
    return replace(block, name=name(block.name)) if isinstance(block, Table) else block


# ---- what is found -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Gathered:
    """What a page is made of, and a sentence for each stored answer that cannot be read: where, why, how to mend it."""

    results: list[Any]
    left_out: list[str]


def gathered(found: Sequence[Any]) -> Gathered:
    """Results as they are, runs as a report shows them, folders read; raises as `write_report` does."""
    if not found:
        raise SettingsError("a report needs something to show", remedy="name at least one folder with stored answers")
    every = sections()
    known = (Run, Shown, *(kind for s in every for kind in (s.shows, *s.takes) if kind is not None))
    results: list[Any] = []
    faults: list[tuple[Path, BayesmembraneError]] = []
    for entry in found:
        if isinstance(entry, str | Path):
            results += _stored(Path(entry), every, faults)
        elif isinstance(entry, known):
            results.append(read(entry) if isinstance(entry, Run) else entry)
        else:
            raise SettingsError(
                f"no section of the report shows a {type(entry).__name__}",
                remedy='install the package that brings one under the entry points "bayesmembrane.sections"',
            )
    if faults and not results:
        raise _nothing(faults)
    return Gathered(results, [f"Left out: {_placed(place, fault)}" for place, fault in faults])


def _stored(folder: Path, every: Sequence[Section], faults: list[tuple[Path, BayesmembraneError]]) -> list[Any]:
    """All that the sections read from a folder and from those right under it; what cannot be read joins ``faults``."""
    check_folder(folder)
    places = [folder, *sorted(p for p in folder.iterdir() if p.is_dir())]
    results, before = [], len(faults)
    for place, section in ((place, section) for place in places for section in every):
        try:
            result = section.reads(place)
        except BayesmembraneError as fault:
            faults.append((place, fault))
            continue
        if result is not None:
            results.append(result)
    if not results and len(faults) == before:
        raise StorageError(
            "nothing that a report can show is stored here", str(folder), "name a folder that a verb wrote with --out"
        )
    return results


def _placed(place: Path, fault: BayesmembraneError) -> str:
    """The sentence of an error, with the folder at which it was met."""
    said = str(fault)
    return said if str(place) in said else f"{place}: {said}"


def _nothing(faults: Sequence[tuple[Path, BayesmembraneError]]) -> BayesmembraneError:
    """The error where none of the stored answers can be read: of one its own, of several the first stands for all."""
    place, first = faults[0]
    if len(faults) == 1:
        return first
    return StorageError(
        f"none of the {len(faults)} stored answers can be read, the first because {first.what.rstrip('. ')}",
        first.where or str(place),
        first.remedy,
    )


# ---- files -----------------------------------------------------------------------------------------------------------


def _refuse_foreign(path: Path) -> None:
    """Raise `StorageError` if something stands at ``path`` that is no report of ours."""
    if not path.exists():
        return
    if path.is_file():
        with path.open(encoding="utf-8", errors="replace") as file:
            if GENERATOR in file.read(2000):
                return
    raise StorageError("this is no report of ours, and nothing is overwritten", str(path), "choose another folder")

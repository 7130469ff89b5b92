"""A comparison: which hypothesis the data support, how sure that is, and the paper's ranking beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bayesmembrane.comparison.result import Comparison
from bayesmembrane.data.published import PublishedTable
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Figure, Points
from bayesmembrane.report.runs import Shown
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.report.sections.evidence.figures import comparison_picture
from bayesmembrane.report.sections.evidence.tables import (
    evidence_table,
    modes_table,
    noises_table,
    ranking_table,
    widths_table,
)
from bayesmembrane.words import comparison as words
from bayesmembrane.words.beside_paper import PaperLosses, order_sentences, paper_losses
from bayesmembrane.words.comparison import called
from bayesmembrane.words.language import listed

UNNAMED = "the data"


class EvidenceSection(Section):
    """Comparisons by range; with the published table among the results, the paper's order too."""

    name = "evidence"
    title = "Which model, and how sure"
    order = 50
    shows = Comparison
    takes = (Mapping, PublishedTable)
    aside = True

    def reads(self, folder: Path) -> Any | None:
        found = read(folder, "comparison")
        return read(folder, "published") if found is None else found

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        found, paper = _called(results)
        if not found:
            return ()
        figure = Figure(
            comparison_picture(found),
            alt=_alternative_text(found),
            caption="Left: evidence ln Z of each hypothesis minus that of the best, by both estimators; right: "
            "expected log predictive density of points left out, minus that of the best. Both without unit, to scale "
            "within 3 and logarithmic beyond; whiskers are two standard errors.",
        )
        tables = (
            evidence_table(found),
            noises_table(found),
            ranking_table(found, paper),
            modes_table(found),
            widths_table(found),
        )
        return [Points(tuple(sentences(found, paper))), figure, *(t for t in tables if t is not None)]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return sentences(_called(results)[0], {})

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [
            Glance(
                "comparison",
                f"{len(c.rows)} hypotheses {name if name.startswith('up to') else f'on {name}'}",
                f"{called(c.ranking[0])} first" if c.ranking else "no ranking",
            )
            for name, c in _called(results)[0].items()
        ]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        found = by_range(results)
        names = listed(dict.fromkeys(called(r) for c in found.values() for r in c.rows))
        return Subject((), f"A comparison of {names}.") if found else None


def by_range(results: Sequence[Any]) -> dict[str, Comparison]:
    """The comparisons among ``results``: by range, or alone."""
    found: dict[str, Comparison] = {}
    for result in results:
        if isinstance(result, Comparison):
            found[UNNAMED if UNNAMED not in found else f"{UNNAMED}, {len(found) + 1}"] = result
        elif isinstance(result, Mapping):
            found |= {name: c for name, c in result.items() if isinstance(c, Comparison)}
    return found


def _called(results: Sequence[Any]) -> tuple[dict[str, Comparison], PaperLosses]:
    """The comparisons, and the paper's losses, by the names that ranges have on the rest of the page: how far the runs
    were fitted that they rest on.
    """
    found, paper = by_range(results), _paper(results)
    ends = {Path(s.folder).name: s.end for s in of_kind(results, Shown)}
    names = {}
    for name, c in found.items():
        reached = {ends.get(r.run.name) for r in c.rows if r.run is not None} - {None}
        names[name] = f"up to {reached.pop()}" if len(reached) == 1 else name
    if len(set(names.values())) < len(names):
        return found, paper
    return {names[n]: c for n, c in found.items()}, {names.get(n, n): losses for n, losses in paper.items()}


def sentences(found: Mapping[str, Comparison], paper: PaperLosses) -> list[str]:
    """What each range says, whether it survives other priors, and every difference to the paper's ranking."""
    told = []
    for name, c in found.items():
        own = words.sentences(c) + order_sentences(c, paper.get(name, {}))
        told += [f"{name}: {s}" for s in own]
    return told


def _paper(results: Sequence[Any]) -> PaperLosses:
    return {name: losses for table in of_kind(results, PublishedTable) for name, losses in paper_losses(table).items()}


def _alternative_text(found: Mapping[str, Comparison]) -> str:
    names = listed(dict.fromkeys(called(r) for c in found.values() for r in c.rows))
    return f"Evidence and leave-one-out prediction of {names}, relative to the best, for {listed(found)}"

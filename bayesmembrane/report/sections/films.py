"""Films asked about by themselves: their forces, and whether their energy is convex on a box of stretches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Column, Points, Table
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind
from bayesmembrane.words.hypothesis import material_title
from bayesmembrane.words.language import listed


@dataclass(frozen=True)
class SingleFilm:
    """What ``force`` ("force") or ``convexity`` ("convexity") answered, and what they were asked."""

    kind: str
    told: Mapping[str, Any]

    @property
    def title(self) -> str:
        """``Gent (5.312, 17.42)``."""
        parameters = ", ".join(f"{p:.4g}" for p in self.told["parameters"])
        return f"{material_title(self.told['material'])} ({parameters})"


class FilmsSection(Section):
    """A table of forces for each film, and a sentence on each energy."""

    name = "films"
    title = "Single films"
    order = 75
    shows = SingleFilm
    aside = True

    def reads(self, folder: Path) -> Any | None:
        found = ((kind, read(folder, kind)) for kind in ("force", "convexity"))
        return next((SingleFilm(kind, told) for kind, told in found if told is not None), None)

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        films = of_kind(results, SingleFilm)
        said = tuple(self.answer(films))
        tables = [forces_table(film) for film in films if film.kind == "force"]
        return [*([Points(said)] if said else []), *tables]

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [_sentence(film) for film in of_kind(results, SingleFilm)]

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [Glance(film.kind, film.title, _sentence(film)) for film in of_kind(results, SingleFilm)]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        films = of_kind(results, SingleFilm)
        return Subject((), f"Single films: {listed(f.title for f in films)}.") if films else None


def forces_table(film: SingleFilm) -> Table:
    """One row for each deflection."""
    columns = (
        Column("deflection_mm", "deflection (mm)"),
        Column("force_N", "force (N)", ".5g"),
        Column("max_stretch", "largest stretch (-)"),
        Column("status", "status"),
    )
    told = film.told
    values = (told[column.key] for column in columns)
    rows = tuple((float(d), float(f), float(m), str(s)) for d, f, m, s in zip(*values, strict=True))
    radii = f"{1e3 * told['inner_radius']:.4g} and {1e3 * told['outer_radius']:.4g} mm"
    caption = f"{film.title} between the radii {radii}, pre-stretch {told['prestretch']:.4g}: force against deflection."
    return Table("forces", caption, columns, rows)


def _sentence(film: SingleFilm) -> str:
    told = film.told
    if film.kind == "force":
        lost = sum(s != "ok" for s in told["status"])
        missing = f"; {lost} of {len(told['status'])} deflections have none" if lost else ""
        return f"{film.title}: forces up to {max(told['deflection_mm']):.4g} mm{missing}."
    low, high = told["box"]
    return (
        f"{film.title} is {'' if told['convex'] else 'not '}convex on [{low:g}, {high:g}]^2: least eigenvalue of the "
        f"Hessian {told['margin']:.4g} G d, at stretches ({told['worst']['l1']:.4g}, {told['worst']['l2']:.4g})."
    )

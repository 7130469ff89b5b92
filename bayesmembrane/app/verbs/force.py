"""``force``: the forward model by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import typer

from bayesmembrane.app.options import (
    FilmOptions,
    OptionGroup,
    OutputOptions,
    StoredOnRequestOption,
)
from bayesmembrane.app.terminal import answer, numbers, table

place = 1


@dataclass(frozen=True)
class ClampedOptions(OptionGroup):
    """What holds the film, and what solves it."""

    prestretch: Annotated[float, typer.Option(help="Equibiaxial stretch of the film before it was clamped.")] = 1.0
    inner_radius_mm: Annotated[float, typer.Option(help="Radius of the disc, mm.")] = 10.0
    outer_radius_mm: Annotated[float, typer.Option(help="Radius of the ring, mm.")] = 35.0
    solver: Annotated[str, typer.Option(help="ritz or shooting.")] = "ritz"


def verb(
    film: FilmOptions,
    deflection_mm: Annotated[str, typer.Option("--deflection-mm", help="Deflections, mm: 1,10,35.1")],
    clamped: ClampedOptions,
    stored: StoredOnRequestOption,
    output: OutputOptions,
) -> None:
    """The force at given deflections for given parameters, or the reason why there is none."""
    import numpy as np

    from bayesmembrane.app.answers import Asked, kept
    from bayesmembrane.ground.fingerprint import digest
    from bayesmembrane.ground.registry import material as named
    from bayesmembrane.physics.mechanics import Note, Status, request, solve

    kind = named(film.material)
    made = kind.from_vector(numbers(film.parameters, "--parameters"))
    where = numbers(deflection_mm, "--deflection-mm")
    settings: dict[str, Any] = {
        "inner_radius": clamped.inner_radius_mm * 1e-3,
        "outer_radius": clamped.outer_radius_mm * 1e-3,
        "prestretch": clamped.prestretch,
        "solver": clamped.solver,
    }
    curves = solve(request(kind, made.vector, np.array(where) * 1e-3, **settings))
    states = [Status(int(s)) for s in curves.status[0]]
    notes = [(Note(int(n)).name or "").lower() if n else "" for n in curves.note[0]]
    document = {
        "material": kind.name,
        "deflection_mm": where,
        "force_N": curves.force[0],
        "status": [s.sentence for s in states],
        "max_stretch": curves.max_stretch[0],
        "notes": notes,
    }
    settings |= {"parameters": made.vector.tolist(), "deflection_mm": where}
    what = Asked("force", "", kind.name, 1e-3 * max(where), digest(settings))
    found = kept("force", {**document, **settings}, document, what, stored.folder)
    rows = zip(where, curves.force[0], curves.max_stretch[0], states, notes, strict=True)
    cells = [[f"{d:g}", f"{f:.6g}", f"{m:.4g}", f"{s.sentence} {n}".strip()] for d, f, m, s, n in rows]
    header = ["deflection, mm", "force, N", "largest stretch", "status"]
    answer(found.document, output.as_json, lambda: table(f"{kind.title}: {made}", header, cells))

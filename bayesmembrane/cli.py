"""The command line: thin verbs over the library.

The library is imported inside the verbs: numba and arviz take seconds that ``--help`` should not.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bayesmembrane.errors import BayesmembraneError, SettingsError
from bayesmembrane.terminal import answer, log, numbers, out, table

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="From a measured force curve to a calibrated film, with its uncertainty.",
)

Material = Annotated[str, typer.Option("--material", help="neo_hookean, mooney_rivlin, gent, yeoh or ogden.")]
Parameters = Annotated[
    str,
    typer.Option("--parameters", help="Membrane parameters, N/m (exponents and Gent's c2 pure numbers), by commas."),
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout; logs go to stderr.")]
Seed = Annotated[int, typer.Option("--seed", help="Seed of every random number.")]


@app.command()
def force(
    material: Material,
    parameters: Parameters,
    deflection_mm: Annotated[str, typer.Option("--deflection-mm", help="Deflections, mm: 1,10,35.1")],
    prestretch: Annotated[float, typer.Option(help="Equibiaxial stretch of the film before it was clamped.")] = 1.0,
    inner_radius_mm: Annotated[float, typer.Option(help="Radius of the disc, mm.")] = 10.0,
    outer_radius_mm: Annotated[float, typer.Option(help="Radius of the ring, mm.")] = 35.0,
    solver: Annotated[str, typer.Option(help="ritz or shooting.")] = "ritz",
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """The force at given deflections for given parameters, or the reason why there is none."""
    import numpy as np

    from bayesmembrane.mechanics import Note, Status, solve
    from bayesmembrane.registry import material as named

    kind = named(material)
    film = kind.from_vector(numbers(parameters, "--parameters"))
    where = numbers(deflection_mm, "--deflection-mm")
    curves = solve(
        kind,
        film.vector,
        np.array(where) * 1e-3,
        inner_radius=inner_radius_mm * 1e-3,
        outer_radius=outer_radius_mm * 1e-3,
        prestretch=prestretch,
        solver=solver,
    )
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
    rows = zip(where, curves.force[0], curves.max_stretch[0], states, notes, strict=True)
    cells = [[f"{d:g}", f"{f:.6g}", f"{m:.4g}", f"{s.sentence} {n}".strip()] for d, f, m, s, n in rows]
    header = ["deflection, mm", "force, N", "largest stretch", "status"]
    answer(document, as_json, lambda: table(f"{kind.title}: {film}", header, cells))


@app.command()
def convexity(
    material: Material,
    parameters: Parameters,
    box: Annotated[str, typer.Option(help="Stretches between which W(l1, l2) must be convex.")] = "1,8",
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """Whether an energy is convex in the stretches on a box, by what margin, and where it is worst."""
    from bayesmembrane.mechanics.convexity import box_convexity, box_ellipticity
    from bayesmembrane.registry import material as named

    edges = numbers(box, "--box")
    if len(edges) != 2:
        raise SettingsError(
            f"a box has two edges, and {len(edges)} were given", where="--box", remedy="write --box 1,8"
        )
    film = named(material).from_vector(numbers(parameters, "--parameters"))
    found, elliptic = box_convexity(film, *edges), box_ellipticity(film, *edges)
    document = {
        "material": film.name,
        "convex": found.convex,
        "margin": found.margin,
        "worst": dict(zip(("l1", "l2"), found.worst, strict=True)),
        "elliptic": elliptic.elliptic,
        "elliptic_margin": elliptic.margin,
        "box": edges,
    }
    l1, l2 = found.worst
    sentence = (
        f"{film.title} with {parameters} is {'' if found.convex else 'not '}convex on [{edges[0]:g}, {edges[1]:g}]^2: "
        f"least eigenvalue of the Hessian {found.margin:.4g} G d, at stretches ({l1:.4g}, {l2:.4g}); "
        f"it is {'' if elliptic.elliptic else 'not '}elliptic there (least of P11, P22: {elliptic.margin:.4g} G d)."
    )
    answer(document, as_json, lambda: out.print(sentence))


@app.command("import")
def import_(
    export: Annotated[Path, typer.Argument(help="The file that the machine wrote.", metavar="EXPORT")],
    out_file: Annotated[Path, typer.Option("--out", help="Where the curve goes; a TOML is written beside it.")] = Path(
        "curve.csv"
    ),
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """The curve and the specimen file from another program's export; refuses what it cannot read."""
    from bayesmembrane.importers.base import import_export

    written = import_export(export, out_file)
    document = {
        "curve": str(written.curve),
        "specimen": str(written.specimen),
        "importer": written.importer,
        "n_points": written.n_points,
    }
    sentence = (
        f"{written.n_points} points read as {written.importer}, written to {written.curve}; "
        f"complete {written.specimen} with the film and the rig before using them."
    )
    answer(document, as_json, lambda: out.print(sentence))


def main() -> None:
    """Run a verb. Exit status: 0 done; 1 wrong data or settings, in one sentence; 2 wrong usage; 130 interrupted."""
    try:
        app(standalone_mode=True)
    except BayesmembraneError as error:
        log.print(str(error), markup=False)
        sys.exit(1)
    except KeyboardInterrupt:
        log.print("Interrupted.")
        sys.exit(130)


if __name__ == "__main__":
    main()

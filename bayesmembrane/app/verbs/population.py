"""``population``: what runs of several specimens say of the material they are made of."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayesmembrane.app.options import OutputOptions, StoredOption
from bayesmembrane.app.terminal import answer, note, say, table

if TYPE_CHECKING:
    from bayesmembrane.calibration.hierarchy.population import Population

place = 7.5
EARLIER = "population.json"  # a pattern that names all runs of a folder names what was made of them, too


def verb(
    folders: Annotated[
        list[Path], typer.Argument(help="Runs that sample made, one for each specimen.", metavar="RUN...")
    ],
    stored: StoredOption,
    output: OutputOptions,
    pool: Annotated[
        str,
        typer.Option(
            "--pool", help="Coordinates, by commas: ln_modulus, bend, thickness.error; those of the material."
        ),
    ] = "",
) -> None:
    """Mean and scatter of a population of specimens, each with an interval, and the next specimen."""
    from bayesmembrane.app import analyses
    from bayesmembrane.calibration.run import load_run, run_folders

    named = [f for f in folders if len(folders) == 1 or not (f / EARLIER).is_file()]
    for folder in folders:
        if folder not in named:
            note(f"{folder} is an earlier answer about a population, no run: left out.")
    runs = [load_run(path) for folder in named for path in run_folders(folder)]
    names = [name.strip() for name in pool.split(",") if name.strip()]
    found = analyses.population(runs, analyses.Work(output.seed, stored.folder), pool=names)
    answer(found.document, output.as_json, lambda: show(found.result))


def show(found: Population) -> None:
    """Every coordinate: mean, scatter and the next specimen, on the terminal."""
    from bayesmembrane.words.population import rows, sentences

    head = ["", "mean", "sd", "94 % interval"]
    table(
        f"{len(found.specimens.labels)} specimens",
        head,
        [[r[0], *(f"{v:.4g}" for v in r[1:3]), r[3]] for r in rows(found)],
    )
    for sentence in sentences(found):
        say(sentence)

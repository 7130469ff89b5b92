"""``population``: what runs of several specimens say of the material they are made of."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayesmembrane.app.options import OutputOptions, StoredOption
from bayesmembrane.app.terminal import answer, say, table

if TYPE_CHECKING:
    from bayesmembrane.calibration.hierarchy.population import Population

place = 7.5


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

    runs = [load_run(path) for folder in folders for path in run_folders(folder)]
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

"""``import``: what other programs export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesmembrane.app.options import OutputOptions
from bayesmembrane.app.terminal import answer, note, say

place = 3


def verb(
    export: Annotated[Path, typer.Argument(help="The file that the machine wrote.", metavar="EXPORT")],
    output: OutputOptions,
    curve: Annotated[Path, typer.Option("--out", help="Where the curve goes; a TOML is written beside it.")] = Path(
        "curve.csv"
    ),
) -> None:
    """The curve and the specimen file from another program's export; refuses what it cannot read."""
    from bayesmembrane.data.importers.base import import_export

    written = import_export(export, curve)
    for left_aside in written.notes:
        note(f"{export}: {left_aside}.")
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
    answer(document, output.as_json, lambda: say(sentence))

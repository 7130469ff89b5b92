"""``report``: a page about whatever answers lie in some folders."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesmembrane.app.options import OutputOptions
from bayesmembrane.app.terminal import answer, note, say

place = 11


def verb(
    folders: Annotated[
        list[Path], typer.Argument(help="Folders of answers and runs, or that hold such.", metavar="DIR...")
    ],
    output: OutputOptions,
    page_folder: Annotated[Path, typer.Option("--out", help="Folder of the page.")] = Path("reports/report"),
    title: Annotated[str | None, typer.Option(help="Title of the page.")] = None,
) -> None:
    """One self-contained HTML page about whatever answers and runs lie there."""
    from bayesmembrane.app.folders import RUN, lying_in
    from bayesmembrane.report.page import write_report

    left_out: list[str] = []
    page = write_report(folders, page_folder, title, left_out.append)
    for sentence in left_out:
        note(sentence)
    found = list(dict.fromkeys(one for folder in folders for one in lying_in(folder)))
    document = {
        "report": str(page),
        "left_out": left_out,
        "runs": [str(f.folder) for f in found if f.kind == RUN],
        "answers": [{"folder": str(f.folder), "kind": f.kind} for f in found if f.kind != RUN],
    }
    answer(document, output.as_json, lambda: say(f"The report lies in {page}"))

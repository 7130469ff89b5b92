"""``demo``: all of it on the data that ship."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesmembrane.app.options import CHAINS, OutputOptions, SamplingOptions
from bayesmembrane.app.terminal import answer, bars, note, resumable, say

place = 12


def verb(
    sampling: SamplingOptions,
    output: OutputOptions,
    page_folder: Annotated[Path, typer.Option("--out", help="Folder of the page.")] = Path("reports/demo"),
    chains: Annotated[Path, typer.Option(help="Folder of the answers and runs.")] = CHAINS / "demo",
) -> None:
    """Reconstruct, fit and sample five materials on both ranges of the data that ship, compare, close loops, report."""
    from bayesmembrane.app.analyses import Work
    from bayesmembrane.app.demo import demo
    from bayesmembrane.ground.files import ensure_writable

    ensure_writable(page_folder, "the page")
    note("Five materials on two ranges; the first run compiles the solvers, which takes about a minute.")
    with resumable(chains), bars() as tell:
        document = demo(page_folder, Work(output.seed, chains, sampling.ess, tell))
    answer(document, output.as_json, lambda: say(f"The report lies in {document['report']}"))

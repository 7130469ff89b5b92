"""What `campaign run --dry-run` foretells beside what the campaign then takes.

python -m tests.studies.foretold --table docs/studies/foretold.md
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.campaign.films import write_campaign

ROOT = Path(__file__).resolve().parents[2]
FILM = f'curves = ["{ROOT / "data" / "elastosil_50um_op1.csv"}"]'
PAGES, NONE = 'wanted = ["sample"]\npages = true', 'wanted = ["sample"]\npages = false'

CAMPAIGNS: dict[str, dict[str, str]] = {
    "four strips, two materials, two noise models, pages": {
        "hypotheses": 'materials = ["neo_hookean", "mooney_rivlin"]\nnoise = ["white", "ar1"]',
        "analyses": PAGES,
        "sampling": "ess = 1000",
    },
    "the film of the paper, neo-Hookean and Gent, ESS 200": {
        "measurements": FILM,
        "hypotheses": 'materials = ["neo_hookean", "gent"]',
        "analyses": NONE,
        "sampling": "ess = 200",
    },
    "the film of the paper, Yeoh up to 20 mm and whole, pages": {
        "measurements": FILM,
        "hypotheses": 'materials = ["yeoh"]\nmax_deflection_mm = [20.0, "all"]',
        "analyses": PAGES,
        "sampling": "ess = 400",
    },
}


@dataclass(frozen=True)
class Took:
    """s by the clock, and of a processor: of a command with all its workers."""

    clock: float
    processor: float


def called(*words: object) -> tuple[Took, Any]:
    """What a command takes, and its answer."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [sys.executable, "-m", "bayesmembrane", "campaign", "run", *map(str, words), "--workers", "2", "--json"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Took(time.perf_counter() - began, processor), json.loads(done.stdout)


def measured(name: str, place: Path) -> str:
    """A line of the table."""
    file = write_campaign(place, films=("a", "b", "c", "d"), **CAMPAIGNS[name])
    _, told = called(file, "--out", place / "out", "--dry-run")
    took, ended = called(file, "--out", place / "out")
    assert ended["finished"], ended
    work = sum(told["core_seconds"].values()) + told["starting_core_seconds"]
    off, late = 100 * (work / took.processor - 1), 100 * (told["seconds"] / took.clock - 1)
    clock = f"{told['seconds']:.0f} s, {took.clock:.0f} s, {late:+.0f} %"
    return f"| {name} | {work:.0f} s, {took.processor:.0f} s, {off:+.0f} % | {clock} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--table", type=Path)
    parser.add_argument("--only", type=int, nargs="*", default=range(len(CAMPAIGNS)))
    given = parser.parse_args()
    rows = []
    for name in [name for i, name in enumerate(CAMPAIGNS) if i in given.only]:
        with tempfile.TemporaryDirectory(prefix="foretold-") as place:
            rows.append(measured(name, Path(place)))
            print(rows[-1], flush=True)
    text = f"""# What a dry run foretells

`make study-foretold` (`python -m tests.studies.foretold`), two workers: foretold, taken, and how far off. "Of a
processor" is all that the command and its workers take; the time by the clock hangs on what else the machine does.

| campaign | of a processor | by the clock |
|---|---|---|
{chr(10).join(rows)}
"""
    if given.table is not None:
        given.table.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

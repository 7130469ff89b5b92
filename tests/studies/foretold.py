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
from pathlib import Path
from typing import Any

from tests.campaign.films import write_campaign

ROOT = Path(__file__).resolve().parents[2]
OP1, OP2 = (ROOT / "data" / f"elastosil_50um_{name}.csv" for name in ("op1", "op2"))
FILM, BOTH = f'curves = ["{OP1}"]', f'curves = ["{OP1}", "{OP2}"]'
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
    "four strips, two materials: runs, comparisons, valleys": {
        "hypotheses": 'materials = ["neo_hookean", "mooney_rivlin"]',
        "analyses": 'wanted = ["sample", "compare", "valleys"]\npages = false',
        "sampling": "ess = 400",
    },
    "both curves of the paper's film, neo-Hookean and Gent: runs, comparisons, valleys": {
        "measurements": BOTH,
        "hypotheses": 'materials = ["neo_hookean", "gent"]',
        "analyses": 'wanted = ["sample", "compare", "valleys"]\npages = false',
        "sampling": "ess = 400",
    },
    "four strips: diagnoses and loops": {
        "hypotheses": 'materials = ["neo_hookean"]',
        "analyses": 'wanted = ["diagnose", "loop"]\npages = false',
        "sampling": "ess = 400",
    },
}


def called(*words: object) -> tuple[float, Any]:
    """s of a processor that a command takes with all its workers, and its answer."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "bayesmembrane", "campaign", "run", *map(str, words), "--workers", "2", "--json"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, json.loads(done.stdout)


def measured(name: str, place: Path) -> str:
    """A line of the table."""
    file = write_campaign(place, films=("a", "b", "c", "d"), **CAMPAIGNS[name])
    rehearsing, told = called(file, "--out", place / "out", "--dry-run")
    took, ended = called(file, "--out", place / "out")
    assert ended["finished"], ended
    work, (least, most) = told["whole_core_seconds"], told["whole_core_seconds_range"]
    foretold = f"{work:.0f} s ({least:.0f} to {most:.0f})"
    return f"| {name} | {foretold} | {took:.0f} s | {100 * (work / took - 1):+.0f} % | {rehearsing:.0f} s |"


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

`make study-foretold` (`python -m tests.studies.foretold`): time of a processor, foretold with its range, taken by the
command and its two workers, and how far off; and what the dry run itself took. The time by the clock is the same on as
many processors, and longer where others work on them, as they did here: it was not measured on an idle machine.

| campaign | foretold | taken | off | dry run |
|---|---|---|---|---|
{chr(10).join(rows)}
"""
    if given.table is not None:
        given.table.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

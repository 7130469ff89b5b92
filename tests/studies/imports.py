"""10 000 damaged exports: what becomes of them (``python -m tests.studies.imports --table docs/studies/import.md``).

Every layout in `tests.data.exports.damage` is damaged in turn by hypothesis, which keeps no memory and draws from a
fixed seed; every file is imported, and what comes out is laid beside what the whole file holds.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

from tests.data.exports.damage import FAULTS, Verdict, damages, every_layout, judged

OUTCOMES = ("refused", "same", "fewer rows", "damaged rows only", "sizes lost", "another scale or column", *FAULTS)
HEAD = """# Damaged exports

{count} exports of {layouts} layouts, each damaged once: bytes cut out, written in or changed, lines or cells moved, the
end cut off (`make study-import`; hypothesis, seed {seed}). `refused`: one sentence with the file. `same`: the numbers
of the whole file. `fewer rows`: some of its rows, and no other. `damaged rows only`: other numbers in at most five
rows. `sizes lost`: force and travel instead of stress and stretch, since the preamble no longer states the strip.
`another scale or column`: units, names, signs or marks that the damage changed into other valid ones. The last four are
faults.

| layout | files | {outcomes} | longest (s) |
|---|---|{dashes}|---|
"""


def study(name: str, count: int, first: int) -> list[tuple[str, bytes, Verdict]]:
    """The verdicts on ``count`` damaged files of one layout."""
    found: list[tuple[str, bytes, Verdict]] = []

    @seed(first)
    @settings(
        max_examples=count,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(damage=damages(name))
    def run(damage: tuple[str, bytes]) -> None:
        found.append((*damage, judged(name, damage[1])))

    run()
    return found


def row(name: str, found: list[tuple[str, bytes, Verdict]]) -> str:
    """A line of the table."""
    tally = Counter(v.outcome for _, _, v in found)
    cells = " | ".join(str(tally[o]) for o in OUTCOMES)
    return f"| {name} | {len(found)} | {cells} | {max(v.seconds for _, _, v in found):.2f} |\n"


def main() -> int:
    """Run it, write the table, and end with 1 if there was a fault."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--show", default="", help="print the files of this outcome")
    said = parser.parse_args()
    layouts = every_layout()
    every = {name: study(name, said.count // len(layouts), said.seed) for name in layouts}
    whole = [one for found in every.values() for one in found]
    for how, content, verdict in whole:
        if verdict.outcome in FAULTS or verdict.outcome == said.show:
            print(verdict.outcome, how, content, verdict.detail, sep="\n", end="\n\n")
    text = HEAD.format(
        count=len(whole),
        layouts=len(layouts),
        seed=said.seed,
        outcomes=" | ".join(OUTCOMES),
        dashes="---|" * (len(OUTCOMES) - 1) + "---",
    )
    text += "".join(row(name, found) for name, found in every.items()) + row("all", whole)
    shown = Counter(v.said for _, _, v in whole if v.outcome in OUTCOMES[2:6])
    text += f"\nOf the {sum(shown.values())} files that gave other numbers, {shown[True]} came with a contradiction.\n"
    print(text)
    if said.table is not None:
        said.table.write_text(text)
    return int(any(v.outcome in FAULTS for _, _, v in whole))


if __name__ == "__main__":
    sys.exit(main())

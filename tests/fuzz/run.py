"""`make study-fuzz`: calls of fit, sample and diagnose on curves and settings drawn at random, each judged.

One row of a CSV a call, written as soon as it is done; what stands there is skipped, so that the run can be interrupted
and goes on where it was. `--write FOLDER` writes the files of the first call instead, and prints its command.
"""

from __future__ import annotations

import argparse
import csv
import math
import shlex
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, fields
from functools import partial
from itertools import takewhile
from pathlib import Path

from tests.fuzz.calls import GOOD, LIMIT, Row, call
from tests.fuzz.cases import VERBS, Case, case

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "reports" / "study-fuzz" / "results.csv"
SHOWN = 12


def run_case(asked: Case, limit: float | None = None) -> Row:
    """The call, in a folder that is removed afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        return call(asked, Path(folder), limit)


def stored(path: Path) -> dict[int, Row]:
    """Rows by seed; one that an interruption cut short is left out."""
    if not path.exists():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        rows = [r for r in csv.DictReader(file) if None not in r.values() and len(r) == len(fields(Row))]
    return {
        int(r["seed"]): Row(
            int(r["seed"]), r["verb"], r["arguments"], int(r["exit"]), float(r["seconds"]), r["outcome"], r["sentence"]
        )
        for r in rows
    }


def run(cases: Iterable[Case], path: Path, jobs: int, limit: float | None = None, seconds: float = math.inf) -> None:
    """Run what is not stored yet, at most ``limit`` seconds a call; one process begins none after ``seconds``."""
    done, end = stored(path), time.monotonic() + seconds
    todo = takewhile(lambda _: time.monotonic() < end, (c for c in cases if c.seed not in done))
    path.parent.mkdir(parents=True, exist_ok=True)
    new = not path.exists() or path.stat().st_size == 0
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Row)])
        if new:
            writer.writeheader()
            file.flush()
        for row in _rows(todo, jobs, limit):
            writer.writerow(asdict(row))
            file.flush()
            print(f"{row.seed} {row.verb}: {row.outcome}, {row.seconds:.1f} s: {row.sentence[:150]}", flush=True)


def _rows(todo: Iterator[Case], jobs: int, limit: float | None) -> Iterator[Row]:
    one = partial(run_case, limit=limit)
    if jobs == 1:
        yield from map(one, todo)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(one, todo)


def table(rows: Iterable[Row]) -> str:
    """How many calls of each verb came to what, and the failures by cause."""
    rows = list(rows)
    counts = Counter((r.verb, r.outcome) for r in rows)
    outcomes = sorted({r.outcome for r in rows}, key=lambda o: (o not in GOOD, o))
    lines = ["| verb | " + " | ".join(outcomes) + " | seconds |", "|---" * (len(outcomes) + 2) + "|"]
    for verb in dict.fromkeys(VERBS):
        seconds = sum(r.seconds for r in rows if r.verb == verb)
        lines.append(f"| {verb} | " + " | ".join(str(counts[verb, o]) for o in outcomes) + f" | {seconds:.0f} |")
    causes: dict[tuple[str, str], list[int]] = defaultdict(list)
    for r in rows:
        if r.outcome not in GOOD:
            causes[r.outcome, r.sentence].append(r.seed)
    for (outcome, sentence), seeds in sorted(causes.items(), key=lambda i: -len(i[1])):
        lines.append(f"\n{outcome}: {sentence}\n  seeds {', '.join(map(str, seeds[:SHOWN]))}")
    return "\n".join(lines)


def page(rows: Iterable[Row], first: int, count: int, note: str = "") -> str:
    """docs/studies/fuzz.md: what was called, what came of it, and in ``note`` what else is to be said."""
    rows = list(rows)
    good, given_up = sum(r.outcome in GOOD for r in rows), sum(r.outcome == "timeout" for r in rows)
    return (
        "# Calls of the command line at random\n\n"
        f"Made by `python -m tests.fuzz.run --first {first} --count {count} --table docs/studies/fuzz.md`: `fit`, "
        "`sample` and `diagnose` on curves and settings drawn from a seed: rigs (R2/R1 1.1 to 10), thickness, "
        "protocols, energies, effects, faults that no effect describes, noise, and options that nobody should choose. "
        "Each answer must be one whole JSON document that does not contradict itself, each refusal one sentence that "
        "says what, where and how to mend it. A call is given up after "
        f"{', '.join(f'{s:g} s ({verb})' for verb, s in LIMIT.items())} of computing.\n\n"
        f"{len(rows)} of {count} seeds were run; {good} calls were answered or refused, {given_up} given up.\n\n"
        f"{note}{2 * chr(10) if note else ''}{table(rows)}\n"
    )


def main(arguments: list[str] | None = None) -> int:
    """Run, and print the table of all calls asked for; exit status 1 if one of them failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0, help="seed of the first call")
    parser.add_argument("--count", type=int, default=500, help="how many seeds")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--only", choices=sorted(set(VERBS)), help="only the calls of this verb")
    parser.add_argument("--limit", type=float, help="seconds of a call; without, those of its verb")
    parser.add_argument(
        "--seconds", type=float, default=math.inf, help="no call is begun once they have passed (one process)"
    )
    parser.add_argument("--results", type=Path, default=RESULTS, help="CSV, one row a call")
    parser.add_argument("--table", type=Path, help="write what came of all calls here, as Markdown")
    parser.add_argument("--note", default="", help="what else the table is to say, as Markdown")
    parser.add_argument("--write", type=Path, help="write the files of the first call here, and print its command")
    asked = parser.parse_args(arguments)
    if asked.write is not None:
        print(shlex.join(["bayesmembrane", *case(asked.first).arguments(asked.write)]))
        return 0
    seeds = range(asked.first, asked.first + asked.count)
    cases = (c for c in map(case, seeds) if asked.only in (None, c.verb))
    run(cases, asked.results, asked.jobs, asked.limit, asked.seconds)
    rows = [r for r in stored(asked.results).values() if r.seed in seeds and asked.only in (None, r.verb)]
    print(table(rows))
    if asked.table is not None:
        asked.table.write_text(page(rows, asked.first, asked.count, asked.note), encoding="utf-8")
    return int(any(r.outcome not in GOOD for r in rows))


if __name__ == "__main__":
    sys.exit(main())

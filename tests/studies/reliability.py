"""`make study-reliability`: are the probabilities of a diagnosis right, and its names; docs/studies/reliability.md.

`make study-second` asks the same of the second generator (`--generator second`), once; docs/studies/second.md.
`make study-third` asks it of the third (`--generator third`), which has 120 cases for each `--seed`.
`--generator fourth` asks it of the fourth, which has 60.
Each case is one line of a JSON-lines file, written as soon as it is done; cases that stand there are skipped, so that
the study can be interrupted and goes on where it was. `--first 0 --count 40 --half calibration --results FILE` runs a
part and prints a line for each case; `--summary FILE` prints the tables of what is there.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from itertools import islice, product
from pathlib import Path
from typing import Any

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.explanation.total import set_name
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.registry import materials, ordinary_materials
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.words.diagnosis import document
from tests.generator.datasets import Dataset, generate
from tests.generator.film import NoSolutionError
from tests.generator.protocols import Protocol
from tests.generator_four.datasets import BenchDataset
from tests.generator_three.datasets import Dataset as ThirdDataset
from tests.generator_three.elements import NoBalanceError
from tests.generator_two.datasets import Dataset as SecondDataset
from tests.generator_two.membrane import LockedError
from tests.studies import reliability_plan, second_plan
from tests.studies.loop_intervals import covered
from tests.studies.reliability_plan import HALVES, Case
from tests.studies.reliability_rows import Row, answer_row, right_name, spoken_truth, top, truth_row
from tests.studies.reliability_table import report
from tests.studies.results import append, stored, until

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "reports" / "study-reliability"
DECLARED, NONE = "declared", "none"
ENERGIES = {"declared": (DECLARED,), "none": (NONE,), "both": (DECLARED, NONE)}
AnyDataset = Dataset | SecondDataset | ThirdDataset | BenchDataset


@dataclass(frozen=True)
class Source:
    """A generator with a plan of its own: half, base of the seeds, cases, measurement of a case, and a title."""

    half: str
    seed: int
    plan: Callable[[str, int], Iterator[Case]]
    measured: Callable[[Case], AnyDataset]
    title: str


OWN, SECOND, THIRD, FOURTH = "own", "second", reliability_plan.THIRD, reliability_plan.FOURTH
SOURCES = {
    OWN: Source("test", reliability_plan.SEED, reliability_plan.plan, reliability_plan.measured, "Reliability"),
    SECOND: Source(
        second_plan.HALF,
        second_plan.SEED,
        second_plan.plan,
        second_plan.measured,
        "Reliability on the second generator, looked at once",
    ),
    THIRD: Source(
        THIRD,
        reliability_plan.THIRD_SEED,
        reliability_plan.third_plan,
        reliability_plan.third_measured,
        "Reliability on the third generator",
    ),
    FOURTH: Source(
        FOURTH,
        reliability_plan.FOURTH_SEED,
        reliability_plan.fourth_plan,
        reliability_plan.fourth_measured,
        "Reliability on the fourth generator",
    ),
}


def run_case(case: Case, energy: str, source: str, half: str) -> Row:
    """Everything that the tables need of one case; ``seconds`` are those of the process, for the diagnosis alone."""
    head = {**asdict(case), "half": half, "energy": energy, "key": key(case, energy)}
    try:
        data = SOURCES[source].measured(case)
    except (NoSolutionError, LockedError, NoBalanceError) as error:
        return head | {"skipped": str(error)}
    head |= truth_row(data.truth, data.identifiable if isinstance(data, Dataset) else None) | {
        "protocol": data.truth["protocol"],
        "material": data.truth.get("declared", case.material),
    }
    with tempfile.TemporaryDirectory() as folder:
        measurement = read_measurement(*data.write(Path(folder)))
    begun = time.process_time()
    try:
        found = diagnosed(measurement, None if energy == NONE else head["material"])
    except BayesmembraneError as error:
        return head | {"verdict": "error", "effects": [], "sentence": str(error), "probabilities": None}
    row = head | {"seconds": time.process_time() - begun} | answer_row(document(found)) | {"terms": terms(found)}
    return row | intervals(row, found, data)


def diagnosed(measurement: Measurement, material: str | None) -> Diagnosis:
    """The answer with an energy declared, or with none."""
    asked = Hypothesis(materials()[material or min(ordinary_materials())])
    return diagnose(measurement, Question(asked, declared=material is not None))


def terms(found: Diagnosis) -> list[tuple[str, str, float]]:
    """(energy, set of effects, ln Z) of every hypothesis: enough to weigh them by other beliefs."""
    given = found.null.names
    return [
        (j.candidate.hypothesis.material.name, set_name(j.candidate, given), round(j.log_evidence, 3))
        for j in found.ranking
    ]


def intervals(row: Row, found: Diagnosis, data: AnyDataset) -> dict[str, Any]:
    """Whether the 90 % intervals hold the film that was put in, where the truth is named with its energy."""
    if not right_name(row) or found.best.hypothesis.material.name != row["family"]:
        return {}
    return {"covered": covered(found, found.best, data)}


def key(case: Case, energy: str) -> str:
    """What makes it the same diagnosis in another run."""
    return f"{case.key}|{energy}"


def warmed() -> None:
    """What is compiled on first use is no part of a case's time."""
    short = Protocol("short", (0.015, 0.030), (1e-3,) * 2, 80)
    data = generate("friction", "neo_hookean", short, "white", 2.0, seed=11)
    with tempfile.TemporaryDirectory() as folder:
        diagnosed(read_measurement(*data.write(Path(folder))), "neo_hookean")


def line_of(row: Row) -> str:
    """Truth, verdict, effects, most probable sets and seconds of one case."""
    if "skipped" in row:
        return f"{row['number']:4d} {row['group']}: skipped, {row['skipped']}"
    said = "+".join(row["effects"]) or row.get("found_material") or "-"
    mark = " (not identifiable)" if row["truth"] and row["identifiable"] is False else ""
    return (
        f"{row['number']:4d} {row['group']}, {row['material'] if row['energy'] == DECLARED else 'no energy'} declared, "
        f"{row['protocol']}: {spoken_truth(row)}{mark} -> {row['verdict']} {said} [{top(row)}] "
        f"{row.get('seconds', 0):.1f} s"
    )


def _one(item: tuple[Case, str], source: str, half: str) -> Row:
    return run_case(*item, source, half)


def main(arguments: list[str] | None = None) -> int:
    """Run, and write or print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generator", choices=tuple(SOURCES), default=OWN, help="the others are for the end")
    parser.add_argument("--half", choices=tuple(HALVES), default=None, help="of the own generator; test by default")
    parser.add_argument("--energy", choices=tuple(ENERGIES), default=DECLARED, help="what is declared")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--count", type=int, default=None, help="so many cases; all that follow by default")
    parser.add_argument(
        "--seed", type=int, default=None, help="base of the seeds, an even number; of the third and fourth the seed"
    )
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no case after this time")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--results", type=Path, default=None, help="JSON lines, one a case")
    parser.add_argument("--table", type=Path, default=None, help="Markdown; printed only, if not given")
    parser.add_argument("--summary", type=Path, default=None, help="print the tables of these results, run nothing")
    asked = parser.parse_args(arguments)
    if asked.summary is not None:
        print(report(list(stored(asked.summary).values()), f"--summary {asked.summary}"))
        return 0
    source = SOURCES[asked.generator]
    half, seed = asked.half or source.half, source.seed if asked.seed is None else asked.seed
    results = asked.results or RESULTS / f"{half}.jsonl"
    end = None if asked.count is None else asked.first + asked.count
    cases = list(islice(source.plan(half, seed), asked.first, end))
    todo = list(product(cases, ENERGIES[asked.energy]))
    done = stored(results)
    rest = [item for item in todo if key(*item) not in done]
    work = partial(_one, source=asked.generator, half=half)
    append(until(asked.seconds, rest, work, asked.jobs, warmed), results, line_of)
    have = stored(results)
    rows = [have[key(*item)] for item in todo if key(*item) in have]
    told = "" if asked.count is None else f" --first {asked.first} --count {asked.count}"
    which = f"--half {half}" if asked.generator == OWN else f"--generator {asked.generator}"
    what = f"{which} --energy {asked.energy} --seed {seed}{told}"
    text = report(rows, f"python -m tests.studies.reliability {what}", len(todo), source.title)
    if asked.table is not None:
        asked.table.parent.mkdir(parents=True, exist_ok=True)
        asked.table.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

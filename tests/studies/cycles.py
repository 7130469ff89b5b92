"""Is the answer the same whatever energy is declared? Every real cyclic test, with each energy declared and with none.

    python -m tests.studies.cycles [--data FOLDER] [--declare none yeoh ...] [--rows FILE] [--table FILE]

The measurements lie in ../shared/data/effects and are no part of the project. Rows that the file holds are not made
again; the table is written from all of them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.explanation.telling import NOTHING
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.hypothesis import hypothesis
from tests.studies.cycles_page import page
from tests.studies.vhb_data import FAST, FOLDER, cycles, fast_cycle, kPa

NONE = "none"
"""No energy is declared."""
FIRST = "yeoh"


@dataclass(frozen=True)
class Row:
    """What one diagnosis came to.

    name, readings : of the measurement
    declared : the energy, or `NONE`
    verdict, effects : as told
    sets, energies : the three most probable each, with their probabilities
    foreign : probability of anything foreign
    before, after : kPa, root mean square residual of the plain energy and of the answer
    chi2, covered : reduced chi-square left, and part of the held-out points inside the 90 % band
    set_aside : readings that were left out of the diagnosis
    seconds : of one core
    seed : of the diagnosis
    """

    name: str
    readings: int
    declared: str
    verdict: str
    effects: tuple[str, ...]
    sets: dict[str, float]
    energies: dict[str, float]
    foreign: float
    before: float
    after: float
    chi2: float
    covered: float | None
    set_aside: int
    seconds: float
    seed: int

    @property
    def key(self) -> tuple[str, str, int]:
        """What makes it the same row."""
        return self.name, self.declared, self.seed


def main() -> None:
    """Diagnose what is not there yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=FOLDER)
    parser.add_argument("--declare", nargs="+", default=[NONE, *ordinary_materials()])
    parser.add_argument("--rows", type=Path, default=Path("studies/cycles.jsonl"))
    parser.add_argument("--table", type=Path, default=Path("docs/studies/cycles.md"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--note", default="", help="what is to be said of the rows")
    asked = parser.parse_args()
    tests = dict(measurements(asked.data))
    if not tests:
        print(f"Skipped: the measurements are not in {asked.data}.")
        return
    known = read_rows(asked.rows)
    for declared in asked.declare:
        for name, measurement in tests.items():
            if (name, declared, asked.seed) not in {r.key for r in known}:
                known.append(row(name, measurement, declared, asked.seed))
                write_row(asked.rows, known[-1])
                print(f"{name}, {declared}: {known[-1].verdict} {known[-1].sets}", flush=True)
    asked.table.write_text(page(known, asked.seed, asked.note), encoding="utf-8")


def measurements(folder: Path) -> Iterator[tuple[str, Measurement]]:
    """Every cyclic test by its name."""
    for c in cycles(folder):
        yield f"to {c.peak} at {c.rate} 1/s", c.measurement
    if (folder / FAST).is_file():
        yield "to 5.4 at 0.68 1/s, another laboratory", fast_cycle(folder)


def row(name: str, measurement: Measurement, declared: str, seed: int) -> Row:
    """One diagnosis."""
    began = time.process_time()
    energy = FIRST if declared == NONE else declared
    told = diagnose(measurement, Question(hypothesis(energy), declared=declared != NONE), seed=seed)
    seconds = time.process_time() - began
    held = told.validation
    return Row(
        name=name,
        readings=len(measurement),
        declared=declared,
        verdict=told.verdict,
        effects=told.effects,
        sets=_first(told.probabilities.effects),
        energies=_first(told.probabilities.energies),
        foreign=1 - told.probabilities.foreign.get(NOTHING, 1.0),
        before=float(kPa(told.before.rmse_N)),
        after=float(kPa(told.after.rmse_N)),
        chi2=told.remaining.reduced_chi2,
        covered=None if held is None else held.covered_after,
        set_aside=0 if told.set_aside is None else len(told.set_aside.numbers),
        seconds=seconds,
        seed=seed,
    )


def _first(probabilities: Mapping[str, float], count: int = 3) -> dict[str, float]:
    return {k: round(v, 4) for k, v in sorted(probabilities.items(), key=lambda i: -i[1])[:count]}


def read_rows(path: Path) -> list[Row]:
    """The rows of a file; none if there is no such file."""
    if not path.is_file():
        return []
    found = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return [Row(**{**r, "effects": tuple(r["effects"])}) for r in found]


def write_row(path: Path, row: Row) -> None:
    """One more line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(row)) + "\n")


if __name__ == "__main__":
    main()

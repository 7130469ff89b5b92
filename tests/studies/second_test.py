"""Does a strip of the same film end the doubt: what one test cannot tell, with a sound tension test beside it.

`python -m tests.studies.second_test --first 140 --count 60` goes through the single effects and pairs of the
calibration half of `make study-reliability` whose faults belong to the rig. Where the answer to the first test is
ambiguous, a strip of the same film is pulled on a sound machine (the generator's energy in tension, noise of half a per
cent of its largest force), and both tests are diagnosed together. One line of JSON a case.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Mapping
from itertools import islice
from pathlib import Path

import numpy as np

from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.diagnosis.joint.diagnose import diagnose_jointly
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.words.diagnosis import document
from tests.generator.datasets import Dataset
from tests.generator.film import NoSolutionError
from tests.studies.reliability import diagnosed
from tests.studies.reliability_plan import HALVES, SEED, Case, measured, plan
from tests.studies.reliability_rows import Row, answer_row, inside, right_name, spoken_truth, truth_row
from tests.studies.results import append, stored, until

RESULTS = Path(__file__).parents[2] / "reports" / "study-second-test" / "results.jsonl"
GROUPS = ("single", "pair")
READINGS, STRETCH, SPEED = 120, 1.8, 1e-3
NOISE = 0.005
FILM = "@film"
LEAST = 1e-4
OUTCOMES = ("right", "wrong", "ambiguous with the truth", "ambiguous without it", "unknown", "material", "adequate")


def strip(data: Dataset, rng: np.random.Generator) -> Measurement:
    """A strip of the same film, its sides free, on a machine without fault."""
    rig = Uniaxial()
    stretch = np.linspace(1.0, STRETCH, READINGS + 1)[1:]
    tension = data.film.family.derivatives(data.film.p, stretch, stretch**-0.5)[1]
    force = rig.width * np.asarray(tension)
    noisy = force + NOISE * float(np.max(force)) * rng.standard_normal(force.size)
    travel = rig.length * (stretch - 1)
    return Measurement(travel, noisy, rig, Specimen("strip", data.bench.thickness), time=travel / SPEED)


def run_case(case: Case) -> Row:
    """P(truth) and verdict of one test, and of both."""
    try:
        data = measured(case)
    except NoSolutionError as error:
        return {"key": case.key, "number": case.number, "skipped": str(error)}
    row: Row = {"key": case.key, "number": case.number, "group": case.group}
    row |= truth_row(data.truth, data.identifiable)
    known = components("effects")
    if not row["truth"] or row["foreign"] or any(known[e].of_the_material for e in row["truth"] + row["faint"]):
        return row | {"skipped": "not of the rig"}
    with tempfile.TemporaryDirectory() as folder:
        first = read_measurement(*data.write(Path(folder)))
    try:
        alone = answer_row(document(diagnosed(first, None)))
    except BayesmembraneError as error:
        return row | {"error": str(error)}
    row["alone"] = {
        "verdict": alone["verdict"],
        "effects": alone["effects"],
        "p": believed(row, alone["probabilities"]["effects"]),
    }
    if alone["verdict"] != "ambiguous":
        return row
    begin = time.process_time()
    tests = {"film": first, "strip": strip(data, np.random.default_rng([case.seed, 92]))}
    try:
        both = diagnose_jointly(joint(tests, hypothesis("gent")), declared=False)
    except (BayesmembraneError, np.linalg.LinAlgError) as error:
        return row | {"error": str(error)}
    sets: dict[str, float] = {}
    for name, q in both.probabilities.effects.items():
        sets[here(name)] = sets.get(here(name), 0.0) + q
    effects = sorted({here(n) for n in both.effects})
    row["both"] = {
        "verdict": both.verdict,
        "effects": effects,
        "p": believed(row, sets),
    }
    return row | {"seconds": time.process_time() - begin}


def here(name: str) -> str:
    """Effects of the film's own test by their bare names, in alphabetical order; those of the strip keep its label."""
    return "+".join(sorted(n.removesuffix(FILM) for n in name.split("+")))


def believed(row: Row, sets: Mapping[str, float]) -> float:
    """Of all ``sets`` that hold the true effects, and beside them only faint ones."""
    truth, faint = set(row["truth"]), set(row["faint"])
    return float(sum(p for name, p in sets.items() if truth <= set(name.split("+")) <= truth | faint))


def outcome(row: Row, which: str) -> str:
    """ "right", "wrong", "ambiguous with the truth", "ambiguous without it", or the verdict."""
    one = row | row[which]
    kind = str(one["verdict"])
    if kind == "named":
        return "right" if right_name(one) else "wrong"
    return f"{kind} {'with the truth' if inside(one) else 'without it'}" if kind == "ambiguous" else kind


def table(rows: list[Row], command: str) -> str:
    """Markdown."""
    doubt = [r for r in rows if "both" in r]
    shown = [r for r in rows if "alone" in r]
    lines = [
        "# Does a strip of the same film end the doubt",
        "",
        f"`{command}`: {len(shown)} measurements with one or two faults of the rig, no energy declared; {len(doubt)} "
        "answers are ambiguous, and are given again with a strip of the same film on a sound machine beside them.",
        "",
        "| | one test | with a strip |",
        "| --- | --- | --- |",
    ]
    for kind in (
        "right",
        "wrong",
        "ambiguous with the truth",
        "ambiguous without it",
        "unknown",
        "material",
        "adequate",
    ):
        counts = [sum(outcome(r, which) == kind for r in doubt) for which in ("alone", "both")]
        if any(counts):
            lines.append(f"| {kind} | {counts[0]} | {counts[1]} |")
    if doubt:
        scores = [np.mean([np.log(max(r[w]["p"], LEAST)) for r in doubt]) for w in ("alone", "both")]
        means = [np.mean([r[w]["p"] for r in doubt]) for w in ("alone", "both")]
        lines.append(f"| mean of ln P(truth) | {scores[0]:.2f} | {scores[1]:.2f} |")
        lines.append(f"| mean P(truth) | {means[0]:.2f} | {means[1]:.2f} |")
        lines.append(f"| CPU, median | | {np.median([r['seconds'] for r in doubt]):.0f} s |")
    lines += [
        "",
        "| case | truth, with own ratios | P(truth) | with a strip | then |",
        "| --- | --- | --- | --- | --- |",
    ]
    for r in doubt:
        p, q = r["alone"]["p"], r["both"]["p"]
        then = f"{outcome(r, 'both')}: {', '.join(r['both']['effects'])}"
        lines.append(f"| {r['number']} | {spoken_truth(r)} | {p:.2f} | {q:.2f} | {then} |")
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Run, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--half", choices=tuple(HALVES), default="calibration")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=60, help="cases of the plan; of these only faults of the rig")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no case after this time")
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--table", type=Path, default=None)
    asked = parser.parse_args(arguments)
    cases = [c for c in islice(plan(asked.half, SEED), asked.first, asked.first + asked.count) if c.group in GROUPS]
    have = stored(asked.results)
    todo = [c for c in cases if c.key not in have]
    append(
        until(asked.seconds, todo, run_case, 1, lambda: None),
        asked.results,
        lambda r: f"{r['number']} {r.get('alone')} {r.get('both')} {r.get('skipped', '')}",
    )
    have = stored(asked.results)
    command = f"python -m tests.studies.second_test --half {asked.half} --first {asked.first} --count {asked.count}"
    text = table([have[c.key] for c in cases if c.key in have], command)
    if asked.table is not None:
        asked.table.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

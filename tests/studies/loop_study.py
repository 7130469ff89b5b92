"""`make study-loop`: measurements with an undeclared fault, diagnosed one by one; writes docs/studies/loop.md.

Each case is one line of a JSON-lines file, written as soon as it is done; cases that stand there are skipped, so that
the study can be interrupted and goes on where it was.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import Any

from bayesmembrane.data.reading import read_measurement
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.hypothesis import Hypothesis
from tests.generator.datasets import Dataset, generate
from tests.generator.film import NoSolutionError
from tests.studies.loop_intervals import covered
from tests.studies.loop_plan import Case, plan
from tests.studies.loop_table import report
from tests.studies.results import Row, append, stored, until

SEED = 180000
ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "reports" / "study-loop" / "results.jsonl"
TABLE = ROOT / "docs" / "studies" / "loop.md"
SHOWN = 6


def run_case(case: Case) -> Row:
    """Everything that the tables need of one case; ``seconds`` are those of the process, for the diagnosis alone."""
    head = asdict(case) | {"key": case.key}
    try:
        data = generate(case.kind, case.material, case.protocol, case.noise, case.strength, case.seed)
    except NoSolutionError as error:
        return head | {"skipped": str(error)}
    with tempfile.TemporaryDirectory() as folder:
        measurement = read_measurement(*data.write(Path(folder)))
    begun = time.process_time()
    try:
        found = diagnose(measurement, Hypothesis(materials()[case.material]))
    except BayesmembraneError as error:
        return head | truth_of(data) | {"verdict": "error", "effects": [], "sentence": str(error)}
    seconds = time.process_time() - begun
    answer = {"seconds": seconds} | answer_of(found, data)
    if found.verdict == "named" and data.truth["family"] == case.material:
        answer |= {f"covered_{k}": covered(found, c, data) for k, c in (("null", found.null), ("best", found.best))}
    return head | truth_of(data) | answer


def warmed() -> None:
    """What is compiled on first use is no part of a case's time."""
    data = generate("friction+clamp_slip", "neo_hookean", "two_speeds", seed=1)
    with tempfile.TemporaryDirectory() as folder:
        diagnose(read_measurement(*data.write(Path(folder))), Hypothesis(materials()["neo_hookean"]))


def truth_of(data: Dataset) -> dict[str, Any]:
    """What is in the measurement, and whether it can be told."""
    t = data.truth
    return {
        "truth": sorted(t["effects"]),
        "forms": {k: v["form"] for k, v in t["effects"].items()},
        "snr": t["snr"],
        "snr_own": t["snr_own"],
        "reached": t["reached"],
        "expected": t["expected"],
        "identifiable": data.identifiable,
        "angles": {k: dict(sorted(v.items(), key=lambda i: i[1])[:3]) for k, v in data.angles.items()},
    }


def answer_of(found: Diagnosis, data: Dataset) -> dict[str, Any]:
    """The verdict with what led to it; errors are in standard deviations of the noise that was put in."""
    true = data.truth["noise"]
    sd = (true["sd"] ** 2 + true["quantum"] ** 2 / 12) ** 0.5
    tests = found.detection
    null = found.null.log_evidence
    return {
        "verdict": found.verdict,
        "effects": list(found.effects),
        "found_material": found.material,
        "p_value": tests.p_value,
        "p_lack_of_fit": tests.lack_of_fit.p_value,
        "p_score": tests.score.p_value,
        "p_periodicity": None if tests.periodicity is None else tests.periodicity.p_value,
        "sd": found.noise.sd / sd,
        "rho": found.noise.rho,
        "before": found.before.rmse_N / sd,
        "after": found.after.rmse_N / sd,
        "heldout_before": None if found.validation is None else found.validation.before.rmse_N / sd,
        "heldout_after": None if found.validation is None else found.validation.after.rmse_N / sd,
        "ranking": [
            {
                "label": j.candidate.label,
                "ln_k": j.log_evidence - null,
                "probability": j.probability,
                "unexplained": j.unexplained,
                "reduced_chi2": j.reduced_chi2,
                "at_bound": list(j.candidate.at_bound),
            }
            for j in found.ranking[:SHOWN]
        ],
    }


def line_of(row: Row) -> str:
    """Verdict and seconds of one case."""
    told = ", ".join(row.get("effects", ())) or row.get("found_material", "") or row.get("skipped", "")
    return f"{row['key']}: {row.get('verdict', 'skipped')} {told} ({row.get('seconds', 0):.1f} s)"


def main(arguments: list[str] | None = None) -> int:
    """Run, and write the tables of all that is stored of this plan."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=SEED, help="of the first case; the others follow")
    parser.add_argument("--limit", type=int, default=None, help="only the first so many cases of the plan")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no case after this time")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--results", type=Path, default=RESULTS, help="JSON lines, one a case")
    parser.add_argument("--table", type=Path, default=TABLE, help="Markdown")
    asked = parser.parse_args(arguments)
    cases = list(islice(plan(asked.seed), asked.limit))
    done = stored(asked.results)
    todo = [c for c in cases if c.key not in done]
    append(until(asked.seconds, todo, run_case, asked.jobs, warmed), asked.results, line_of)
    have = stored(asked.results)
    rows = [have[c.key] for c in cases if c.key in have]
    # The place of the file and the number of processes change nothing.
    limit = "" if asked.limit is None else f" --limit {asked.limit}"
    text = report(rows, f"python -m tests.studies.loop_study --seed {asked.seed}{limit}", asked.seed, len(cases))
    asked.table.parent.mkdir(parents=True, exist_ok=True)
    asked.table.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""`make study-seeds`: the statistical tests of the suite on many seeds, with wide SIMD lanes and without.

One process of pytest for each group of files, seed and arithmetic; one line of JSON a test under reports/study-seeds/,
as soon as its process is done. What stands there is skipped, so that the study can be interrupted and goes on where it
was. Writes docs/studies/seeds.md. Seeds enter by the environment (`tests/seeds.py`).

Without lanes means: numba compiles for the oldest processor of this kind (two lanes, no fused operations), and so does
OpenBLAS choose its kernels. It is what another machine does to the last digits.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.seeds import NAME

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "reports" / "study-seeds" / "results.jsonl"
PAGE = ROOT / "docs" / "studies" / "seeds.md"
LANES = {
    "wide": {},
    "off": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "OPENBLAS_CORETYPE": "NEHALEM"},
}
# Files by what a run of theirs takes, and for how many seeds each group is run.
GROUPS: dict[str, tuple[int, tuple[str, ...]]] = {
    "quick": (
        50,
        (
            "tests/comparison/test_layers.py",
            "tests/comparison/test_prior_widths.py",
            "tests/diagnosis/detection/test_scores.py",
            "tests/physics/noise/test_noise.py",
        ),
    ),
    "slow": (
        10,
        (
            "tests/calibration/test_prior.py",
            "tests/calibration/sampling/proposals",
            "tests/comparison/test_leave_out.py",
            "tests/comparison/test_search.py",
            "tests/diagnosis/detection/test_lack_of_fit.py",
            "tests/diagnosis/detection/test_detect.py",
        ),
    ),
    "dear": (
        5,
        (
            "tests/calibration/sampling/test_walk.py",
            "tests/calibration/test_run.py",
            "tests/comparison/test_evidence.py",
            "tests/statistics/test_evidence_posteriors.py",
        ),
    ),
}


@dataclass(frozen=True)
class Row:
    """One test with one seed and arithmetic: "passed", "failed" or "skipped", and how long it took."""

    group: str
    seed: int
    lanes: str
    test: str
    outcome: str
    seconds: float


def stored(path: Path) -> list[Row]:
    """The rows in a file; a line that an interruption cut short is left out."""
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            rows.append(Row(**json.loads(line)))
        except (ValueError, TypeError):
            continue
    return rows


def run(group: str, seed: int, lanes: str) -> list[Row]:
    """The tests of a group in a process of their own.

    Raises RuntimeError if pytest could not run them, with what it printed.
    """
    files = [f for f in GROUPS[group][1] if (ROOT / f).exists()]
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        words = ["-n0", "-q", "--tb=no", "-p", "no:cacheprovider", f"--junitxml={report}", *files]
        environment = {**os.environ, **LANES[lanes], NAME: str(seed)}
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *words],
            cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode not in (0, 1) or not report.exists():
            raise RuntimeError(done.stdout + done.stderr)
        cases = ET.parse(report).getroot().iter("testcase")
        return [_row(group, seed, lanes, case) for case in cases]


def _row(group: str, seed: int, lanes: str, case: ET.Element) -> Row:
    kinds = {child.tag for child in case}
    outcome = "failed" if kinds & {"failure", "error"} else "skipped" if "skipped" in kinds else "passed"
    name = f"{case.get('classname')}::{case.get('name')}"
    return Row(group, seed, lanes, name, outcome, float(case.get("time", 0.0)))


def page(rows: Iterable[Row]) -> str:
    """The table: each test with the seeds it was run on, and those on which it failed."""
    by_test: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        by_test[row.group, row.test].append(row)
    lines = []
    for (group, test), of_test in sorted(by_test.items()):
        cells = [group, f"`{test}`"]
        for lanes in LANES:
            own = [r for r in of_test if r.lanes == lanes and r.outcome != "skipped"]
            lost = sorted(r.seed for r in own if r.outcome == "failed")
            cells += [str(len(own)), ", ".join(map(str, lost)) or "-"]
        cells.append(f"{max(r.seconds for r in of_test):.1f}")
        lines.append(f"| {' | '.join(cells)} |")
    return HEAD + "\n".join(lines) + "\n"


HEAD = """# The statistical tests on other seeds, with wide lanes and without

Made by `make study-seeds` (`python -m tests.studies.seeds`; `SEEDS='--group quick --most 5'` asks for less), which
moves every random stream of a test and of the package by BAYESMEMBRANE_TEST_SEED = 1, 2, ... Without lanes, numba and
OpenBLAS compute as on the oldest processor of the kind. Runs: how many seeds were tried so far; the study goes on
from there. A dash: none failed. Seconds: the longest run, on a shared machine.

| group | test | runs, wide lanes | failed seeds | runs, lanes off | failed seeds | seconds |
|---|---|---|---|---|---|---|
"""


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--group", choices=GROUPS, action="append", help="only this one; may be repeated")
    parser.add_argument("--most", type=int, help="seeds at most")
    asked = parser.parse_args()
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    for group in asked.group or GROUPS:
        for seed in range(1, min(GROUPS[group][0], asked.most or GROUPS[group][0]) + 1):
            for lanes in LANES:
                if any((r.group, r.seed, r.lanes) == (group, seed, lanes) for r in stored(RESULTS)):
                    continue
                rows = run(group, seed, lanes)
                text = "".join(json.dumps(asdict(r)) + "\n" for r in rows)
                with RESULTS.open("a", encoding="utf-8") as file:
                    file.write(text)
                lost = [r.test for r in rows if r.outcome == "failed"]
                print(f"{group}, seed {seed}, lanes {lanes}: {len(rows)} tests, failed: {lost or 'none'}", flush=True)
                PAGE.write_text(page(stored(RESULTS)), encoding="utf-8")


if __name__ == "__main__":
    main()

"""`make study-seeds`: the statistical tests of the suite on many seeds, with wide SIMD lanes and without.

One process of pytest for each group of files and arithmetic, which imports and compiles once for `ROUND` seeds; test
modules are imported anew for each, as they may draw when they are made. One line of JSON a test under
reports/study-seeds/, as soon as its seed is done. What stands there is skipped, so that the study can be interrupted
and goes on where it was. Writes docs/studies/seeds.md. Seeds enter by the environment (`tests/seeds.py`).

Without lanes means: numba compiles for the oldest processor of this kind (two lanes, no fused operations), and so does
OpenBLAS choose its kernels. It is what another machine does to the last digits.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass, field
from pathlib import Path

import pytest

from tests.seeds import NAME

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "reports" / "study-seeds" / "results.jsonl"
PAGE = ROOT / "docs" / "studies" / "seeds.md"
LANES = {
    "wide": {},
    "off": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "OPENBLAS_CORETYPE": "NEHALEM"},
}
ROUND = 10  # seeds of one process
# Files by what a run of theirs takes, and for how many seeds each group is run.
GROUPS: dict[str, tuple[int, tuple[str, ...]]] = {
    "quick": (
        50,
        (
            "tests/comparison/test_layers.py",
            "tests/comparison/test_prior_widths.py",
            "tests/diagnosis/detection/test_scores.py",
        ),
    ),
    "noise": (50, ("tests/physics/noise/test_noise.py",)),
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


def missing(group: str, lanes: str, most: int | None, rows: Iterable[Row]) -> list[int]:
    """Seeds, from 1 on, of which ``rows`` say nothing."""
    done = {r.seed for r in rows if (r.group, r.lanes) == (group, lanes)}
    return [s for s in range(1, min(GROUPS[group][0], most or GROUPS[group][0]) + 1) if s not in done]


def run(group: str, seeds: Sequence[int], lanes: str) -> None:
    """The tests of a group in a process of their own, whose arithmetic is settled when it begins.

    Raises CalledProcessError if pytest could not run them.
    """
    words = ["--within", lanes, "--group", group, "--seeds", ",".join(map(str, seeds))]
    environment = {**os.environ, **LANES[lanes]}
    subprocess.run([sys.executable, "-m", "tests.studies.seeds", *words], cwd=ROOT, env=environment, check=True)


def within(group: str, seeds: Sequence[int], lanes: str) -> None:
    """The tests of a group in this process, seed by seed; rows are stored as soon as a seed is done.

    Raises RuntimeError if pytest could not run them.
    """
    files = [f for f in GROUPS[group][1] if (ROOT / f).exists()]
    for seed in seeds:
        os.environ[NAME] = str(seed)
        for name in [n for n in sys.modules if n.startswith("tests.") and n not in KEPT]:
            del sys.modules[name]
        heard, begun = Heard(), time.process_time()
        with Path(os.devnull).open("w", encoding="utf-8") as nowhere, redirect_stdout(nowhere):
            code = pytest.main(["-n0", "-q", "--tb=no", "-p", "no:cacheprovider", *files], plugins=[heard])
        if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
            raise RuntimeError(f"pytest ended with {code!r}")
        rows = [
            Row(group, seed, lanes, _name(node), heard.outcomes[node], round(heard.seconds[node], 3))
            for node in heard.outcomes
        ]
        with RESULTS.open("a", encoding="utf-8") as file:
            file.write("".join(json.dumps(asdict(r)) + "\n" for r in rows))
        lost = [r.test for r in rows if r.outcome == "failed"]
        spent = time.process_time() - begun
        print(
            f"{group}, seed {seed}, lanes {lanes}: {len(rows)} tests in {spent:.0f} s of a processor, "
            f"failed: {lost or 'none'}",
            flush=True,
        )


KEPT = ("tests.seeds", "tests.studies", "tests.studies.seeds")
"""What is not imported anew: `tests.seeds` keeps the generator as it was before it was moved."""


@dataclass
class Heard:
    """What pytest says of each test, by its node."""

    outcomes: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Of its set-up, its call and its end: the worst."""
        node = report.nodeid
        self.seconds[node] += report.duration
        before = self.outcomes.get(node, "passed")
        self.outcomes[node] = before if report.passed or before == "failed" else report.outcome


def _name(node: str) -> str:
    """tests/a/b.py::c as tests.a.b::c."""
    path, _, rest = node.partition("::")
    return f"{path.removesuffix('.py').replace('/', '.')}::{rest}"


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
    parser.add_argument("--within", choices=LANES, help=argparse.SUPPRESS)
    parser.add_argument("--seeds", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    if asked.within:
        within(asked.group[0], [int(s) for s in asked.seeds.split(",")], asked.within)
        return
    for group in asked.group or GROUPS:
        # In turn, so that both arithmetics have as many seeds whenever it ends.
        while any((left := {lanes: missing(group, lanes, asked.most, stored(RESULTS)) for lanes in LANES}).values()):
            for lanes, seeds in left.items():
                if seeds:
                    run(group, seeds[:ROUND], lanes)
                    PAGE.write_text(page(stored(RESULTS)), encoding="utf-8")


if __name__ == "__main__":
    main()

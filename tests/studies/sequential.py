"""Do proposed tests end the doubt: ambiguous answers, the test that each proposes made, and all of it diagnosed again.

`python -m tests.studies.sequential --count 60` goes through the single effects, pairs and triples of the calibration
half of `make study-reliability`. Where the answer is ambiguous, or more explanations share it than can be told, the
first proposed motion of the same film on the same rig is made by the generator, on the film that remembers, read behind
what there is, and diagnosed with it; or a blank run of the generator's frame is read beside it. Twice at most. One line
of JSON a case, so that the study goes on where it was; docs/studies/sequential.md is its table.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.next_test.further import Kind, OnFilm, other_motions
from bayesmembrane.words.diagnosis import document
from tests.generator.datasets import Dataset
from tests.generator.distortions import Active, give, response
from tests.generator.film import NoSolutionError
from tests.generator.noise import Noise
from tests.generator.protocols import Path as Way
from tests.studies.reliability import diagnosed
from tests.studies.reliability_plan import HALVES, SEED, Case, measured, plan
from tests.studies.reliability_rows import Row, answer_row, inside, right_name, spoken_truth, truth_row
from tests.studies.results import stored

RESULTS = Path(__file__).parents[2] / "reports" / "study-sequential" / "results.jsonl"
GROUPS = ("single", "pair", "triple")
TESTS = 2
READINGS = 480
"""Of a further test, at most: evenly among those that it was simulated with."""
SAME_RIG = (Kind.UNLOADING, Kind.CYCLES, Kind.FASTER, Kind.HOLD)
FRAME = "machine_compliance"
BLANK_READINGS = 60
TRAVEL_SD = 1e-6
"""m, of the crosshead's position in a blank run."""
CLEAR = 3.0
"""Standard deviations from which on a blank run says that a frame yields."""


@dataclass(frozen=True, eq=False)
class Film:
    """What was done to a film so far, and what is in it; ``blank_run``: what a run without it showed of the frame."""

    data: Dataset
    path: Way
    blank_run: np.ndarray | None = None

    def measurement(self, rng: np.random.Generator) -> Measurement:
        """All of it as an instrument writes it."""
        noise = Noise(**self.data.truth["noise"])
        force = response(self.data.film, self.path, self._at_work()) + noise.draw(rng, self.path.deflection)
        if not np.all(np.isfinite(force)):
            raise NoSolutionError("the film has no force somewhere on the way of the further test")
        told = replace(
            self.data,
            time_s=self.path.time,
            deflection_mm=1e3 * self.path.deflection,
            force_N=noise.rounded(force),
        )
        with tempfile.TemporaryDirectory() as folder:
            return replace(read_measurement(*told.write(Path(folder))), blank_run=self.blank_run)

    def with_blank_run(self, rng: np.random.Generator) -> Film:
        """The same after the frame was pulled without a film, up and down, as hard as the film pulled it."""
        most = 1.05 * float(np.max(self.data.force_N))
        force = most * np.concatenate([np.linspace(0, 1, BLANK_READINGS // 2), np.linspace(1, 0, BLANK_READINGS // 2)])
        yields = self.data.at_work.get(FRAME)
        travel = np.zeros_like(force) if yields is None else give(yields, force)
        noise = Noise(**self.data.truth["noise"])
        travel = travel + TRAVEL_SD * rng.standard_normal(force.size)
        read = force + noise.sd * rng.standard_normal(force.size)
        return replace(self, blank_run=np.column_stack([travel, read]))

    def _at_work(self) -> dict[str, Active]:
        """The effects, as large on the first test as they were: laws that end with the way know the longer one."""
        first, out = self.data.path, {}
        law, size = self.data.film, first.time.size
        for name, active in self.data.at_work.items():
            traces = [response(law, p, {name: active}) - response(law, p, {}) for p in (first, self.path)]
            now = float(np.linalg.norm(traces[1][:size]))
            out[name] = active if now == 0.0 else _scaled(active, float(np.linalg.norm(traces[0])) / now)
        return out

    def moved(self, trial: OnFilm) -> Film:
        """The same after a further test."""
        motion, done = trial.measurement.path, self.path
        new = motion.deflection[done.time.size :], motion.time
        assert new[1] is not None
        where, when = new[0], new[1][done.time.size :]
        keep = _kept(where, when)
        where, when = where[keep], when[keep] - float(motion.time[done.time.size - 1]) + float(done.time[-1])  # type: ignore[index]
        steps = np.diff(where, prepend=done.deflection[-1])
        last = np.maximum.accumulate(np.where(steps != 0, np.arange(steps.size), -1))
        # Where the disc stands still it belongs to the leg before, and has its speed.
        up = np.where(last >= 0, steps[last] > 0, done.leg[-1] % 2 == 0)
        leg = int(done.leg[-1]) + np.cumsum(np.diff(up, prepend=bool(done.leg[-1] % 2 == 0)))
        speed = np.abs(steps) / np.diff(when, prepend=done.time[-1])
        speed = np.where(last >= 0, speed[last], done.speed[-1])
        peak = np.array([max(np.max(where[leg == n]), where[leg == n][0]) for n in leg])
        joined = [np.concatenate(pair) for pair in zip(_arrays(done), (when, where, leg, speed, peak), strict=True)]
        return replace(self, path=Way(*joined))


def _scaled(active: Active, factor: float) -> Active:
    return replace(active, size=active.size * factor)


def _arrays(path: Way) -> tuple[np.ndarray, ...]:
    return path.time, path.deflection, path.leg, path.speed, path.peak


def _kept(where: np.ndarray, when: np.ndarray) -> np.ndarray:
    """Places of `READINGS` of these deflections, turning points among them, each later than the one before."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(where)))) + 1
    even = np.linspace(0, where.size - 1, min(READINGS, where.size)).round().astype(int)
    keep = np.unique(np.concatenate([even, turns]))
    later = np.diff(when[keep], prepend=-np.inf) > 1e-3 * np.median(np.diff(when))
    return np.asarray(keep[later])


def run_case(case: Case) -> Row:
    """The answers to one, two and three tests, as long as they are ambiguous."""
    try:
        data = measured(case)
    except NoSolutionError as error:
        return {"key": case.key, "number": case.number, "skipped": str(error)}
    row: Row = {"key": case.key, "number": case.number, "group": case.group, "answers": [], "tests": []}
    row |= truth_row(data.truth, data.identifiable)
    film = Film(data, data.path)
    with tempfile.TemporaryDirectory() as folder:
        measurement = read_measurement(*data.write(Path(folder)))
    for turn in range(TESTS + 1):
        try:
            found = diagnosed(measurement, None)
        except BayesmembraneError as error:
            return row | {"error": str(error)}
        answer = answer_row(document(found))
        row["answers"].append({k: answer[k] for k in ("verdict", "effects", "coverage", "sentence")})
        row["answers"][-1]["shown"] = shown(found)
        trial = proposed(found, measurement) if turn < TESTS else None
        if trial is None:
            break
        row["tests"].append(trial.value if isinstance(trial, Kind) else trial.test.kind.value)
        rng = np.random.default_rng([case.seed, 91, turn])
        if isinstance(trial, Kind):
            film = film.with_blank_run(rng)
            measurement = replace(measurement, blank_run=film.blank_run)
            continue
        try:
            film = film.moved(trial)
            measurement = film.measurement(rng)
        except NoSolutionError as error:
            return row | {"error": str(error)}
    return row


def proposed(found: Diagnosis, measurement: Measurement) -> OnFilm | Kind | None:
    """The best proposed motion of the same film on the same rig, with a clock, or a blank run."""
    if measurement.time is None:
        return None
    trials = {t.test: t for t in other_motions(measurement)}
    chosen = [e.test for e in found.experiments if e.test.kind in (*SAME_RIG, Kind.BLANK)]
    if not chosen:
        return None
    return Kind.BLANK if chosen[0].kind is Kind.BLANK else trials[chosen[0]]


def shown(found: Diagnosis) -> list[str]:
    """Effects that a blank run shows by itself."""
    known = [e for e in found.null.hypothesis.effects if e.known]
    return [e.name for e in known if e.size.prior.mean_sd[0] > CLEAR * e.size.prior.mean_sd[1]]


def judged(row: Row) -> list[str]:
    """Of each answer: "right", "wrong", "ambiguous with the truth", "ambiguous without it", or its verdict.

    What a blank run shows belongs to the answer.
    """
    out = []
    for answer in row["answers"]:
        known = answer.get("shown", [])
        one = row | answer | {"truth": [e for e in row["truth"] if e not in known]}
        kind = answer["verdict"]
        if kind == "named":
            kind = "right" if right_name(one) else "wrong"
        elif kind == "adequate" and known:
            kind = "wrong" if one["truth"] else "right"
        elif kind == "ambiguous":
            kind += " with the truth" if inside(one) else " without it"
        out.append(kind)
    return out


def table(rows: list[Row], command: str) -> str:
    """Markdown: what became of ambiguous answers after one and after two proposed tests."""
    asked = [r for r in rows if r.get("answers")]
    doubt = [r for r in asked if r["tests"] or r["answers"][0]["verdict"] == "ambiguous"]
    tested = [r for r in doubt if r["tests"]]
    lines = [
        "# Do proposed tests end the doubt",
        "",
        f"`{command}`: {len(asked)} measurements with one to three effects of the library, no energy "
        f"declared, {len(doubt)} answers ambiguous, or of more sets than can be told; for {len(tested)} of them a "
        "motion of the same film is proposed, made by the generator and diagnosed with what was there, or a blank run "
        f"of the frame, {TESTS} at most; what that shows belongs to the answer. An effect whose own trace is below "
        "3 standard deviations of the noise in the first test is no truth.",
        "",
        "| after | right | wrong | ambiguous with the truth | ambiguous without it | other |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for turn in range(TESTS + 1):
        last = [judged(r)[min(turn, len(r["answers"]) - 1)] for r in tested]
        named = ("right", "wrong", "ambiguous with the truth", "ambiguous without it")
        counts = [last.count(k) for k in named]
        after = ("the first test", "one proposed test", "two proposed tests")[turn]
        lines.append(f"| {after} | {' | '.join(map(str, counts))} | {len(last) - sum(counts)} |")
    lines += ["", "| case | truth, with own ratios | answers | proposed |", "| --- | --- | --- | --- |"]
    for r in doubt:
        lines.append(f"| {r['number']} | {spoken_truth(r)} | {', '.join(judged(r))} | {', '.join(r['tests'])} |")
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Run, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--half", choices=tuple(HALVES), default="calibration")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument(
        "--count", type=int, default=100, help="cases of the plan; those without an effect are left out"
    )
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--table", type=Path, default=None)
    asked = parser.parse_args(arguments)
    cases = [c for c in islice(plan(asked.half, SEED), asked.first, asked.first + asked.count) if c.group in GROUPS]
    asked.results.parent.mkdir(parents=True, exist_ok=True)
    have: dict[str, Any] = stored(asked.results)
    with asked.results.open("a", encoding="utf-8") as file:
        for case in cases:
            if case.key not in have:
                have[case.key] = run_case(case)
                file.write(json.dumps(have[case.key]) + "\n")
                file.flush()
                print(
                    case.number,
                    case.kind,
                    have[case.key].get("tests"),
                    judged(have[case.key]) if "answers" in have[case.key] else "",
                    flush=True,
                )
    rows = [have[c.key] for c in cases if c.key in have]
    text = table(
        rows, f"python -m tests.studies.sequential --half {asked.half} --first {asked.first} --count {asked.count}"
    )
    if asked.table is not None:
        asked.table.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

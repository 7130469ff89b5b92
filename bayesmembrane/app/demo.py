"""The demonstration: a list of verbs on the data that ship, each storing its answer, and a page about what lies there.

Five materials on both ranges of the paper are fitted, sampled and compared, valleys are followed, loops are closed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.app import analyses
from bayesmembrane.app.analyses import Work
from bayesmembrane.app.answers import asked, kept
from bayesmembrane.app.terminal import note
from bayesmembrane.calibration.beside_paper import compare_with_paper, paper_break_points
from bayesmembrane.calibration.run import load_run
from bayesmembrane.comparison.compare import Range
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.published import read_published_table
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.ground.jobs import Submit, Tell, silent, workers
from bayesmembrane.ground.plain import plain
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.ground.stored import answer, answer_folders, store
from bayesmembrane.physics.hypothesis import hypothesis

TITLE = "What the reconstructed force curve of a 50 um silicone film says about five materials"
RANGES = ("OP1", "OP2")
VALLEYS = ("yeoh", "mooney_rivlin", "gent")
OPEN = ""
"""No energy is declared."""
# What the loop is closed on: the paper's curve over both of its ranges and a measured cycle, from nothing but the data,
# and a cyclic curve with something hidden in it.
LOOPS = (
    *((OPEN, "elastosil_50um_first_loading"), (OPEN, "elastosil_50um_op1")),
    *((OPEN, "vhb4910_0d03"), ("yeoh", "synthetic_cyclic")),
)
LONGEST = "synthetic_cyclic"
"""The loop that takes most of the time; it is begun first, so that nobody waits for it alone."""
LOOP_ESS = 400.0
# The same tape at other rates, which no fit sees. Its strips differ by about five per cent: loading legs of nine pairs
# at one rate are 3.3 kPa apart (root mean square; docs/studies/vhb.md), thus 2.3 kPa each, of some 45 kPa.
PREDICTED = {"vhb4910_0d03": ("vhb4910_0d01", "vhb4910_0d05")}
SCATTER = 0.05


Verb = Callable[[Work], None]
Verbs = dict[str, Verb]


def order() -> list[tuple[str, str]]:
    """Every material on every range: those with the most parameters first, on the longer range, since they take longest
    and valleys and comparisons wait for all of them; two materials at a time, so that no solver is compiled twice.
    """
    names = sorted(ordinary_materials(), key=lambda name: -len(ordinary_materials()[name].field_names()))
    pairs = [names[i : i + 2] for i in range(0, len(names), 2)]
    return [(name, range_name) for pair in pairs for range_name in reversed(RANGES) for name in pair]


def verbs() -> tuple[Verbs, Verbs, Verbs]:
    """The verbs by the label that their progress has: calibrations and the reconstruction; loops, which need none of
    these, the longest first; and valleys, which need the calibrations.
    """
    runs: Verbs = {f"{name}, {where}": partial(calibrate, name, where) for name, where in order()}
    loops = sorted(LOOPS, key=lambda loop: loop[1] != LONGEST)
    closed: Verbs = {f"loop, {stem}": partial(close_loop, name, stem) for name, stem in loops}
    valleys: Verbs = {f"valleys, {name}": partial(follow_valleys, name) for name in VALLEYS}
    return {**runs, "reconstruct": reconstruct}, closed, valleys


def demo(page_folder: Path, work: Work) -> dict[str, Any]:
    """Run it all on the cores there are, and write the page to ``page_folder``.

    Returns the JSON answer: where the page lies, the runs, and the seconds it took. Runs of an earlier demonstration
    with the same data, settings and code are read back. Raises `StorageError` if a folder cannot be written.
    """
    began, folder = time.perf_counter(), _folder(work)
    runs, loops, valleys = verbs()
    with workers(work.tell) as submit:

        def begin(some: Verbs) -> list[Future[None]]:
            return [submit(_done, label, verb, replace(work, tell=silent)) for label, verb in some.items()]

        # One queue, so that no core waits: the longest first, and last the comparisons, which are many and short.
        longest = next(iter(loops), "")
        first = begin({label: loops[label] for label in loops if label == longest})
        calibrated = begin(runs)
        others = begin({label: loops[label] for label in loops if label != longest})
        _wait(calibrated)
        others += begin(valleys)
        compare(work, submit)
        _wait(first + others)
        from bayesmembrane.report.page import write_report  # on demand: what draws takes 30 MB, and work needs none

        page = write_report([folder], page_folder, TITLE, note, submit)
    return {
        "report": str(page),
        "verdicts": [_verdict(found) for found in _answers(folder, "loop")],
        "runs": [str(folder / run_of(name, r)) for name in ordinary_materials() for r in RANGES],
        "suspect_rows": [row for found in _answers(folder, "reconstruction") for row in found["suspect_rows"]],
        "stored": str(folder),
        "seconds": time.perf_counter() - began,
    }


def _wait(jobs: Sequence[Future[None]]) -> None:
    for job in jobs:
        job.result()


def _done(label: str, verb: Verb, work: Work, tell: Tell) -> None:
    """A verb in a process of the pool, told of under its own label."""
    tell(label, "working")
    verb(replace(work, tell=lambda _, now: tell(label, now)))
    tell(label, "")


# ---- the verbs -------------------------------------------------------------------------------------------------------


def reconstruct(work: Work) -> None:
    """The curve behind the published losses, and those losses beside it."""
    found, printed = analyses.reconstruct(work), read_published_table()
    assert found.folder is not None
    store(found.folder, "published", printed, plain(printed))


def calibrate(name: str, range_name: str, work: Work) -> None:
    """Fit one material on one range, lay that beside the paper, and sample it."""
    claim, measurement = hypothesis(name), shipped_measurement(range_name)
    published = [list(row.values) for row in read_published_table().rows if row.material == name]
    found = analyses.fit(measurement, claim, work, starts=published)
    (beside,) = compare_with_paper(measurement, [found.result], range_name, solve=work.solve)
    what = asked("paper", compare_with_paper, [measurement], [claim], {"seed": work.seed, "range": range_name})
    kept("beside_paper", beside, plain(beside), what, work.out)
    run = analyses.sample(
        measurement,
        claim,
        work,
        name=run_of(name, range_name),
        whole=shipped_measurement(RANGES[-1]),
        breaks=paper_break_points() if range_name == RANGES[-1] else (),
    )
    if run.result.interrupted:
        raise KeyboardInterrupt


def follow_valleys(name: str, work: Work) -> None:
    """The valleys of one material on both ranges, with the draws of its runs."""
    draws = [load_run(_folder(work) / run_of(name, r)).draws() for r in RANGES]
    analyses.valleys_with_draws([shipped_measurement(r) for r in RANGES], hypothesis(name), work, draws)


def close_loop(name: str, stem: str, work: Work) -> None:
    """The loop on one curve that ships; its runs lie deeper, for the page shows them with their loop."""
    measurement, *others = (_curve(s) for s in (stem, *PREDICTED.get(stem, ())))
    well = replace(work, ess=min(work.ess, LOOP_ESS))
    question = Question(hypothesis(name or VALLEYS[0]), declared=name != OPEN)
    runs = _folder(work) / "loops"
    how = replace(analyses.ADAPTING, out=runs, predict=tuple(others), scatter=SCATTER)
    analyses.loop(measurement, question, well, how)


def _curve(stem: str) -> Measurement:
    return read_measurement(shipped(f"{stem}.csv"), shipped(f"{stem}.toml"))


def compare(work: Work, submit: Submit) -> None:
    """The five materials on each range of the paper, from the runs that are there."""
    ranges = {name: shipped_ranges()[name] for name in RANGES}
    analyses.compare(ranges, [hypothesis(name) for name in ordinary_materials()], work, submit=submit)


def run_of(name: str, range_name: str) -> str:
    """The name of a material's run."""
    return f"elastosil_50um_{range_name.lower()}_{name}"


def _folder(work: Work) -> Path:
    assert work.out is not None
    return work.out


# ---- the data --------------------------------------------------------------------------------------------------------


def shipped_measurement(range_name: str) -> Measurement:
    """The reconstructed curve of one range of the paper; the film was tested to the end of the longer one."""
    both = [_read(name) for name in RANGES]
    chosen = both[RANGES.index(range_name)]
    return replace(chosen, full_range=max(float(m.deflection.max()) for m in both))


def shipped_ranges() -> dict[str, Range]:
    """Both ranges of the paper, and all their points together; of the shorter one the rest is to be predicted."""
    short, long, both = shipped_measurement("OP1"), shipped_measurement("OP2"), _read("first_loading")
    # Of both, the points of the shorter range and those beyond it: their joint covariance says what follows.
    end = float(short.deflection.max())
    used = np.isclose(both.deflection[:, None], short.deflection, rtol=1e-9).any(axis=1)
    return {
        "OP1": Range(short, both.select(used | (both.deflection > end * (1 + 1e-9)))),
        "OP2": Range(long),
        "OP1 and OP2": Range(both),
    }


def _read(range_name: str) -> Measurement:
    stem = f"elastosil_50um_{range_name.lower()}"
    return read_measurement(shipped(f"{stem}.csv"), shipped(f"{stem}.toml"))


def _answers(folder: Path, kind: str) -> list[dict[str, Any]]:
    """The stored answers of one kind."""
    found = [answer(path, kind) for path in answer_folders(folder)]
    return [document for document in found if document is not None]


def _verdict(document: dict[str, Any]) -> dict[str, str]:
    return {"verdict": document["rounds"][0]["verdict"], "sentence": document["sentence"]}

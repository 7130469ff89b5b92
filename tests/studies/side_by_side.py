"""`make study-beside`: the same posteriors by what a user would pick instead, and the same film by another program.

    python -m tests.studies.side_by_side [--materials gent,yeoh] [--seeds 2] [--table docs/studies/side_by_side.md]

On the measurement OP1 that ships, noise inferred, each sampler as its own documentation starts it; one thread, CPU
seconds, imports and kernels warm. One line of JSON a run, written at once; runs that stand there are skipped.
`side_by_side.txt` lists what has to be installed, in an environment of its own.
"""

from __future__ import annotations

import argparse
import os
import signal
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import bayesmembrane as bm
from bayesmembrane.app.demo import shipped_measurement
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.mechanics import request
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from tests.benchmarks.bench import BATCH, microseconds
from tests.benchmarks.in_use import metered
from tests.statistics.cubature import log_evidence
from tests.studies.results import Row, append, stored, until
from tests.studies.side_page import FELUPE, REFERENCE, page
from tests.studies.side_samplers import SAMPLERS

SEED, REPEATS = 20261124, 15
MOST_SECONDS = 240.0  # of a run
CELLS = {1: 240, 2: 120, 3: 40}  # of the cubature, along each parameter of the curve
THINNER = 4  # times, at the same G d: less bends, and the membrane is the same
# N/m and -, near the posterior of OP1.
FILMS = {"neo_hookean": (7.5,), "gent": (5.312, 17.42), "yeoh": (8.840838, -0.6303258, 0.05632747)}
Case = tuple[str, str, int]


@cache
def posterior(material: str) -> Posterior:
    return Posterior(bm.hypothesis(material), shipped_measurement("OP1"))


def plan(names: Sequence[str], samplers: Sequence[str], seeds: int) -> list[Case]:
    """All of one seed before the next, so that an interrupted study has every sampler."""
    films = [(m, FELUPE, 0) for m in FILMS]
    exact = [(m, REFERENCE, 0) for m in names if posterior(m).hypothesis.curve_size in CELLS]
    return films + exact + [(m, s, SEED + i) for i in range(seeds) for m in names for s in samplers]


def key(case: Case) -> str:
    return "|".join(map(str, case))


def measured(case: Case) -> Row:
    """One run; what a package raises is a result, too."""
    material, what, seed = case
    row: Row = {"key": key(case), "material": material, "sampler": what, "seed": seed}
    with warnings.catch_warnings(), ended_after(MOST_SECONDS):
        warnings.simplefilter("ignore")
        try:
            row |= film(material) if what == FELUPE else exactly(material) if what == REFERENCE else drawn(*case)
        except Exception as error:  # whatever others' packages raise
            row["error"] = f"{type(error).__name__}: {error}"[:300]
    return row


@contextmanager
def ended_after(seconds: float) -> Iterator[None]:
    """Raise `TimeoutError` in what takes more CPU seconds."""

    def end(*_: Any) -> None:
        raise TimeoutError(f"stopped after {seconds:g} CPU s")

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def drawn(material: str, sampler: str, seed: int) -> Row:
    """One sampler: films asked for, CPU seconds of all and of the density alone, and what came out."""
    begun = time.process_time()
    with metered(Posterior, "evaluate") as density:
        found = SAMPLERS[sampler](posterior(material), seed)
    films = density.films if found.evaluations is None else found.evaluations
    row: Row = {"evaluations": films, "seconds": time.process_time() - begun, "density": density.seconds}
    if len(found.x):
        row |= {"effective": float(found.effective), "mean": found.mean.tolist(), "sd": found.sd.tolist()}
    if found.log_evidence is not None:
        row |= dict(zip(("log_evidence", "log_evidence_sd"), map(float, found.log_evidence), strict=True))
    return row


def exactly(material: str) -> Row:
    p = posterior(material)
    cells = CELLS[p.hypothesis.curve_size]
    return {"log_evidence": log_evidence(p, cells), "coarse": log_evidence(p, cells * 3 // 4)}


def film(material: str) -> Row:
    """One curve at the readings of OP1 by FElupe, and by this package: one alone, and in a batch."""
    from tests.studies.side_felupe import lifted

    m, c = shipped_measurement("OP1"), np.array(FILMS[material])
    films = c * np.exp(0.02 * np.random.default_rng(SEED).standard_normal((BATCH, len(c))))
    one, many = _question(material, c[None]), _question(material, films)
    own = ritz.solve(one).force[0]
    rims, lifts = (1e3 * m.rig.inner_radius, 1e3 * m.rig.outer_radius), 1e3 * m.deflection
    theirs = lifted(material, c, 1e3 * m.specimen.thickness, rims, lifts)
    thinner = lifted(material, c, 1e3 * m.specimen.thickness / THINNER, rims, lifts)
    return {
        "seconds": theirs.seconds,
        "increments": theirs.increments,
        "alone": microseconds(lambda: ritz.solve(one), REPEATS),
        "batch": microseconds(lambda: ritz.solve(many), REPEATS) / BATCH,
        "apart": (theirs.force / own - 1).tolist(),
        "thinner": (thinner.force / own - 1).tolist(),
    }


def _question(material: str, films: Array) -> Any:
    m = shipped_measurement("OP1")
    return request(materials()[material], films, m.deflection, m.rig.inner_radius, m.rig.outer_radius)


def warmed() -> None:
    """Import what is compared with, compile what all of them use, and keep JAX to one thread."""
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import nautilus  # noqa: F401
        import ultranest  # noqa: F401

        from tests.studies import side_felupe, side_nuts  # noqa: F401
    for material in ("gent", "mooney_rivlin", "yeoh"):
        bm.sample(shipped_measurement("OP1"), bm.hypothesis(material), ess=50.0, seed=1)


def main() -> None:
    """What is not stored yet is run; then the page is written."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--materials", default="gent,yeoh", help="names, with commas")
    parser.add_argument("--samplers", default=",".join(SAMPLERS), help="names, with commas")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin nothing after this time")
    parser.add_argument("--results", type=Path, default=Path("chains/side_by_side.jsonl"), help="JSON lines, one a run")
    parser.add_argument("--table", type=Path, help="Markdown")
    options = parser.parse_args()
    cases = plan(options.materials.split(","), options.samplers.split(","), options.seeds)
    done = stored(options.results)
    append(until(options.seconds, [c for c in cases if key(c) not in done], measured, 1, warmed), options.results, told)
    if options.table is not None:
        options.table.write_text(page(list(stored(options.results).values()), list(SAMPLERS)), encoding="utf-8")


def told(r: Row) -> str:
    shown = ("effective", "evaluations", "seconds", "density", "log_evidence", "log_evidence_sd")
    return f"{r['key']}: " + ", ".join(f"{k} {r[k]:.5g}" for k in shown if k in r) + r.get("error", "")


if __name__ == "__main__":
    main()

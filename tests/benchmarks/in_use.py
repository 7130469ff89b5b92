"""`python -m tests.benchmarks.in_use`: what a curve costs where it is used, beside what it costs alone.

On the measurement OP1 that ships (or ``--curve`` and ``--specimen``), for each material:

    sample      microseconds per draw of which the posterior is evaluated while 1000 effective draws are made
    bare        microseconds per curve of the solver at the measured points, 64 draws of that posterior in a batch
    diagnose    microseconds per film of which the curve is asked while the residual of this energy is diagnosed,
                most of them with slopes
    of them     microseconds per curve of the solver of just these films, of whatever energy, 64 in a batch, alone

and the ratios of the first to the second and of the third to the fourth: prior, likelihood, states that only show
convexity, effects, sensitivities and films that are asked for one by one are in the one and not in the other. CPU times
of one thread, kernels compiled. ``--diagnose`` is slow (minutes); without it these columns are left out. ``--json``
prints the same as JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import bayesmembrane as bm
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import materials, ordinary_materials
from bayesmembrane.physics import in_step
from bayesmembrane.physics.forward import Forward, Prediction
from bayesmembrane.physics.mechanics import request
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from tests.benchmarks.bench import BATCH, microseconds

SEED, REPEATS = 20261122, 15
DATA = Path(__file__).parents[2] / "data"


@dataclass
class Meter:
    """What calls of one method took: CPU seconds, and films that were asked for, ``calls`` as (self, x (B, k))."""

    seconds: float = 0.0
    calls: list[tuple[Any, Array]] = field(default_factory=list)

    @property
    def films(self) -> int:
        return sum(len(x) for _, x in self.calls)

    @property
    def each(self) -> float:
        """Microseconds per film."""
        return 1e6 * self.seconds / max(self.films, 1)


@contextmanager
def metered(owner: type, name: str) -> Iterator[Meter]:
    """Meter all calls of a method whose first argument is a batch, x (B, k)."""
    meter, method = Meter(), getattr(owner, name)

    def timed(self: Any, x: Array, *more: Any, **options: Any) -> Any:
        begun = time.thread_time()
        found = method(self, x, *more, **options)
        meter.seconds += time.thread_time() - begun
        meter.calls.append((self, np.atleast_2d(x)))
        return found

    with patch.object(owner, name, timed):
        yield meter


@contextmanager
def metered_in_step(meter: Meter) -> Iterator[None]:
    """Meter films that searches ask for side by side, too: they do not go through `Forward` one by one."""
    together = in_step._together

    def timed(asked: Sequence[in_step.Asked], sensitivities: bool) -> list[Prediction]:
        begun = time.thread_time()
        found = together(asked, sensitivities)
        meter.seconds += time.thread_time() - begun
        meter.calls.extend(asked)
        return found

    with patch.object(in_step, "_together", timed):
        yield


def alone(meter: Meter, measurement: Measurement) -> float:
    """Microseconds per curve of the solver, of the films that `Forward` was asked for: `REPEATS` batches per energy."""
    asked: dict[str, list[Array]] = {}
    for forward, x in meter.calls:
        films, prestretch = forward.hypothesis.films(x), forward.composition.prestretch(forward.effects(x))
        rows = np.column_stack([films, np.broadcast_to(prestretch, len(x))])
        asked.setdefault(forward.hypothesis.material.name, []).append(rows)
    rng, rig, total = np.random.default_rng(SEED), measurement.rig, 0.0
    for name, parts in asked.items():
        rows = np.concatenate(parts)
        for _ in range(REPEATS):
            some = rows[rng.choice(len(rows), BATCH)]
            question = request(
                materials()[name],
                some[:, :-1],
                measurement.deflection,
                rig.inner_radius,
                rig.outer_radius,
                prestretch=some[:, -1],
            )
            total += len(rows) * microseconds(lambda question=question: ritz.solve(question), 3) / (BATCH * REPEATS)
    return total / meter.films


@dataclass(frozen=True)
class Row:
    """One line of the table: microseconds, counts, and CPU seconds of the whole verb."""

    material: str
    bare: float
    sample: float
    evaluations: int
    sample_seconds: float
    diagnose: float | None = None
    alone: float | None = None
    curves: int | None = None
    diagnose_seconds: float | None = None

    @property
    def ratios(self) -> tuple[float, float | None]:
        return self.sample / self.bare, None if not self.diagnose or not self.alone else self.diagnose / self.alone


def spent(work: Callable[[], Any]) -> tuple[Any, float]:
    begun = time.thread_time()
    return work(), time.thread_time() - begun


def measure(name: str, measurement: Measurement, diagnosing: bool) -> Row:
    """The row of one material, after everything has been compiled by a shorter run."""
    hypothesis = bm.hypothesis(name)
    bm.sample(measurement, hypothesis, ess=50.0, seed=SEED + 1)
    with metered(Posterior, "evaluate") as evaluated:
        run, seconds = spent(lambda: bm.sample(measurement, hypothesis, seed=SEED))
    draws = run.draws()
    rows = np.random.default_rng(SEED).choice(len(draws), BATCH)
    films = hypothesis.films(np.asarray(draws)[rows])
    rig = measurement.rig
    question = request(materials()[name], films, measurement.deflection, rig.inner_radius, rig.outer_radius)
    bare = microseconds(lambda: ritz.solve(question), REPEATS) / BATCH
    row = Row(name, bare, evaluated.each, evaluated.films, seconds)
    if not diagnosing:
        return row
    with metered(Forward, "__call__") as solved, metered_in_step(solved):
        _, seconds = spent(lambda: bm.diagnose(measurement, hypothesis, seed=SEED))
    return replace(
        row,
        diagnose=solved.each,
        alone=alone(solved, measurement),
        curves=solved.films,
        diagnose_seconds=seconds,
    )


def table(rows: list[Row]) -> str:
    """The rows as text."""
    head = f"{'material':14} {'bare us':>9} {'sample us':>10} {'ratio':>6} {'draws':>7} {'CPU s':>7}"
    lines = [f"{head} {'diagnose us':>12} {'of them us':>10} {'ratio':>6} {'films':>7} {'CPU s':>7}"]
    for r in rows:
        line = f"{r.material:14} {r.bare:9.1f} {r.sample:10.1f} {r.ratios[0]:6.1f} {r.evaluations:7d}"
        line += f" {r.sample_seconds:7.1f}"
        if r.diagnose is not None:
            line += f" {r.diagnose:12.1f} {r.alone:10.1f} {r.ratios[1]:6.1f} {r.curves:7d} {r.diagnose_seconds:7.1f}"
        lines.append(line)
    return "\n".join(lines)


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--curve", default=str(DATA / "elastosil_50um_op1.csv"))
    parser.add_argument("--specimen", default=str(DATA / "elastosil_50um_op1.toml"))
    parser.add_argument("--materials", default=",".join(ordinary_materials()), help="names, with commas")
    parser.add_argument("--diagnose", action="store_true", help="diagnose, too")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    options = parser.parse_args()
    measurement, rows = bm.read(options.curve, options.specimen), []
    for name in options.materials.split(","):
        print(f"{name} ...", file=sys.stderr, flush=True)
        rows.append(measure(name, measurement, options.diagnose))
    print(json.dumps([vars(row) for row in rows], indent=1) if options.json else table(rows))


if __name__ == "__main__":
    main()

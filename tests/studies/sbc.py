"""`make study-sbc`: are posteriors calibrated; docs/studies/sbc.md.

Simulation-based calibration: a truth from the prior, cut exactly as the posterior cuts it; readings from that truth
with forces of the other solver; the posterior of those readings. The rank of the truth among independent draws is
uniform if everything between prior and draws is right (S. Talts et al., arXiv:1804.06788; M. Modrák et al., Bayesian
Anal. 20 (2025) 461, for the log likelihood as a further quantity). Each replicate is a line of a JSON-lines file,
written when it is done; those that stand there are skipped. `--only gent --limit 20` asks for less; `--summary` prints
what is there.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.noise.base import force_scale
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.studies.sbc_table import RANKED, report

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "reports" / "study-sbc.jsonl"
SEED = 500_000
WALK = Settings(ess=250.0, chunk=100)
"""Of the slowest coordinate, so that `RANKED` draws are far enough apart to be independent."""
POINTS, FARTHEST = 14, 0.012  # m: short and mild, so that films of the whole prior get there
GIVEN = 4e-3  # noise that a measurement states, of a force of 1 N
BASELINES, VARIATIONS = 300, 100
SCALED = "noise.ln_sd"


@dataclass(frozen=True)
class Design:
    """What is calibrated: a hypothesis, whether the noise is stated, how many replicates there are to be.

    turns : whether the disc comes halfway back although nothing in the hypothesis remembers: no further, as which
        readings are slack follows from those of the film and not from the truth
    """

    name: str
    hypothesis: Hypothesis
    stated: bool = False
    replicates: int = VARIATIONS
    turns: bool = False


def designs() -> Iterator[Design]:
    """Each material's baseline, then its variations."""
    names = sorted(ordinary_materials(), key=lambda n: len(ordinary_materials()[n].field_names()))
    for name in names:
        yield Design(name, hypothesis(name), replicates=BASELINES)
    for name in names:
        plain = hypothesis(name)
        yield Design(f"{name}, noise stated", plain, stated=True)
        for mode in ("box", "elliptic", "none"):
            yield Design(f"{name}, convexity {mode}", hypothesis(name, convexity=mode))
        yield Design(f"{name}, zero offset", hypothesis(name, ["zero_offset"]))
        yield Design(f"{name}, viscoelastic", hypothesis(name, ["viscoelastic"]))
        yield Design(f"{name}, form error", hypothesis(name, (), "form"))
        yield Design(f"{name}, form error, halfway back", hypothesis(name, (), "form"), turns=True)


def readings(force: Array | None = None, sd: float | None = None, back: float = 0.0) -> Measurement:
    """The test that all replicates are of: one loading, and the part ``back`` of it back at a steady speed."""
    up = np.linspace(FARTHEST / POINTS, FARTHEST, POINTS)
    deflection = np.concatenate([up, up[-2::-1][: int(back * (POINTS - 1))]])
    moved = np.abs(np.diff(deflection, prepend=0.0))
    return Measurement(
        deflection,
        np.ones(deflection.size) if force is None else force,
        Annulus(0.010, 0.035),
        Specimen("simulated", 50e-6),
        time=np.cumsum(moved) / 1e-3,
        force_sd=None if sd is None else np.full(deflection.size, sd),
    )


def truth(posterior: Posterior, rng: np.random.Generator) -> Array:
    """(1, k) from the prior, cut to where the posterior is not zero: by rejection, hence exact."""
    while True:
        x = posterior.prior.draw(rng, 16)
        good = np.flatnonzero(np.isfinite(posterior.evaluate(x).log_posterior))
        if good.size:
            return np.asarray(x[good[:1]])


def replicate(design: Design, number: int) -> dict[str, Any]:
    """Ranks of one truth: of every coordinate, of the force at the end, and of the log likelihood."""
    rng = np.random.default_rng([SEED, number, *design.name.encode()])
    h = design.hypothesis
    blank = readings(sd=GIVEN if design.stated else None, back=1.0 if h.effects else 0.5 * design.turns)
    asked = Posterior(h, blank)
    x = truth(asked, rng)
    # Plain films come from the other solver; effects and form errors are put on top by the only code that knows them.
    solver = "ritz" if h.effects else "shooting"
    force = asked.forward(x, reached=False, solver=solver).force
    # Inferred noise is relative to the largest reading: drawn for that of this film, told in that of its readings.
    film = replace(blank, force=force[0])
    noise = Posterior(h, film).noise_at(x, force).draw(h.noise_coordinates(x), rng)
    measured = replace(blank, force=(force + noise)[0])
    x = np.where(np.array(h.names) == SCALED, x + np.log(force_scale(film) / force_scale(measured)), x)
    begun = time.process_time()
    run = sample(measured, h, RunSettings(seed=number, settings=WALK, predictions=False))
    draws = run.draws()
    posterior = Posterior(h, measured)
    chosen = draws[np.linspace(0, len(draws) - 1, RANKED).round().astype(int)]
    both = posterior.evaluate(np.concatenate([x, chosen]))
    told = {n: (x[0, i], chosen[:, i]) for i, n in enumerate(h.names)}
    told["force at the end"] = (float(both.force[0, POINTS - 1]), both.force[1:, POINTS - 1])
    told["log likelihood"] = (float(both.log_likelihood[0]), both.log_likelihood[1:])
    return {
        "ranks": {n: int(np.sum(values < value)) for n, (value, values) in told.items()},
        "ess": run.status["ess_bulk"],
        "reached": bool(run.status["ess_bulk"] >= WALK.ess),
        "evaluations": run.status["evaluations"],
        "seconds": time.process_time() - begun,
    }


def one(item: tuple[str, int]) -> dict[str, Any]:
    """A row; what cannot be sampled says why, and counts against the study."""
    name, number = item
    design = next(d for d in designs() if d.name == name)
    row = {"design": name, "replicate": number}
    try:
        return row | replicate(design, number)
    except (BayesmembraneError, np.linalg.LinAlgError) as error:
        return row | {"failed": f"{type(error).__name__}: {error}"}


def stored(path: Path) -> list[dict[str, Any]]:
    """Rows that are there."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line]


def main(arguments: list[str] | None = None) -> int:
    """Run what is not stored, then print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="designs whose name begins so")
    parser.add_argument("--without", default="", help="leave out designs in whose name this stands")
    parser.add_argument("--limit", type=int, default=10**6, help="replicates of each design")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no replicate after this time")
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--table", type=Path, help="write the table here, and its figure beside it")
    parser.add_argument("--summary", action="store_true", help="run nothing")
    asked = parser.parse_args(arguments)
    done = {(r["design"], r["replicate"]) for r in stored(asked.results)}
    some = [d for d in designs() if d.name.startswith(asked.only)]
    some = [d for d in some if not asked.without or asked.without not in d.name]
    # Round by round, so that what is there is balanced whenever it ends.
    most = min(asked.limit, max((d.replicates for d in some), default=0))
    todo = [(d.name, i) for i in range(most) for d in some if i < d.replicates and (d.name, i) not in done]
    if not asked.summary:
        asked.results.parent.mkdir(parents=True, exist_ok=True)
        _run(todo, asked.results, asked.jobs, time.monotonic() + asked.seconds)
    command = "python -m tests.studies.sbc " + " ".join(sys.argv[1:] if arguments is None else arguments)
    print(report(stored(asked.results), f"`{command.strip()}`, seed {SEED}", asked.table))
    return 0


def _run(todo: list[tuple[str, int]], results: Path, jobs: int, end: float) -> None:
    with ProcessPoolExecutor(jobs) as pool:
        for start in range(0, len(todo), 4 * jobs):
            if time.monotonic() > end:
                break
            for row in pool.map(one, todo[start : start + 4 * jobs]):
                with results.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    sys.exit(main())

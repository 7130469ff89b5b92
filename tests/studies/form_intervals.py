"""How often 90 % intervals hold with the right effect named, by white noise and with a form error.

Parameters and the force of the film itself, without faults, at half and at the end of the range. Posteriors are
weighted draws: Laplace's approximation, then mixtures fitted to what it found. One line of JSON a case.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from bayesmembrane.calibration.descent import descend
from bayesmembrane.calibration.objective import Objective
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, around
from bayesmembrane.data.motion import Motion
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.noise.base import Elsewhere
from tests.generator.datasets import Dataset, generate
from tests.generator.distortions import LIBRARY
from tests.generator.film import NoSolutionError
from tests.studies.loop_plan import Case, plan

Array = NDArray[np.float64]

SEED = 700_000
STARTS, ITERATIONS, TURNS = 8, 40, 3
ROUNDS, EACH, LAST = 3, 400, 1200
INTERVAL, PLACES = (0.05, 0.95), (0.5, 1.0)
MATERIALS = ("neo_hookean", "mooney_rivlin", "gent", "yeoh")


def cases(base: int) -> Iterator[Case]:
    """Those of the plan whose effects a hypothesis can name, of materials whose parameters mean one film each.

    Of those without an effect, every sixth.
    """
    nulls = 0
    for case in plan(base):
        named = [] if case.kind == "null" else case.kind.split("+")
        nulls += not named
        if case.material in MATERIALS and all(n in LIBRARY for n in named) and (named or nulls % 6 == 1):
            yield case


def judged(case: Case, noise: str) -> dict[str, Any]:
    """Whether each interval holds the truth, and how wide it is."""
    data = generate(case.kind, case.material, case.protocol, case.noise, case.strength, case.seed)
    effects = [] if case.kind == "null" else case.kind.split("+")
    with tempfile.TemporaryDirectory() as folder:
        measurement = read_measurement(*data.write(Path(folder)))
    posterior = Posterior(hypothesis(case.material, effects, noise), measurement)
    rng = np.random.default_rng([case.seed, 3])
    x, weight = weighted(posterior, truth_of(posterior.hypothesis, data), rng)
    draws = x[rng.choice(len(x), 400, p=weight / np.sum(weight))]
    values = told(posterior, draws, data, rng)
    out: dict[str, Any] = {"effective": effective_draws(weight)}
    theta = posterior.hypothesis.natural(draws, measurement)[:, -len(posterior.hypothesis.noise.coordinates) :]
    out["noise"] = np.median(theta, axis=0).tolist()
    for name, (found, truth) in values.items():
        low, high = np.quantile(found, INTERVAL)
        out[name] = [bool(low <= truth <= high), float((high - low) / abs(truth)), float(np.median(found) / truth - 1)]
    return out


def truth_of(h: Hypothesis, data: Dataset) -> Array:
    """(1, k) the film that was put in, without effects."""
    p = np.array([data.truth["parameters"][n] for n in h.material.field_names()])
    null = [e.null for e in h.effects]
    return np.concatenate([h.material.to_coordinates(p), *null])[None, :]


def weighted(posterior: Posterior, start: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draws (B, k) and weights (B,) of the posterior."""
    x, covariance = laplace(posterior, start, rng)
    root = np.linalg.cholesky(covariance)
    g = Mixture(np.zeros(1), x[None, :], 1.3 * root[None], 5.0)
    for size in (*(EACH,) * ROUNDS, LAST):
        draws = g.draw(rng, size)
        log_weight = posterior.evaluate(draws).log_posterior - g.log_density(draws)
        weight = np.exp(log_weight - np.max(log_weight))
        cut = np.minimum(weight, np.sqrt(size) * np.mean(weight))
        if size != LAST and effective_draws(weight) > posterior.size + 2:
            g = around(draws[rng.choice(size, size, p=cut / np.sum(cut))], rng)
    return draws, weight


def laplace(posterior: Posterior, start: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Mode (k,) and covariance (k, k): parameters of the curve and those of the noise in turn."""
    h, m = posterior.hypothesis, posterior.measurement
    objective = Objective(h, m, "euclidean", api.solve)
    k = h.curve_size
    x = np.repeat(start, STARTS, axis=0)
    drawn = posterior.prior.draw(rng, STARTS)
    x[1:, h.material_size :] = drawn[1:, h.material_size : k]
    theta = np.array([p.prior.quantile(0.5) for p in h.parameters[k:]], dtype=float)
    sigma, best = 0.01 * np.max(np.abs(m.force)) * np.ones((1, 1)), x
    for turn in range(TURNS):
        inverse = 1 / sigma if turn == 0 else np.linalg.inv(np.linalg.cholesky(sigma))
        x, size = descend(_residuals(objective, inverse), best, (objective.low, objective.high), ITERATIONS)
        best = x[[int(np.argmin(size))]]
        force = posterior.forward(best, reached=False).force
        noise = posterior.noise_at(best, force)

        def loss(t: Array, r: Array = m.force - force, noise: Any = noise) -> float:
            prior = sum(float(p.prior.log_density(v)) for p, v in zip(h.parameters[k:], t, strict=True))
            return -prior - float(noise.log_likelihood(r, t[None, :])[0])

        theta = minimize(loss, theta, method="Nelder-Mead", options={"maxiter": 400, "xatol": 1e-2, "fatol": 1e-2}).x
        sigma = noise.covariance(theta)
    _, j = _residuals(objective, np.linalg.inv(np.linalg.cholesky(sigma)))(best)
    covariance = np.zeros((h.curve_size + theta.size,) * 2)
    covariance[:k, :k] = np.linalg.inv(j[0].T @ j[0])
    covariance[k:, k:] = np.linalg.inv(_hessian(loss, theta))
    return np.concatenate([best[0], theta]), covariance


def _residuals(objective: Objective, inverse: Array) -> Any:
    pull = np.diag(1 / objective.spread)

    def residuals(x: Array) -> tuple[Array, Array]:
        r, j = objective.batch(x)
        white = (r * inverse[0, 0], j * inverse[0, 0])
        if inverse.size > 1:
            white = (r @ inverse.T, np.einsum("mn,bnk->bmk", inverse, j))
        wide = np.broadcast_to(pull, (len(x), *pull.shape))
        return (
            np.concatenate([white[0], (x - objective.centre) / objective.spread], axis=1),
            np.concatenate([white[1], wide], axis=1),
        )

    return residuals


def _hessian(loss: Any, at: Array, step: float = 0.1) -> Array:
    """(n, n) of second differences, made positive definite."""
    n = at.size
    e = step * np.eye(n)
    out = np.array(
        [
            [(loss(at + a + b) - loss(at + a - b) - loss(at - a + b) + loss(at - a - b)) / (4 * step**2) for b in e]
            for a in e
        ]
    )
    values, vectors = np.linalg.eigh(0.5 * (out + out.T))
    return np.asarray((vectors * np.maximum(values, 0.3)) @ vectors.T)


def told(posterior: Posterior, x: Array, data: Dataset, rng: np.random.Generator) -> dict[str, tuple[Array, float]]:
    """{parameter or force: (draws (B,), truth)}."""
    h, m = posterior.hypothesis, posterior.measurement
    films = h.films(x)
    out = {n: (films[:, i], data.truth["parameters"][n]) for i, n in enumerate(h.material.field_names())}
    at = np.array(PLACES) * data.path.largest
    radii = {"inner_radius": data.film.inner, "outer_radius": data.film.outer}
    plain = api.solve(api.request(h.material, films, at, **radii)).force
    force = posterior.forward(x, reached=False).force
    there = Elsewhere(Motion(at, None, m.full_range), plain)
    error = posterior.noise_at(x, force).recurring(m.force - force, h.noise_coordinates(x), rng, there)
    for name, values, truth in zip(("half", "end"), (plain + error).T, data.film.force(at), strict=True):
        out[name] = (values, float(truth))
    return out


def stored(path: Path) -> dict[str, dict[str, Any]]:
    """Results by key."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return {row["key"]: row for row in map(json.loads, lines)}


def main(arguments: list[str] | None = None) -> int:
    """Run what is not stored, then say how often intervals hold and how wide they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--limit", type=int, default=60, help="of the cases")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no case after this time")
    parser.add_argument("--results", type=Path, default=Path("reports/form-intervals.jsonl"))
    parser.add_argument("--noise", default="white,form")
    parser.add_argument("--half", choices=("even", "odd", "all"), default="all", help="which seeds")
    asked = parser.parse_args(arguments)
    asked.results.parent.mkdir(parents=True, exist_ok=True)
    done, end = stored(asked.results), time.monotonic() + asked.seconds
    halves = {"all": (0, 1), "even": (0,), "odd": (1,)}[asked.half]
    chosen = [c for c in islice(cases(asked.seed), asked.limit) if c.seed % 2 in halves]
    for case in chosen:
        for noise in asked.noise.split(","):
            key = f"{case.key}|{noise}"
            if key in done or time.monotonic() > end:
                continue
            begun = time.process_time()
            try:
                row = judged(case, noise)
            except (NoSolutionError, BayesmembraneError, np.linalg.LinAlgError, ValueError) as error:
                row = {"skipped": f"{type(error).__name__}: {error}"}
            row = {"key": key, "case": case.key, "seed": case.seed, "by": noise, **row}
            row["seconds"] = time.process_time() - begun
            done[key] = row
            with asked.results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            print(json.dumps(row), flush=True)
    print(table([done[k] for c in chosen for n in asked.noise.split(",") if (k := f"{c.key}|{n}") in done]))
    return 0


FORCES = ("half", "end")


def table(rows: list[dict[str, Any]]) -> str:
    """Coverage and width, of parameters and of forces, with an effect and without."""
    out = []
    for kind, null in (("with effects", False), ("without", True)):
        some = [r for r in rows if "skipped" not in r and r["case"].startswith("null|") == null]
        for group, forces in (("forces", True), ("parameters", False)):
            widths: dict[tuple[str, str], float] = {}
            for noise in dict.fromkeys(r["by"] for r in some):
                cells = _cells([r for r in some if r["by"] == noise], forces)
                widths = widths or {k: v[1] for k, v in cells.items()}
                ratio = [v[1] / widths[k] for k, v in cells.items() if k in widths]
                held = np.mean([v[0] for v in cells.values()])
                out.append(
                    f"{kind}, {group}, {noise}: {held:.3f} of {len(cells)} hold; times as wide: median "
                    f"{np.median(ratio):.2f}, geometric mean {np.exp(np.mean(np.log(ratio))):.2f}"
                )
    return "\n".join(out)


def _cells(rows: list[dict[str, Any]], forces: bool) -> dict[tuple[str, str], list[Any]]:
    """(case, name) -> held, width, error."""
    return {
        (r["case"], n): v
        for r in rows
        for n, v in r.items()
        if isinstance(v, list) and n != "noise" and (n in FORCES) == forces
    }


if __name__ == "__main__":
    sys.exit(main())

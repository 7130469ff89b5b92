"""How often 90 % intervals hold with the right effect named, by white noise and with a form error.

Parameters and the force of the film itself, without faults, at half and at the end of the range. Posteriors are
linearised in the parameters of the curve at their mode and exact in those of the noise. One line of JSON a case.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.descent import descend
from bayesmembrane.calibration.objective import Objective
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.data.motion import Motion
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.parameters import Normal
from bayesmembrane.physics.form_error import mixed
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.noise import form
from bayesmembrane.physics.noise.ar1 import LN_LENGTH
from bayesmembrane.physics.noise.base import Elsewhere, force_scale
from bayesmembrane.physics.noise.form import innovations, log_scale
from bayesmembrane.physics.noise.form_ar1 import FormAR1Likelihood
from tests.generator.datasets import Dataset, generate
from tests.generator.distortions import LIBRARY
from tests.generator.film import NoSolutionError
from tests.studies.loop_plan import Case, plan
from tests.studies.results import stored

Array = NDArray[np.float64]

SEED = 700_000
STARTS, ITERATIONS, TURNS = 8, 40, 3
NODES, DRAWS = 13, 400
INTERVAL, PLACES, FORCES = (0.05, 0.95), (0.5, 1.0), ("half", "end")
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
    line = found_line(posterior, truth_of(posterior.hypothesis, data), rng)
    x = line.draws(rng, DRAWS)
    out: dict[str, Any] = {}
    theta = posterior.hypothesis.natural(x, measurement)[:, -len(posterior.hypothesis.noise.coordinates) :]
    out["noise"] = np.median(theta, axis=0).tolist()
    for name, (found, truth) in told(line, x, data, rng).items():
        low, high = np.nanquantile(found, INTERVAL)
        out[name] = [
            bool(low <= truth <= high),
            float((high - low) / abs(truth)),
            float(np.nanmedian(found) / truth - 1),
        ]
    return out


def truth_of(h: Hypothesis, data: Dataset) -> Array:
    """(1, k) the film that was put in, without effects."""
    p = np.array([data.truth["parameters"][n] for n in h.material.field_names()])
    null = [e.null for e in h.effects]
    return np.concatenate([h.material.to_coordinates(p), *null])[None, :]


@dataclass(frozen=True, eq=False)
class Line:
    """A posterior whose curve is a line in its parameters about ``x`` (1, k): F + J (x' - x), white noise inferred.

    force (1, N), residual (N,), slopes (N, k); nodes (M, m) of the noise's coordinates with log_weights (M,), and means
    (M, k) and covariances (M, k, k) of x' - x at each.
    """

    posterior: Posterior
    objective: Objective
    x: Array
    force: Array
    residual: Array
    slopes: Array
    nodes: Array
    log_weights: Array
    means: Array
    covariances: Array

    def draws(self, rng: np.random.Generator, count: int) -> Array:
        """(count, k + m) within the bounds."""
        w = np.exp(self.log_weights - np.max(self.log_weights))
        kept: list[Array] = []
        while sum(map(len, kept)) < count:
            at = rng.choice(len(w), 4 * count, p=w / np.sum(w))
            roots = np.linalg.cholesky(self.covariances)
            z = rng.standard_normal((len(at), self.x.size))
            x = self.x + self.means[at] + np.einsum("bij,bj->bi", roots[at], z)
            inside = np.all((x >= self.objective.low) & (x <= self.objective.high), axis=1)
            kept.append(np.concatenate([x, self.nodes[at]], axis=1)[inside])
        return np.concatenate(kept)[:count]


def found_line(posterior: Posterior, start: Array, rng: np.random.Generator) -> Line:
    """The line at the mode, which is found with the noise that the line before makes most probable."""
    h, m = posterior.hypothesis, posterior.measurement
    objective = Objective(h, m, "euclidean", api.solve)
    k = h.curve_size
    best = np.repeat(start, STARTS, axis=0)
    best[1:, h.material_size :] = posterior.prior.draw(rng, STARTS)[1:, h.material_size : k]
    inverse = np.eye(len(m)) / (0.01 * np.max(np.abs(m.force)))
    for _ in range(TURNS):
        x, size = descend(_residuals(objective, inverse), best, (objective.low, objective.high), ITERATIONS)
        best = x[[int(np.argmin(size))]]
        line = _line(posterior, objective, best)
        theta = line.nodes[int(np.argmax(line.log_weights))]
        inverse = np.linalg.inv(np.linalg.cholesky(posterior.noise_at(best, line.force).covariance(theta)))
    return line


def _line(posterior: Posterior, objective: Objective, x: Array) -> Line:
    """ln p(y | nodes) and the normal distributions there, with the parameters of the curve integrated out."""
    h, m = posterior.hypothesis, posterior.measurement
    r, j = objective.batch(x)
    residual, slopes, force = -r[0], j[0], m.force + r
    noise, scale = posterior.noise_at(x, force), force_scale(m)
    columns, sizes = _columns(noise)
    every = np.concatenate([columns, slopes, residual[:, None]], axis=1)
    c = columns.shape[1]
    nodes, prior = _nodes(h, residual / scale)
    grams = {length: _gram(noise, every, length) for length in np.unique(nodes[:, -1])}
    pull, offset = np.diag(objective.spread**-2), objective.centre - x[0]
    log_weights, means, covariances = [], [], []
    for theta, log_prior in zip(nodes, prior, strict=True):
        power = np.exp(2 * theta[0]) * scale**2
        gram, remembered = grams[theta[-1]]
        s = np.exp(np.append(theta, 0.0)[sizes]) if c else np.empty(0)
        inner = np.eye(c) + gram[:c, :c] * s[:, None] * s / power
        across = gram[:c, c:] * s[:, None] / power
        white = gram[c:, c:] / power - across.T @ np.linalg.solve(inner, across)
        precision = white[:-1, :-1] + pull
        right = white[:-1, -1] + pull @ offset
        covariance = np.linalg.inv(precision)
        log_det = len(m) * np.log(power) + remembered + np.linalg.slogdet(inner)[1] + np.linalg.slogdet(precision)[1]
        log_weights.append(log_prior + 0.5 * (right @ covariance @ right - white[-1, -1] - log_det))
        means.append(covariance @ right)
        covariances.append(0.5 * (covariance + covariance.T))
    parts = (np.array(v) for v in (log_weights, means, covariances))
    return Line(posterior, objective, x, force, residual, slopes, nodes, *parts)


def _gram(noise: Any, values: Array, ln_length: float) -> tuple[Array, float]:
    """(products of values (N, c) freed of noise of variance one, ln |its covariance|)."""
    n = len(values)
    remembers = isinstance(noise, FormAR1Likelihood)
    stays = np.full(n, np.exp(-np.exp(-ln_length)) if remembers else 0.0)
    white = innovations(values, 1.0, np.zeros(n), stays)
    return white.T @ white, float(log_scale(1.0, np.zeros(n), stays))


def _columns(noise: Any) -> tuple[Array, NDArray[np.intp]]:
    """Columns (N, r) of the form error at relative errors of one, and the coordinate that scales each, or -1."""
    if not hasattr(noise, "factors"):
        return np.empty((noise.variance.size, 0)), np.empty(0, dtype=int)
    f = noise.factors
    film, laws = noise.force[0][:, None] * f.state, [t[:, None] * f.progress for t in noise.traces[0]]
    parts = [film, *laws, mixed(noise.force[0], noise.traces[0]) * film]
    return np.concatenate(parts, axis=1), np.repeat([1, *(2 for _ in laws), -1], [p.shape[1] for p in parts])


def _nodes(h: Hypothesis, share: Array) -> tuple[Array, Array]:
    """Coordinates of the noise (M, m) on a grid, and ln of their prior (M,)."""
    own = h.parameters[h.curve_size :]
    remembers = own[-1] is LN_LENGTH
    # Noise that remembers is larger than what a fit leaves, and asks for one more coordinate.
    steps = np.linspace(-8, 24, 33) if remembers else np.linspace(-8, 3, 23)
    near, count = np.log(np.std(share)) + steps / np.sqrt(2 * share.size), 9 if remembers else NODES
    wide = [np.linspace(float(p.prior.quantile(0.003)), float(p.prior.quantile(0.997)), count) for p in own[1:]]
    nodes = np.stack([g.ravel() for g in np.meshgrid(near, *wide, indexing="ij")], axis=1)
    return nodes, np.sum([p.prior.log_density(nodes[:, i]) for i, p in enumerate(own)], axis=0)


def _residuals(objective: Objective, inverse: Array) -> Any:
    pull = np.diag(1 / objective.spread)

    def residuals(x: Array) -> tuple[Array, Array]:
        r, j = objective.batch(x)
        wide = np.broadcast_to(pull, (len(x), *pull.shape))
        return (
            np.concatenate([r @ inverse.T, (x - objective.centre) / objective.spread], axis=1),
            np.concatenate([np.einsum("mn,bnk->bmk", inverse, j, optimize=True), wide], axis=1),
        )

    return residuals


def told(line: Line, x: Array, data: Dataset, rng: np.random.Generator) -> dict[str, tuple[Array, float]]:
    """{parameter or force: (draws (B,), truth)}."""
    h, m, k = line.posterior.hypothesis, line.posterior.measurement, line.x.size
    films = h.films(x)
    out = {n: (films[:, i], data.truth["parameters"][n]) for i, n in enumerate(h.material.field_names())}
    at = np.array(PLACES) * data.path.largest
    radii = {"inner_radius": data.film.inner, "outer_radius": data.film.outer}
    plain = api.solve(api.request(h.material, films, at, **radii)).force
    residual = line.residual - (x[:, :k] - line.x) @ line.slopes.T
    there = Elsewhere(Motion(at, None, m.full_range), plain)
    noise = line.posterior.noise_at(line.x, line.force)
    error = noise.recurring(residual, h.noise_coordinates(x), rng, there)
    for name, values, truth in zip(FORCES, (plain + error).T, data.film.force(at), strict=True):
        out[name] = (values, float(truth))
    return out


def main(arguments: list[str] | None = None) -> int:
    """Run what is not stored, then say how often intervals hold and how wide they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--limit", type=int, default=60, help="of the cases")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no case after this time")
    parser.add_argument("--results", type=Path, default=Path("reports/form-intervals.jsonl"))
    parser.add_argument("--noise", default="white,form")
    parser.add_argument("--energy", default="", help="median,spread of the prior of eta_a, instead of its own")
    parser.add_argument("--law", default="", help="the same of eta_e")
    parser.add_argument("--half", choices=("even", "odd", "all"), default="all", help="which seeds")
    asked = parser.parse_args(arguments)
    for name, text in (("ENERGY", asked.energy), ("LAW", asked.law)):
        if text:
            median, spread = map(float, text.split(","))
            setattr(form, name, replace(getattr(form, name), prior=Normal(float(np.log(median)), spread)))
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

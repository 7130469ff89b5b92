"""How often 90 % intervals hold with the right effect named, by white noise and with a form error.

Parameters and the force of the film itself, without faults, at half and at the end of the range. Posteriors are
linearised in the parameters of the curve at their mode, the prior as the square of a root that is linear there, and
exact in those of the noise. One line of JSON a case.
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
from scipy.special import ndtr

from bayesmembrane.calibration.descent import descend
from bayesmembrane.calibration.objective import Objective
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.data.motion import Motion
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.parameters import Normal
from bayesmembrane.physics.form_error import LOCAL, local_size, mixed
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
DRAWS = 400
FINE, COARSE = (1.45, 9, 7), (3.2, 5, 5)
"""Steps of the noise's logarithm in its own deviations, nodes of eta_a, and of every other coordinate."""
RATIOS = (-2.5, -0.75, 1.0, 2.75, 4.5)  # ln of the error where nothing is steady over that of all readings
LEVEL = 0.1  # of a prior that is level: as if its deviation were ten times as large
OUTSIDE = 6.0  # deviations from the mode, where a prior is zero within its bounds
AT_ONCE, FAR = 500, 20.0  # nodes; nats below the most probable one that count for nothing
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

    force (1, N), residual (N,), slopes (N, k); nodes (M, m) of the noise's coordinates with log_prior (M,) and
    log_weights (M,), and means (M, k) and covariances (M, k, k) of x' - x at each.
    """

    posterior: Posterior
    objective: Objective
    x: Array
    force: Array
    residual: Array
    slopes: Array
    nodes: Array
    log_prior: Array
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
    for turn in range(TURNS):
        x, size = descend(_residuals(objective, inverse), best, (objective.low, objective.high), ITERATIONS)
        best = x[[int(np.argmin(size))]]
        line = _line(posterior, objective, best, COARSE if turn < TURNS - 1 else FINE)
        theta = line.nodes[int(np.argmax(line.log_weights))]
        inverse = np.linalg.inv(np.linalg.cholesky(posterior.noise_at(best, line.force).covariance(theta)))
    return line


def _line(posterior: Posterior, objective: Objective, x: Array, grid: tuple[float, int, int]) -> Line:
    """ln p(y | nodes) and the normal distributions there, with the parameters of the curve integrated out.

    With columns C of the form error, slopes J and the residual r, freed of the readings' noise, all of it follows from
    the Cholesky root of [C J r]^T [C J r] + diag(1, prior, 0): its diagonal, and its last rows.
    """
    h, m = posterior.hypothesis, posterior.measurement
    r, j = objective.batch(x)
    residual, slopes, force = -r[0], j[0], m.force + r
    noise, scale = posterior.noise_at(x, force), force_scale(m)
    columns, sizes = _columns(noise)
    every = np.concatenate([columns, slopes, residual[:, None]], axis=1)
    c, k = columns.shape[1], slopes.shape[1]
    nodes, prior, louder = _nodes(h, residual / scale, float(local_size(force[0])) / scale, grid)
    pull, by_x = (v[0] for v in pulls(objective, x))
    added = np.zeros((c + k + 1, c + k + 1))
    added[:c, :c] = np.eye(c)
    added[c:-1, c:-1] = np.diag(by_x**2)
    added[c:-1, -1] = added[-1, c:-1] = -by_x * pull
    added[-1, -1] = pull @ pull
    kinds, kind = np.unique(np.column_stack([louder, nodes[:, -1]]), axis=0, return_inverse=True)
    log_weights, roots = np.empty(len(nodes)), np.empty((len(nodes), k + 1, k + 1))
    for number, (ratio, length) in enumerate(kinds):
        gram, remembered = _gram(noise, every, length, ratio)
        for some in np.array_split(np.flatnonzero(kind.ravel() == number), 1 + len(nodes) // len(kinds) // AT_ONCE):
            tau = np.exp(nodes[some, 0]) * scale
            s = np.exp(np.column_stack([nodes[some], np.zeros((len(some), 1 + k + 1))]))
            s = s[:, [*sizes, *(-1 - np.arange(k + 1))]] / tau[:, None]
            root = np.linalg.cholesky(gram * s[:, :, None] * s[:, None, :] + added)
            logs = 2 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)[:, :-1]), axis=1)
            log_det = 2 * len(m) * np.log(tau) + remembered + logs
            log_weights[some] = prior[some] - 0.5 * (root[:, -1, -1] ** 2 + log_det)
            roots[some] = root[:, c:, c:]
    kept = log_weights > np.max(log_weights) - FAR
    halves = np.linalg.inv(roots[kept, :-1, :-1])
    covariances = np.swapaxes(halves, 1, 2) @ halves
    means = np.einsum("bji,bj->bi", halves, roots[kept, -1, :-1])
    parts = (nodes[kept], prior[kept], log_weights[kept], means, covariances)
    return Line(posterior, objective, x, force, residual, slopes, *parts)


def _gram(noise: Any, values: Array, ln_length: float, ratio: float) -> tuple[Array, float]:
    """(products of values (N, c) freed of noise of variance one, with ``ratio`` of it more where nothing is steady, ln
    |its covariance|).
    """
    n = len(values)
    remembers = isinstance(noise, FormAR1Likelihood)
    stays = np.full(n, np.exp(-np.exp(-ln_length)) if remembers else 0.0)
    own = ratio**2 * noise.spots if hasattr(noise, "spots") else np.zeros(n)
    white = innovations(values, 1.0, own, stays)
    return white.T @ white, float(log_scale(1.0, own, stays))


def _columns(noise: Any) -> tuple[Array, NDArray[np.intp]]:
    """Columns (N, r) of the form error at relative errors of one, and the coordinate that scales each, or -1."""
    if not hasattr(noise, "factors"):
        return np.empty((noise.variance.size, 0)), np.empty(0, dtype=int)
    f = noise.factors
    film, laws = noise.force[0][:, None] * f.state, [t[:, None] * f.progress for t in noise.traces[0]]
    parts = [film, *laws, mixed(noise.force[0], noise.traces[0]) * film]
    return np.concatenate(parts, axis=1), np.repeat([1, *(3 for _ in laws), -1], [p.shape[1] for p in parts])


def _nodes(h: Hypothesis, share: Array, scale: float, grid: tuple[float, int, int]) -> tuple[Array, Array, Array]:
    """Coordinates of the noise (M, m) on a grid, ln of their prior (M,), and the error where nothing is steady, at
    ``scale`` times the largest reading, over the noise (M,).

    That error is on a grid of this ratio: below its first value it makes no difference, beyond the last one those
    readings say nothing.
    """
    own = h.noise.coordinates
    names = [p.name for p in own]
    # Noise that remembers is larger than what a fit leaves.
    most = 24.0 if names[-1] == LN_LENGTH.name else 3.0
    near = np.log(np.std(share)) + np.arange(-8.0, most + grid[0], grid[0]) / np.sqrt(2 * share.size)
    rest = [p for p, name in zip(own[1:], names[1:], strict=True) if name != LOCAL.name]
    counts = [grid[1 + (i > 0)] for i in range(len(rest))]
    wide = [np.linspace(*p.prior.quantile(np.array([0.003, 0.997])), n) for p, n in zip(rest, counts, strict=True)]
    local = LOCAL.name in names
    ratios = np.array(RATIOS)[: None if local else 1]
    nodes = np.stack([g.ravel() for g in np.meshgrid(near, ratios, *wide, indexing="ij")], axis=1)
    louder = np.exp(nodes[:, 1]) if local else np.zeros(len(nodes))
    log_prior = own[0].prior.log_density(nodes[:, 0])
    log_prior = log_prior + np.sum([p.prior.log_density(nodes[:, 2 + i]) for i, p in enumerate(rest)], axis=0)
    if not local:
        return np.delete(nodes, 1, axis=1), log_prior, louder
    level = nodes[:, 0] + nodes[:, 1] - np.log(scale)
    half = 0.5 * np.ptp(RATIOS) / max(len(RATIOS) - 1, 1)
    low = np.where(nodes[:, 1] == RATIOS[0], -np.inf, level - half)
    high = np.where(nodes[:, 1] == RATIOS[-1], np.inf, level + half)
    prior = own[names.index(LOCAL.name)].prior
    z = (np.stack([low, high]) - prior.quantile(0.5)) / (prior.quantile(ndtr(1.0)) - prior.quantile(0.5))
    # Of the side where both are small: differences of numbers near 1 have no digits.
    z = np.where(z[0] > 0, -z[::-1], z)
    log_prior = log_prior + np.log(np.maximum(ndtr(z[1]) - ndtr(z[0]), 1e-300))
    # (sd, ratio, eta, ...) to (sd, eta, local, ...)
    return np.column_stack([nodes[:, [0, 2]], level, nodes[:, 3:]]), log_prior, louder


def pulls(objective: Objective, x: Array) -> tuple[Array, Array]:
    """(r, dr/dx), (B, k) each, with r^2 / 2 what the prior's logarithm lies below its largest value at x (B, k)."""
    r, by_x = np.zeros(x.shape), np.zeros(x.shape)
    for i, (p, sd) in enumerate(zip(objective.parameters, objective.spread, strict=True)):
        # Of what can only be positive the most probable is often the bound.
        grid = np.concatenate([p.prior.quantile(np.linspace(1e-4, 1 - 1e-4, 2001)), p.bounds])
        density = p.prior.log_density(grid)
        density[~np.isfinite(density)] = -np.inf
        mode, top = grid[np.argmax(density)], np.max(density)
        h = 1e-5 * sd
        high, at, low = (p.prior.log_density(x[:, i] + s) for s in (h, 0.0, -h))
        with np.errstate(invalid="ignore"):
            slope = np.where(np.isfinite(low), (high - low) / (2 * h), (high - at) / h)
        far = np.where(np.isfinite(at), np.sqrt(2 * np.maximum(top - at, 0.0)), OUTSIDE)
        r[:, i] = np.sign(x[:, i] - mode) * far
        steep = (far > 1e-3) & np.isfinite(at) & np.isfinite(slope)
        by_x[:, i] = np.where(steep, -np.where(steep, slope, 0.0) / np.where(steep, r[:, i], 1.0), LEVEL / sd)
    return r, by_x


def _residuals(objective: Objective, inverse: Array) -> Any:
    def residuals(x: Array) -> tuple[Array, Array]:
        r, j = objective.batch(x)
        pull, by_x = pulls(objective, x)
        return (
            np.concatenate([r @ inverse.T, pull], axis=1),
            np.concatenate(
                [np.einsum("mn,bnk->bmk", inverse, j, optimize=True), by_x[:, :, None] * np.eye(x.shape[1])], axis=1
            ),
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
    parser.add_argument("--only", default="", help="cases with one of these effects, by comma")
    parser.add_argument("--steady", action="store_true", help="no error at starts, turns and slack ends")
    asked = parser.parse_args(arguments)
    if asked.steady:
        globals()["RATIOS"] = RATIOS[:1]
    for name, text in (("ENERGY", asked.energy), ("LAW", asked.law)):
        if text:
            median, spread = map(float, text.split(","))
            setattr(form, name, replace(getattr(form, name), prior=Normal(float(np.log(median)), spread)))
    asked.results.parent.mkdir(parents=True, exist_ok=True)
    done, end = stored(asked.results), time.monotonic() + asked.seconds
    halves = {"all": (0, 1), "even": (0,), "odd": (1,)}[asked.half]
    some = (c for c in cases(asked.seed) if not asked.only or any(n in c.kind for n in asked.only.split(",")))
    chosen = [c for c in islice(some, asked.limit) if c.seed % 2 in halves]
    for case in chosen:
        for noise in asked.noise.split(","):
            key = f"{case.key}|{noise}{' steady' * asked.steady}"
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
    wanted = [f"{c.key}|{n}{' steady' * asked.steady}" for c in chosen for n in asked.noise.split(",")]
    print(table([done[k] for k in wanted if k in done]))
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

"""`make bench`: microseconds per force curve, for each material and solver, beside what SciPy alone needs.

Films are distinct random draws from the priors whose energy is convex over the states reached (`reached`), and no cache
stands in between. A curve has 15 or 366 deflections that end at 91.5 mm. Errors are the largest relative ones of the
15-point forces, against shooting at a relative tolerance of 1e-12. The baseline is ``solve_ivp`` + ``root``,
warm-started along the curve, with the method and the loosest tolerance that give it 1e-6 in the shortest time.

Times are CPU times of one thread, compilation excluded: medians over repeats. ``--json`` prints the same as JSON.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.cache import CachedSolver
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics import fallback, request, solve
from bayesmembrane.physics.mechanics.convexity import reached_convexity
from bayesmembrane.physics.mechanics.request import Request
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.shooting import solver as shooting
from tests.reference import slow_solver

SEED = 20240607
RADII = {"inner_radius": 0.010, "outer_radius": 0.035}
END = 0.0915
GRIDS = {15: np.linspace(END / 15, END, 15), 366: np.linspace(END / 366, END, 366)}
BATCH = 64
# Films that are solved one by one, the same for every solver.
FEW = 4
EXACT = 1e-6
METHODS = ("DOP853", "LSODA", "RK45")
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
TARGETS = {"shooting, compiled": dict.fromkeys(ordinary_materials(), 300)} | {
    f"Ritz, {BATCH} films": {"neo_hookean": 3000, "mooney_rivlin": 3000, "gent": 3000, "ogden": 1000, "yeoh": 1000}
}


@dataclass(frozen=True)
class Row:
    """One line of the table; microseconds per curve and film."""

    material: str
    solver: str
    us_15: float
    us_366: float
    error: float
    faster: float | None = None
    target: int | None = None
    note: str = ""


def admissible(material: type[Material], count: int, rng: np.random.Generator) -> Array:
    """Draws (count, n) from the prior that are `ok` and convex on all states reached."""
    kept: list[Array] = []
    while sum(map(len, kept)) < count:
        x = np.stack([c.prior.draw(rng, 2 * count) for c in material.coordinates])
        p = material.from_coordinates(x).T
        curves = fallback.solve(request(material, p, GRIDS[15], *RADII.values()))
        kept.append(p[np.all(curves.ok, axis=1) & (reached_convexity(curves) >= 0)])
    return np.concatenate(kept)[:count]


def microseconds(work: Callable[[], object], repeats: int) -> float:
    """Median CPU time of one call."""
    times = []
    for _ in range(repeats):
        begun = time.thread_time_ns()
        work()
        times.append((time.thread_time_ns() - begun) / 1e3)
    return statistics.median(times)


def error(forces: Array, exact: Array) -> float:
    """Largest relative error; infinite if a force is missing."""
    return float(np.max(np.where(np.isfinite(forces), np.abs(forces / exact - 1), np.inf)))


def asked(material: type[Material], films: Array, points: int) -> Request:
    return request(material, films, GRIDS[points], *RADII.values())


def baseline(films: list[Material], exact: Array) -> Row:
    """``solve_ivp`` + ``root``: the fastest method at its loosest tolerance within 1e-6."""
    best: Row | None = None
    for method in METHODS:
        for rtol in TOLERANCES:
            forces, begun = [], time.thread_time()
            for film in films:
                forces.append(slow_solver.force_curve(film, GRIDS[15], **RADII, rtol=rtol, method=method))
            spent = (time.thread_time() - begun) / len(films) * 1e6
            if best is not None and spent > 1.5 * best.us_15:
                break
            worst = error(np.array(forces), exact)
            if worst <= EXACT:
                if best is None or spent < best.us_15:
                    note = f"{method}, rtol {rtol:.0e}"
                    best = Row(films[0].name, "solve_ivp + root", spent, np.nan, worst, note=note)
                break
    if best is None:
        raise SystemExit(f"solve_ivp + root does not reach {EXACT:g} for {films[0].name}")
    method, rtol = best.note.split(", rtol ")
    options = {**RADII, "method": method, "rtol": float(rtol)}
    spent = microseconds(lambda: slow_solver.force_curve(films[0], GRIDS[366], **options), 1)
    again = microseconds(lambda: [slow_solver.force_curve(film, GRIDS[15], **options) for film in films], 3)
    return replace(best, us_15=again / len(films), us_366=spent)


def collocation(film: Material, exact: Array) -> Row:
    """``solve_bvp``; its time for 366 points is that of every 24th step, times 24."""
    for tol in TOLERANCES:
        begun = time.thread_time()
        forces = slow_solver.force_curve_bvp(film, GRIDS[15], **RADII, tol=tol)
        spent = (time.thread_time() - begun) * 1e6
        worst = error(forces, exact)
        if worst <= EXACT:
            break
    few = np.sort(np.concatenate([GRIDS[366][23::48], GRIDS[366][24::48]]))
    part = microseconds(lambda: slow_solver.force_curve_bvp(film, few, **RADII, tol=tol), 1)
    note = f"tol {tol:.0e}; 366 points: {few.size} solved and scaled up"
    return Row(film.name, "solve_bvp", spent, part * 366 / few.size, worst, note=note)


def ours(material: type[Material], films: Array, exact: Array) -> list[Row]:
    """Compiled shooting, Ritz with one film and with a batch; ``films`` are several batches."""
    some, rows = films[:FEW], []
    single = [[asked(material, p, n) for p in some] for n in (15, 366)]
    many = [[asked(material, part, n) for part in films.reshape(-1, BATCH, films.shape[1])] for n in (15, 366)]
    cases = (
        ("shooting, compiled", shooting.solve, single, 1, len(some), (9, 3)),
        ("Ritz, one film", ritz.solve, single, 1, len(some), (15, 3)),
        (f"Ritz, {BATCH} films", ritz.solve, many, BATCH, len(films), (15, 3)),
    )
    for name, solver, problems, width, count, repeats in cases:
        forces = np.concatenate([solver(q).force for q in problems[0]])
        times = []
        for questions, times_asked in zip(problems, repeats, strict=True):
            solver(questions[0])
            spent = [microseconds(partial(solver, q), times_asked) for q in questions]
            times.append(statistics.mean(spent) / width)
        rows.append(Row(material.name, name, times[0], times[1], error(forces, exact[:count])))
    return rows


def cached(material: type[Material], films: Array) -> Row:
    """One film, found in the memory of the cache; its error is against the solver itself."""
    remembered, times = CachedSolver(), []
    for n in (15, 366):
        asked_for = request(material, films[0], GRIDS[n], **RADII)
        remembered(asked_for)
        times.append(microseconds(partial(remembered, asked_for), 50))
    few = request(material, films[0], GRIDS[15], **RADII)
    direct = solve(few).force
    hit = remembered(few).force
    return Row(material.name, "cache, a hit", *times, error(hit, direct))


def measure(material: type[Material], batches: int) -> list[Row]:
    """All rows of one material, with how many times faster than the baseline they are."""
    films = admissible(material, batches * BATCH, np.random.default_rng(SEED))
    exact = shooting.solve(asked(material, films, 15), rtol=1e-12).force
    few = [material.from_vector(p) for p in films[:FEW]]
    base = baseline(few, exact[: len(few)])
    rows = [collocation(few[0], exact[0]), *ours(material, films, exact), cached(material, films)]
    goals = [TARGETS.get(row.solver, {}).get(material.name) for row in rows]
    return [base, *(replace(r, faster=base.us_15 / r.us_15, target=g) for r, g in zip(rows, goals, strict=True))]


def table(rows: list[Row]) -> str:
    """The rows as text."""
    lines = [
        f"{'material':14} {'solver':20} {'us/15 pts':>11} {'us/366 pts':>12} {'error':>8} {'times faster':>12}  remark"
    ]
    for row in rows:
        faster = "" if row.faster is None else f"{row.faster:.0f}"
        remark = row.note
        if row.target is not None and row.faster is not None:
            remark = f"target {row.target}: {'met' if row.faster >= row.target and row.error <= EXACT else 'missed'}"
        lines.append(
            f"{row.material:14} {row.solver:20} {row.us_15:11.1f} {row.us_366:12.1f} {row.error:8.1e} {faster:>12}"
            f"  {remark}"
        )
    return "\n".join(lines)


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--batches", type=int, default=3, help=f"batches of {BATCH} films per material")
    options = parser.parse_args()
    rows: list[Row] = []
    for name, material in ordinary_materials().items():
        print(f"{name} ...", file=sys.stderr, flush=True)
        rows += measure(material, options.batches)
    print(json.dumps([vars(row) for row in rows], indent=1) if options.json else table(rows))


if __name__ == "__main__":
    main()

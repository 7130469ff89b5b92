"""The page of `tests.studies.growth`, made of its rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from tests.studies.results import Row

LARGEST = 3  # sizes from which the second exponent is fitted

HEAD = """# How cost grows with work

`make study-growth` (`python -m tests.studies.growth`, seeds from 20261124). CPU seconds of one thread, kernels
compiled, nothing stored, on a machine that others used as well. Measurements are simulated from the hypothesis that
is calibrated: Gent films of 2 mN noise for readings, walkers and specimens (10 readings where their number does not
vary); for parameters one cycle of 59 readings of a neo-Hookean film whose noise is stated, with effects added one
after another, at the medians of their priors. Joint specimens share their energy, and their noise is stated; a
population is of two coordinates.

Exponents p of cost ~ size^p are least squares of ln cost over ln size, with their standard errors; small sizes are
mostly fixed cost, so that those of the three largest sizes are nearer to what comes beyond. Draws asked for, the cost
of a draw in the density (prior, film, likelihood) and all else (starts, learning, proposals, convergence, checks) are
parts of the whole, over all sizes.

"""

FOUND = """## What grows faster than the work

Only the number of parameters, and joint specimens a little, at their end. Readings and walkers have exponents of 0.3
to 0.8 over all sizes, and at most 0.9 at their end.

- **Parameters** (2.4 over all, 4.2 from 6 to 15). *A draw*, 1.2: up to two parameters the film is one curve that is
  scaled (33 µs with an effect on it), with pre-stretch each draw has a film of its own (80 µs, and no more up to ten
  parameters), and the film on a frame that yields, which is the last effect, has to be closed (140 to 170 µs). *Draws
  asked for*, 1.7: with fifteen parameters one run of two fell back on emcee's ensembles, and both asked for 800 000
  to 1 100 000 draws, for twice the effective ones that ten parameters have from 58 000. From one to ten parameters
  the cost grows 47-fold.
- *What could be done about it* was not looked into: four of the frame's five coordinates are shapes that a first
  cycle hardly shows, with bounds on most sides, where a mixture of normal distributions may be poor.

Beside the exponents:

- `sample` of 20 000 readings takes 5.1 times as long as of 250, though it asks for a tenth of the draws; 2.1 of its
  3.0 s are not in the density.
- A draw with form error costs 2.2 ms at 20 000 readings, and nowhere grows faster than they do.
- Walkers: more of them are more draws (114 000 effective with 1024), and by emcee the cost of a draw falls with the
  batch (49 to 15 µs).
- Specimens: 100 joint ones take 34 s, of which 11 s are in their densities (17 µs a film) and 24 s in all else, among
  it a run for each test. From 30 to 100 their exponent is 1.2.
- A population of 100 specimens takes a second.
"""
Part = Callable[[Row], float]
PARTS: dict[str, Part] = {
    "draws asked for": lambda r: r["evaluations"],
    "a draw": lambda r: r["density"] / max(r["evaluations"], 1),
    "all else": lambda r: r["seconds"] - r["density"],
}


def exponent(sizes: ArrayLike, values: ArrayLike) -> tuple[float, float]:
    """(p, its standard error) of least squares, ln value = a + p ln size; the error is nan for fewer than three."""
    x, y = np.log(np.asarray(sizes, dtype=float)), np.log(np.asarray(values, dtype=float))
    apart = x - np.mean(x)
    p = float(apart @ y / (apart @ apart))
    left = y - np.mean(y) - p * apart
    freedom = len(x) - 2
    return p, float(np.sqrt(left @ left / freedom / (apart @ apart))) if freedom > 0 else float("nan")


def page(rows: Sequence[Row], axes: Sequence[str]) -> str:
    """Markdown of all rows."""
    found = {axis: [r for r in rows if r["axis"] == axis] for axis in axes}
    found = {axis: own for axis, own in found.items() if own}
    out = [HEAD + "\n".join(exponents(found)), FOUND.rstrip()]
    for axis, own in found.items():
        out.append("\n".join([f"## {axis[0].upper()}{axis[1:]}\n", *measured(own)]))
    return "\n\n".join(out) + "\n"


def exponents(found: dict[str, list[Row]]) -> Iterator[str]:
    yield f"| what grows | from, to | CPU s | CPU s, largest {LARGEST} | {' | '.join(PARTS)} |"
    yield "|---|---|---|---|---|---|---|"
    for axis, rows in found.items():
        sizes = sorted({r["size"] for r in rows})
        last = [r for r in rows if r["size"] in sizes[-LARGEST:]]
        cells = [_exponent(rows, lambda r: r["seconds"]), _exponent(last, lambda r: r["seconds"])]
        cells += [_exponent(rows, part) for part in PARTS.values()]
        yield f"| {axis} | {sizes[0]:,}, {sizes[-1]:,} | {' | '.join(cells)} |"


def _exponent(rows: Sequence[Row], part: Part) -> str:
    values = [part(r) for r in rows]
    if min(values) <= 0 or len(values) < 2:
        return ""
    p, sd = exponent([r["size"] for r in rows], values)
    return f"{p:.2f} ± {sd:.2f}"


def measured(rows: Sequence[Row]) -> Iterator[str]:
    """Means over seeds, and the least and the most CPU seconds."""
    yield "| | runs | CPU s | least, most | draws asked for | µs a draw | all else, s | effective draws | proposals |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for size in sorted({r["size"] for r in rows}):
        own = [r for r in rows if r["size"] == size]
        seconds = [r["seconds"] for r in own]
        films, each, rest = (float(np.mean([part(r) for r in own])) for part in PARTS.values())
        cells = [f"{size:,}", str(len(own)), f"{np.mean(seconds):.3g}", f"{min(seconds):.3g}, {max(seconds):.3g}"]
        cells += [f"{films:,.0f}", f"{1e6 * each:,.0f}", f"{rest:.2g}"] if films else ["", "", ""]
        worth = [r["ess_bulk"] for r in own if r.get("ess_bulk")]
        cells.append(f"{np.mean(worth):,.0f}" if worth else "")
        cells.append(", ".join(sorted({r["sampler"] for r in own if r.get("sampler")})))
        yield f"| {' | '.join(cells)} |"

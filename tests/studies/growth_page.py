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

Only the number of parameters. Readings, walkers and specimens have exponents of 0.5 to 0.9 over all sizes, and at
most 1 at their end.

- **Parameters** (1.9 over all, 6.6 from 8 to 12). *A draw*, 1.6: up to three parameters the film is one curve that is
  scaled (2 µs, and 28 with effects on it), with pre-stretch each draw has a film of its own (70 µs), and with twelve
  they are asked for in the small batches of emcee's walkers; from 4 to 10 parameters the exponent is 0.3. *Draws
  asked for*: from 8 parameters on the mixture is worth less, and at 12 it is not close enough, so that emcee's
  ensembles walk. *All else*: at 12 parameters 45 of 61 s. Under a profiler 62 of 79 s of such a run (its first 330
  steps) went into six rounds of learning a mixture that was then not used, and 43 of these 62 into one call, the
  nearest point that tells whether the prior is cut there (`Lookup`): in twelve dimensions a tree looks at nearly all
  of them.
- *What could be done about it.* In that case the look-up tells nothing: all 245 of 1472 points that were not possible
  had left the bounds of an effect (a half-normal prior), which the density of the prior knows without it; a
  neo-Hookean film is always convex. Only points that convexity or the film cut away need looking up. And rounds that
  come to nothing could end sooner.

Beside the exponents:

- `sample` of 20 000 readings takes 20 times as long as of 250: 11 s in the density (1.8 ms a draw), 6 s in all else.
  The number of draws does not grow.
- A draw with form error costs 3.3 ms at 20 000 readings, and nowhere grows faster than they do.
- Walkers: more of them are more draws (122 000 effective with 1024), and the cost of a draw falls with the batch
  (emcee: 41 to 13 µs). Ensembles of 1024 were refused, with a false reason, until more starts were tried for them.
- Specimens: a joint posterior walks with emcee whatever is asked, since its walk begins without a mixture; one film
  takes 3.1 s that way, and some 0.5 s by `sample` alone. Half of the time at 100 films is in their densities (61 µs a
  film), half in all else, among it emulated curves of all readings (those of one test are shortened to a few axes,
  those of several are not) and a run for each test.
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

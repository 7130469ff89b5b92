"""The page of `tests.studies.growth`, made of its rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from tests.studies.results import Row

LARGEST = 3  # sizes from which the second exponent is fitted

HEAD = """# How cost grows with work

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
    out = [HEAD + "\n".join(exponents(found))]
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
        cells = [f"{size:,}", str(len(own)), f"{np.mean(seconds):.2f}", f"{min(seconds):.2f}, {max(seconds):.2f}"]
        cells += [f"{films:,.0f}", f"{1e6 * each:,.0f}", f"{rest:.2f}"] if films else ["", "", ""]
        worth = [r["ess_bulk"] for r in own if r.get("ess_bulk")]
        cells.append(f"{np.mean(worth):,.0f}" if worth else "")
        cells.append(", ".join(sorted({r["sampler"] for r in own if r.get("sampler")})))
        yield f"| {' | '.join(cells)} |"

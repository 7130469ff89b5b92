"""Ranks as a table and a figure: coverage of intervals, and how far ranks are from uniform."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, kstest, kstwo

Array = NDArray[np.float64]

RANKED = 63
"""Draws that a truth is ranked among: 0 to 63 below it, 64 ranks."""
LEVELS = (0.5, 0.8, 0.9, 0.95)
SURE = 1e-3
"""Of the p-values of one design, after Bonferroni's correction: below it, its ranks are not uniform."""


def places(ranks: Array) -> Array:
    """(n,) in (0, 1): ranks (n,) with the place inside a rank drawn, so that right ranks are exactly uniform."""
    rng = np.random.default_rng(7)
    return np.asarray((ranks + rng.uniform(size=ranks.size)) / (RANKED + 1))


def p_value(ranks: Array) -> float:
    """Of A. Kolmogorov's test that ``ranks`` (n,) are uniform."""
    return float(kstest(places(ranks), "uniform").pvalue)


def held(ranks: Array, level: float) -> int:
    """How many truths lie in the central interval of ``level``."""
    u = places(ranks)
    return int(np.sum(np.abs(u - 0.5) <= 0.5 * level))


def report(rows: list[dict[str, Any]], made_by: str, table: Path | None = None) -> str:
    """The page; also written to ``table``, with the figure beside it."""
    by_design: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in rows:
        by_design[row["design"]].append(row)
    lines = [
        "# Simulation-based calibration",
        "",
        f"{made_by}: {len(rows)} replicates. A truth from the prior, readings of it with forces of the other solver "
        f"(of the same one where there are effects), and its rank among {RANKED} independent draws of the posterior: "
        "of every coordinate, of the force at the end and of the log likelihood. Coverage is of all these together; "
        "p is the least of Kolmogorov's tests of a "
        f"design, times their number; below {SURE:g} the ranks are not uniform.",
        "",
        "| design | replicates | " + " | ".join(f"{lv:.0%}" for lv in LEVELS) + " | p | worst | failed | s (median) |",
        "|" + " --- |" * (len(LEVELS) + 6),
    ]
    for name, some in by_design.items():
        lines.append(_line(name, some))
    text = "\n".join(lines) + "\n"
    if table is not None:
        table.write_text(text, encoding="utf-8")
        figure(by_design, table.with_suffix(".png"))
    return text


def _line(name: str, rows: list[dict[str, Any]]) -> str:
    good = [r for r in rows if "ranks" in r]
    if not good:
        return f"| {name} | 0 |" + " |" * len(LEVELS) + f" | | {len(rows)} | |"
    ranks = ranks_of(good)
    tests = {n: p_value(v) for n, v in ranks.items()}
    worst = min(tests, key=lambda n: tests[n])
    p = min(1.0, tests[worst] * len(tests))
    cells = []
    for level in LEVELS:
        count, total = sum(held(v, level) for v in ranks.values()), sum(v.size for v in ranks.values())
        cells.append(f"{count / total:.1%}")
    said = f"{p:.2g}" + (" **not uniform**" if p < SURE else "")
    median = np.median([r["seconds"] for r in good])
    return f"| {name} | {len(good)} | {' | '.join(cells)} | {said} | {worst} | {len(rows) - len(good)} | {median:.1f} |"


def ranks_of(rows: list[dict[str, Any]]) -> dict[str, Array]:
    """{quantity: ranks (n,)}."""
    return {n: np.array([r["ranks"][n] for r in rows], dtype=float) for n in rows[0]["ranks"]}


def figure(by_design: dict[str, list[dict[str, Any]]], path: Path) -> None:
    """ECDF less the diagonal of every quantity, a panel a design, with the band that holds 95 % of right ones."""
    shown = {n: [r for r in rows if "ranks" in r] for n, rows in by_design.items()}
    shown = {n: rows for n, rows in shown.items() if rows}
    columns = min(4, max(len(shown), 1))
    lines = int(np.ceil(len(shown) / columns)) or 1
    made, axes = plt.subplots(lines, columns, figsize=(3.2 * columns, 2.5 * lines), squeeze=False, layout="constrained")
    for ax in axes.ravel()[len(shown) :]:
        ax.axis("off")
    for ax, (name, rows) in zip(axes.ravel(), shown.items(), strict=False):
        band = float(kstwo.ppf(0.95, len(rows)))
        ax.axhspan(-band, band, color="0.9")
        for n, ranks in ranks_of(rows).items():
            u = np.sort(places(ranks))
            ax.step(u, np.arange(1, u.size + 1) / u.size - u, where="post", lw=1, label=n)
        ax.set_title(f"{name} ({len(rows)})", fontsize=8)
        ax.set_xlim(0, 1)
        ax.legend(fontsize=5, frameon=False)
    made.supxlabel("rank of the truth among draws, 0 to 1")
    made.supylabel("ECDF less the diagonal")
    made.savefig(path, dpi=130)
    plt.close(made)


def surely_off(ranks: Array, level: float, sure: float = 1e-6) -> bool:
    """True if the intervals of ``level`` hold so few or so many truths that chance does not do it."""
    return bool(binomtest(held(ranks, level), ranks.size, level).pvalue < sure)

"""The page of `tests.studies.side_by_side`, made of its rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tests.studies.results import Row

FELUPE, REFERENCE = "FElupe", "cubature"

HEAD = """# Side by side with other samplers, and with finite elements

"""

FILM_WORDS = """
## One film by finite elements
"""
FILM_HEAD = (
    "| energy | FElupe, CPU s | increments | here alone, ms | in a batch of 64, µs | times faster, alone, in a batch "
    "| apart, smallest and largest deflection | the same a quarter as thick |\n|---|---|---|---|---|---|---|---|"
)


def page(rows: Sequence[Row], samplers: Sequence[str]) -> str:
    """Markdown of all rows."""
    out = [HEAD]
    for material in dict.fromkeys(r["material"] for r in rows if r["sampler"] in samplers):
        here = [r for r in rows if r["material"] == material]
        out += [f"\n## {material.replace('_', '-')}\n", reference(here), "", *lines(here, samplers)]
    films = [r for r in rows if r["sampler"] == FELUPE]
    if films:
        out += [FILM_WORDS, FILM_HEAD, *map(film_line, films)]
    return "\n".join(out) + "\n"


def film_line(r: Row) -> str:
    name = r["material"].replace("_", "-")
    if "error" in r:
        return f"| {name} | {r['error']} | | | | | | |"
    alone, batch = 1e6 * r["seconds"] / r["alone"], 1e6 * r["seconds"] / r["batch"]
    apart, thinner = (f"{r[k][0]:+.2%}, {r[k][-1]:+.3%}" for k in ("apart", "thinner"))
    return (
        f"| {name} | {r['seconds']:.1f} | {r['increments']} | {r['alone'] / 1e3:.2f} | {r['batch']:.0f} "
        f"| {alone:,.0f}, {batch:,.0f} | {apart} | {thinner} |"
    )


def reference(here: Sequence[Row]) -> str:
    exact = [r for r in here if r["sampler"] == REFERENCE and "log_evidence" in r]
    if exact:
        r = exact[0]
        return f"ln Z by cubature: {r['log_evidence']:.4f} ({r['coarse']:.4f} on three quarters of the points an axis)."
    value = np.median([r["log_evidence"] for r in here if "log_evidence" in r])
    return f"ln Z, median of all that give one: {value:.3f}; each is compared with the median of the others."


def lines(here: Sequence[Row], samplers: Sequence[str]) -> Iterator[str]:
    yield (
        "| sampler | runs | CPU s | of that the density | evaluations | effective draws | evaluations a draw "
        "| effective draws a CPU second | means off | error of ln Z | stated |"
    )
    yield "|---|---|---|---|---|---|---|---|---|---|---|"
    exact = {r["sampler"]: r.get("log_evidence") for r in here}.get(REFERENCE)
    for name in samplers:
        mine = [r for r in here if r["sampler"] == name]
        good = [r for r in mine if "error" not in r]
        others = [r for r in here if r["sampler"] in samplers and r["sampler"] != name and "error" not in r]
        if good:
            yield _line(name, good, others, exact)
        elif mine:
            yield f"| {name} | {len(mine)} | {mine[0]['error']} | | | | | | | | |"


def _line(name: str, mine: Sequence[Row], others: Sequence[Row], exact: float | None) -> str:
    seconds, density, films = (float(np.mean([r[k] for r in mine])) for k in ("seconds", "density", "evaluations"))
    cells = [name, str(len(mine)), f"{seconds:.1f}", f"{density / seconds:.0%}", f"{films:,.0f}"]
    if "mean" in mine[0]:
        effective = float(np.mean([r["effective"] for r in mine]))
        cells += [f"{effective:,.0f}", f"{films / effective:.1f}", f"{effective / seconds:,.0f}"]
        cells.append(f"{means_off(mine, others):.1f}")
    else:
        cells += [""] * 4
    return f"| {' | '.join([*cells, *_log_evidence(mine, others, exact)])} |"


def means_off(mine: Sequence[Row], others: Sequence[Row]) -> float:
    """Root mean square of (mean - median of the others' means) / (sd / sqrt(effective)); nan without others."""
    drawn = [r for r in others if "mean" in r]
    if not drawn:
        return float("nan")
    centre, sd = (np.median([r[k] for r in drawn], axis=0) for k in ("mean", "sd"))
    z = [(np.array(r["mean"]) - centre) / sd * np.sqrt(r["effective"]) for r in mine]
    return float(np.sqrt(np.mean(np.square(z))))


def _log_evidence(mine: Sequence[Row], others: Sequence[Row], exact: float | None) -> tuple[str, str]:
    """Root mean square error, and what is stated."""
    own = [r for r in mine if "log_evidence" in r]
    known = [r["log_evidence"] for r in others if "log_evidence" in r]
    if not own or (exact is None and not known):
        return "", ""
    truth = float(np.median(known)) if exact is None else exact
    error = float(np.sqrt(np.mean([(r["log_evidence"] - truth) ** 2 for r in own])))
    return f"{error:.3f}", f"{np.mean([r['log_evidence_sd'] for r in own]):.3f}"

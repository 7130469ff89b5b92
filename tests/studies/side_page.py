"""The page of `tests.studies.side_by_side`, made of its rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tests.studies.results import Row

FELUPE, REFERENCE = "FElupe", "cubature"

HEAD = """# Side by side with other samplers, and with finite elements

`make study-beside` (`python -m tests.studies.side_by_side`, seeds from 20261124; versions in
`tests/studies/side_by_side.txt`). The posteriors of two energies on the measurement OP1 that ships (10 readings,
noise inferred; 3 parameters with Gent, 4 with Yeoh), each sampler as its documentation starts it, at least 1000
effective draws where it can be told so, all asking the same batched density. CPU seconds of one thread, imports and
kernels warm, on a machine that others used as well; what a sampler compiles for one posterior counts. Means over runs
of different seeds.

- **Density**: part of the CPU time that prior, film and likelihood take; the rest is the sampler itself.
- **Films**: draws of which the posterior was asked (of `sample`, without the checks of its answer, which its time
  includes). **Effective**: draws, as the sampler itself counts them.
- **Means off**: root mean square, over coordinates and runs, of how far its means lie from those of all other
  samplers, in the standard errors that effective draws promise: about 1 where they are what they say.
- **Error of ln Z**: root mean square over runs, by cubature; **stated**: what it says of itself.

## What it says

- `sample` is the fastest in CPU time, 8 times as many effective draws a second as UltraNest with Gent and 7 times as
  many as nautilus with Yeoh, and asks for the fewest films: 2.5 and 3.2 for an effective draw. It solves 32 steps of
  all walkers at once; dynesty asks for one film at a time, which costs 840 µs with Gent, against 21 µs.
- **nautilus** comes next in films (3.1 and 3.5) and is 16 and 7 times slower in draws a second: 95 to 98 % of its
  time is its own, which bounds its shells by networks. Asked for 1000 draws it makes 13 000 to 17 000. What it does
  better: every point is kept with its weight.
- **To be taken over: the weights.** `sample` makes a chain of what its mixture proposes, of which 43 to 60 % count as
  independent; by their weights 70 to 85 % do (efficiencies of the four runs: 0.85, 0.84, 0.72, 0.70). Draws with
  weights, or drawn anew by them where k-hat allows the mixture at all, would be 1.4 to 1.7 times as many: 1.7 to 2.1
  films each.
- **ln Z from the weights of the mixture is as good as by the bridge** (errors of 0.006 and 0.008, against 0.006) and
  costs no film; with the bridge a calibration takes four to five times as many films. Among these is its search for
  modes that the draws have missed, which weights cannot replace. *To be taken over:* the weights as an estimator of a
  comparison, and the bridge where emcee's ensembles walked.
- Nested sampling around the draws costs as much as the bridge. From the prior it took 347 000 films and 94 s with
  Yeoh, of whose prior convexity leaves 0.36: more than UltraNest, with a smaller error. One of UltraNest's two runs
  with Gent is off by 0.35 in ln Z and states 0.19.
- dynesty had not finished with Yeoh after 237 CPU seconds, one film at a time. `nested` of this package is dynesty
  with proposals in batches.
- **emcee as it comes** needs 60 to 73 films for an effective draw, and one of its three runs is wrong without saying
  so (Gent, means 9.6 standard errors off): a deviation of ln G d of 0.17 instead of 0.026, as walkers leave it that
  are still far away when the burn-in of two autocorrelation times is over.
- **NUTS on the emulator** asks for twice as many films as `sample` or more, and spends 80 to 95 % of its time in JAX,
  compiling and walking: in three or four dimensions gradients do not pay. Its draws are weighed by the film: one run
  with Yeoh was left with 85 effective draws of 4000, by a few where the polynomial has too little density. The wide
  density beside the polynomial that the emulator of this package has for its own walks is the remedy.
- Left out: pocoMC, since it needs PyTorch; Ogden's energy, for the time it takes all of them. nautilus, dynesty and
  all that is slow with Yeoh have one run each.
- **FElupe** takes 3600 to 8600 times as long for one curve, and 45 000 to 200 000 times as long as a film in a batch.
  It solves a solid, this package a membrane: the same force within 0.02 % at the largest deflection, 3.3 % more at 1
  mm (twenty times the thickness), 0.8 % more at 4.8 mm. Bending at the rims does that: a film of the same G d and a
  quarter of the thickness is 1.0 % stiffer at 1 mm.
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
    out = [HEAD.rstrip()]
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
        "| sampler | runs | CPU s | density | films | effective | films for an effective draw "
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
    """Root mean square of (mean - that of the others) / its standard error, if effective draws are what they say.

    Rows with the very same draws are no others. nan without any.
    """
    own = [r["mean"] for r in mine]
    drawn = [r for r in others if "mean" in r and r["mean"] not in own]
    drawn = list({str(r["mean"]): r for r in drawn}.values())
    if not drawn:
        return float("nan")
    worth = np.array([r["effective"] for r in drawn])
    centre, sd = (worth @ np.array([r[k] for r in drawn]) / np.sum(worth) for k in ("mean", "sd"))
    z = [(np.array(r["mean"]) - centre) / sd / np.sqrt(1 / r["effective"] + 1 / np.sum(worth)) for r in mine]
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

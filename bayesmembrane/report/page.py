"""The report: one HTML page that needs nothing else, and its tables as JSON. Reads results and solves nothing."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from bayesmembrane.calibration.beside_paper import Compared
from bayesmembrane.calibration.run import Run
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.ground.errors import SettingsError, StorageError
from bayesmembrane.physics.cache import Tally
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.base import Strip
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.report import canvas as figures
from bayesmembrane.report import sentences, tables
from bayesmembrane.report.blocks import Block, Section
from bayesmembrane.report.reading import read
from bayesmembrane.report.sections.comparison import section as comparison_section
from bayesmembrane.report.sections.comparison.figures import comparison_picture
from bayesmembrane.report.sections.loop.section import loop_answers, loop_sections
from bayesmembrane.report.sections.valleys.figures import valley_picture
from bayesmembrane.report.sections.valleys.section import alternative_text, next_table, valley_table
from bayesmembrane.report.style import spoken
from bayesmembrane.report.style import title as material_title
from bayesmembrane.report.tables import Table
from bayesmembrane.report.view import Shown, Specimen
from bayesmembrane.valleys.result import Valleys
from bayesmembrane.words import valleys as valley_words
from bayesmembrane.words.reconstruction import contradiction

GENERATOR = "bayesmembrane report"
PAGE, TWIN = "index.html", "report.json"
MOST_CORNER = 4000  # draws in a corner plot


def write_report(
    runs: Sequence[Run | Path],
    out: Path,
    reconstruction: Reconstruction | None = None,
    fits: Sequence[Compared] | None = None,
    title: str | None = None,
    cache: Tally | None = None,
    valleys: Sequence[Valleys] | None = None,
    comparison: Mapping[str, Comparison] | None = None,
    paper: comparison_section.Paper | None = None,
    loops: Sequence[Loop] | None = None,
) -> Path:
    """Write ``out/index.html`` and ``out/report.json`` about one run or several, and return the page's path.

    Parameters
    ----------
    runs : runs, or the folders that hold them
    out : folder; made if it is missing
    reconstruction : shown in a section of its own
    fits : our optima beside the paper's, from `calibration.beside_paper.compare_with_paper`
    title : of the page; made of the specimens' names unless given
    cache : what the curve cache did while all this was computed
    valleys : of some materials, from `valleys.follow`; shown in a section of their own
    comparison : by range, from `comparison.compare`; shown in a section of its own
    paper : losses (N) of the paper's optima by range and material, whose ranking is shown beside ours
    loops : what the model lacks, from `diagnosis.loop`; the page answers with that first

    A report of an earlier time is replaced, any other file is not: `StorageError`. The same error, or `DataError`,
    names a folder that holds no run; `SettingsError` says that there is none at all.
    """
    if not runs:
        raise SettingsError("a report needs a run", remedy="name at least one run folder")
    for name in (PAGE, TWIN):
        _refuse_foreign(out / name)
    shown = [read(run) for run in runs]
    return write_shown(shown, out, reconstruction, fits or (), title, cache, valleys, comparison, paper, loops)


def write_shown(
    shown: Sequence[Shown],
    out: Path,
    reconstruction: Reconstruction | None = None,
    compared: Sequence[Compared] = (),
    title: str | None = None,
    cache: Tally | None = None,
    valleys: Sequence[Valleys] | None = None,
    comparison: Mapping[str, Comparison] | None = None,
    paper: comparison_section.Paper | None = None,
    loops: Sequence[Loop] | None = None,
) -> Path:
    """As `write_report`, of runs that have been read."""
    shown = sorted(shown, key=lambda s: (s.digest.end, s.data_hash, s.hypothesis.curve_size, s.name))
    names = list(dict.fromkeys(s.specimen.name for s in shown))
    title = title or f"What the force curve of {sentences.listed(names)} says"
    cases = [s.case for s in shown]
    warnings = [*sentences.warnings(cases), *_solver_warnings(shown)]
    told = [*loop_answers(loops or ()), *sentences.answer(cases)]
    parts = loop_sections(loops or ())
    parts += [_data(shown, reconstruction), _curves(shown), _comparison(shown, compared)]
    parts += [_evidence(comparison, paper or {})] if comparison else []
    broken = [s for s in shown if s.digest.specimens]
    parts += [_break_points(broken)] if broken else []
    parts += [_valleys(valleys)] if valleys else []
    parts += [_reconstruction(reconstruction)] if reconstruction is not None else []
    parts += [_run(s, _of(s, compared)) for s in shown]
    parts += [_checks(shown), _made(shown, cache)]
    twin = {
        "generator": GENERATOR,
        "title": title,
        "answer": told,
        "warnings": warnings,
        "tables": {b.table.name: b.table.records() for p in parts for b in p.blocks if b.table is not None},
    }
    page = (
        _environment()
        .get_template("report.html.j2")
        .render(
            generator=GENERATOR,
            title=title,
            subtitle=_subtitle(shown),
            answer=told,
            warnings=warnings,
            sections=parts,
            footer="Bands hold what data and priors leave open if the material is right. Forces in N or mN, lengths "
            "in mm.",
        )
    )
    _write(out / TWIN, json.dumps(twin, indent=1, allow_nan=False, ensure_ascii=False))
    _write(out / PAGE, page)
    return out / PAGE


def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("bayesmembrane.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )


def _subtitle(shown: Sequence[Shown]) -> str:
    ends = sorted({s.digest.end for s in shown})
    materials = list(dict.fromkeys(s.name for s in shown))
    runs = f"{len(shown)} calibrations" if len(shown) > 1 else "One calibration"
    return (
        f"{runs}: {sentences.listed(materials)}, fitted up to {sentences.listed(f'{1e3 * e:.4g}' for e in ends)} mm of "
        "deflection."
    )


# ---- sections --------------------------------------------------------------------------------------------------------


def _data(shown: Sequence[Shown], reconstruction: Reconstruction | None) -> Section:
    blocks = [Block("text", s) for s in _reconstruction_sentences(reconstruction)]
    origin = ""
    for group in _groups(shown):
        s = group[0]
        d, film = s.digest, s.specimen
        noise = (
            f"stated noise {1e3 * float(np.min(d.sd)):.3g} to {1e3 * float(np.max(d.sd)):.3g} mN (sd)"
            if d.has_noise
            else "no stated noise: it is inferred"
        )
        facts = {
            "specimen": film.name,
            "thickness": f"{1e6 * film.thickness:.4g} um",
            "rig": _rig(film),
            "points": f"{d.at.size}, from {1e3 * float(np.min(d.at)):.4g} to {1e3 * d.end:.4g} mm of deflection",
            "forces": f"{float(np.min(d.force)):.4g} to {float(np.max(d.force)):.4g} N; {noise}",
            "whole measurement": f"up to {1e3 * d.full_range:.4g} mm",
            "files": ", ".join(f for f in film.files if f) or "-",
            "origin": "as above" if origin and film.origin == origin else film.origin or "not stated",
            "notes": "; ".join(film.notes) or "none",
            "data hash (SHA-256)": s.data_hash,
        }
        origin = film.origin
        name = f"data up to {1e3 * d.end:.4g} mm"
        blocks.append(_table(tables.facts_table(name, f"The measurement, fitted up to {1e3 * d.end:.4g} mm.", facts)))
    return Section("data", "Data", tuple(blocks))


def _curves(shown: Sequence[Shown]) -> Section:
    blocks = []
    for group in _groups(shown):
        look = look_of(group)
        names = sentences.listed(s.name for s in group)
        end = f"{1e3 * group[0].digest.end:.4g} mm"
        blocks.append(
            Block(
                "figure",
                picture=figures.first_look([look]),
                alt=f"Measured force against deflection up to {end} with the curves of {names}, and their residuals",
                caption=f"Force (N) against deflection (mm), fitted up to {end}: median curves and 90 % bands of "
                f"{names}. Beyond the fitted range curves are dashed and bands hatched: there only the form of the "
                "energy and the priors speak. Below: measured minus median force (N); the grey band is two standard "
                "deviations of the stated noise. The vertical axis of the residuals is logarithmic away from zero "
                "where it has to be.",
            )
        )
        unused = tuple(_held_out(s) for s in group if s.digest.rest_at.size)
        blocks += [Block("list", lines=unused)] if unused else []
    return Section("curves", "Curves and residuals", tuple(blocks))


def look_of(group: Sequence[Shown]) -> figures.Look:
    """The first-look picture of runs that were fitted to the same points."""
    d = group[0].digest
    rest = None
    if d.rest_at.size:
        rest = figures.Points(d.rest_at, d.rest_force, d.rest_sd if np.all(np.isfinite(d.rest_sd)) else None)
    curves = tuple(
        figures.Curve(s.material, s.digest.deflection, s.digest.curve, s.digest.beyond, s.digest.residual, s.name)
        for s in group
    )
    return figures.Look(_points(group[0]), curves, rest, f"Fitted up to {1e3 * d.end:.4g} mm")


def _points(s: Shown) -> figures.Points:
    return figures.Points(s.digest.at, s.digest.force, s.digest.sd if s.digest.has_noise else None)


def _held_out(s: Shown) -> str:
    """What a run says of points that it has not seen."""
    r = s.digest.rest_residual
    known = np.isfinite(r[1])
    n = r.shape[1]
    if not np.any(known):
        return f"{s.name}: no force can be predicted at any of the {n} points beyond the fitted range."
    inside = int(np.sum((r[0] <= 0) & (r[2] >= 0)))
    worst = sentences.newtons(float(np.nanmax(np.abs(r[1]))))
    missing = f", and {n - int(known.sum())} points have no prediction" if not np.all(known) else ""
    return (
        f"{s.name}: of the {n} points beyond the fitted range {inside} lie in the 90 % band; the median misses them by "
        f"up to {worst}{missing}."
    )


def _comparison(shown: Sequence[Shown], compared: Sequence[Compared]) -> Section:
    more = sentences.details([s.case for s in shown])
    blocks = [Block("list", lines=tuple(more))] if more else []
    blocks.append(_table(tables.fits_table(shown)))
    if compared:
        blocks += [Block("text", s) for s in _loss_sentence(compared)]
        blocks.append(_table(tables.losses_table(compared)))
    for material, group in groupby(sorted(shown, key=lambda s: s.hypothesis.label()), lambda s: s.hypothesis.label()):
        runs = sorted(group, key=lambda s: s.digest.end)
        if len(runs) > 1:
            blocks.append(_forest(runs, material))
    return Section("comparison", "Comparison", tuple(blocks))


def _evidence(found: Mapping[str, Comparison], paper: comparison_section.Paper) -> Section:
    caption = (
        "Left: evidence ln Z of each hypothesis minus that of the best, by both estimators; right: expected log "
        "predictive density of points left out, minus that of the best. Both without unit, to scale within 3 and "
        "logarithmic beyond; whiskers are two standard errors."
    )
    picture = Block(
        "figure", picture=comparison_picture(found), alt=comparison_section.alternative_text(found), caption=caption
    )
    made = (
        comparison_section.evidence_table(found),
        comparison_section.ranking_table(found, paper),
        comparison_section.modes_table(found),
        comparison_section.widths_table(found),
    )
    told = Block("list", lines=tuple(comparison_section.comparison_sentences(found, paper)))
    return Section(
        "evidence", "Which model, and how sure", (told, picture, *(_table(t) for t in made if t is not None))
    )


def _forest(runs: Sequence[Shown], label: str) -> Block:
    first = runs[0]
    parameters = {
        name: [
            figures.Interval(
                f"{1e3 * s.digest.end:.4g} mm", s.material, np.quantile(s.natural[:, i], (0.05, 0.5, 0.95))
            )
            for s in runs
        ]
        for i, name in enumerate(first.hypothesis.natural_names)
    }
    units = dict(zip(first.hypothesis.natural_names, first.hypothesis.natural_units, strict=True))
    ends = sentences.listed(f"{1e3 * s.digest.end:.4g}" for s in runs)
    listed = sentences.listed(f"{spoken(n)} ({units[n]})" for n in parameters)
    return Block(
        "figure",
        picture=figures.forest(parameters, units),
        alt=f"Intervals of the parameters of {first.name} for the fitted ranges {ends} mm",
        caption=f"{first.name}: medians and 90 % intervals of {listed}, fitted up to {ends} mm. Intervals that do not "
        "overlap say that one set of parameters cannot serve both ranges.",
    )


def _break_points(shown: Sequence[Shown]) -> Section:
    blocks = []
    for group in _groups(shown):
        d = group[0].digest
        names = [
            f"{n}: {1e6 * t:.0f} um, {1e3 * x:.0f} mm"
            for n, t, x in zip(d.specimens, d.break_thickness, d.break_at, strict=True)
        ]
        rows = [
            [figures.Interval(s.name, s.material, s.digest.break_predicted[:, i], "no force") for s in group]
            for i in range(len(names))
        ]
        end = f"{1e3 * d.end:.4g} mm"
        blocks.append(
            Block(
                "figure",
                picture=figures.break_points(names, d.break_force, rows),
                alt=f"Forces at the break points of {len(names)} specimens, observed and predicted from fits up to "
                f"{end}",
                caption=f"Force (N) at the deflections at which {len(names)} specimens broke: observed, and predicted "
                f"by films fitted up to {end}, scaled with the thickness (median, 90 % interval). The specimens had "
                "been cycled before they broke, and the fitted curve is a first loading.",
            )
        )
        lines = (
            sentences.break_points(
                s.name,
                d.end,
                d.break_force.tolist(),
                s.digest.break_predicted[0].tolist(),
                s.digest.break_predicted[2].tolist(),
            )
            for s in group
        )
        blocks += [Block("list", lines=tuple(lines)), _table(tables.break_table(group))]
    return Section("break-points", "Break points: a prediction for other specimens", tuple(blocks))


def _valleys(found: Sequence[Valleys]) -> Section:
    blocks = [_table(valley_table(found))]
    for f in found:
        blocks.append(Block("heading", f.hypothesis.material.title))
        caption = (
            "Films that fit nearly as well as the best one, over the membrane parameters; the loss is the Euclidean "
            "norm of the residual (N), without convexity prior."
        )
        picture = valley_picture(f)
        blocks.append(Block("figure", picture=picture, alt=alternative_text(f), caption=caption))
        blocks.append(Block("list", lines=valley_words.sentences(f)))
        blocks += [_table(next_table(v)) for v in f.ranges if v.next_tests]
    return Section("valleys", "Valleys of the loss", tuple(blocks))


def _reconstruction(found: Reconstruction) -> Section:
    suspects = {(s.material, s.column) for s in found.suspects}
    recovered = [
        figures.Recovered(r.name, figures.Points(r.deflection, r.force, r.force_sd), r.n_points) for r in found.ranges
    ]
    bars = [
        figures.LossBar(
            f"{material_title(c.material)} {c.column}",
            c.range,
            c.reconstructed - c.printed,
            (c.material, c.column) in suspects,
        )
        for c in found.losses
    ]
    names = sentences.listed(r.name for r in found.ranges)
    picture = Block(
        "figure",
        picture=figures.reconstruction(recovered, bars),
        alt=f"Recovered force curve over {names}, probabilities of the number of points, and loss residuals",
        caption="The measured curve behind the published losses: recovered forces (N) and their standard deviations "
        "(mN) against deflection (mm), probability of the number of points, and distance of the recovered curve to "
        "each printed loss (mN). Suspect rows are red and hatched.",
    )
    blocks = [Block("text", s) for s in _reconstruction_sentences(found)] + [picture]
    if found.suspects:
        blocks.append(Block("heading", "Printed entries that contradict the rest"))
        blocks.append(Block("list", lines=tuple(_suspect_line(s) for s in found.suspects)))
    influence = {i.changed: f"{1e3 * float(np.max(np.abs(i.force - found.force))):.3g} mN" for i in found.influence}
    if influence:
        caption = "Largest change of any recovered force (mN) when one assumption of the reconstruction is changed."
        blocks.append(_table(tables.facts_table("reconstruction influence", caption, influence)))
    return Section("reconstruction", "Where the curve comes from", tuple(blocks))


def _suspect_line(found: Any) -> str:
    changes = sentences.listed(f"{c.entry} {c.printed} to {c.consistent:g}" for c in found.corrections)
    mend = f"; smallest change that mends it: {changes}" if changes else ""
    return f"{material_title(found.material)} {found.column}: {contradiction(found)}{mend}."


def _run(s: Shown, compared: Compared | None) -> Section:
    end = f"{1e3 * s.digest.end:.4g} mm"
    blocks = [Block("text", text) for text in _run_sentences(s)]
    blocks.append(_table(tables.parameters_table(s, compared)))
    blocks += [_residuals(s), _corner(s, compared)]
    blocks += (
        [_priors(s)] if len(s.prior) else [Block("text", "The convexity prior leaves next to no prior draws to show.")]
    )
    blocks += [_traces(s), _map(s), *_profiles(s)]
    blocks.append(_table(tables.coordinates_table(s)))
    return Section(s.key, f"{s.name}, fitted up to {end}", tuple(blocks))


def _run_sentences(s: Shown) -> list[str]:
    case = s.case
    told = [sentences.describes([case]), sentences.unknown([case]), sentences.extrapolation([case])]
    return [t for t in [*told, sentences.convergence([case])] if t]


def _residuals(s: Shown) -> Block:
    unit = "in units of the stated noise (sd)" if s.digest.has_noise else "in N"
    return Block(
        "figure",
        picture=figures.residuals(_points(s), s.digest.residual, s.material),
        alt=f"Residuals of {s.name} against deflection {unit}",
        caption=f"{s.name}: measured minus computed force {unit} against deflection (mm), with the 90 % band of the "
        "posterior. The grey bands are one and two standard deviations. Residuals that follow each other with one "
        "sign say that the curve has another shape, or that the errors of the points depend on each other.",
    )


def _corner(s: Shown, compared: Compared | None) -> Block:
    h = s.hypothesis
    thin = s.natural[:: max(1, len(s.natural) // MOST_CORNER)]
    optimum = published = None
    marked = ""
    if compared is not None:
        held = compared.held_parameters or compared.parameters
        own = [n.partition(".")[2] if n.startswith(f"{s.material}.") else "" for n in h.natural_names]
        optimum = [held.get(n) for n in own]
        published = [compared.published.get(n) for n in own] if compared.published else None
        marked = (
            " Crosses: our least-squares optimum under the convexity prior, and the paper's, where they lie inside."
        )
    names = sentences.listed(f"{spoken(n)} ({u})" for n, u in zip(h.natural_names, h.natural_units, strict=True))
    return Block(
        "figure",
        picture=figures.corner_plot(thin, h.natural_names, h.natural_units, s.material, optimum, published),
        alt=f"Corner plot of the parameters of {s.name}",
        caption=f"{s.name}: posterior of {names}, one by one and in pairs (regions that hold 50 % and 90 %; dashed: "
        f"5, 50 and 95 %; axes are logarithmic where a parameter spans more than a decade).{marked}",
    )


def _priors(s: Shown) -> Block:
    parameters = s.hypothesis.parameters
    marginals = [figures.Marginal(p.name, p.unit, s.prior[:, i], s.x[:, i]) for i, p in enumerate(parameters)]
    names = sentences.listed(f"{spoken(p.name)} ({p.unit})" for p in parameters)
    return Block(
        "figure",
        picture=figures.prior_posterior(marginals, s.material),
        alt=f"Prior and posterior of the sampled coordinates of {s.name}",
        caption=f"{s.name}: what the data add to the prior, for {names}; each scaled to its own maximum.",
    )


def _traces(s: Shown) -> Block:
    parameters = s.hypothesis.parameters
    names, units = [p.name for p in parameters], [p.unit for p in parameters]
    listed = sentences.listed(f"{spoken(n)} ({u})" for n, u in zip(names, units, strict=True))
    whole = s.sampling.steps_at[0] < s.sampling.burn
    discarded = "What is shaded was discarded." if whole else f"The first {s.sampling.burn} steps were discarded."
    return Block(
        "figure",
        picture=figures.traces(s.sampling.means, s.sampling.steps_at, s.sampling.burn, names, units),
        alt=f"Means of the ensembles of {s.name} against the step",
        caption=f"{s.name}: mean over the walkers of each ensemble against the step (-), for {listed}. {discarded} "
        "Ensembles that stay apart, or drift, have not converged.",
    )


def _map(s: Shown) -> Block:
    d = s.digest
    shares = sentences.listed(f"{m} {sentences.percent(v)}" for m, v in d.convex.items())
    annulus = isinstance(s.specimen.rig, Annulus)
    states = "the states that its film passes from the ring to the disc" if annulus else "the state of the film"
    return Block(
        "figure",
        picture=figures.convexity_map(d.map_1, d.map_2, d.eigenvalue, d.shape_at, d.state_1, d.state_2, s.material),
        alt=f"Map of the convexity of {s.name} over the stretches, with the states that the film reaches",
        caption=f"{s.name}: least eigenvalue of the Hessian of the energy over G d (-) in the plane of the stretches "
        f"(-), for the draw nearest to the median curve, and {states} "
        f"at several deflections (mm). Convexity prior: {s.hypothesis.convexity}; posterior draws that meet each "
        f"mode: {shares}.",
    )


def _profiles(s: Shown) -> list[Block]:
    """The lifted film; a strip is as long as it is stretched, and needs no picture."""
    d, rig = s.digest, s.specimen.rig
    if not isinstance(rig, Annulus):
        return []
    at = sentences.listed(f"{1e3 * x:.3g}" for x in d.shape_at)
    return [
        Block(
            "figure",
            picture=figures.profiles(
                d.shape_at, d.shape_radius, d.shape_height, rig.inner_radius, rig.outer_radius, s.material
            ),
            alt=f"Deformed film of {s.name} at {at} mm",
            caption=f"{s.name}: the deformed film, height (mm) against radius (mm), at deflections of {at} mm; one "
            f"thin line for each of {d.shape_radius.shape[1]} posterior draws.",
        )
    ]


def _checks(shown: Sequence[Shown]) -> Section:
    made = (tables.crosscheck_table(shown), tables.masses_table(shown), tables.outcomes_table(shown))
    return Section("checks", "Cross-checks", tuple(_table(t) for t in made))


def _made(shown: Sequence[Shown], cache: Tally | None) -> Section:
    blocks = [_table(tables.sampling_table(shown))]
    if cache is not None or any(s.cache for s in shown):
        blocks.append(_table(tables.cache_table(shown, cache)))
    facts = _common([s.facts for s in shown])
    blocks.append(
        _table(
            tables.facts_table(
                "settings", "Settings, seed and versions" + (" common to all runs." if len(shown) > 1 else "."), facts
            )
        )
    )
    if len(shown) > 1:
        blocks.append(_table(tables.own_facts_table(shown, facts)))
    return Section("made", "How it was made", tuple(blocks))


# ---- pieces ----------------------------------------------------------------------------------------------------------


def _rig(film: Specimen) -> str:
    """Its lengths, and for a strip what stress and stretch the page's forces and deflections stand for."""
    rig = film.rig
    lengths = sentences.listed(f"{name.replace('_', ' ')} {1e3 * v:.4g} mm" for name, v in rig.lengths.items())
    if not isinstance(rig, Strip):
        return f"{rig.title}, {lengths}"
    shown = rig.shown(film.thickness)
    return (
        f"{rig.title}, {lengths}; forces are nominal stress times width times thickness, 1 N for "
        f"{shown['N'][0]:.4g} kPa, and 1 mm of deflection is {1e-3 * shown['m'][0]:.4g} of stretch"
    )


def _groups(shown: Sequence[Shown]) -> list[list[Shown]]:
    """Runs fitted to the same points, in order."""
    return [list(g) for _, g in groupby(shown, key=lambda s: (s.digest.end, s.data_hash))]


def _common(facts: Iterable[Any]) -> dict[str, Any]:
    every = list(facts)
    return {k: v for k, v in every[0].items() if all(k in f and f[k] == v for f in every)}


def _of(s: Shown, compared: Sequence[Compared]) -> Compared | None:
    fits = (c for c in compared if c.material == s.material and abs(c.end - s.digest.end) <= 1e-6 * s.digest.end)
    return None if s.hypothesis.effects else next(fits, None)


def _table(table: Table) -> Block:
    return Block("table", table=table)


def _loss_sentence(compared: Sequence[Compared]) -> list[str]:
    pairs = [sentences.LossPair(material_title(c.material), c.range, c.ours, c.evaluated) for c in compared]
    told = sentences.losses(pairs)
    return [told] if told else []


def _reconstruction_sentences(found: Reconstruction | None) -> list[str]:
    if found is None:
        return []
    counts = [max(r.n_points.items(), key=lambda i: i[1]) for r in found.ranges]
    ranges = sentences.listed(
        f"{n} points over {r.name} (probability {p:.2g})" for r, (n, p) in zip(found.ranges, counts, strict=True)
    )
    suspects = sentences.listed(f"{material_title(s.material)} {s.column}" for s in found.suspects)
    rows = f"printed rows that contradict the rest: {suspects}" if suspects else "no printed row contradicts the rest"
    return [f"The curve is not raw data: it was reconstructed from published losses, {ranges}; {rows}."]


def _solver_warnings(shown: Sequence[Shown]) -> list[str]:
    found = []
    for s in shown:
        largest = s.crosscheck.get("largest")
        if isinstance(largest, float):
            found.append(sentences.disagreement(s.name, s.digest.end, largest))
    return [f for f in found if f]


# ---- files -----------------------------------------------------------------------------------------------------------


def _refuse_foreign(path: Path) -> None:
    """Raise `StorageError` if something stands at ``path`` that is no report of ours."""
    if not path.exists():
        return
    if path.is_file():
        with path.open(encoding="utf-8", errors="replace") as file:
            if GENERATOR in file.read(2000):
                return
    raise StorageError("this is no report of ours, and nothing is overwritten", str(path), "choose another folder")


def _write(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".part", delete=False, encoding="utf-8") as file:
            file.write(text)
        os.replace(file.name, path)
    except OSError as error:
        raise StorageError(
            f"the report cannot be written ({error.strerror})", str(path), "choose another folder"
        ) from None


__all__ = ["look_of", "write_report", "write_shown"]

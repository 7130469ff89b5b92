"""The tables of a diagnosis: errors, candidates, effects that look alike, effects that would have shown."""

from __future__ import annotations

import math

from bayesmembrane.diagnosis.candidates.standard import expected_size
from bayesmembrane.diagnosis.left.heldout import Misfit
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.registry import components
from bayesmembrane.report.blocks import PLAIN, Column, Table, Value
from bayesmembrane.words.candidates import candidate_title, sizes
from bayesmembrane.words.diagnosis import set_aside
from bayesmembrane.words.hypothesis import effect_title, spoken
from bayesmembrane.words.language import spoken_parameter
from bayesmembrane.words.seen import Seen, seen
from bayesmembrane.words.units import size_in_words

MOST_CANDIDATES = 20


def error_columns(how: Seen) -> tuple[Column, ...]:
    """Those of a table of errors, in the unit of what models leave."""
    unit = how.small[1]
    return (
        Column("model", "model"),
        Column(f"rmse_{unit}", f"root mean square ({unit})", PLAIN),
        Column(f"max_{unit}", f"largest ({unit})", PLAIN),
        Column("reduced_chi2", "reduced chi-square", ".3g"),
        Column(f"heldout_rmse_{unit}", f"held out: root mean square ({unit})", PLAIN),
        Column(f"heldout_max_{unit}", f"held out: largest ({unit})", PLAIN),
        Column("heldout_reduced_chi2", "held out: reduced chi-square", ".3g"),
        Column("heldout_coverage_90", "held out: inside the 90 % band", "%"),
    )


def errors_caption(where: str) -> str:
    """What a table of errors says; ``where`` : which points were held out."""
    return (
        "Errors of the best fits, each as it was fitted last (a reduced chi-square of 1 is noise alone). Held "
        f"out: {where}; predicted by the model fitted to the other points, its form error going on from there."
    )


def error_cells(error: Misfit | None, how: Seen) -> tuple[Value, ...]:
    """An error in three cells."""
    if error is None:
        return (None, None, None)
    factor = how.small[0]
    return (factor * error.rmse_N, factor * error.max_N, error.reduced_chi2)


def before_and_after(d: Diagnosis, name: str) -> Table:
    """Errors of the model as given and, if something was found, of the most probable one."""
    v, how = d.validation, seen(d.measurement)
    rows = [
        (
            spoken(d.null.hypothesis),
            *error_cells(d.before, how),
            *error_cells(v.before if v else None, how),
            v.covered_before if v else None,
        )
    ]
    if d.best is not d.null:
        rows.append(
            (
                spoken(d.best.hypothesis),
                *error_cells(d.after, how),
                *error_cells(v.after if v else None, how),
                v.covered_after if v else None,
            )
        )
    return Table(name, errors_caption(set_aside(v)), error_columns(how), tuple(rows))


def ranking_table(d: Diagnosis, name: str) -> Table:
    """Every candidate that was refitted, the most probable first."""
    columns = (
        Column("candidate", "candidate"),
        Column("size", "most probable size"),
        Column("probability", "probability, with this energy", "%"),
        Column("log_bayes_factor", "ln Bayes factor", "+.1f"),
        Column("unexplained", "unexplained", "%"),
        Column("law_error", "error of its law", "%"),
        Column("at_bound", "at a bound"),
        Column("in_answer", "in the answer"),
    )
    members = {j.candidate.label for j in d.members} if d.verdict != "unknown" else set()
    rows = []
    first = d.ranking[:MOST_CANDIDATES]
    null = [j for j in d.ranking[MOST_CANDIDATES:] if j.candidate.label == d.null.label]
    for j in (*first, *null):
        c = j.candidate
        rows.append(
            (
                candidate_title(c, d.null),
                ", ".join(sizes(c, d)) or "-",
                j.probability,
                j.gain,
                j.unexplained,
                max(c.law_errors.values(), default=None),
                ", ".join(spoken_parameter(n) for n in c.at_bound) or "-",
                c.label in members,
            )
        )
    caption = (
        f"What could explain the residual of {spoken(d.null.hypothesis)}: every hypothesis was fitted as a whole, and "
        "its sizes are those of that fit; of what was then sampled the posterior tells the size. "
        "Probability: among all of them, nothing foreign beside it. ln Bayes factor: against the model as it was, "
        "noise and form error integrated out. Unexplained: part of the squares beyond noise that is left, form error "
        "aside; above 100 % it is more than the model as it was leaves. Error of its law: what the trace of its "
        "effects would have to be off."
    )
    if len(d.ranking) > MOST_CANDIDATES:
        caption += f" The {MOST_CANDIDATES} most probable of {len(d.ranking)}."
    return Table(name, caption, columns, tuple(rows))


def confounded_table(d: Diagnosis, name: str) -> Table:
    """Pairs of effects whose traces are nearly the same on this protocol."""
    columns = (
        Column("effect", "effect"),
        Column("other", "and"),
        Column("degrees", "degrees between their traces", ".1f"),
    )
    rows = tuple((effect_title(a), effect_title(b), v) for a, b, v in d.confounded)
    caption = (
        "Effects that this measurement hardly tells apart, whichever is at work: angle between what they leave in the "
        "residual after the material has absorbed its part (0: the same, 90: nothing in common)."
    )
    return Table(name, caption, columns, rows)


def power_table(d: Diagnosis, name: str) -> Table:
    """The smallest size of each effect that would have shown, the easiest to see first."""
    columns = (
        Column("effect", "effect"),
        Column("parameter", "size"),
        Column("smallest", "smallest that shows"),
        Column("usual", "usual"),
        Column("ratio", "smallest over usual", ".2g"),
    )
    known, shown = components("effects"), d.rig.shown(d.thickness)
    rows: list[tuple[Value, ...]] = []
    for effect, smallest in d.power.items():
        size = known[effect]().size
        if math.isfinite(smallest):
            usual = expected_size(known[effect](), d.measurement)
            words = (size_in_words(v, size.unit, shown) for v in (smallest, usual))
            rows.append((effect_title(effect), spoken_parameter(f"{effect}.{size.name}"), *words, smallest / usual))
    rows.sort(key=lambda r: float(r[-1] or 0.0))
    caption = (
        f"What this measurement could have shown beside {spoken(d.null.hypothesis)}: the smallest effect "
        "that the tests would have found nine times out of ten, beside what is usual before the data. An effect whose "
        "ratio is above 1 could be there, of usual size, and not be seen."
    )
    return Table(name, caption, columns, tuple(rows))

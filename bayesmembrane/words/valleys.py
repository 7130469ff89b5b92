"""What the valleys say, in words, and the JSON answer of ``valleys``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.convexity import RESTRICTING
from bayesmembrane.valleys.beside import Beside
from bayesmembrane.valleys.profile import End, Ending
from bayesmembrane.valleys.result import Between, Valley, Valleys
from bayesmembrane.words.hypothesis import spoken, title
from bayesmembrane.words.language import listed
from bayesmembrane.words.next_test import ASSUMPTION, spoken_test
from bayesmembrane.words.seen import seen_by_valley

FEW = 2  # open ends that have a sentence each
CLOSE = 2.0  # posterior standard deviations within which two valleys count as compatible
UNIT = "posterior standard deviations (Mahalanobis, the sum of both posterior covariances)"
ENDINGS = {
    Ending.RISES: "",
    Ending.NO_FILM: "beyond it no film reaches the data",
    Ending.NOT_FOLLOWED: "not followed to the end",
    Ending.TENDS: "the loss stays within the rise and tends to a limit",
    Ending.CHANGES: "the loss stays within the rise and still changes",
}


def document(found: Valleys | Beside) -> dict[str, Any]:
    """The JSON answer of ``valleys``; with effects, that without them stands beside it."""
    if isinstance(found, Valleys):
        return _document(found)
    return {
        **_document(found.added),
        "without_effects": _document(found.without),
        "beside": [{**_approach(c), "sentence": sentence_beside(a, b, c)} for a, b, c in found.compared],
        "sentences": list(sentences(found)),
    }


def sentences(found: Valleys | Beside) -> tuple[str, ...]:
    """All that a reader should know; what effects do to the valley comes first."""
    if isinstance(found, Valleys):
        every = [s for v in found.ranges for s in valley_sentences(v)]
        return (*every, *(sentence_between(a, b, c) for a, b, c in found.compared))
    beside = (sentence_beside(a, b, c) for a, b, c in found.compared)
    return (*beside, *sentences(found.added), *(f"Without effects: {s}" for s in sentences(found.without)))


def _document(found: Valleys) -> dict[str, Any]:
    every = [{**_approach(c), "sentence": sentence_between(a, b, c)} for a, b, c in found.compared]
    return {
        **found.summary(),
        "ranges": [_valley(v) for v in found.ranges],
        "closest_approach": every[0] if every else None,
        "approaches": every,
        "sentences": list(sentences(found)),
    }


def _approach(between: Between) -> dict[str, Any]:
    return {**between.summary(), "unit": UNIT}


def _valley(v: Valley) -> dict[str, Any]:
    values = v.summary()
    profiles = zip(values["profiles"].items(), v.profiles, strict=True)
    return {
        **values,
        "limit": limit_title(v),
        "profiles": {n: {**part, "reason": [ENDINGS[e.ending] for e in p.ends]} for (n, part), p in profiles},
        "next_measurements": [{"test": spoken_test(t.test), **t.summary()} for t in v.next_tests],
        "next_measurements_assume": ASSUMPTION,
        "sentences": list(valley_sentences(v)),
    }


# ---- one valley ------------------------------------------------------------------------------------------------------


def valley_sentences(v: Valley) -> tuple[str, ...]:
    """What is to be said of one valley."""
    told = [_where(v), *_edge(v), *_open(v), *_basins(v), *_nothing_needed(v), *_modes(v), *_published(v), *_next(v)]
    if v.unreached > 0:
        told.append(f"{100 * v.unreached:.2g} % of the cells of the pairwise maps hold no film that reaches the data.")
    return tuple(told)


def _names(v: Valley) -> list[str]:
    return [n.partition(".")[2] for n in v.chart.names]


def up_to(v: Valley) -> str:
    """How a range is called: ``up to 35.1 mm``, ``up to a stretch of 2.5``."""
    return f"up to {seen_by_valley(v).place(v.end)}"


def _range(v: Valley) -> str:
    return up_to(v).capitalize()


def loss_of(v: Valley, value: float, count: int = 4) -> str:
    """A loss in N, in the unit of the curve's forces."""
    return seen_by_valley(v).loss(value, count)


def point(v: Valley, p: Array | Sequence[float]) -> str:
    """``c1 8.84, c2 -0.63``."""
    return ", ".join(f"{n} {x:.4g}" for n, x in zip(_names(v), p, strict=True))


def _where(v: Valley) -> str:
    share = 100 * v.rise / v.best_loss
    unit = f" {v.metric.unit}" if v.metric.unit not in ("-", "") else " in logarithms"
    length = v.length(v.metric)
    long = "" if length is None else f"; it is {'at least ' if v.open_end else ''}{length:.3g}{unit} long"
    number = v.spectra[0].condition_number
    ratio = f", condition number {number:.3g}" if np.isfinite(number) and v.best.size > 1 else ""
    return (
        f"{_range(v)} every {spoken(v.hypothesis)} film between ({point(v, v.floor[0])}) and "
        f"({point(v, v.floor[-1])}) on the valley's floor fits within {share:.3g} % of the least loss, "
        f"{loss_of(v, v.best_loss)}{long}{ratio}."
    )


def _open(v: Valley) -> list[str]:
    """Every parameter with an end that does not close the valley; of many of them in one sentence."""
    told: list[str] = []
    if sum(e.open for p in v.profiles for e in p.ends) > FEW:
        return [_open_in_many(v)]
    for p in v.profiles:
        for end, far in zip(p.ends, ("low", "high"), strict=True):
            if end.open:
                told.append(_open_end(v, p.index, end, far))
    return told


def _open_in_many(v: Valley) -> str:
    names, units = _names(v), [f" {u}" if u not in ("-", "") else "" for u in v.chart.units]
    opened, losses, closed = [], [v.best_loss], []
    for p in v.profiles:
        ends = [e for e in p.ends if e.open]
        losses += [e.loss for e in ends]
        if ends:
            opened.append(f"{names[p.index]} (to {' and '.join(f'{e.value:.3g}' for e in ends)}{units[p.index]})")
        if len(ends) == 1:
            high = p.ends[0].open
            bound = p.ends[int(high)].value
            closed.append(f"{names[p.index]} is {'below' if high else 'above'} {bound:.3g}{units[p.index]}")
    only = f"; what the data do say is that {', '.join(closed)}" if closed else ""
    return (
        f"{_range(v)} the valley is open in {', '.join(opened)}: as far as each of these is followed, with the others "
        f"adjusted, the loss stays between {loss_of(v, min(losses))} and {loss_of(v, max(losses))}{only}."
    )


def _edge(v: Valley) -> list[str]:
    """An optimum at the bounds of its coordinates is none."""
    if not v.at_bound:
        return []
    names = ", ".join(n.partition(".")[2] or n for n in v.at_bound)
    return [
        f"{_range(v)} the least loss lies where the search ends, in the coordinate {names}: it is a limit that films "
        "come close to, and no optimum."
    ]


def _open_end(v: Valley, i: int, end: End, far: str) -> str:
    name, unit = _names(v)[i], v.chart.units[i]
    shown = f"{end.value:.3g}" + (f" {unit}" if unit not in ("-", "") else "")
    if not v.chart.log[i] and i >= v.hypothesis.material_size:
        edge = "least" if far == "low" else "largest"
        return (
            f"{_range(v)} the valley is open: at {name} = {shown}, the {edge} value that is allowed, the loss is "
            f"{loss_of(v, end.loss)}."
        )
    goal = "zero" if abs(end.value) < abs(float(v.best[i])) or (v.chart.log[i] and far == "low") else "infinity"
    if v.chart.log[i] and v.chart.sign[i] < 0 and far == "high":
        goal = "minus infinity" if goal == "infinity" else goal
    limit = f", that of a {limit_title(v)} film" if v.limit and i == v.along else ""
    edge = f"the loss {'tends to' if end.tends else 'is still'} {loss_of(v, end.loss)}{limit}"
    low, high = v.profiles[i].ends
    other = low if far == "high" else high
    bound = f"; the data only say that {name} is {'above' if far == 'high' else 'below'} {other.value:.3g}"
    told = f"{_range(v)} the valley is open: as {name} goes to {goal} (followed to {shown}) {edge}"
    falls = f", and no value of {name} is an optimum" if end.loss <= v.best_loss * (1 + 1e-4) and end.tends else ""
    # Negative parameters on a logarithmic axis run the other way.
    clear = not other.open and v.chart.sign[i] >= 0
    return told + falls + (bound if clear else "") + "."


def _basins(v: Valley) -> list[str]:
    """Other minima along the floor: an optimiser may stop there."""
    return [
        f"{_range(v)} the loss has another basin near ({point(v, natural)}) with {loss_of(v, loss, 3)}, "
        f"{100 * (loss / v.best_loss - 1):.2g} % above the least, in which an optimiser may stop; it is no part of the "
        "length."
        for natural, loss in v.basins
    ]


def _nothing_needed(v: Valley) -> list[str]:
    """Parameters that may as well be zero."""
    told = []
    for p in v.profiles:
        low, high = p.ends
        if not v.chart.log[p.index] and v.best.size > 1 and low.value < 0 < high.value:
            told.append(
                f"{_range(v)} {_names(v)[p.index]} = 0 lies within the valley: a simpler film fits almost as well."
            )
    return told


def _modes(v: Valley) -> list[str]:
    parts = [f"{m.name} leaves {100 * v.share(m.name):.3g} %" for m in RESTRICTING]
    return [f"{_range(v)}, of the floor's length the convexity prior {parts[0]}, {parts[1]}, {parts[2]}."]


def _published(v: Valley) -> list[str]:
    if not v.published:
        return []
    on = [p.label for p in v.published if p.within]
    off = [f"{p.label} ({'no film' if p.loss is None else loss_of(v, p.loss, 3)})" for p in v.published if not p.within]
    parts = [f"{', '.join(on)} lie inside" if on else "", f"{', '.join(off)} lie outside" if off else ""]
    return [f"{_range(v)}, of the published parameter sets " + " and ".join(p for p in parts if p) + " the valley."]


def _next(v: Valley) -> list[str]:
    if not v.next_tests:
        return []
    first = v.next_tests[0]
    return [
        f"{_range(v)}, what would shorten the valley most is {spoken_test(first.test)}: its longest axis is expected "
        f"to shrink by {100 * first.reduction:.3g} %."
    ]


def limit_title(v: Valley) -> str:
    """The simpler material whose loss is that of an open end, as it is printed; "" without any."""
    return material(v.limit).title if v.limit else ""


# ---- two valleys -----------------------------------------------------------------------------------------------------


def sentence_between(a: Valley, b: Valley, found: Between) -> str:
    """How two valleys lie to each other."""
    distance, both = found.approach.distance, f"The valleys {up_to(a)} and {up_to(b)}"
    if found.crossing is not None:
        return f"{both} cross at ({point(a, found.crossing)})."
    if not np.isfinite(distance):
        return f"{both} cannot be compared: a posterior has no spread."
    if distance < CLOSE:
        return f"{both} do not cross, but come as close as {distance:.2g} posterior standard deviations."
    return (
        f"{both} stay apart: at their closest approach they are {distance:.3g} posterior standard deviations from each "
        "other, so that no one set of parameters serves both ranges."
    )


def sentence_beside(a: Valley, b: Valley, found: Between) -> str:
    """What the effects of ``b`` do to the valley ``a``."""
    names = listed(map(title, b.hypothesis.effects))
    change = 100 * (b.best_loss / a.best_loss - 1)
    n = a.best.size
    loss = (
        f"{abs(change):.2g} % {'lower' if change < 0 else 'higher'}, {loss_of(b, b.best_loss, 3)} instead of "
        f"{loss_of(a, a.best_loss, 3)}"
    )
    start = (
        f"{_range(a)}, with {names} the least loss is {loss}, and the optimum of "
        f"{a.hypothesis.material.title} moves from ({point(a, a.best)}) to ({point(a, b.best[:n])})"
    )
    distance = found.approach.distance
    if distance < CLOSE:
        return f"{start}; the valleys with and without come as close as {distance:.2g} posterior standard deviations."
    return (
        f"{start}; the valleys with and without stay {distance:.3g} posterior standard deviations apart, so that the "
        "material's parameters depend on the effects assumed."
    )

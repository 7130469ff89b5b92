"""The page on the cyclic tests of VHB 4910: tables, and the sentences that follow from their numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import combinations

import numpy as np

from bayesmembrane.ground.registry import components, material
from tests.studies.vhb import FIRST, SHOWN, Quick, Trial, Tried
from tests.studies.vhb_data import Cycle, difference, even, scatter

CALCULATED = 1e-6
NO_BETTER = 0.9  # of the plain error


def page(found: Sequence[Cycle], trials: Sequence[Trial], fast: Quick, seed: int) -> str:
    """Markdown of the whole page."""
    first = [t for t in trials if t.energy == FIRST]
    noise = {(c.peak, c.rate): scatter(c.measurement) for c in found}
    parts = [
        *_head(found, seed),
        "## How well such tests repeat",
        *_repeats(found, noise),
        f"## {material(FIRST).title}: calibrated at one rate, the others predicted",
        *_rates(first, noise),
        *_sentences(first, noise, found),
        "## A second round",
        *_again(first),
        f"## Every effect beside {material(FIRST).title}",
        *_effects(first),
        "## The other energies",
        *_energies(trials),
        "## A cycle of another laboratory, thirteen times as fast",
        *_quick(fast),
    ]
    return "\n\n".join(parts) + "\n"


def _head(found: Sequence[Cycle], seed: int) -> list[str]:
    return [
        "# What cyclic tests of VHB 4910 hold beside the material",
        f"Made by `python -m tests.studies.vhb --seed {seed}` from measurements that are not part of the project "
        "(uniaxial strips of the acrylic tape VHB 4910, loaded and unloaded once at 0.01, 0.03 and 0.05 1/s to a "
        "stretch of 1.5, 2.0 and 2.5; github.com/Chongran-Zhao/Viscoelastic-fitting, MIT).",
        "An energy is calibrated on one cycle and diagnosed; what the diagnosis names is added, or each of the first "
        f"{SHOWN} members where it is ambiguous. Both models then predict the cycles to the same peak at the other two "
        "rates, with nothing refitted. All errors are root mean squares of the nominal stress over a whole cycle, in "
        "kPa. Sizes of effects that are lengths or forces take the strip as 50 mm long, 10 mm wide and 1 mm thick.",
        _times(found),
    ]


def _times(found: Sequence[Cycle]) -> str:
    """Whether the times were measured."""
    off = max(even(c) for c in found)
    if off < CALCULATED:
        return (
            f"In all {len(found)} files each step in time is the step in stretch over the rate, to {off:.1g} of it: "
            "the times were calculated, not measured, and a machine that turned or waited otherwise would not show."
        )
    return f"Steps in time differ from the step in stretch over the rate by up to {100 * off:.2g} %."


def _table(head: str, rows: Iterable[str]) -> str:
    columns = head.count("|") - 1
    return "\n".join([head, "|" + "---|" * columns, *rows])


def _repeats(found: Sequence[Cycle], noise: dict[tuple[float, float], float]) -> list[str]:
    """Loading legs of one rate to different peaks measure the same thing."""
    rows, pairs = [], []
    for rate in sorted({c.rate for c in found}):
        for a, b in combinations([c for c in found if c.rate == rate], 2):
            pairs.append(difference(a.measurement, b.measurement))
            rows.append(f"| {rate:g} | {a.peak} and {b.peak} | {pairs[-1]:.2g} |")
    low, high = min(noise.values()), max(noise.values())
    return [
        _table("| rate, 1/s | peaks | difference of the loading legs, kPa |", rows),
        "Loading to one peak passes through the loading to a lower one, so that at one rate these legs should be one "
        f"curve. They differ by {min(pairs):.2g} to {max(pairs):.2g} kPa (median {np.median(pairs):.2g}): strips, or "
        f"days, differ by that much. Within one cycle a saturated reference leaves {low:.2g} to {high:.2g} kPa. A "
        "prediction of another test can be expected to be as good as the first number, not as the second.",
    ]


def _rates(first: Sequence[Trial], noise: dict[tuple[float, float], float]) -> list[str]:
    rates = sorted({t.rate for t in first})
    head = "| peak | calibrated at, 1/s | verdict | added | its size | noise | in sample |"
    head += "".join(f" predicted at {r:g} |" for r in rates)
    rows = []
    for t in first:
        for m in t.members or (None,):
            cells = [f"{t.peak}", f"{t.rate:g}", t.verdict, _title(m), m.size if m else ""]
            cells += [f"{noise[t.peak, t.rate]:.2g}", _arrow(t.plain.inside, m and m.inside)]
            cells += [_arrow(t.plain.outside.get(r), m and m.outside.get(r)) for r in rates]
            rows.append("| " + " | ".join(cells) + " |")
    return [_table(head, rows), "Errors: energy alone -> with what was added."]


def _title(m: Tried | None) -> str:
    if m is None:
        return "nothing"
    known = components("effects")
    return " and ".join(known[n].title for n in m.effects) or f"the energy {material(m.energy).title}"


def _arrow(before: float | None, after: float | None) -> str:
    if before is None:
        return ""
    return f"{before:.3g}" if after is None else f"{before:.3g} -> {after:.3g}"


def _sentences(first: Sequence[Trial], noise: dict[tuple[float, float], float], found: Sequence[Cycle]) -> list[str]:
    added = [(t, m) for t in first for m in t.members]
    if not added:
        return ["Nothing was named in any of them."]
    inside = [t.plain.inside / m.inside for t, m in added]
    pairs = [(t.rate, r, t.plain.outside[r], m.outside[r], m.low[r]) for t, m in added for r in m.outside]
    better = sum(after < before for _, _, before, after, _ in pairs)
    gain = [before / after for _, _, before, after, _ in pairs]
    told = [
        f"- Verdicts: {_counts(t.verdict for t in first)}. Added: {_counts(_title(m) for _, m in added)}.",
        f"- In sample the error falls {_span(inside)} times. That alone proves nothing: a model with more parameters "
        "always fits better.",
        f"- Predicted, it falls in {better} of {len(pairs)} cases, {_span(gain)} times.",
    ]
    for words, low, high in (("next", 0.0, 3.5), ("farthest", 3.5, np.inf)):
        near = [p for p in pairs if low <= max(p[0] / p[1], p[1] / p[0]) < high]
        told.append(
            f"- To the {words} rate ({_ratios(near)} apart) the median error is "
            f"{np.median([p[2] for p in near]):.2g} kPa before and {np.median([p[3] for p in near]):.2g} kPa after."
        )
    faster = [p[4] for p in pairs if p[1] > p[0]]
    slower = [p[4] for p in pairs if p[1] < p[0]]
    told += [
        f"- Loading legs at faster rates are predicted too low in {sum(v > 0 for v in faster)} of {len(faster)} cases, "
        f"those at slower rates in {sum(v > 0 for v in slower)} of {len(slower)}.",
        _beside(pairs, noise, found),
    ]
    return ["\n".join(told)]


def _beside(
    pairs: Sequence[tuple[float, float, float, float, float]],
    noise: dict[tuple[float, float], float],
    found: Sequence[Cycle],
) -> str:
    """Predictions beside the noise and beside how well tests repeat."""
    after = [p[3] for p in pairs]
    middle = float(np.median(after))
    sd = float(np.median(list(noise.values())))
    legs = [difference(a.measurement, b.measurement) for a, b in combinations(found, 2) if a.rate == b.rate]
    inside = sum(v <= max(legs) for v in after)
    return (
        f"- What is left of the predictions (median {middle:.2g} kPa) is {middle / sd:.0f} times the "
        f"noise of a cycle (median {sd:.2g} kPa), and {middle / np.median(legs):.1f} times the median "
        f"difference of loading legs at one rate; {inside} of {len(after)} predictions lie within the largest such "
        "difference. How much of it is the model's and how much the strips' cannot be told from one test of each kind."
    )


def _again(first: Sequence[Trial]) -> list[str]:
    """What the diagnosis of the model with what was named adds, and what that does to the predictions."""
    rows, change = [], []
    for t in first:
        if not t.again or not t.members:
            continue
        one, two = t.members[0], next((m for m in t.more if m.member), None)
        added = [n for n in two.effects if n not in one.effects] if two else []
        words = " and ".join(components("effects")[n].title for n in added) or (_title(two) if two else "nothing")
        cells = [f"{t.peak}", f"{t.rate:g}", t.again, words]
        cells += [_arrow(one.inside, two and two.inside), _arrow(one.predicted, two and two.predicted)]
        rows.append("| " + " | ".join(cells) + " |")
        change += [two.predicted / one.predicted] if two else []
    head = "| peak | calibrated at, 1/s | verdict | added to the first | in sample | predicted, both rates |"
    told = [
        "The loop would diagnose the model with what was named again. The first of each set stands here.",
        _table(head, rows),
    ]
    if change:
        worse = sum(c > 1 for c in change)
        told.append(
            f"A second effect is added in {len(change)} of {len(rows)} cycles. It makes the predictions worse in "
            f"{worse} of them; the error is multiplied by {_span(change)}. It takes what the form of the first leaves."
        )
    return told


def _effects(first: Sequence[Trial]) -> list[str]:
    """Every single effect that was refitted: medians, and how often it is best."""
    names = dict.fromkeys(x.effects[0] for t in first for x in _singles(t))
    fits = [min(_singles(t), key=lambda x: x.inside) for t in first]
    tells = [min(_singles(t), key=lambda x: x.predicted) for t in first]
    rows = []
    for name in names:
        own = [x for t in first for x in _singles(t) if x.effects == (name,)]
        best = [sum(x.effects == (name,) for x in found) for found in (fits, tells)]
        row = _effect_row(components("effects")[name].title, sum(x.explains for x in own), own, best)
        rows.append((float(np.median([x.predicted for x in own])), row))
    none = _effect_row("none", 0, [t.plain for t in first], (0, 0))
    head = f"| effect | explains, of {len(first)} | in sample, median | predicted, median | fits best | predicts best |"
    return [_table(head, [*(text for _, text in sorted(rows)), none]), winners(first)]


def _singles(t: Trial) -> list[Tried]:
    """The models with one effect."""
    return [x for x in t.tried if len(x.effects) == 1 and x.energy == t.energy]


def _effect_row(title: str, explains: int, own: Sequence[Tried], best: Sequence[int]) -> str:
    inside, predicted = (np.median(v) for v in ([x.inside for x in own], [x.predicted for x in own]))
    return f"| {title} | {explains} | {inside:.3g} | {predicted:.3g} | {best[0]} | {best[1]} |"


def winners(first: Sequence[Trial]) -> str:
    """Whether the effect that fits one cycle best predicts the others best, and how many that fit predict nothing."""
    told, same = [], 0
    for t in first:
        a, b = (min(_singles(t), key=key) for key in (lambda x: x.inside, lambda x: x.predicted))
        same += a is b
        if a is not b:
            told.append(
                f"Peak {t.peak} at {t.rate:g} 1/s: {_title(a)} fits best ({a.inside:.2g} kPa) and predicts to "
                f"{a.predicted:.2g} kPa; {_title(b)} fits to {b.inside:.2g} kPa and predicts to {b.predicted:.2g} kPa."
            )
    every = [(x, t.plain) for t in first for x in _singles(t) if x.explains]
    worse = sum(x.predicted > NO_BETTER * plain.predicted for x, plain in every)
    told.insert(0, f"The effect that fits best also predicts the other rates best in {same} of {len(first)} cycles.")
    told.append(
        f"Of the {len(every)} models that pass as an explanation of their own cycle, {worse} predict the other rates "
        "no better than the energy alone (less than a tenth off its error): a good fit to one cycle says little."
    )
    return " ".join(told)


def _energies(trials: Sequence[Trial]) -> list[str]:
    """The same with every energy, and the best of all combinations."""
    rows = []
    for name in dict.fromkeys(t.energy for t in trials):
        own = [t for t in trials if t.energy == name]
        added = [m for t in own for m in t.members]
        cells = [material(name).title, _counts(t.verdict for t in own), _counts(_title(m) for m in added)]
        cells.append(_arrow(_median(t.plain.inside for t in own), _median(m.inside for m in added)))
        cells.append(_arrow(_median(t.plain.predicted for t in own), _median(m.predicted for m in added)))
        rows.append("| " + " | ".join(cells) + " |")
    head = "| energy | verdicts | added | in sample, median | predicted, median |"
    return [_table(head, rows), *_odd(trials), _best_of_all(trials)]


def _median(values: Iterable[float]) -> float | None:
    found = list(values)
    return float(np.median(found)) if found else None


def _odd(trials: Sequence[Trial]) -> list[str]:
    """What was named that is not what is named elsewhere."""
    usual, _ = Counter(m.effects for t in trials for m in t.members).most_common(1)[0]
    told = []
    for t in trials:
        for m in t.members:
            rival = next((x for x in t.tried if x.effects == usual and x.energy == m.energy), None)
            if m.effects == usual or rival is None:
                continue
            told.append(
                f"- {material(t.energy).title}, peak {t.peak} at {t.rate:g} 1/s: {_title(m)} ({t.verdict}) fits "
                f"to {m.inside:.2g} kPa and predicts to {m.predicted:.2g} kPa, {_title(rival)} fits to "
                f"{rival.inside:.2g} kPa and predicts to {rival.predicted:.2g} kPa (the energy alone "
                f"{t.plain.predicted:.2g} kPa)."
            )
    return ["Named otherwise:\n\n" + "\n".join(told)] if told else []


def _best_of_all(trials: Sequence[Trial]) -> str:
    by: dict[tuple[float, float], list[Tried]] = {}
    for t in trials:
        by.setdefault((t.peak, t.rate), []).extend(t.tried)
    fits = {k: min(v, key=lambda x: x.inside) for k, v in by.items()}
    tells = {k: min(v, key=lambda x: x.predicted) for k, v in by.items()}
    same = sum(fits[k] is tells[k] for k in by)
    effects = sum(fits[k].effects == tells[k].effects for k in by)
    lost = [fits[k].predicted / tells[k].predicted for k in by]
    energies = _counts(material(x.energy).title for x in fits.values())
    others = _counts(material(x.energy).title for x in tells.values())
    return (
        f"Over all energies and effects, pairs included, the combination with the least error in sample is the best "
        f"predictor in {same} of {len(by)} cycles, and has the effects of the best predictor in {effects}; its "
        f"predictions are {_span(lost)} times as far off as the best. Least in sample: {energies}. Best in prediction: "
        f"{others}."
    )


def _quick(fast: Quick) -> list[str]:
    name = _title(fast.best)
    return [
        "Loading to a stretch of 5.4 and back at 0.68 1/s (github.com/prmiles/pymcmcstat_examples, MIT). By itself: "
        f"{material(FIRST).title} leaves {fast.plain.inside:.3g} kPa, with {name} {fast.best.inside:.3g} kPa "
        f"({fast.best.size}); verdict `{fast.verdict}`. {fast.sentence}",
        f"Its loading leg up to a stretch of {fast.end:.2f} (root mean square {fast.level:.3g} kPa), predicted by what "
        f"was calibrated on the cycle to that peak at the fastest of the slow rates: off by {fast.before:.3g} kPa with "
        f"the energy alone and by {fast.after:.3g} kPa with what was named there. The rates lie a factor of thirteen "
        "apart and the strips come from two laboratories.",
    ]


def _counts(values: Iterable[str]) -> str:
    found = Counter(values)
    return ", ".join(f"{name} {n}" for name, n in found.most_common()) or "nothing"


def _span(values: Sequence[float]) -> str:
    return f"{min(values):.2g} to {max(values):.2g} (median {np.median(values):.2g})"


def _ratios(pairs: Sequence[tuple[float, ...]]) -> str:
    ratios = sorted({round(max(p[0] / p[1], p[1] / p[0]), 2) for p in pairs})
    return " or ".join(f"{r:g} times" for r in ratios)

"""The tables of a reliability study: are probabilities frequencies, and are names right."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby, pairwise

import numpy as np

from bayesmembrane.ground.registry import components
from tests.studies.loop_table import counted, share
from tests.studies.reliability_plan import GROUPS
from tests.studies.reliability_rows import (
    FAINT,
    NONE,
    Row,
    inside,
    right_name,
    spoken_truth,
    top,
    wrong_name,
)

BINS = (0.0, 0.001, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0)
LISTED = 0.001  # sets less probable are not in the reliability table of sets
FLOOR = 1e-4  # of the probability of the truth, in the log score
MASS = 0.95
CLEAR = 10.0  # ratio of an effect's own trace from which it has to be named
# The diagnosis and the generators have different words for the same thing.
ALIASES = {
    "ripple": ("ripple",),
    "clipped": ("clipping", "clipped"),
    "temperature_step": ("sudden_change", "sudden", "thermal_step", "temperature_step", "step"),
    "backlash": ("dead_zone", "backlash"),
}
MISSING_ENERGY = ("energy", "other_energy", "unknown_energy", "form", "form_error", "other", "unknown")
FOREIGN = "!"


def report(rows: Sequence[Row], command: str, planned: int | None = None, title: str = "") -> str:
    """Markdown of all tables."""
    whole = [r for r in rows if "skipped" not in r]
    judged = [r for r in whole if r.get("probabilities") is not None]
    seeds = sorted(r["seed"] for r in rows)
    parts = [
        f"# {title or 'Reliability: probabilities against frequencies, and names against truths'}\n",
        f"`{command}`: {len(rows)} {f'of {planned} ' if planned else ''}diagnoses of the plan, seeds "
        f"{seeds[0] if seeds else '-'} to {seeds[-1] if seeds else '-'}, {len(rows) - len(whole)} without a film, "
        f"{len(whole) - len(judged)} without probabilities. In brackets: 95 % Wilson intervals. An effect whose own "
        f"trace has a signal-to-noise ratio below {FAINT:g} is no truth: sets with and without it are added up, and "
        "names with and without it are right.\n",
        _rates(whole),
        _scores(judged),
        _binned("Sets of effects", judged, _set_claims),
        _binned("Each effect by itself", judged, _effect_claims),
        _binned("Energies, where the true one is in the library", judged, _energy_claims),
        _groups(whole),
        _times(whole),
        _worst(judged),
        _wrong(whole),
    ]
    return "\n".join(parts)


# ---- claims: (probability, whether it is so) -------------------------------------------------------------------------

Claim = tuple[float, bool]


def merged(row: Row) -> dict[tuple[str, ...], float]:
    """{effects without the faint ones: p}, with foreign faults as sets of their own where they are rivals of the sets.

    They are if all probabilities together are no more than one.
    """
    p, faint = row["probabilities"], set(row["faint"])
    out: dict[tuple[str, ...], float] = {}
    for name, value in p["effects"].items():
        names = () if name == NONE else tuple(n for n in name.split("+") if n not in faint)
        out[names] = out.get(names, 0.0) + value
    if rivals(row):
        for name, value in p["foreign"].items():
            out[FOREIGN + name,] = value
    return out


def rivals(row: Row) -> bool:
    """True if foreign faults share one sum with the sets of effects."""
    p = row["probabilities"]
    return sum(p["effects"].values()) + sum(p["foreign"].values()) < 1.001


def right_sets(row: Row) -> set[tuple[str, ...]]:
    """The keys of `merged` that are right."""
    if row["foreign"] and rivals(row):
        return {(FOREIGN + n,) for k in row["foreign"] for n in ALIASES.get(k, (k,))}
    names = {tuple(row["truth"])}
    if not row["family_known"] and not row["truth"]:
        names |= {(FOREIGN + n,) for n in MISSING_ENERGY}
    return names


def of_truth(row: Row) -> float:
    """Probability of what is there: the true set of effects, or something foreign of whatever kind."""
    p = row["probabilities"]
    if row["foreign"]:
        return float(min(1.0, sum(p["foreign"].values())))
    found = merged(row)
    return float(min(1.0, sum(found.get(s, 0.0) for s in right_sets(row))))


def held(row: Row) -> bool:
    """True if the truth is among the most probable sets that hold `MASS` together."""
    falling = sorted(merged(row).items(), key=lambda i: -i[1])
    if row["foreign"]:
        if not rivals(row):
            return of_truth(row) > 1 - MASS
        right = {s for s, _ in falling if s and s[0].startswith(FOREIGN)}
    else:
        right = right_sets(row)
    total = 0.0
    for names, value in falling:
        if names in right:
            return True
        total += value
        if total >= MASS:
            return False
    return False


def _set_claims(row: Row) -> Iterator[Claim]:
    right = right_sets(row)
    yield from ((p, names in right) for names, p in merged(row).items() if p >= LISTED)


def _effect_claims(row: Row) -> Iterator[Claim]:
    found = merged(row)
    for name in sorted(components("effects")):
        if name not in row["faint"]:
            yield sum(p for names, p in found.items() if name in names), name in row["truth"]


def _energy_claims(row: Row) -> Iterator[Claim]:
    if row["family_known"]:
        yield from ((p, name == row["family"]) for name, p in row["probabilities"]["energies"].items())


# ---- tables ----------------------------------------------------------------------------------------------------------


def _table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(r) + " |" for r in rows) + "\n"


def clear(row: Row) -> bool:
    """True if there are effects of the library alone, which can be told and are strong enough."""
    return bool(row["truth"]) and not row["foreign"] and row["identifiable"] is not False and strong(row)


def strong(row: Row) -> bool:
    """True if each true effect has a trace of its own that is strong enough to be named."""
    return min((row["own"][k] for k in row["truth"]), default=0.0) >= CLEAR


def _rates(rows: Sequence[Row]) -> str:
    nulls = [r for r in rows if r["group"] == "null"]
    named = [r for r in rows if r["verdict"] == "named"]
    spoilt = [r for r in rows if r["truth"] and not r["foreign"]]
    outside = [r for r in rows if not r["family_known"] and not r["truth"]]
    covers = [r["coverage"] for r in rows if right_name(r) and r.get("coverage") is not None]
    some = [
        ("nulls: adequate", counted(nulls, lambda r: r["verdict"] == "adequate")),
        ("wrong unique names, of all names", counted(named, wrong_name)),
        ("wrong unique names, of all diagnoses", counted(rows, wrong_name)),
        ("effects of the library: named and right", counted(spoilt, right_name)),
        (f"the same, tellable and each own ratio >= {CLEAR:g}", counted([r for r in rows if clear(r)], right_name)),
        ("the same: truth inside the answer", counted([r for r in rows if clear(r)], inside)),
        ("firm effects of answers without a name: of the truth", counted_firm(rows)),
        ("foreign faults: a wrong name", counted([r for r in rows if r["foreign"]], wrong_name)),
        ("energies outside the library, no effect: a wrong name", counted(outside, wrong_name)),
        *((f"90 % intervals hold, {what}", counted_bits(rows, what == "forces")) for what in ("parameters", "forces")),
        (
            "held-out readings in their 90 % band, named and right: median (least)",
            f"{100 * float(np.median(covers)):.0f} % ({100 * min(covers):.0f} %), {len(covers)} cases"
            if covers
            else "",
        ),
        ("errors", counted(rows, lambda r: r["verdict"] == "error")),
    ]
    return "## Rates\n\n" + _table(("what", "found"), some)


def counted_firm(rows: Iterable[Row]) -> str:
    """How many of the effects that are firm of an answer without a name are there, be it faintly."""
    told = [name in (*r["truth"], *r["faint"]) for r in rows if r["verdict"] != "named" for name in r.get("firm", ())]
    return share(sum(told), len(told))


def counted_bits(rows: Iterable[Row], forces: bool) -> str:
    """How many of the stored intervals hold, of forces or of parameters."""
    bits = [v for r in rows for k, v in r.get("covered", {}).items() if k.startswith("force") == forces]
    return share(sum(bits), len(bits))


def _scores(rows: Sequence[Row]) -> str:
    lines = []
    for name, some in _by_group(rows):
        p = np.array([of_truth(r) for r in some])
        score = float(np.mean(np.log(np.maximum(p, FLOOR))))
        sure = [r for r, v in zip(some, p, strict=True) if v < 1e-3]
        lines.append((name, str(len(some)), f"{score:.3f}", f"{p.mean():.3f}", counted(some, held), str(len(sure))))
    head = ("cases", "count", "log score", "mean P(truth)", "truth in the 95 % set", "P(truth) < 0.001")
    return (
        "## Probability of the truth\n\nLog score: mean of ln P(truth), P no less than "
        f"{FLOOR:g}; of a foreign fault P is that of anything foreign.\n\n" + _table(head, lines)
    )


def _by_group(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    out = [("all", list(rows))] if rows else []
    for energy in sorted({r["energy"] for r in rows}):
        some = [r for r in rows if r["energy"] == energy]
        if len(some) < len(rows):
            out.append((f"energy {energy}", some))
    kinds = [(g, [r for r in rows if r["group"] == g]) for g in GROUPS]
    tell = [r for r in rows if r["truth"] and not r["foreign"]]
    kinds += [
        ("effects that can be told", [r for r in tell if clear(r)]),
        ("effects that cannot, or are weak", [r for r in tell if not clear(r)]),
    ]
    return out + [(name, some) for name, some in kinds if some]


def _binned(title: str, rows: Sequence[Row], claims: Callable[[Row], Iterator[Claim]]) -> str:
    found = [c for r in rows for c in claims(r)]
    p, so = np.array([c[0] for c in found]), np.array([c[1] for c in found], dtype=bool)
    lines = []
    for low, high in pairwise(BINS):
        on = (p >= low) & ((p < high) | (high == 1.0)) if found else np.zeros(0, bool)
        if np.any(on):
            lines.append((f"{low:g} to {high:g}", f"{p[on].mean():.4f}", share(int(so[on].sum()), int(on.sum()))))
    return f"## {title}: probability against frequency\n\n" + _table(("stated", "mean", "so in"), lines)


def _groups(rows: Sequence[Row]) -> str:
    columns = ("adequate", "named", "ambiguous", "material", "unknown", "error")
    lines = []
    for name, some in _by_group(rows):
        counts = [sum(r["verdict"] == v for r in some) for v in columns]
        wrong = sum(wrong_name(r) for r in some)
        kept = sum(inside(r) for r in some if r["verdict"] == "ambiguous")
        lines.append((name, str(len(some)), *map(str, counts), str(wrong), f"{kept} / {counts[2]}"))
    head = ("cases", "count", *columns, "wrong names", "ambiguous with the truth")
    return "## Verdicts\n\n" + _table(head, lines)


def _times(rows: Sequence[Row]) -> str:
    timed = sorted((r for r in rows if "seconds" in r), key=lambda r: str(r["verdict"]))
    groups = [("all", timed), *((v, list(g)) for v, g in groupby(timed, key=lambda r: str(r["verdict"])))]
    lines = []
    for name, some in groups:
        s = np.array([r["seconds"] for r in some])
        if s.size:
            lines.append((name, str(s.size), f"{np.median(s):.1f}", f"{np.quantile(s, 0.9):.1f}", f"{s.max():.1f}"))
    return "## CPU seconds, one thread\n\n" + _table(("verdict", "count", "median", "90 %", "largest"), lines)


def _worst(rows: Sequence[Row], count: int = 20) -> str:
    """Where the truth was thought least probable."""
    falling = sorted(rows, key=of_truth)[:count]
    lines = [
        (
            str(r["number"]),
            r["group"],
            spoken_truth(r),
            f"{math.log(max(of_truth(r), 1e-12)):.1f}",
            r["verdict"],
            top(r),
        )
        for r in falling
        if of_truth(r) < 0.05
    ]
    head = ("case", "group", "truth with own ratios", "ln P(truth)", "verdict", "most probable")
    return "## Truths thought least probable\n\n" + _table(head, lines)


def _wrong(rows: Sequence[Row]) -> str:
    """Every wrong unique name, to be looked at."""
    lines = [
        (
            str(r["number"]),
            r["group"],
            r["energy"],
            spoken_truth(r),
            "+".join(r["effects"]),
            f"{r['reduced_chi2']:.2f}",
            "yes" if r["identifiable"] else "no",
        )
        for r in rows
        if wrong_name(r)
    ]
    head = ("case", "group", "energy", "truth with own ratios", "named", "reduced chi-square after", "identifiable")
    return "## Wrong unique names\n\n" + _table(head, lines)

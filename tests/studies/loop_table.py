"""The tables of `make study-loop`: counts with Wilson intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

Row = dict[str, Any]
NAMED_FROM = 10.0  # signal-to-noise ratio from which an effect has to be named
ROUNDING = 0.97  # of a ratio: how exactly the generator meets what is asked for
VERDICTS = ("adequate", "named", "ambiguous", "material", "unknown", "error")


def report(rows: Sequence[Row], command: str, seed: int, planned: int) -> str:
    """Markdown of all tables."""
    whole = [r for r in rows if "skipped" not in r]
    parts = [
        "# Diagnosis of measurements with an undeclared fault\n",
        f"`{command}` (`make study-loop`): seeds from {seed}, {len(rows)} of {planned} cases of the plan done, "
        f"{len(rows) - len(whole)} of them without a film. In brackets: 95 % Wilson intervals. Strength 1 is a "
        "signal-to-noise ratio of 20 of the projected signature; an effect is identifiable where that makes 20 degrees "
        "and more with every rival's.\n",
        _targets(whole),
        _confusion(whole),
        _power(whole),
        _residuals(whole),
        _intervals(whole),
        _times(whole),
        _wrong(whole),
    ]
    return "\n".join(parts)


def share(hits: int, count: int) -> str:
    """``hits / count = % [low, high]``."""
    if count == 0:
        return "none yet"
    low, high = binomtest(hits, count).proportion_ci(0.95, method="wilson")
    return f"{hits} / {count} = {100 * hits / count:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


def counted(rows: Iterable[Row], test: Callable[[Row], bool]) -> str:
    """`share` of the rows that pass."""
    found = [test(r) for r in rows]
    return share(sum(found), len(found))


# ---- what a row says -------------------------------------------------------------------------------------------------


def clear(row: Row) -> bool:
    """True if its effects can be told on this protocol and are strong enough."""
    return bool(row["identifiable"]) and strong(row)


def strong(row: Row) -> bool:
    """True if every fault is strong enough to be named."""
    return min(row["snr"].values(), default=0.0) >= ROUNDING * NAMED_FROM


def exact(row: Row) -> bool:
    """True if the truth and nothing else is named."""
    return row["verdict"] == "named" and sorted(row["effects"]) == row["truth"]


def inside(row: Row) -> bool:
    """True if every true effect is in the answer."""
    return row["verdict"] in ("named", "ambiguous") and set(row["truth"]) <= set(row["effects"])


def wrong_name(row: Row) -> bool:
    """True if a single answer is given, and it is not the truth."""
    return row["verdict"] == "named" and sorted(row["effects"]) != row["truth"]


def passed(row: Row) -> bool:
    """True if the verdict is one of those that are right, and what it names is not wrong."""
    if row["group"] in ("single", "compliance", "pair"):
        return row["verdict"] in row["expected"] and (row["verdict"] == "adequate" or inside(row))
    # A family that imitates the declared one better than the noise can tell is adequate.
    faint = row["group"] == "family" and not strong(row)
    return row["verdict"] in row["expected"] or (faint and row["verdict"] == "adequate")


# ---- tables ----------------------------------------------------------------------------------------------------------


def _table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(r) + " |" for r in rows) + "\n"


def _targets(rows: Sequence[Row]) -> str:
    by: dict[str, list[Row]] = {}
    for r in rows:
        by.setdefault(r["group"], []).append(r)
    nulls = by.get("null", [])
    singles = [r for r in by.get("single", []) if clear(r)]
    pairs = by.get("pair", [])
    families = by.get("family", [])

    def raised(r: Row) -> bool:
        return bool(r["verdict"] != "adequate")

    compliance = [r for r in by.get("compliance", []) if raised(r)]
    lines = [
        ("false alarms, white noise", "<= 2 %", counted([r for r in nulls if r["noise"] == "white"], raised)),
        ("false alarms, AR(1), rho = 0.5", "<= 5 %", counted([r for r in nulls if r["noise"] != "white"], raised)),
        ("false alarms, gain error of 3 %", "", counted(by.get("gain", []), raised)),
        ("single, identifiable, ratio >= 10: unique and right", ">= 95 %", counted(singles, exact)),
        ("the same: truth inside the answer", ">= 99 %", counted(singles, inside)),
        ("the same: a wrong unique name", "<= 1 %", counted(singles, wrong_name)),
        ("all singles: a wrong unique name", "", counted(by.get("single", []), wrong_name)),
        ("compliance, detected: truth in the set", "always", counted(compliance, inside)),
        ("compliance, detected: a wrong unique name", "never", counted(compliance, wrong_name)),
        ("pairs: exact", ">= 85 %", counted(pairs, exact)),
        ("pairs, identifiable: exact", "", counted([r for r in pairs if clear(r)], exact)),
        ("pairs: truth inside the answer", "", counted(pairs, inside)),
        (
            "outside the library: unknown",
            ">= 95 %",
            counted(by.get("outside", []), lambda r: r["verdict"] == "unknown"),
        ),
        ("wrong family: material, unknown or adequate, never an effect", ">= 90 %", counted(families, _no_effect)),
        ("the same, ratio >= 10: material or unknown", "", counted([r for r in families if strong(r)], passed)),
    ]
    return "## Rates\n\n" + _table(("what", "target", "found"), lines)


def _no_effect(r: Row) -> bool:
    return r["verdict"] in ("material", "unknown", "adequate")


def _confusion(rows: Sequence[Row]) -> str:
    """Kinds against what was answered."""
    table: dict[str, Counter[str]] = {}
    for r in rows:
        table.setdefault(_kind(r), Counter())[_answer(r)] += 1
    columns = ("right name", "wrong name", "set with it", "set without it", "adequate", "material", "unknown", "error")
    lines = [
        (kind, *(str(found[c] or "") for c in columns), _names(kind, rows)) for kind, found in sorted(table.items())
    ]
    return "## Truth against answer\n\n" + _table(("truth", *columns, "wrong names"), lines)


def _kind(r: Row) -> str:
    if r["group"] == "null":
        return f"null, {r['noise']}"
    if r["group"] == "family":
        return f"{r['kind'].split(':')[0]}, declared {r['material']}"
    if r["group"] == "single":
        return f"{r['kind']}, strength {r['strength']:g}{'' if r['identifiable'] else ', not identifiable'}"
    return str(r["kind"])


def _answer(r: Row) -> str:
    if r["verdict"] == "named":
        return "right name" if exact(r) else "wrong name"
    if r["verdict"] == "ambiguous":
        return "set with it" if r["truth"] and inside(r) else "set without it"
    return str(r["verdict"])


def _names(kind: str, rows: Sequence[Row]) -> str:
    found = Counter("+".join(r["effects"]) for r in rows if _kind(r) == kind and wrong_name(r))
    return ", ".join(f"{n} ({c})" for n, c in found.most_common())


def _power(rows: Sequence[Row]) -> str:
    lines = []
    for strength in (1.0, 0.5, 0.25):
        some = [
            r
            for r in rows
            if r["group"] == "single" and r["strength"] == strength and r["identifiable"] and r["reached"]
        ]
        lines.append(
            (
                f"{strength:g}",
                counted(some, lambda r: r["verdict"] != "adequate"),
                counted(some, exact),
                counted(some, inside),
                counted(some, wrong_name),
            )
        )
    head = ("strength", "detected", "named and right", "truth inside", "wrong unique name")
    return "## Power: single identifiable effects\n\n" + _table(head, lines)


def _residuals(rows: Sequence[Row]) -> str:
    good = [r for r in rows if r["group"] in ("single", "compliance", "pair") and exact(r)]
    nulls = [r for r in rows if r["group"] == "null" and r["verdict"] == "adequate"]
    lines = [
        (name, str(len(some)), *(_spread([r[k] for r in some if r.get(k) is not None]) for k in KEYS))
        for name, some in (("named and right", good), ("null, adequate", nulls))
    ]
    head = ("cases", "count", "in sample before", "in sample after", "held out before", "held out after")
    return (
        "## Residual after the loop\n\nRoot mean square over the standard deviation of the noise that was put in: "
        "median (90 %, largest).\n\n" + _table(head, lines)
    )


KEYS = ("before", "after", "heldout_before", "heldout_after")


def _spread(values: Sequence[float]) -> str:
    if not values:
        return ""
    v = np.asarray(values)
    return f"{np.median(v):.3f} ({np.quantile(v, 0.9):.3f}, {v.max():.3f})"


def _intervals(rows: Sequence[Row]) -> str:
    """How often 90 % intervals hold the film that was put in, without and with the effect that is named."""
    good = [r for r in rows if r["group"] in ("single", "compliance", "pair") and exact(r)]
    lines = []
    for name, asked in (("parameters of the material", False), ("force of the film without faults", True)):
        sides = []
        for side in ("covered_null", "covered_best"):
            found = [v for r in good for k, v in r.get(side, {}).items() if k.startswith("force") == asked]
            sides.append(share(sum(found), len(found)))
        lines.append((name, *sides))
    return (
        "## 90 % intervals that hold the truth, where the right effect is named\n\nLaplace's approximation; forms "
        "of the fault and of the effect differ. The target is 80 % and more after.\n\n"
        + _table(("what", "before", "after"), lines)
    )


def _times(rows: Sequence[Row]) -> str:
    groups: dict[str, list[float]] = {}
    for r in rows:
        if "seconds" in r:
            groups.setdefault("adequate" if r["verdict"] == "adequate" else r["group"], []).append(r["seconds"])
    lines = [
        (name, str(len(s)), f"{np.median(s):.1f}", f"{np.quantile(s, 0.9):.1f}", f"{max(s):.1f}")
        for name, s in sorted(groups.items())
    ]
    head = ("cases", "count", "median", "90 %", "longest")
    return "## Seconds of the process, one thread, without sampling\n\n" + _table(head, lines)


def _wrong(rows: Sequence[Row]) -> str:
    """Every case that is not passed, to be looked at."""
    lines = [
        (
            r["key"].replace("|", ", "),
            r["verdict"],
            " + ".join(r["effects"]) or r.get("found_material", ""),
            "yes" if r["identifiable"] else "no",
            ", ".join(f"{v:.0f}" for v in r["snr"].values()),
        )
        for r in rows
        if not passed(r)
    ]
    return "## Verdicts that are not right\n\n" + _table(("case", "verdict", "answer", "identifiable", "ratio"), lines)

"""What a reliability study keeps of one case: the truth, and the JSON answer of the diagnosis, on one line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bayesmembrane.ground.registry import components, ordinary_materials

Row = dict[str, Any]

FAINT = 3.0
"""An effect whose own trace (free of what the material and the other effects absorb) has a signal-to-noise ratio below
this is no truth: answers with and without it are both right. Its log likelihood is expected to gain 4.5 at most."""
NEGLIGIBLE = 1e-6
"""Probabilities below it are not kept."""
NONE = "none"


def truth_row(truth: Mapping[str, Any], identifiable: bool | None) -> Row:
    """What is in the measurement, as far as it can be seen. ``identifiable``: None where nobody has judged it.

    ``truth`` holds ``effects``, ``snr``, ``snr_own``, ``family`` and ``expected`` (of a `Dataset` of either generator).
    Effects that the library does not know are ``foreign``, and so are energies.
    """
    known = components("effects")
    own = {k: float(v) for k, v in truth["snr_own"].items()}
    seen = {k for k in truth["effects"] if own[k] >= FAINT}
    return {
        "truth": sorted(seen & known.keys()),
        "faint": sorted(set(truth["effects"]) - seen),
        "foreign": sorted(seen - known.keys()),
        "family": truth["family"],
        "family_known": truth["family"] in ordinary_materials(),
        "own": own,
        "snr": {k: float(v) for k, v in truth["snr"].items()},
        "expected": list(truth["expected"]),
        "identifiable": identifiable,
    }


def answer_row(document: Mapping[str, Any]) -> Row:
    """What the JSON answer of ``diagnose`` says, as far as it is judged."""
    error = document["error"]
    return {
        "verdict": document["verdict"],
        "effects": sorted(document["effects"]),
        "found_material": document["material"],
        "coverage": error["heldout_coverage_90_after"],
        "reduced_chi2": error["after"]["reduced_chi2"],
        "sentence": document["sentence"],
        "probabilities": beliefs(document.get("probabilities")),
        "firm": list(document.get("firm", ())),
    }


def beliefs(found: Mapping[str, Any] | None) -> dict[str, dict[str, float]] | None:
    """{"effects": {set: p}, "energies": {name: p}, "foreign": {name: p}} of an answer; None if it has none.

    Sets are names in alphabetical order joined by "+", "none" for the empty one.
    """
    if found is None:
        return None
    out: dict[str, dict[str, float]] = {"effects": {}, "energies": {}, "foreign": {}}
    for name, p in found["effects"].items():
        key = "+".join(sorted(name.split("+")))
        out["effects"][key] = out["effects"].get(key, 0.0) + p
    for kind in ("energies", "foreign"):
        out[kind] = {name: p for name, p in (found.get(kind) or {}).items() if name != NONE}
    return {kind: {k: round(p, 9) for k, p in _falling(each) if p >= NEGLIGIBLE} for kind, each in out.items()}


def _falling(each: Mapping[str, float]) -> list[tuple[str, float]]:
    return sorted(each.items(), key=lambda item: -item[1])


# ---- what a row says -------------------------------------------------------------------------------------------------


def right_name(row: Row) -> bool:
    """True if effects are named: all that are there, and none that is not."""
    named, truth = set(row["effects"]), set(row["truth"])
    return row["verdict"] == "named" and not row["foreign"] and truth <= named <= truth | set(row["faint"])


def wrong_name(row: Row) -> bool:
    """True if a single answer names effects, and not those that are there."""
    return row["verdict"] == "named" and not right_name(row)


def inside(row: Row) -> bool:
    """True if every true effect is in the answer."""
    return row["verdict"] in ("named", "ambiguous") and set(row["truth"]) <= set(row["effects"])


def top(row: Row, count: int = 3) -> str:
    """The most probable sets and foreign faults, and the most probable energy, in a few words."""
    p = row.get("probabilities")
    if p is None:
        return "no probabilities"
    all_ = _falling(p["effects"] | {f"!{k}": v for k, v in p["foreign"].items()})[:count]
    energy = _falling(p["energies"])[:1]
    return ", ".join(f"{k} {v:.3g}" for k, v in all_) + "".join(f" | {k} {v:.3g}" for k, v in energy)


def spoken_truth(row: Row) -> str:
    """What is there, with each effect's own ratio; faint effects in brackets, foreign ones after a "!"."""
    own = {k: f"{k} {v:.0f}" for k, v in row["own"].items()}
    words = [
        *(own[k] for k in row["truth"]),
        *(f"!{own[k]}" for k in row["foreign"]),
        *(f"({own[k]})" for k in row["faint"]),
    ]
    energy = "" if row["family_known"] else "!"
    return f"{' + '.join(words) or NONE} of {energy}{row['family']}"

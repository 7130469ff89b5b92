"""The morning page: a row for every hypothesis on every measurement, and above it what failed and why."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bayesmembrane.campaign.index import Entry, opened
from bayesmembrane.campaign.record import DONE, FAILED, PREEMPTED, REFUSED, WAITING
from bayesmembrane.campaign.status import Standing, standing_of
from bayesmembrane.campaign.task import READ
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import write_text
from bayesmembrane.ground.plain import json_text
from bayesmembrane.report.render import campaign_page
from bayesmembrane.words.language import three_digits

GENERATOR = "bayesmembrane campaign report"
PAGE, TWIN, FOLDER = "index.html", "report.json", "report"
FEW = 3  # names told of those that share a reason
STATED_SHARE = 0.01  # of proposals that could not be solved, above which a run says so
QUESTIONS = ("diagnose", "loop")
ORDER = (FAILED, REFUSED, PREEMPTED, WAITING, DONE)


@dataclass
class HypothesisRow:
    """One hypothesis on one measurement."""

    film: str
    reach: str
    label: str
    noise: str
    convexity: str
    states: dict[str, str] = field(default_factory=dict)
    reasons: list[str] = field(default_factory=list)
    sampled: Mapping[str, Any] = field(default_factory=dict)
    evidence: Mapping[str, Any] = field(default_factory=dict)
    verdicts: dict[str, str] = field(default_factory=dict)
    links: dict[str, str] = field(default_factory=dict)

    @property
    def state(self) -> str:
        """The state of what is worst off."""
        return next((s for s in ORDER if s in self.states.values()), WAITING)

    def take(self, entry: Entry) -> None:
        """Note an analysis of this row."""
        self.states[entry.analysis] = entry.state
        if entry.reason and entry.state != DONE:
            self.reasons.append(entry.reason)
        if entry.page or entry.folder:
            self.links[entry.analysis] = entry.page or entry.folder


def write_morning_page(campaign: Path, out: Path | None = None) -> Path:
    """Write ``out/index.html`` and ``out/report.json`` (``out`` None: the folder ``report`` of the campaign).

    Returns the path of the page. A report of an earlier time is replaced, any other file is not: `StorageError`.
    """
    out = campaign / FOLDER if out is None else out
    for name in (PAGE, TWIN):
        _refuse_foreign(out / name)
    with opened(campaign) as index:
        found = standing_of(campaign, index)
        entries = list(index.entries())
    rows = table_rows(entries)
    twin = {"generator": GENERATOR, **found.document(), "rows": [_plain(row) for row in rows]}
    write_text(out / TWIN, json_text(twin), "the report")
    base = os.path.relpath(campaign.resolve(), out.resolve())
    text = campaign_page(
        generator=GENERATOR,
        title=found.name,
        subtitle=_subtitle(found),
        faults=faults(entries),
        remarks=remarks(rows),
        columns=_columns(rows),
        rows=[_cells(row, base) for row in rows],
        states=sorted({row.state for row in rows}),
    )
    return write_text(out / PAGE, text, "the report")


def _refuse_foreign(path: Path) -> None:
    if path.is_file() and GENERATOR in path.read_text(encoding="utf-8", errors="replace")[:2000]:
        return
    if path.exists():
        raise StorageError("this is no report of ours, and nothing is overwritten", str(path), "choose another folder")


# ---- rows ------------------------------------------------------------------------------------------------------------


def table_rows(entries: Iterable[Entry]) -> list[HypothesisRow]:
    """A row for every hypothesis on every range of every measurement, with what all the analyses say of it."""
    rows: dict[tuple[str, str, str], HypothesisRow] = {}
    asked: list[Entry] = []
    for entry in entries:
        if entry.analysis in QUESTIONS:
            asked.append(entry)
        for place, claim in enumerate(entry.claims if entry.analysis not in QUESTIONS else ()):
            row = rows.setdefault((entry.film, entry.reach, json.dumps(claim, sort_keys=True)), _row(entry, claim))
            row.take(entry)
            if entry.analysis == "sample":
                row.sampled = entry.found
            if entry.analysis == "compare" and entry.found:
                row.evidence = entry.found["rows"][place]
    beside: dict[tuple[str, str], list[HypothesisRow]] = {}
    for row in rows.values():
        beside.setdefault((row.film, row.reach), []).append(row)
    for entry in asked:
        _answer(beside, entry)
    return [row for group in beside.values() for row in group]


def _row(entry: Entry, claim: Mapping[str, Any]) -> HypothesisRow:
    label = "+".join([claim["material"], *claim["effects"]])
    return HypothesisRow(entry.film, entry.reach, label, claim["noise"], claim["convexity"])


def _answer(beside: dict[tuple[str, str], list[HypothesisRow]], entry: Entry) -> None:
    """Lay the verdict on a measurement beside all of its hypotheses; alone in a row where there is none."""
    group = beside.setdefault((entry.film, entry.reach), [])
    if not any(row.convexity == entry.convexity for row in group):
        group.append(HypothesisRow(entry.film, entry.reach, "any", entry.noise, entry.convexity))
    for row in group:
        if row.convexity == entry.convexity:
            row.take(entry)
            if entry.found:
                row.verdicts[entry.analysis] = str(entry.found["verdict"])


def faults(entries: Iterable[Entry]) -> list[dict[str, Any]]:
    """What is not done, by reason: the state, the reason, how many tasks, and the first of them."""
    found: dict[tuple[str, str], list[str]] = {}
    for entry in entries:
        if entry.reason and entry.state != DONE:
            name = " ".join(w for w in (entry.film, "" if entry.analysis == READ else entry.label) if w)
            found.setdefault((entry.state, entry.reason), []).append(f"{name} ({entry.analysis})")
    ordered = sorted(found.items(), key=lambda item: (ORDER.index(item[0][0]), -len(item[1])))
    return [
        {"state": state, "reason": reason, "count": len(names), "names": _few(names)}
        for (state, reason), names in ordered
    ]


def _few(names: Sequence[str]) -> str:
    more = len(names) - FEW
    return ", ".join(names[:FEW]) + (f" and {more} more" if more > 0 else "")


def remarks(rows: Sequence[HypothesisRow]) -> list[str]:
    """What must be known before the numbers are trusted."""
    sampled = [row for row in rows if row.sampled]
    short = [row for row in sampled if not row.sampled["converged"]]
    many = [row for row in sampled if row.sampled["failed"] > STATED_SHARE]
    unsure = [row for row in rows if row.evidence and not row.evidence["agreed"]]
    said = []
    if short:
        said.append(f"{len(short)} of {len(sampled)} runs ended before they converged: {_films(short)}.")
    if many:
        said.append(
            f"In {len(many)} runs more than {100 * STATED_SHARE:g} % of the proposals could not be solved: "
            f"{_films(many)}."
        )
    if unsure:
        said.append(f"The two estimates of the evidence do not agree for {len(unsure)} hypotheses: {_films(unsure)}.")
    return said


def _films(rows: Sequence[HypothesisRow]) -> str:
    return _few([f"{row.film} {row.label}" for row in rows])


# ---- cells -----------------------------------------------------------------------------------------------------------

_HEADS = {
    "film": "measurement",
    "reach": "range",
    "label": "hypothesis",
    "noise": "noise",
    "convexity": "convexity",
    "state": "state",
    "ess": "ESS",
    "r_hat": "R-hat",
    "parameters": "parameters (SI), mean [94 % interval]",
    "log_evidence": "ln Z",
    "probability": "probability",
    "verdict": "verdict",
    "links": "pages",
}
_ONLY_IF_SEVERAL = ("reach", "noise", "convexity")


def _columns(rows: Sequence[HypothesisRow]) -> list[dict[str, Any]]:
    """Columns that say something: what is the same in all rows is left out of the ranges, noises and convexities."""
    used = {k for row in rows for k, v in _values(row).items() if v not in (None, "", {})} | {"state"}
    for name in _ONLY_IF_SEVERAL:
        if len({getattr(row, name) for row in rows}) < 2:
            used.discard(name)
    return [{"key": key, "head": head} for key, head in _HEADS.items() if key in used]


def _values(row: HypothesisRow) -> dict[str, Any]:
    z, sd = row.evidence.get("log_evidence") or {}, row.evidence.get("log_evidence_sd") or {}
    first = next(iter(z), None)
    return {
        "film": row.film,
        "reach": row.reach,
        "label": row.label,
        "noise": row.noise,
        "convexity": row.convexity,
        "state": row.state,
        "ess": row.sampled.get("ess"),
        "r_hat": row.sampled.get("r_hat"),
        "parameters": row.sampled.get("parameters") or {},
        "log_evidence": None if first is None else z[first],
        "log_evidence_sd": None if first is None else sd[first],
        "probability": row.evidence.get("probability"),
        "verdict": "; ".join(dict.fromkeys(row.verdicts.values())),
        "links": row.links,
    }


def _plain(row: HypothesisRow) -> dict[str, Any]:
    """A row as programs read it."""
    return {**_values(row), "states": row.states, "reasons": row.reasons, "converged": row.sampled.get("converged")}


def _cells(row: HypothesisRow, base: str) -> dict[str, Any]:
    """A row as people read it: text, and what it is sorted by where that is another thing."""
    values = _values(row)
    texts: dict[str, str] = {k: str(values[k]) for k in ("film", "reach", "label", "noise", "convexity", "verdict")}
    texts["state"] = row.state
    texts["ess"] = _number(values["ess"], ".0f")
    texts["r_hat"] = _number(values["r_hat"], ".3f")
    texts["parameters"] = "; ".join(_parameter(n, v) for n, v in values["parameters"].items())
    texts["log_evidence"] = _number(values["log_evidence"], ".2f")
    if values["log_evidence_sd"] is not None:
        texts["log_evidence"] += f" ± {_number(values['log_evidence_sd'], '.2f')}"
    texts["probability"] = _number(values["probability"], ".3f")
    numbers = ("ess", "r_hat", "log_evidence", "probability")
    return {
        "state": row.state,
        "why": " ".join(row.reasons),
        "texts": texts,
        "sort": {k: "" if values[k] is None else f"{values[k]:.9g}" for k in numbers},
        "links": [{"name": name, "href": f"{base}/{place}"} for name, place in row.links.items()],
    }


def _number(value: float | None, form: str) -> str:
    return "" if value is None else f"{value:{form}}"


def _parameter(name: str, value: Sequence[float | None]) -> str:
    mean, low, high = (three_digits(v) if v is not None else "-" for v in value)
    return f"{name} {mean} [{low}, {high}]"


def _subtitle(found: Standing) -> str:
    total = {state: count for state, count in found.total.items() if count}
    said = ", ".join(f"{count} {state}" for state, count in total.items())
    return f"{sum(total.values())} tasks: {said}." + (" Work goes on." if found.active else "")

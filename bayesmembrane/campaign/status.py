"""Where a campaign stands, from its index and the notes of the workers: quickly, whether anybody works on it or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesmembrane.campaign.index import OWNER, Index, opened
from bayesmembrane.campaign.record import ENDED, PREEMPTED, RUNNING, STATES, WAITING, read_now
from bayesmembrane.ground.locks import is_held

MOST_SHOWN = 40


@dataclass(frozen=True)
class Running:
    """A task that somebody works on, and how far it is: what sampling tells of itself, None where it does not."""

    key: str
    analysis: str
    film: str
    label: str
    reach: str
    doing: str
    worker: str
    ess: float | None = None
    wanted: float | None = None
    tau: float | None = None
    r_hat: float | None = None
    acceptance: float | None = None
    seconds_left: float | None = None


@dataclass(frozen=True)
class Standing:
    """Where a campaign stands.

    counts : tasks by analysis and state, in the order of the plan
    reasons : (state, reason, tasks), the most frequent first
    sampled : of all sampled runs the least and mean ESS, the largest tau, the mean acceptance, the largest failed share
    seconds_left : from the mean time of what is done and the number of workers, None as long as that is not known
    active : a client hands out tasks
    """

    name: str
    folder: Path
    counts: Mapping[str, Mapping[str, int]]
    running: tuple[Running, ...]
    reasons: tuple[tuple[str, str, int], ...]
    sampled: Mapping[str, float | None]
    seconds_left: float | None
    active: bool

    @property
    def total(self) -> dict[str, int]:
        """Tasks by state."""
        return {state: sum(of.get(state, 0) for of in self.counts.values()) for state in STATES}

    @property
    def finished(self) -> bool:
        """Whether nothing is left that resuming would do."""
        return all(count == 0 for state, count in self.total.items() if state not in ENDED)

    def document(self) -> dict[str, Any]:
        """Plain values: the JSON answer of ``campaign status``."""
        return {
            "campaign": str(self.folder),
            "name": self.name,
            "active": self.active,
            "finished": self.finished,
            "tasks": self.total,
            "by_analysis": {analysis: dict(of) for analysis, of in self.counts.items()},
            "running": [vars(r) for r in self.running],
            "reasons": [{"state": s, "reason": r, "tasks": n} for s, r, n in self.reasons],
            "sampled": dict(self.sampled),
            "seconds_left": self.seconds_left,
        }


def standing(campaign: Path) -> Standing:
    """Where the campaign in a folder stands; raises `StorageError` if there is none."""
    with opened(campaign) as index:
        return standing_of(campaign, index)


def standing_of(campaign: Path, index: Index) -> Standing:
    """The same from an index that is open."""
    notes = read_now(campaign)
    states = {e.key: e for e in index.entries(list(notes)[:MOST_SHOWN])} if notes else {}
    running = tuple(
        Running(k, e.analysis, e.film, e.label, e.reach, str(n.get("doing", "")), str(n["worker"]), **_numbers(n))
        for k, n in notes.items()
        if (e := states.get(k)) is not None and e.state in (WAITING, PREEMPTED)
    )
    counts = {analysis: dict(of) for analysis, of in index.counts().items()}
    for task in running:
        of = counts[task.analysis]
        state = states[task.key].state
        of[state] -= 1
        of[RUNNING] = of.get(RUNNING, 0) + 1
    return Standing(
        name=index.about().get("name", ""),
        folder=campaign,
        counts=counts,
        running=running,
        reasons=tuple(index.reasons()),
        sampled=index.sampled(),
        seconds_left=_left(counts, index.spent(), len(running)),
        active=is_held(campaign / OWNER),
    )


def _numbers(note: Mapping[str, Any]) -> dict[str, float | None]:
    """What a note tells in numbers; the note of a dead worker may hold anything."""
    told = {n: note.get(n) for n in ("ess", "wanted", "tau", "r_hat", "acceptance", "seconds_left")}
    return {n: value if isinstance(value, int | float) else None for n, value in told.items()}


def _left(
    counts: Mapping[str, Mapping[str, int]], spent: Mapping[str, tuple[int, float]], workers: int
) -> float | None:
    """s: what is left of every analysis takes as long as what is done of it did; half of what is running is left."""
    total = 0.0
    for analysis, of in counts.items():
        left = of.get(WAITING, 0) + of.get(PREEMPTED, 0) + 0.5 * of.get(RUNNING, 0)
        if left and analysis not in spent:
            return None
        if left:
            total += left * spent[analysis][1]
    return total / workers if workers else None if total else 0.0

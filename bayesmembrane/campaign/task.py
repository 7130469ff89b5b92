"""One piece of a campaign: an analysis of hypotheses on one measurement, with a seed and a name of its own."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

READ = "read"
"""The analysis of a measurement that cannot be read, so that nothing else is asked of it."""


@dataclass(frozen=True)
class Task:
    """What is asked; plain values, so that it travels to any worker and lies in a file.

    analysis : sample, compare, diagnose, valleys or loop
    film : name of the measurement, one word; its answers lie in a folder of that name
    curve, specimen : the files; ``data`` is the hash of what they hold up to ``end`` (m; None: the whole curve)
    claims : settings of the hypotheses
    options : further settings of the analysis, among them those of sampling
    seed : follows from the campaign's seed and the data alone
    needs : keys of the tasks that must be done before
    fault : why it cannot be done; "" if it can
    """

    analysis: str
    film: str
    curve: str
    specimen: str
    data: str = ""
    end: float | None = None
    claims: tuple[Mapping[str, Any], ...] = ()
    options: Mapping[str, Any] | None = None
    seed: int = 0
    needs: tuple[str, ...] = ()
    fault: str = ""
    key: str = ""

    def keyed(self) -> Task:
        """The same with the ``key`` that follows from what it is: equal keys mean equal answers."""
        asked = [self.analysis, self.film, self.data, self.end, list(self.claims), self.options, self.seed]
        text = json.dumps(asked, sort_keys=True)
        return replace(self, key=hashlib.sha256(text.encode()).hexdigest()[:16])

    @property
    def label(self) -> str:
        """The hypothesis in one word; of several, how many."""
        labels = ["+".join([c["material"], *c["effects"]]) for c in self.claims]
        return labels[0] if len(labels) == 1 else f"{len(labels)} hypotheses" if labels else ""

    @property
    def reach(self) -> str:
        """The range in words."""
        return "all" if self.end is None else f"{1e3 * self.end:.4g} mm"

    def plain(self) -> dict[str, Any]:
        """What `from_plain` reads back."""
        return {name: value for name, value in asdict(self).items() if value not in (None, "", ())}

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> Task:
        """The inverse of `plain`."""
        lists = {n: tuple(values[n]) for n in ("claims", "needs") if n in values}
        return cls(**{**values, **lists})


def seed_of(campaign: int, data: str) -> int:
    """A seed from the seed of the campaign and the hash of the data: what else is asked changes nothing."""
    return int.from_bytes(hashlib.sha256(f"{campaign} {data}".encode()).digest()[:4])

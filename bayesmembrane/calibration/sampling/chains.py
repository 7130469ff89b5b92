"""What the ensembles walked and where they stand: what a run needs to go on as if it had never stopped."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesmembrane.calibration.sampling.growing import followed
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.ground.parameters import Array


@dataclass(frozen=True, eq=False)
class Chains:
    """Everything that the ensembles walked, and where they stand; or a part of it that follows on what was before.

    Attributes
    ----------
    x : (E, steps, walkers, k) coordinates, in order; of a long walk these and what follows lie in files (`growing`),
        are not contiguous, and cannot be written to
    log_posterior : (E, steps, walkers)
    random_states : state of each ensemble's generator at the end, as NumPy gives it
    counts : outcomes of all evaluations until then, by label
    seconds : time spent until then
    lessons : steps after which the proposal was learned
    look : steps at which it is to be judged next whether all is there; 0 if that was not said yet
    mixture : from which every step is proposed, whatever was walked before; None if ensembles move by emcee's moves
    leapt : steps that a mixture proposed before emcee's ensembles went on
    offered : (E, steps, walkers) ln of p / mixture at what was proposed, nan where nothing was; None without a mixture
    """

    x: Array
    log_posterior: Array
    random_states: tuple[Any, ...]
    counts: Counter[str]
    seconds: float
    lessons: tuple[int, ...] = ()
    look: int = 0
    mixture: Mixture | None = None
    offered: Array | None = None
    leapt: int = 0

    @property
    def steps(self) -> int:
        return int(self.x.shape[1])

    @property
    def learned(self) -> int:
        """Steps until the last lesson; what came before does not count."""
        return self.lessons[-1] if self.lessons else 0

    @property
    def evaluations(self) -> int:
        return sum(self.counts.values())


def joined(parts: Sequence[Chains]) -> Chains:
    """One walk made of its parts, in order; a long one lies in files and not in memory (`growing`)."""
    offered = [p.offered for p in parts if p.offered is not None]
    return replace(
        parts[-1],
        x=_joined([p.x for p in parts]),
        log_posterior=_joined([p.log_posterior for p in parts]),
        offered=_joined(offered) if len(offered) == len(parts) else None,
    )


def _joined(parts: Sequence[Array]) -> Array:
    first, *more = parts
    return followed(first, np.concatenate(more, axis=1)) if more else first

"""What the ensembles walked and where they stand; stored, so that an interrupted run goes on as if it had not been."""

from __future__ import annotations

import json
import zipfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import write_whole
from bayesmembrane.ground.parameters import Array


@dataclass(frozen=True, eq=False)
class Chains:
    """Everything that the ensembles walked, and where they stand: what resuming needs.

    Attributes
    ----------
    x : (E, steps, walkers, k) coordinates, in order
    log_posterior : (E, steps, walkers)
    random_states : state of each ensemble's generator, as NumPy gives it
    counts : outcomes of all evaluations, by label
    seconds : time spent
    lessons : steps after which the proposal was learned
    """

    x: Array
    log_posterior: Array
    random_states: tuple[Any, ...]
    counts: Counter[str]
    seconds: float
    lessons: tuple[int, ...] = ()

    @property
    def steps(self) -> int:
        return int(self.x.shape[1])

    @property
    def evaluations(self) -> int:
        return sum(self.counts.values())


def write_chains(path: Path, chains: Chains) -> None:
    """Store a walk as ``path`` (npz), whole; raises `StorageError` if that cannot be."""
    states: dict[str, Any] = {}
    for e, (_, key, position, has_gauss, gauss) in enumerate(chains.random_states):
        states |= {f"key{e}": key, f"rest{e}": np.array([position, has_gauss, gauss])}

    def save(part: Path) -> None:
        with part.open("wb") as file:
            np.savez(
                file,
                x=chains.x,
                log_posterior=chains.log_posterior,
                counts=np.array(json.dumps(chains.counts)),
                seconds=np.array(chains.seconds),
                lessons=np.array(chains.lessons, dtype=int),
                **states,
            )

    write_whole(path, save, "the walk of the run")


def read_chains(path: Path) -> Chains | None:
    """The walk stored as ``path``, None if there is none; raises `StorageError` if the file is damaged."""
    if not path.exists():
        return None
    try:
        with np.load(path) as f:
            states = tuple(
                ("MT19937", f[f"key{e}"], int(rest[0]), int(rest[1]), float(rest[2]))
                for e, rest in ((e, f[f"rest{e}"]) for e in range(len(f["x"])))
            )
            counts = Counter(json.loads(str(f["counts"])))
            lessons = tuple(int(s) for s in f["lessons"])
            return Chains(f["x"], f["log_posterior"], states, counts, float(f["seconds"]), lessons)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise StorageError(
            f"the chains are damaged ({error})", str(path), "remove the folder and sample again"
        ) from None

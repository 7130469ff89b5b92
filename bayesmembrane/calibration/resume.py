"""Going on with a walk that was stored: is it still the same one, and where does a new one begin at its end."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.posterior import Posterior, weighed
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.store import ASKED, read_asked
from bayesmembrane.ground.errors import SettingsError, StorageError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis, from_settings

POINTS, ALIKE = 8, 1e-5
"""So many stored points are evaluated again; ln p may differ by this part of it (or of one), as machines do."""
SPARE = 10  # earlier draws for each walker, where its end is no longer possible


def check_same(posterior: Posterior, chains: Chains, folder: Path) -> None:
    """Raise `StorageError` if ln p of some stored points is no longer what was stored with them."""
    at = np.unique(np.linspace(0, chains.log_posterior.size - 1, POINTS).round().astype(int))
    stored = _at(chains.log_posterior, at)
    now = weighed(posterior, _at(chains.x, at)).log_posterior
    with np.errstate(invalid="ignore"):
        apart = ~(np.abs(now - stored) <= ALIKE * np.maximum(1.0, np.abs(stored)))
    if np.any(apart):
        i = int(np.flatnonzero(apart)[0])
        raise StorageError(
            f"ln p of a stored point was {stored[i]:.10g} and is now {now[i]:.10g}: the run would not go on alike",
            str(folder),
            f"choose another folder, or start a new run at its end with --fork {folder}",
        )


@dataclass(frozen=True, eq=False)
class Origin:
    """The run at whose end another begins: its folder, its walk, and the checksum of that."""

    folder: Path
    chains: Chains
    end: str

    @property
    def described(self) -> dict[str, Any]:
        """What run.toml says of it."""
        return {"run": self.folder.name, "steps": self.chains.steps, "end": self.end}


def origin(folder: str | Path, hypothesis: Hypothesis) -> Origin:
    """The run in ``folder``, for another to begin at its end.

    Raises `StorageError` if no walk is stored there, or it has other coordinates than ``hypothesis``.
    """
    folder = Path(folder)
    if not (folder / ASKED).is_file():
        raise StorageError("there is no run to begin at the end of", str(folder), "name the folder of a run")
    held, segments = read_asked(folder), Segments(folder)
    chains = segments.read()
    if chains is None:
        raise StorageError("there is no walk to begin at the end of", str(folder), "name a run that has segments/")
    names = from_settings(held["hypothesis"]).names
    if names != hypothesis.names:
        raise StorageError(
            f"the run has the coordinates {', '.join(names)}, and {', '.join(hypothesis.names)} are asked for",
            str(folder),
            "begin without it",
        )
    if chains.x.shape[-1] != len(names):
        raise StorageError(
            f"the run holds {chains.x.shape[-1]} coordinates, and its hypothesis has {len(names)}: of another version",
            str(folder),
            "begin without it",
        )
    return Origin(folder, chains, segments.end)


def ends(posterior: Posterior, old: Chains, wanted: tuple[int, int], seed: int) -> Array:
    """Where the ``wanted`` (ensembles, walkers) begin, (E, W, k): where those of ``old`` ended, as far as that is
    possible now, and else at draws of its second half.

    Raises `SettingsError` if too few of them are possible.
    """
    count = wanted[0] * wanted[1]
    last, earlier = old.x[:, -1].reshape(-1, old.x.shape[-1]), old.x[:, old.steps // 2 : -1]
    chosen = np.random.default_rng([seed, 11]).permutation(earlier[..., 0].size)[: SPARE * count]
    x = np.concatenate([last, _at(earlier, chosen)])
    _, once = np.unique(x, axis=0, return_index=True)
    x = x[np.sort(once)]
    x = x[np.isfinite(weighed(posterior, x).log_posterior)][:count]
    if len(x) < count:
        raise SettingsError(
            f"only {len(x)} of the draws at the end of the old run are possible now, and {count} are needed",
            remedy="begin without --fork",
        )
    return np.asarray(x.reshape(*wanted, -1))


def _at(values: Array, draws: NDArray[np.intp]) -> Array:
    """Those of the ``values`` (E, steps, walkers, ...) with these numbers; of a long walk the others stay unread."""
    return np.asarray(values[np.unravel_index(draws, values.shape[:3])])

"""A run as a report shows it: what was stored, and the few numbers that sentences need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import FAILURES
from bayesmembrane.calibration.predictions import Predictions
from bayesmembrane.data.fixture import Fixture
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.report.sentences import LOOSE, Case
from bayesmembrane.report.style import spoken, title


@dataclass(frozen=True, eq=False)
class Sampling:
    """How a run was sampled.

    status : "converged", or why it stopped
    ess, r_hat : of the worst coordinate
    wanted : effective draws that were asked for
    tau : (k,) autocorrelation times of the coordinates, steps
    means : (E, T, k) means over the walkers of each ensemble at ``steps_at`` (T,), burn-in included
    """

    status: str
    ess: float
    wanted: float
    r_hat: float
    tau: Array
    acceptance: float
    ensembles: int
    walkers: int
    steps: int
    burn: int
    evaluations: int
    seconds: float
    means: Array
    steps_at: Array


@dataclass(frozen=True, eq=False)
class Specimen:
    """The film, what held it, and its origin in words."""

    name: str
    thickness: float
    rig: Fixture
    origin: str
    files: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Shown:
    """One run.

    x, natural : (S, k) and (S, m) posterior draws in coordinates and natural parameters
    prior : (P, k) draws of the truncated prior in coordinates; none where the convexity prior leaves next to nothing
    goodness : of the draw with the largest posterior density (`calibration.goodness`)
    dominated : the inferred noise exceeds the stated one
    masses : (mass of the prior, standard error) by convexity mode
    outcomes : what became of all evaluations
    cache, crosscheck : tally of the curve cache; what the second solver found
    facts : settings, versions and the like
    """

    folder: str
    hypothesis: Hypothesis
    specimen: Specimen
    data_hash: str
    digest: Predictions
    x: Array
    natural: Array
    prior: Array
    sampling: Sampling
    goodness: Mapping[str, float | None]
    dominated: bool
    outcomes: Mapping[str, int]
    masses: Mapping[str, tuple[float, float]]
    cache: Mapping[str, Any]
    crosscheck: Mapping[str, Any]
    facts: Mapping[str, Any]

    @property
    def material(self) -> str:
        """Name of the material."""
        return self.hypothesis.material.name

    @property
    def name(self) -> str:
        """Material and effects, for people."""
        effects = [getattr(e, "title", e.name.replace("_", " ")) for e in self.hypothesis.effects]
        return " + ".join([self.hypothesis.material.title or title(self.material), *effects])

    @property
    def key(self) -> str:
        """A word for anchors and JSON: material, effects, range."""
        return f"{self.hypothesis.label()}-{1e3 * self.digest.end:.4g}mm".replace("+", "-").replace(".", "_")

    @cached_property
    def case(self) -> Case:
        """The numbers that the answer needs."""
        d, noise = self.digest, self._extra_noise()
        fit = self.goodness
        gd = np.asarray(self.hypothesis.material.shear_modulus(self.hypothesis.films(self.x).T), dtype=float)
        failed = sum(self.outcomes.get(o.label, 0) for o in FAILURES) / max(1, sum(self.outcomes.values()))
        low, middle, high = np.quantile(gd, (0.05, 0.5, 0.95)).tolist()
        force = d.curve[:, -1].tolist()
        return Case(
            name=self.name,
            end=d.end,
            rmse=float(fit["rmse_N"] or 0.0),
            own_noise=fit["own_noise_N"],
            extra_noise=None if noise is None else float(np.median(noise)),
            dominated=self.dominated,
            p_value=fit["p_value"],
            modulus=(low, middle, high),
            thickness=self.specimen.thickness,
            status=self.sampling.status,
            ess=self.sampling.ess,
            wanted=self.sampling.wanted,
            r_hat=self.sampling.r_hat,
            failed=failed,
            last=float(d.deflection[-1]),
            last_force=(force[0], force[1], force[2]),
            lost={r: float(d.lost[i, -1]) for i, r in enumerate(d.reasons) if d.lost[i, -1] > 0},
            loose=self._loose(),
        )

    def _extra_noise(self) -> Array | None:
        names = self.hypothesis.natural_names
        return self.natural[:, names.index("noise.sd")] if "noise.sd" in names else None

    def _loose(self) -> dict[str, float]:
        """Coordinates of the curve whose posterior is nearly as wide as the prior, with the ratio of the widths."""
        found: dict[str, float] = {}
        if not len(self.prior):
            return found
        for i, p in enumerate(self.hypothesis.parameters[: self.hypothesis.curve_size]):
            wide = float(np.subtract(*np.quantile(self.prior[:, i], (0.95, 0.05))))
            ratio = float(np.subtract(*np.quantile(self.x[:, i], (0.95, 0.05)))) / wide if wide > 0 else 0.0
            if ratio >= LOOSE:
                found[spoken(p.name)] = ratio
        return found

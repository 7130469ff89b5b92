"""A run as a report shows it: what was stored, and the few numbers that sentences need. Nothing is solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.layout import Groups
from bayesmembrane.calibration.posterior import FAILURES
from bayesmembrane.calibration.predictions import Predictions
from bayesmembrane.calibration.quality import Quality
from bayesmembrane.calibration.run import Run, load_run, stored_predictions
from bayesmembrane.data.fixture import Fixture
from bayesmembrane.ground.draws import pareto_smoothed
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.noise.white import White
from bayesmembrane.report.blocks import Column, Value
from bayesmembrane.report.canvas import Measured
from bayesmembrane.words.calibration import LOOSE, Case
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import spoken_parameter
from bayesmembrane.words.seen import Seen, in_one_unit, seen_on

USUAL = White.name


@dataclass(frozen=True, eq=False)
class HowSampled:
    """How a run was sampled.

    status : "converged", or why it stopped
    ess, r_hat : of the worst coordinate
    wanted : effective draws that were asked for
    tau : (k,) autocorrelation times of the coordinates, steps
    means : (E, T, k) means over the walkers of each ensemble at ``steps_at`` (T,), burn-in included
    draws : (E, D, k) some of the draws of each ensemble, in the order of the walk, at the steps ``draws_at`` (D,)
    sampler : "emcee", or "mixture" where one proposed every step
    k_hat : Pareto shape of the largest weights of what a mixture proposed; None without one
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
    draws: Array
    draws_at: Array
    sampler: str = "emcee"
    k_hat: float | None = None


@dataclass(frozen=True, eq=False)
class Replicas:
    """Measured forces (N,) N, new readings (N, S) N from the posterior, and the log weights (N, S) with which each
    stands for the posterior that has not seen its point (Pareto-smoothed); ``shape`` (N,) of the weights' tail.
    """

    force: Array
    readings: Array
    log_weights: Array
    shape: Array


@dataclass(frozen=True, eq=False)
class ShownFilm:
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
    replicas : new readings, None where the run stored none
    quality : how far the draws can be trusted
    """

    folder: str
    hypothesis: Hypothesis
    film: ShownFilm
    data_hash: str
    digest: Predictions
    x: Array
    natural: Array
    prior: Array
    sampling: HowSampled
    goodness: Mapping[str, float | None]
    dominated: bool
    outcomes: Mapping[str, int]
    masses: Mapping[str, tuple[float, float]]
    cache: Mapping[str, Any]
    crosscheck: Mapping[str, Any]
    facts: Mapping[str, Any]
    replicas: Replicas | None = None
    quality: Quality | None = None

    @property
    def material(self) -> str:
        """Name of the material."""
        return self.hypothesis.material.name

    @property
    def look(self) -> str:
        """The name by which pictures choose colour, line and marker: of the material, or of it with its effects."""
        return self.hypothesis.label()

    @property
    def name(self) -> str:
        """Material and effects, for people; with the noise model where it is not the usual one."""
        return spoken(self.hypothesis) + ("" if self._noise == USUAL else f" ({self._noise})")

    @property
    def key(self) -> str:
        """A word for anchors and JSON: material, effects, noise unless it is the usual one, range."""
        words = [self.hypothesis.label(), *([] if self._noise == USUAL else [self._noise])]
        return "-".join([*words, f"{1e3 * self.digest.end:.4g}mm"]).replace("+", "-").replace(".", "_")

    @property
    def _noise(self) -> str:
        return self.hypothesis.noise.name

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
            points=int(d.at.size),
            rmse=float(fit["rmse_N"] or 0.0),
            own_noise=fit["own_noise_N"],
            extra_noise=None if noise is None else float(np.mean(noise)),
            dominated=self.dominated,
            p_value=fit["p_value"],
            modulus=(low, middle, high),
            thickness=self.film.thickness,
            status=self.sampling.status,
            ess=self.sampling.ess,
            wanted=self.sampling.wanted,
            r_hat=self.sampling.r_hat,
            failed=failed,
            last=float(d.deflection[-1]),
            last_force=(force[0], force[1], force[2]),
            lost={r: float(d.lost[i, -1]) for i, r in enumerate(d.reasons) if d.lost[i, -1] > 0},
            loose=self._loose(),
            how=self.how,
        )

    @property
    def end(self) -> str:
        """The largest fitted deflection: ``35.1 mm``, ``a stretch of 2.5``."""
        return self.how.place(self.digest.end)

    @cached_property
    def how(self) -> Seen:
        """In which quantities and units people read this run's curve."""
        return seen_on(self.film.rig, self.film.thickness, self.film.origin)

    def read_as(self, name: str, unit: str) -> tuple[float, str]:
        """(factor, unit) in which people read a parameter: effects and noise in the units of the rig."""
        if name.startswith(f"{self.material}."):
            return 1.0, unit
        return self.film.rig.shown(self.film.thickness).get(unit, (1.0, unit))

    @property
    def points(self) -> Measured:
        """The fitted points."""
        return Measured(self.digest.at, self.digest.force, self.digest.sd if self.digest.has_noise else None, self.how)

    def _extra_noise(self) -> Array | None:
        names = self.hypothesis.natural_names
        return self.natural[:, names.index("noise.sd")] if "noise.sd" in names else None

    def _loose(self) -> dict[str, float]:
        """Coordinates of the curve whose posterior is nearly as wide as the prior, with the ratio of the widths."""
        found: dict[str, float] = {}
        if not len(self.prior):
            return found
        for i, p in enumerate(self.hypothesis.parameters[: self.hypothesis.curve_size]):
            if p.name in self.hypothesis.known_coordinates:  # what was measured before is known that well
                continue
            wide = float(np.subtract(*np.quantile(self.prior[:, i], (0.95, 0.05))))
            ratio = float(np.subtract(*np.quantile(self.x[:, i], (0.95, 0.05)))) / wide if wide > 0 else 0.0
            if ratio >= LOOSE:
                found[spoken_parameter(p.name)] = ratio
        return found


def by_points(shown: Sequence[Shown]) -> list[list[Shown]]:
    """Runs fitted to the same points, in order."""
    return [list(g) for _, g in groupby(in_order(shown), key=lambda s: (s.digest.end, s.data_hash))]


def reach(s: Shown, shown: Sequence[Shown]) -> str:
    """How far a run was fitted, as all of ``shown`` are told apart: with its specimen, or its points, where others end
    there, too.
    """
    same = {o.data_hash for o in shown if o.end == s.end}
    films = {o.film.name for o in shown if o.end == s.end}
    if len(same) <= 1:
        return s.end
    return f"{s.end} ({s.film.name if len(films) == len(same) else f'{s.digest.at.size} points'})"


def cases(shown: Sequence[Shown]) -> list[Case]:
    """Their cases, each named with its specimen where there are several."""
    several = len({s.film.name for s in shown}) > 1
    return [replace(s.case, name=f"{s.name} on {s.film.name}") if several else s.case for s in shown]


def end_column(shown: Sequence[Shown]) -> Column:
    """How far runs were fitted, in a table; the values are those of `ends`."""
    if _mixed(shown):
        return Column("end", "fitted up to")
    how = shown[0].how
    unit = how.travel if how.bare else how.travel_scale[1]
    return Column(f"end_{unit}", f"fitted up to ({unit})")


def ends(shown: Sequence[Shown]) -> list[Value]:
    """The largest fitted deflection or stretch of each; in words with its unit where they are not read in one."""
    mixed = _mixed(shown)
    return [s.end if mixed else s.how.rest + s.how.travel_scale[0] * s.digest.end for s in shown]


def _mixed(shown: Sequence[Shown]) -> bool:
    return len(in_one_unit(shown, lambda s: s.how)) > 1


def in_order(shown: Sequence[Shown]) -> list[Shown]:
    """Shorter ranges first; of one range those with fewer parameters."""
    return sorted(shown, key=lambda s: (s.digest.end, s.data_hash, s.hypothesis.curve_size, s.name))


# ---- from the run ----------------------------------------------------------------------------------------------------

MOST_TRACED, MOST_REPLICAS = 300, 1000  # draws of an ensemble in a trace, new readings of each point
_SHOWN_APART = ("hypothesis", "sampling", "data", "code", "versions", "seed", "fingerprint")


def read(run: Run | Path | str, predictions: Predictions | None = None) -> Shown:
    """A run, or the folder that holds one, as a report shows it; ``predictions`` are those stored with it unless given.

    Raises `StorageError` if the folder holds no run, a damaged one, or one without predictions: none are made here.
    """
    if not isinstance(run, Run):
        folder = Path(run)
        if not folder.is_dir():
            raise StorageError("there is no such run folder", str(folder), "name a folder under chains/")
        run = load_run(folder)
    try:
        found = predictions or stored_predictions(run)
        if found is not None:
            return _shown(run, found)
    except (KeyError, AttributeError) as error:
        raise StorageError(
            f"another version wrote the run ({type(error).__name__}: {error})", _place(run), "sample again"
        ) from None
    raise StorageError(
        "no predictions are stored with the run, and a report solves no films",
        _place(run),
        "ask for the same again (sample, compare or loop), which keeps the draws and predicts from them",
    )


def _place(run: Run) -> str:
    return run.name if run.path is None else str(run.path)


def _shown(run: Run, found: Predictions) -> Shown:
    m, h = run.measurement, run.hypothesis
    p = m.provenance
    return Shown(
        folder=_place(run),
        hypothesis=h,
        film=ShownFilm(
            m.specimen.name,
            m.specimen.thickness,
            m.rig,
            p.origin,
            (p.curve, p.specimen, p.covariance),
            p.notes,
        ),
        data_hash=m.data_hash,
        digest=found,
        x=run.draws(),
        natural=_stacked(run.groups.posterior, h.natural_names),
        prior=_stacked(run.groups.prior, h.names) if "prior" in run.groups else np.empty((0, len(h.names))),
        sampling=_sampling(run),
        goodness=run.status["goodness"],
        dominated=bool(run.status["extra_noise_dominates"]),
        outcomes=run.status["tally"],
        masses={mode: (v["value"], v["sd"]) for mode, v in run.status["prior_mass"].items()},
        cache=run.status.get("cache", {}),
        crosscheck=run.status["crosscheck"],
        facts=_facts(run),
        replicas=_replicas(run.groups),
        quality=run.quality,
    )


def _stacked(group: Any, names: tuple[str, ...]) -> Array:
    """Draws (S, k) of the named variables, all ensembles together."""
    return np.stack([np.asarray(group[n].values, dtype=float).ravel() for n in names], axis=1)


def _sampling(run: Run) -> HowSampled:
    status = run.status
    means, steps = _means(run)
    draws, at = _draws(run)
    tau = np.array([np.nan if v is None else v for v in (status["tau"][n] for n in run.hypothesis.names)], dtype=float)
    return HowSampled(
        status=status["status"],
        ess=_number(status["ess_bulk"], 0.0),
        wanted=status["ess_wanted"],
        r_hat=_number(status["r_hat"], np.inf),
        tau=tau,
        acceptance=status["acceptance"],
        ensembles=int(run.groups.posterior.sizes["chain"]),
        walkers=status["walkers"],
        steps=status["steps"],
        burn=status["burn"],
        evaluations=status["evaluations"],
        seconds=status["seconds"],
        means=means,
        steps_at=steps,
        draws=draws,
        draws_at=at,
        sampler=status.get("sampler", "emcee"),
        k_hat=(status.get("importance") or {}).get("k_hat"),
    )


def _number(value: float | None, missing: float) -> float:
    return missing if value is None else float(value)


def _means(run: Run) -> tuple[Array, Array]:
    """Means over the walkers (E, T, k) at steps (T,): of the whole walk if it was stored, else of the stored draws."""
    constant = run.groups.constant_data
    if "ensemble_mean" in constant:
        return np.asarray(constant["ensemble_mean"].values, float), np.asarray(constant["ensemble_step"].values, float)
    x = _walked(run)
    ensembles, draws, k = x.shape
    walkers = run.status["walkers"] if draws % run.status["walkers"] == 0 else 1
    means = x.reshape(ensembles, -1, walkers, k).mean(axis=2)
    return means, np.linspace(run.status["burn"], run.status["steps"], means.shape[1])


def _walked(run: Run) -> Array:
    """All stored draws (E, D, k), step after step, of each step all walkers."""
    return np.stack([np.asarray(run.groups.posterior[n].values, float) for n in run.hypothesis.names], axis=-1)


def _draws(run: Run) -> tuple[Array, Array]:
    """At most `MOST_TRACED` draws of each ensemble (E, D, k), and their steps (D,)."""
    x = _walked(run)
    at = np.linspace(run.status["burn"], run.status["steps"], x.shape[1])
    keep = np.unique(np.linspace(0, x.shape[1] - 1, min(x.shape[1], MOST_TRACED)).astype(int))
    return x[:, keep], at[keep]


def _replicas(data: Groups) -> Replicas | None:
    if not {"posterior_predictive", "log_likelihood"} <= set(data):
        return None
    readings, likelihood = (
        np.asarray(g["force"].values, dtype=float).reshape(-1, data.observed_data["force"].size)
        for g in (data.posterior_predictive, data.log_likelihood)
    )
    thin = max(1, len(readings) // MOST_REPLICAS)
    weights, shape = pareto_smoothed(-likelihood[::thin].T)
    force = np.asarray(data.observed_data["force"].values, dtype=float)
    return Replicas(force, readings[::thin].T, weights, shape)


def _facts(run: Run) -> dict[str, Any]:
    """Settings and versions as names and values."""
    asked = run.settings
    facts: dict[str, Any] = {f"hypothesis: {k}": v for k, v in asked["hypothesis"].items()}
    facts |= {f"sampling: {k}": v for k, v in asked["sampling"].items()}
    facts |= {"seed": asked["seed"], "fingerprint": asked["fingerprint"], "code (SHA-256)": asked["code"]["sha256"]}
    facts |= {f"version of {k}": v for k, v in asked["versions"].items()}
    facts |= {k: v for k, v in asked.items() if k not in _SHOWN_APART}
    return facts | {"folder": run.name}

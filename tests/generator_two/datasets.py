"""A second generator of measurements with known faults, for one last look: other laws, other code, other noise.

It shares nothing with the first one and with the package, and nothing is to be tuned on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tests.generator_two import course as courses
from tests.generator_two import scatter as scatters
from tests.generator_two.course import Course
from tests.generator_two.elastic import ELASTIC
from tests.generator_two.faults import FAULTS, Done, Trial, drawn
from tests.generator_two.membrane import LockedError, Membrane

SHORTER, TRIALS = 0.8, 10
SMALLEST = 1e-5
NEAR = 0.02


@dataclass(frozen=True, eq=False)
class Dataset:
    """A measurement and its truth; arrays (N,) as the instrument wrote them, ``clean_N`` without noise."""

    film: Membrane
    path: Course
    thickness: float
    clean_N: Any  # noqa: N815
    force_N: Any  # noqa: N815
    truth: dict[str, Any]

    @property
    def csv(self) -> str:
        """The curve."""
        rows = zip(self.path.time, 1e3 * self.path.at, self.force_N, strict=True)
        return "time_s,deflection_mm,force_N\n" + "\n".join(f"{t:.6f},{d:.6f},{f:.7g}" for t, d, f in rows) + "\n"

    @property
    def toml(self) -> str:
        """The specimen."""
        lines = (
            "[specimen]",
            'name = "film of the second generator"',
            f"thickness_um = {1e6 * self.thickness:.8g}",
            "[rig]",
            'kind = "annulus"',
            f"inner_radius_mm = {1e3 * self.film.inner:.8g}",
            f"outer_radius_mm = {1e3 * self.film.outer:.8g}",
            "[origin]",
            'statement = "SYNTHETIC, not measured"',
        )
        return "\n".join(lines) + "\n"

    def write(self, folder: Path, stem: str = "curve") -> tuple[Path, Path]:
        """(CSV, TOML) in ``folder``."""
        folder.mkdir(parents=True, exist_ok=True)
        files = folder / f"{stem}.csv", folder / f"{stem}.toml"
        for file, text in zip(files, (self.csv, self.toml), strict=True):
            file.write_text(text, encoding="utf-8")
        return files


@dataclass(frozen=True, eq=False)
class Sight:
    """How much of a change of the readings the noise lets see, once the film's own constants have taken their part."""

    trial: Trial
    deviations: Any

    @cached_property
    def _taken(self) -> Any:
        columns = self.trial.film.slopes(self.trial.course.at) / self.deviations[:, None]
        u, s, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
        return u[:, s > 1e-8 * s[0]]

    def left(self, change: Any) -> Any:
        """(N,) in standard deviations; its length is the signal-to-noise ratio."""
        x = change / self.deviations
        return x - self._taken @ (self._taken.T @ x)

    def ratios(self, changes: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, float]]:
        """(of each change alone, of each with the others taken out too)."""
        left = {k: self.left(v) for k, v in changes.items()}
        own = {}
        for name, x in left.items():
            others = [v for k, v in left.items() if k != name and np.linalg.norm(v) > 0]
            y = x
            if others:
                q = np.linalg.qr(np.stack(others, axis=1))[0]
                y = x - q @ (q.T @ x)
            own[name] = float(np.linalg.norm(y))
        return {k: float(np.linalg.norm(v)) for k, v in left.items()}, own


def generate(family: str, ratios: Mapping[str, float], seed: int) -> Dataset:
    """A film of ``family`` with faults whose signal-to-noise ratios, each by itself, are those of ``ratios``.

    Rig, thickness, course, forms and noise follow from the seed. A film that cannot be pulled as far as was drawn is
    pulled less far. Raises `LockedError` if none can be made.
    """
    for trial in range(TRIALS):
        try:
            return _made(family, ratios, seed, SHORTER**trial)
        except LockedError:
            if trial == TRIALS - 1:
                raise
    raise AssertionError("unreachable")


def _made(family: str, ratios: Mapping[str, float], seed: int, part: float) -> Dataset:
    rig_rng, film_rng, course_rng, fault_rng, noise_rng = (
        np.random.default_rng(s) for s in np.random.SeedSequence([2, seed]).spawn(5)
    )
    inner, outer = float(rig_rng.uniform(0.005, 0.015)), float(rig_rng.uniform(0.030, 0.060))
    thickness = 1e-6 * float(np.exp(rig_rng.uniform(np.log(20), np.log(200))))
    top = part * float(rig_rng.uniform(0.7, 1.8)) * (outer - inner)
    readings = int(rig_rng.integers(250, 600))
    film = Membrane(family, ELASTIC[family].draw(film_rng, thickness), inner, outer, 1.15 * top)
    course = courses.drawn(top, list(ratios), readings, course_rng)
    trial = Trial(film, course)
    plain = trial.reading({})
    scatter = scatters.drawn(trial.lengths[1], noise_rng)
    sight = Sight(trial, scatter.deviations(plain))
    faults, reached = {}, True
    for name in sorted(ratios):
        faults[name], close = _sized(sight, plain, name, drawn(name, fault_rng), ratios[name])
        reached = reached and close
    clean = trial.reading(faults)
    alone, own = sight.ratios({k: trial.reading({k: v}) - plain for k, v in faults.items()})
    force, lost = scatter.read(clean, course, noise_rng)
    truth = {
        "kind": "+".join(sorted(ratios)) or "none",
        "family": family,
        "parameters": dict(zip(ELASTIC[family].names, film.constants, strict=True)),
        "effects": {
            k: {"size": trial.si(k, v.size), "unit": FAULTS[k].unit, "form": v.form, **v.details}
            for k, v in faults.items()
        },
        "snr": alone,
        "snr_own": own,
        "reached": reached,
        "protocol": course.name,
        "noise": {
            "sd": scatter.sd,
            "load": scatter.load,
            "freedom": scatter.freedom,
            "digit": scatter.digit,
            "astray": len(lost),
        },
        "seed": seed,
        "expected": _expected(ratios, reached),
    }
    return Dataset(film, course, thickness, clean, force, truth)


def _sized(sight: Sight, plain: Any, name: str, form: Done, ratio: float) -> tuple[Done, bool]:
    """(the fault so large that its ratio is as asked, or as large as it may be; whether it is within `NEAR`)."""
    fault = FAULTS[name]

    def of(size: float) -> Done:
        return Done(form.size * size, form.form, form.details)

    def seen(size: float) -> float:
        try:
            return float(np.linalg.norm(sight.left(sight.trial.reading({name: of(size)}) - plain)))
        except LockedError:
            return np.inf

    low, high, size = 0.0, fault.most, 0.1 * fault.most
    best: tuple[float, float] = (np.inf, size)
    for _ in range(24):
        here = seen(size)
        away = abs(np.log(max(here, 1e-9) / ratio)) if np.isfinite(here) else np.inf
        best = min(best, (away, size))
        if away < NEAR or (here < ratio and size >= fault.most):
            break
        low, high = (size, high) if here < ratio else (low, size)
        guess = size * ratio / here if np.isfinite(here) and here > 0 else 0.0
        size = float(min(guess, fault.most)) if low < guess < high or guess > high == fault.most else 0.5 * (low + high)
        if high < SMALLEST * fault.most:
            break
    if not np.isfinite(best[0]):
        raise LockedError(f"no {name} can be put in")
    return of(best[1]), bool(best[0] < NEAR)


def _expected(faults: Sequence[str] | Mapping[str, float], reached: bool) -> list[str]:
    if not faults:
        return ["adequate", "material", "unknown"]
    return ["named", "ambiguous", "unknown", *([] if reached else ["adequate"])]

"""How parameters moved between two calibrations of one film, and what that means, in words."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.calibration.run import Run
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.ground.parameters import Array
from bayesmembrane.words.calibration import LOOSE
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import listed, spoken_parameter

MATTERS = 1.0  # standard deviations: a smaller change of a parameter is none
TOUCHES = 0.1  # of the width of the 90 %: a bound as near to its end cuts the estimate off
FAR = 1e-3  # of the prior's probability: an estimate beyond is one that the prior did not expect
SAME = 1e-3  # of its value: parameters whose parts differ by less move together


@dataclass(frozen=True)
class Change:
    """A number before and after: posterior means and standard deviations; nan where a model does not have it.

    unit : as people read it; ``material`` tells a property of the film from one of the test
    remark : what must be known of the value after: a bound, or a prior that decides it; "" if nothing
    """

    name: str
    unit: str
    before: tuple[float, float]
    after: tuple[float, float]
    material: bool
    remark: str = ""

    @property
    def share(self) -> float:
        """(after - before) / |before|."""
        return (self.after[0] - self.before[0]) / abs(self.before[0]) if self.before[0] else float("nan")

    @property
    def in_sd(self) -> float:
        """(after - before) over the standard deviation that was stated before."""
        return (self.after[0] - self.before[0]) / self.before[1] if self.before[1] > 0 else float("nan")


def changes(before: Run, after: Run) -> list[Change]:
    """Shear modulus first, then every parameter that either run has, in the order of the later one."""
    out = [Change("shear modulus", "MPa", modulus_of(before), modulus_of(after), True)]
    old, new = _posterior(before), _posterior(after)
    nothing = (float("nan"), float("nan"))
    remarks = remarks_on(after)
    units = after.measurement.rig.shown(after.measurement.specimen.thickness)
    for name in dict.fromkeys([*new, *old]):
        unit = (new.get(name) or old[name])[1]
        b, a = (found[name][0] if name in found else nothing for found in (old, new))
        own = name.partition(".")[0] in (before.hypothesis.material.name, after.hypothesis.material.name)
        factor, shown = (1.0, unit) if own else units.get(unit, (1.0, unit))
        out.append(Change(name, shown, _times(factor, b), _times(factor, a), own, remarks.get(name, "")))
    return out


def remarks_on(run: Run) -> dict[str, str]:
    """By name of the coordinate, what must be known of its estimate: it lies at a bound, or its prior decides it."""
    told = {}
    for p, x in zip(run.hypothesis.parameters, run.draws().T, strict=True):
        low, middle, high = (float(q) for q in np.quantile(x, (0.05, 0.5, 0.95)))
        prior = [float(p.prior.quantile(q)) for q in (0.05, 0.95)]
        if min(low - p.bounds[0], p.bounds[1] - high) < TOUCHES * (high - low):
            told[p.name] = "at its bound"
        elif high - low >= LOOSE * (prior[1] - prior[0]):
            told[p.name] = "the prior decides"
        elif not FAR < float(p.prior.cdf(middle)) < 1 - FAR:
            told[p.name] = "far out in its prior"
    return told


def _times(factor: float, pair: tuple[float, float]) -> tuple[float, float]:
    return factor * pair[0], factor * pair[1]


def _posterior(run: Run) -> dict[str, tuple[tuple[float, float], str]]:
    """By full name, ((mean, sd), unit) of the natural parameters."""
    h = run.hypothesis
    pairs = zip(h.natural_names, h.natural_units, strict=True)
    return {n: (_moments(run.groups.posterior[n].values), u) for n, u in pairs}


def modulus_fitted(c: Candidate, m: Measurement) -> float:
    """G in MPa of what was fitted and not sampled."""
    modulus = c.hypothesis.material.shear_modulus(c.hypothesis.films(c.x[None]).T)
    return float(1e-6 * np.ravel(modulus)[0] / m.specimen.thickness)


def settled(c: Candidate, run: Run | None) -> Candidate:
    """The candidate with its effects as the posterior of the same model has them in the mean; else as it was fitted.

    What was sampled after it had been fitted has one size, wherever it is told.
    """
    if run is None or run.hypothesis.label() != c.hypothesis.label():
        return c
    x, names = c.x.copy(), c.hypothesis.names
    for i in range(c.hypothesis.material_size, c.hypothesis.curve_size):
        x[i] = _moments(run.groups.posterior[names[i]].values)[0]
    return replace(c, x=x)


def modulus_of(run: Run) -> tuple[float, float]:
    """Mean and standard deviation of G in MPa: the initial slope of the energy over the thickness."""
    material = run.hypothesis.material
    fields = np.stack([run.groups.posterior[f"{material.name}.{n}"].values.ravel() for n in material.field_names()])
    return _moments(1e-6 * np.asarray(material.shear_modulus(fields)) / run.measurement.specimen.thickness)


def _moments(values: Array) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values))


def moved_sentences(before: Run, after: Run) -> list[str]:
    """How the material moved, and why that matters."""
    every = [c for c in changes(before, after) if c.material or c.name == "shear modulus"]
    modulus, rest = every[0], every[1:]
    told = [modulus_sentence(modulus, spoken(after.hypothesis))]
    # What only scales with the modulus says nothing new.
    known = [c for c in rest if abs(c.in_sd) > MATTERS and abs(c.share - modulus.share) > SAME]
    if known:
        names = listed(
            f"{spoken_parameter(c.name)} by {100 * c.share:+.2g} % ({c.in_sd:+.1f} sd)"
            for c in sorted(known, key=lambda c: -abs(c.in_sd))
        )
        told.append(
            f"The shape of the curve moves too: {names}. Every prediction made with the first calibration, of another "
            "test or beyond this range, carries what it imitated."
        )
    return told


def modulus_sentence(c: Change, model: str) -> str:
    """What the change of the modulus means to a user."""
    start = f"In {model} the shear modulus is {c.after[0]:.4g} +- {c.after[1]:.2g} MPa instead of {c.before[0]:.4g}"
    if abs(c.in_sd) <= MATTERS:
        return (
            f"{start}: {100 * c.share:+.2g} %, within the {c.before[1]:.2g} MPa that were stated before. The modulus "
            "of the first calibration could be used."
        )
    return (
        f"{start}: {100 * c.share:+.2g} %, {abs(c.in_sd):.1f} of the standard deviations that were stated before. The "
        "first calibration had bent the material to imitate what it lacked, and was surer of it than it should have "
        "been."
    )

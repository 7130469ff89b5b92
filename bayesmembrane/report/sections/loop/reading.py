"""What a report reads from a closed loop: the models on its way, and how the material moved between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.calibration.run import Run
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.left.heldout import Misfit, misfit_of
from bayesmembrane.diagnosis.loop import Loop, Round, Stage
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.report.sentences import listed


@dataclass(frozen=True, eq=False)
class Model:
    """One model on the way.

    title : material and effects as people say them
    candidate : at its most probable parameters
    error, held_out : in sample; on points that were set aside, with the model fitted to the others, or None
    stage : its posterior, or None if it was not sampled
    added : False for what the answer leaves undecided
    covered : part of the points that were set aside inside the 90 % band of the model fitted to the others, or None
    """

    title: str
    candidate: Candidate
    error: Misfit
    held_out: Misfit | None
    stage: Stage | None
    added: bool = True
    covered: float | None = None


@dataclass(frozen=True)
class Change:
    """A number before and after: posterior means and standard deviations; nan where a model does not have it.

    unit : as people read it; ``material`` tells a property of the film from one of the test
    """

    name: str
    unit: str
    before: tuple[float, float]
    after: tuple[float, float]
    material: bool

    @property
    def share(self) -> float:
        """(after - before) / |before|."""
        return (self.after[0] - self.before[0]) / abs(self.before[0]) if self.before[0] else float("nan")

    @property
    def in_sd(self) -> float:
        """(after - before) over the standard deviation that was stated before."""
        return (self.after[0] - self.before[0]) / self.before[1] if self.before[1] > 0 else float("nan")


def spoken_hypothesis(hypothesis: Hypothesis) -> str:
    """``Yeoh with slip in the clamp``."""
    effects = listed(e.title for e in hypothesis.effects)
    return hypothesis.material.title + (f" with {effects}" if effects else "")


def effect_title(name: str) -> str:
    """How reports print an effect."""
    kind = components("effects").get(name)
    return str(kind.title) if kind is not None else name.replace("_", " ")


def models(loop: Loop) -> list[Model]:
    """The model as given, then what each round added or, at the end, would have added if it could be told."""
    first = loop.rounds[0]
    d = first.diagnosis
    out = [_model(d, d.null, d.before, first.before, before=True)]
    for r in loop.rounds:
        d = r.diagnosis
        if d.verdict == "ambiguous":
            out += _undecided(r)
        elif d.explains:
            stage = r.after if r.changed else None
            out.append(replace(_model(d, d.best, d.after, stage, before=False), added=stage is not None))
    return out


def _undecided(r: Round) -> list[Model]:
    """The members of an ambiguous answer that were sampled, or else the first; only that one was held to new points."""
    d = r.diagnosis
    first = replace(_model(d, d.best, d.after, next(iter(r.leaders), None), before=False), added=False)
    sd = d.noise.each
    rest = zip(d.members[1:], r.leaders[1:], strict=False)
    return [
        first,
        *(
            Model(
                spoken_hypothesis(j.candidate.hypothesis),
                j.candidate,
                misfit_of(j.candidate.residual, sd, j.candidate.x.size),
                None,
                stage,
                added=False,
            )
            for j, stage in rest
        ),
    ]


def _model(d: Diagnosis, candidate: Candidate, error: Misfit, stage: Stage | None, before: bool) -> Model:
    v, title = d.validation, spoken_hypothesis(candidate.hypothesis)
    if v is None:
        return Model(title, candidate, error, None, stage)
    held, covered = (v.before, v.covered_before) if before else (v.after, v.covered_after)
    return Model(title, candidate, error, held, stage, covered=covered)


def deciding(loop: Loop) -> Diagnosis:
    """The diagnosis in which something was found: the last that is not `adequate`, or the last."""
    found = [r.diagnosis for r in loop.rounds if r.diagnosis.verdict != "adequate"]
    return found[-1] if found else loop.rounds[-1].diagnosis


def stages(loop: Loop) -> tuple[Stage, Stage]:
    """The first and the last posterior; the same if nothing was added."""
    return loop.rounds[0].before, loop.rounds[-1].after


def changes(before: Run, after: Run) -> list[Change]:
    """Shear modulus first, then every parameter that either run has, in the order of the later one."""
    out = [Change("shear modulus", "MPa", modulus_of(before), modulus_of(after), True)]
    old, new = _posterior(before), _posterior(after)
    nothing = (float("nan"), float("nan"))
    for name in dict.fromkeys([*new, *old]):
        unit = (new.get(name) or old[name])[1]
        b, a = (found[name][0] if name in found else nothing for found in (old, new))
        noise = name.startswith("noise.")
        own = name.partition(".")[0] in (before.hypothesis.material.name, after.hypothesis.material.name)
        factor, shown = (1e3, "mN") if noise and unit == "N" else (1.0, unit)
        out.append(Change(name, shown, _times(factor, b), _times(factor, a), own))
    return out


def _times(factor: float, pair: tuple[float, float]) -> tuple[float, float]:
    return factor * pair[0], factor * pair[1]


def _posterior(run: Run) -> dict[str, tuple[tuple[float, float], str]]:
    """By full name, ((mean, sd), unit) of the natural parameters."""
    h = run.hypothesis
    pairs = zip(h.natural_names, h.natural_units, strict=True)
    return {n: (_moments(run.data.posterior[n].values), u) for n, u in pairs}


def modulus_of(run: Run) -> tuple[float, float]:
    """Mean and standard deviation of G in MPa: the initial slope of the energy over the thickness."""
    material = run.hypothesis.material
    fields = np.stack([run.data.posterior[f"{material.name}.{n}"].values.ravel() for n in material.field_names()])
    return _moments(1e-6 * np.asarray(material.shear_modulus(fields)) / run.measurement.specimen.thickness)


def _moments(values: Array) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values))

"""What a model leaves of the misfit, and what of that its form error carries."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Weighing, beyond_noise
from bayesmembrane.diagnosis.reference.noise import free_of
from bayesmembrane.diagnosis.thresholds import VERDICT
from bayesmembrane.ground.parameters import Array


@dataclass(frozen=True)
class Remaining:
    """What is left.

    share : part of the squares beyond noise that the plain model leaves; 1 where it is the plain model's own, 0 where
        that leaves no more than noise does by chance
    reduced_chi2, dof : of what is left, by the measurement's own noise; the degrees of freedom of that
    carried : part of what is left beyond noise that the form error takes: smooth, and no effect
    rms : N, root mean square of the form error
    energy_error : relative error of the energy's form
    law_errors : by effect, relative error of its law
    excess : squares, freed of noise, that are left beyond noise
    own : by effect, the same of its own trace, less what energy and other effects could take of that
    """

    share: float
    reduced_chi2: float
    carried: float
    rms: float
    energy_error: float
    law_errors: Mapping[str, float]
    dof: int
    excess: float = 0.0
    own: Mapping[str, float] = field(default_factory=dict)

    @property
    def noise(self) -> bool:
        """True if that is noise alone."""
        return self.reduced_chi2 < VERDICT.noise_chi2 and self.share < VERDICT.noise_share

    @property
    def strange(self) -> bool:
        """True if it is more than noise, and more than a small error of the forms that carries it."""
        forms = self.carried >= VERDICT.form_carries and all(e <= VERDICT.law_small for e in self.law_errors.values())
        return over_noise(self.reduced_chi2, self.dof) >= 0.0 and not forms

    def firm(self, names: Iterable[str]) -> list[str]:
        """Those of these effects that explain clearly more by themselves than what is left."""
        return [name for name in names if self.own.get(name, 0.0) > VERDICT.firm * self.excess]


def over_noise(reduced_chi2: float, dof: int) -> float:
    """By what part what is left is more than chance and an error of the noise account for; below 0 where it is less."""
    return reduced_chi2 / max(VERDICT.noise_chi2, 1.0 + VERDICT.chance * float(np.sqrt(2.0 / dof))) - 1.0


def structure(search: Weighing, model: Candidate, trace: Array | None = None) -> float:
    """`over_noise` of what ``model`` leaves at its best, or that and the ``trace`` (N,) N of something foreign."""
    dof = max(model.residual.size - model.x.size, 1)
    return over_noise(search.squares(model, trace) / dof, dof)


def remaining(search: Weighing, model: Candidate, plain: Candidate) -> Remaining:
    """What ``model`` leaves, beside what the ``plain`` one does; both as they were fitted, with their form error."""
    dof = max(model.residual.size - model.x.size, 1)
    left, before = search.excess(model), search.excess(plain)
    rest = beyond_noise(search.noise.white(model.residual - model.form), model)
    beyond = before > VERDICT.chance * float(np.sqrt(2.0 * dof))
    white = search.noise.white(model.slopes)
    return Remaining(
        share=float(np.clip(left / before, 0.0, 1.0)) if beyond else 0.0,
        reduced_chi2=float(np.sum(search.noise.white(search.adapted(model)) ** 2)) / dof,
        carried=1 - min(rest / left, 1.0) if left > 0 else 0.0,
        rms=float(np.sqrt(np.mean(model.form**2))),
        energy_error=model.energy_error,
        law_errors=model.law_errors,
        dof=dof,
        excess=max(float(left), 0.0),
        own=dict(_own_traces(model, white)),
    )


def _own_traces(model: Candidate, white: Array) -> Iterator[tuple[str, float]]:
    """Squares of the trace of each effect by its sizes, to first order, less what all other coordinates could take."""
    place = model.hypothesis.material_size
    for effect in model.hypothesis.effects:
        places = [place + i for i in effect.sizes]
        null = np.array([effect.coordinates[i].null or 0.0 for i in effect.sizes])
        others = np.delete(white, range(place, place + len(effect.coordinates)), axis=1)
        yield effect.name, float(np.sum(free_of(others, white[:, places] @ (model.x[places] - null)) ** 2))
        place += len(effect.coordinates)

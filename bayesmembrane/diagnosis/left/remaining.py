"""What a model leaves of the misfit, and what of that its form error carries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Weighing, beyond_noise
from bayesmembrane.diagnosis.reference.noise import orthonormal
from bayesmembrane.diagnosis.thresholds import VERDICT


@dataclass(frozen=True)
class Remaining:
    """What is left.

    share : part of the squares beyond noise that the plain model leaves; 1 where it is the plain model's own, 0 where
        that leaves no more than noise does by chance
    of_laws : the same part of what the effects of the model change that its energy could not; inf where they change
        nothing
    reduced_chi2, dof : of what is left, by the measurement's own noise; the degrees of freedom of that
    carried : part of what is left beyond noise that the form error takes: smooth, and no effect
    rms : N, root mean square of the form error
    energy_error : relative error of the energy's form
    law_errors : by effect, relative error of its law
    """

    share: float
    of_laws: float
    reduced_chi2: float
    carried: float
    rms: float
    energy_error: float
    law_errors: Mapping[str, float]
    dof: int

    @property
    def noise(self) -> bool:
        """True if that is noise alone."""
        return self.reduced_chi2 < VERDICT.noise_chi2 and self.share < VERDICT.noise_share

    @property
    def strange(self) -> bool:
        """True if it is more than noise, more than laws are usually off, and no small error of the forms carries it."""
        by_chance = VERDICT.chance * float(np.sqrt(2.0 / self.dof))
        forms = self.carried >= VERDICT.form_carries and all(e <= VERDICT.law_small for e in self.law_errors.values())
        noise = self.reduced_chi2 < max(VERDICT.noise_chi2, 1.0 + by_chance)
        return not (noise or forms or min(self.share, self.of_laws) < VERDICT.trifle)


def remaining(search: Weighing, model: Candidate, plain: Candidate) -> Remaining:
    """What ``model`` leaves, beside what the ``plain`` one does; both as they were fitted, with their form error."""
    dof = max(model.residual.size - model.x.size, 1)
    left, before = search.excess(model), search.excess(plain)
    rest = beyond_noise(search.noise.white(model.residual - model.form), model)
    beyond = before > VERDICT.chance * float(np.sqrt(2.0 * dof))
    changed = _changed(search, model)
    return Remaining(
        share=float(np.clip(left / before, 0.0, 1.0)) if beyond else 0.0,
        of_laws=max(left, 0.0) / changed if changed > 0 else np.inf,
        reduced_chi2=float(np.sum(search.noise.white(search.adapted(model)) ** 2)) / dof,
        carried=1 - min(rest / left, 1.0) if left > 0 else 0.0,
        rms=float(np.sqrt(np.mean(model.form**2))),
        energy_error=model.energy_error,
        law_errors=model.law_errors,
        dof=dof,
    )


def _changed(search: Weighing, model: Candidate) -> float:
    """Squares, freed of noise, of what the effects of a model change of the force, and its energy could not."""
    trace = search.noise.white(np.sum(model.traces, axis=0))
    energy = orthonormal(search.noise.white(model.slopes[:, : model.hypothesis.material_size]))
    own = trace - energy @ (energy.T @ trace)
    return float(own @ own)

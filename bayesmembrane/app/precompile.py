"""All that is compiled, compiled ahead: ``python -m bayesmembrane.app.precompile``, at the end of an installation.

A kernel is compiled when it is first asked, and its code stays on the disk beside the package. Here each is asked for
something small, so that nobody waits a minute for a first answer, and no two processes compile the same at once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesmembrane.app.terminal import note
from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.ground.jobs import Tell, workers
from bayesmembrane.ground.registry import components, ordinary_materials
from bayesmembrane.physics.convexity import MODES
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis

FEW = Settings(ess=10.0, walkers=16, chunk=40, most_steps=40)
READINGS = 120
"""Of the cyclic film, evenly over all of its cycles: more than are solved one by one."""


def main() -> None:
    """Compile the kernels of all ordinary materials, effects and noise models, on all cores."""
    note("Compiling the solvers, which takes a minute or so.")
    with workers() as submit:
        materials = [submit(_material, name) for name in ordinary_materials()]
        for job in [*materials, submit(_effects), submit(_noises)]:
            job.result()


def _material(name: str, tell: Tell) -> None:
    """Films, their second solver, and whether they are convex."""
    claim, m = hypothesis(name), _read("elastosil_50um_op1")
    sample(m, claim, RunSettings(settings=FEW))
    x = np.array([[float(p.prior.quantile(0.5)) for p in claim.parameters]])
    found = Forward(claim, m, m.deflection)(x, sensitivities=True)
    for mode in MODES.values():
        mode.margin(found, claim.material)


def _effects(tell: Tell) -> None:
    """What effects bring, and the law of a film with effects."""
    whole = _read("synthetic_cyclic")
    m = whole.select(np.isin(np.arange(len(whole)), np.linspace(0, len(whole) - 1, READINGS).astype(int)))
    for name, effect in components("effects").items():
        if effect().unavailable(m.rig, m.path):
            continue
        claim = hypothesis("neo_hookean", [name])
        x = np.array([[float(p.prior.quantile(0.6)) for p in claim.parameters]])
        Forward(claim, m, m.deflection)(x, sensitivities=True, reached=False)


def _noises(tell: Tell) -> None:
    """What noise models bring."""
    op1 = replace(_read("elastosil_50um_op1"), covariance=None)
    for noise in components("noise"):
        sample(op1, hypothesis("neo_hookean", noise=noise), RunSettings(settings=FEW, predictions=False))


def _read(stem: str) -> Measurement:
    return read_measurement(shipped(f"{stem}.csv"), shipped(f"{stem}.toml"))


if __name__ == "__main__":
    main()

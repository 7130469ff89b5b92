"""`make study-growth`: how the CPU seconds of a calibration grow with the work it is given.

    python -m tests.studies.growth [--seeds 2] [--only readings walkers] [--table docs/studies/growth.md]

One thread, CPU seconds of the process, kernels compiled, nothing stored. One line of JSON a run, written at once; runs
that stand there are skipped. All measurements are simulated by this package from the hypothesis that is calibrated.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import bayesmembrane as bm
from bayesmembrane.calibration.hierarchy.population import population
from bayesmembrane.calibration.hierarchy.specimens import LN_MODULUS, Specimens
from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.joint.run import sample_jointly
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.benchmarks.in_use import metered
from tests.studies.growth_page import page
from tests.studies.results import Row, append, stored, until

SEED = 20261124
LIFT, NOISE = 35e-3, 2e-3  # m, N
MIDDLE, LN_GD = 0.5, 2.0  # truths are medians of the priors, but for the modulus
FEW, MANY = 10, 60  # readings where their number does not vary
EMCEE_STEPS, FORM_DRAWS = 100, 32
# Added one after another to a neo-Hookean film of stated noise; the last makes it fifteen parameters.
EFFECTS = (
    "zero_offset",
    "prestretch",
    "thickness",
    "clamp_bending",
    "off_centre_disc",
    "force_offset",
    "machine_compliance",
)
Case = tuple[str, int, int]


# ---- measurements ----------------------------------------------------------------------------------------------------


def there(count: int) -> Array:
    """Deflections of a first loading, m."""
    return np.linspace(LIFT / count, LIFT, count)


def there_and_back(count: int) -> Array:
    """Deflections of a cycle, m."""
    half = there(count // 2)
    return np.concatenate([half, half[-2::-1]])


def truth(posterior: Posterior) -> Array:
    """(1, k): what is simulated."""
    x = posterior.prior.transform(np.full((1, posterior.size), MIDDLE))
    x[0, 0] = LN_GD
    return np.asarray(x)


def simulated(claim: Hypothesis, deflection: Array, seed: int, stated: bool = False) -> Measurement:
    """A film as ``claim`` has it, with white noise."""
    rig, film = Annulus(10e-3, 35e-3), Specimen("simulated", 50e-6)
    sd = np.full(len(deflection), NOISE)
    blank = Measurement(deflection, np.ones(len(deflection)), rig, film, force_sd=sd)
    posterior = Posterior(claim, blank)
    curve = posterior.forward(truth(posterior)).force[0]
    force = curve + NOISE * np.random.default_rng(seed).standard_normal(len(curve))
    return Measurement(deflection, force, rig, film, force_sd=sd if stated else None)


# ---- what grows ------------------------------------------------------------------------------------------------------


def readings(count: int, seed: int) -> Row:
    """`sample` of a Gent film."""
    claim = bm.hypothesis("gent")
    return _sampled(simulated(claim, there(count), seed), claim, RunSettings(seed))


def readings_form(count: int, seed: int) -> Row:
    """The density alone, of draws around the truth, with a form error."""
    claim = bm.hypothesis("gent", noise="form")
    posterior = Posterior(claim, simulated(claim, there(count), seed))
    x = truth(posterior) + 0.01 * np.random.default_rng(seed).standard_normal((FORM_DRAWS, posterior.size))
    posterior.evaluate(x[:1])  # what is found once
    return _spent(lambda: posterior.evaluate(x), Posterior)


def walkers(count: int, seed: int) -> Row:
    """`sample` of a Gent film by two ensembles of so many walkers."""
    claim = bm.hypothesis("gent")
    return _sampled(simulated(claim, there(FEW), seed), claim, RunSettings(seed, settings=Settings(walkers=count)))


def walkers_emcee(count: int, seed: int) -> Row:
    """The same by emcee's ensembles, a hundred steps."""
    claim = bm.hypothesis("gent")
    how = Settings(walkers=count, sampler="emcee", chunk=EMCEE_STEPS, most_steps=EMCEE_STEPS)
    return _sampled(simulated(claim, there(FEW), seed), claim, RunSettings(seed, settings=how))


def of_size(count: int) -> Hypothesis:
    """A neo-Hookean film of stated noise, with effects until it has ``count`` parameters."""
    for n in range(len(EFFECTS) + 1):
        claim = hypothesis("neo_hookean", EFFECTS[:n], extra_noise=False)
        if len(claim.parameters) == count:
            return claim
    raise ValueError(f"no list of effects gives {count} parameters")


def parameters(count: int, seed: int) -> Row:
    """`sample` of one cycle of a film with effects."""
    claim = of_size(count)
    return _sampled(simulated(claim, there_and_back(MANY), seed, stated=True), claim, RunSettings(seed))


def specimens_joint(count: int, seed: int) -> Row:
    """`sample` of Gent films that share their energy; the noise of each is stated."""
    claim = hypothesis("gent", extra_noise=False)
    tests = {f"film-{i}": simulated(claim, there(FEW), seed + 1000 * i, stated=True) for i in range(count)}
    return _spent(lambda: sample_jointly(joint(tests, claim), RunSettings(seed)).status, JointPosterior)


def specimens_population(count: int, seed: int) -> Row:
    """`population` of so many specimens and two coordinates, each known to a tenth of the scatter."""
    rng, q = np.random.default_rng(seed), 2
    values = rng.normal(0.0, 0.2, (count, q))
    covariances = np.tile(0.02**2 * np.eye(q), (count, 1, 1))
    labels = tuple(f"film-{i}" for i in range(count))
    s = Specimens(labels, (LN_MODULUS, "ln_jm"), values, covariances, np.zeros(q), np.ones(q))
    return _spent(lambda: population(s, seed), Posterior)


def _sampled(m: Measurement, claim: Hypothesis, how: RunSettings) -> Row:
    return _spent(lambda: sample(m, claim, how).status, Posterior)


def _spent(work: Callable[[], Any], owner: type) -> Row:
    """CPU seconds of ``work``, of them the density's, and for how many draws it was asked."""
    begun = time.process_time()
    with metered(owner, "evaluate") as density:
        found = work()
    row: Row = {"seconds": time.process_time() - begun, "density": density.seconds, "evaluations": density.films}
    if isinstance(found, dict):
        row |= {k: found.get(k) for k in ("status", "sampler", "ess_bulk", "steps")}
    return row


AXES: dict[str, tuple[Callable[[int, int], Row], tuple[int, ...]]] = {
    "readings": (readings, (15, 60, 250, 1000, 4500, 20000)),
    "readings, a draw with form error": (readings_form, (15, 60, 250, 1000, 4500, 20000)),
    "walkers": (walkers, (32, 64, 128, 256, 512, 1024)),
    "walkers, a hundred steps of emcee": (walkers_emcee, (32, 64, 128, 256, 512, 1024)),
    "parameters": (parameters, (1, 2, 3, 4, 6, 10, 15)),
    "specimens, joint": (specimens_joint, (1, 3, 10, 30, 100)),
    "specimens, population": (specimens_population, (3, 10, 30, 100)),
}


def key(case: Case) -> str:
    return "|".join(map(str, case))


def plan(axes: Sequence[str], seeds: int) -> list[Case]:
    """All of one seed before the next."""
    return [(axis, size, SEED + i) for i in range(seeds) for axis in axes for size in AXES[axis][1]]


def measured(case: Case) -> Row:
    axis, size, seed = case
    return {"key": key(case), "axis": axis, "size": size, "seed": seed, **AXES[axis][0](size, seed)}


def warmed() -> None:
    """Compile, and import what is imported on demand."""
    readings(15, 0)
    readings_form(15, 0)
    walkers_emcee(32, 0)
    parameters(6, 0)
    specimens_joint(2, 0)
    specimens_population(3, 0)


def main() -> None:
    """What is not stored yet is run; then the page is written."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[""], help="how the names of what varies begin")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin nothing after this time")
    parser.add_argument("--results", type=Path, default=Path("chains/growth.jsonl"), help="JSON lines, one a run")
    parser.add_argument("--table", type=Path, help="Markdown")
    options = parser.parse_args()
    axes = [a for a in AXES if a.startswith(tuple(options.only))]
    done = stored(options.results)
    todo = [c for c in plan(axes, options.seeds) if key(c) not in done]
    append(until(options.seconds, todo, measured, 1, warmed), options.results, told)
    if options.table is not None:
        options.table.write_text(page(list(stored(options.results).values()), list(AXES)), encoding="utf-8")


def told(r: Row) -> str:
    return (
        f"{r['key']}: {r['seconds']:.3f} s, density {r['density']:.3f} s of {r['evaluations']} {r.get('sampler', '')}"
    )


if __name__ == "__main__":
    main()

"""What came out of a walk: the draws and all that is derived from them, laid out in groups and as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesmembrane.calibration.checks import alike, asked
from bayesmembrane.calibration.crosscheck import crosscheck
from bayesmembrane.calibration.goodness import dominates, goodness
from bayesmembrane.calibration.layout import Groups, laid_out
from bayesmembrane.calibration.posterior import FAILURES, Evaluation, Posterior
from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.quality import NOTEWORTHY
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.growing import picked
from bayesmembrane.calibration.sampling.leaps import offers
from bayesmembrane.calibration.sampling.proposals.collapsed import collapsed
from bayesmembrane.calibration.sampling.walk import Sampled
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.draws import shortest_interval
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis

MOST_DRAWS, LONG, DRAWS_IF_LONG, FORCES_IF_LONG, LEAST_DRAWS = 4000, 100, 1000, 4_000_000, 400
PRIOR_DRAWS = 500
WALK_STEPS = 500


def outcome(posterior: Posterior, sampled: Sampled, wanted: float, seed: int) -> tuple[Groups, dict[str, Any]]:
    """(groups, status) of a walk that was to be worth ``wanted`` draws; all of it follows from the chains.

    What is replicated is another test of the same film on the same rig: new noise, and the same form error, as far as
    the data tell it. ``curve`` is the force without that noise, form error included.
    """
    hypothesis, measurement = posterior.hypothesis, posterior.measurement
    x, lp = sampled.draws(_count(len(measurement)))
    flat = x.reshape(-1, x.shape[-1])
    evaluation = _evaluated(posterior, flat)
    rng = np.random.default_rng([seed, 1])
    residual, theta = measurement.force - evaluation.force, hypothesis.noise_coordinates(flat)
    noise = posterior.noise.at(evaluation.force, evaluation.traces)
    curve = evaluation.force + noise.recurring(residual, theta, rng)
    again = curve + noise.fresh(theta, rng)
    masses, prior = posterior.prior.survey(measurement, seed, solve=posterior.solve)
    prior = prior[:PRIOR_DRAWS]
    shape = x.shape[:2]

    def folded(values: Array) -> Array:
        return values.reshape(*shape, *values.shape[1:]).astype(np.float32)

    data = laid_out(
        measurement,
        _walked(sampled.chains),
        posterior=_named(hypothesis, measurement, flat, shape),
        prior=_named(hypothesis, measurement, prior, (1, len(prior))) if len(prior) else None,
        log_likelihood={"force": folded(noise.pointwise(residual, theta))},
        posterior_predictive={"force": folded(again), "curve": folded(curve)},
        sample_stats={"lp": lp, "log_prior": evaluation.log_prior.reshape(shape)},
    )
    best = int(np.argmax(lp))
    square = noise.stated(residual, theta)
    few = asked(*residual.shape)
    seen = posterior.noise.at(evaluation.force[few], None if evaluation.traces is None else evaluation.traces[few])
    status = {
        **_answer(hypothesis, data, sampled, wanted),
        "importance": _importance(sampled.chains, masses[hypothesis.convexity.name]),
        "prior_mass": {mode: {"value": m.value, "sd": m.sd} for mode, m in masses.items()},
        **_judgement(posterior, data, evaluation.force[best], None if square is None else float(square[best])),
        "checks": {
            "alike": alike(hypothesis.noise, seen, residual[few], theta[few], hypothesis.curve_size, rng).summary(),
        },
        "crosscheck": crosscheck(posterior.forward, flat, seed).summary(),
        "best": _best(hypothesis, measurement, flat[best]),
    }
    return data, status


def _evaluated(posterior: Posterior, x: Array) -> Evaluation:
    """As `Posterior.evaluate` of draws x (B, k), many of them the same since chains stand: each is solved once.

    Where chains were walked by shapes, what was proposed is known.
    """
    distinct, back = np.unique(x, axis=0, return_inverse=True)
    shape = collapsed(posterior)
    found, back = posterior.evaluate(distinct) if shape is None else shape.at(distinct), back.ravel()
    traces = None if found.traces is None else found.traces[back]
    return Evaluation(found.log_prior[back], found.log_likelihood[back], found.outcome[back], found.force[back], traces)


def _count(readings: int) -> int:
    """Draws whose curves are kept, fewer of longer curves."""
    if readings <= LONG:
        return MOST_DRAWS
    return max(LEAST_DRAWS, min(DRAWS_IF_LONG, FORCES_IF_LONG // readings))


def _walked(chains: Chains) -> dict[str, Array]:
    """Means over the walkers of each ensemble at `WALK_STEPS` steps at most, burn-in included."""
    at = np.unique(np.linspace(0, chains.steps - 1, WALK_STEPS).round().astype(int))
    return {"ensemble_mean": picked(chains.x, at).mean(axis=2), "ensemble_step": at.astype(float)}


def _named(hypothesis: Hypothesis, measurement: Measurement, x: Array, shape: tuple[int, ...]) -> dict[str, Array]:
    """Coordinates and natural parameters by full name, each of ``shape``, of draws x (B, k)."""
    natural = hypothesis.natural(x, measurement)
    values = {n: natural[:, i] for i, n in enumerate(hypothesis.natural_names)}
    values |= {n: x[:, i] for i, n in enumerate(hypothesis.names)}
    return {n: v.reshape(shape) for n, v in values.items()}


def _short(hypothesis: Hypothesis, name: str) -> str:
    """The name in JSON answers: the material's parameters without their component."""
    return name.removeprefix(f"{hypothesis.material.name}.")


def _answer(hypothesis: Hypothesis, data: Groups, sampled: Sampled, wanted: float) -> dict[str, Any]:
    values = {_short(hypothesis, name): data.posterior[name].values.ravel() for name in hypothesis.natural_names}
    return walk_answer(sampled, hypothesis.names, wanted) | {
        "posterior": {name: marginal(v) for name, v in values.items()},
        "failures": _failures(hypothesis, sampled.chains),
    }


def marginal(values: Array) -> dict[str, Any]:
    """Mean, standard deviation and 94 % interval of draws (S,) of one parameter."""
    return {
        "mean": float(np.mean(values)),
        "sd": float(np.std(values)),
        "hdi_94": list(shortest_interval(values, 0.94)),
    }


def walk_answer(sampled: Sampled, names: Sequence[str], wanted: float) -> dict[str, Any]:
    """How a walk in the coordinates ``names`` went that was to be worth ``wanted`` draws, as JSON answers tell it."""
    c = sampled.convergence
    return {
        "status": sampled.status,
        "sampler": sampler_of(sampled.chains),
        "ess_bulk": float(np.min(c.ess)),
        "ess_wanted": wanted,
        "r_hat": float(np.max(c.r_hat)),
        "tau": {n: float(t) for n, t in zip(names, c.tau, strict=True)},
        "acceptance": c.acceptance,
        "steps": sampled.chains.steps,
        "burn": c.burn,
        "walkers": int(sampled.chains.x.shape[2]),
        "evaluations": sampled.chains.evaluations,
        "seconds": sampled.chains.seconds,
        "tally": dict(sampled.chains.counts),
    }


def sampler_of(chains: Chains) -> str:
    """What made the draws."""
    return "emcee" if chains.mixture is None else "mixture"


def _importance(chains: Chains, mass: Mass) -> dict[str, float] | None:
    """What the weights of all proposals say where they came from one mixture: a third estimate of ln Z."""
    if chains.mixture is None:
        return None
    found = offers(chains)
    log_evidence, sd = mass.divides(found.log_mean, found.log_mean_sd)
    return {
        "k_hat": found.k_hat,
        "efficiency": found.efficiency,
        "log_integral": found.log_mean,
        "log_integral_sd": found.log_mean_sd,
        "log_evidence": log_evidence,
        "log_evidence_sd": sd,
    }


def _failures(hypothesis: Hypothesis, chains: Chains) -> dict[str, Any]:
    """What part of all draws could not be solved, whether that is worth a word, and an example of every outcome."""
    failed = sum(chains.counts.get(o.label, 0) for o in FAILURES)
    examples = getattr(chains.counts, "examples", {})
    return {
        "share": failed / max(1, chains.evaluations),
        "noteworthy": failed > NOTEWORTHY * chains.evaluations,
        "examples": {o: dict(zip(hypothesis.names, x, strict=True)) for o, x in examples.items()},
    }


def _judgement(posterior: Posterior, data: Groups, best: Array, square: float | None) -> dict[str, Any]:
    """Goodness of the best draw's curve, by the measurement's own noise, and what the inferred noise says."""
    found = goodness(posterior.measurement, best, posterior.hypothesis.curve_size, square)
    sd = data.posterior["noise.sd"].values.ravel() if "noise.sd" in data.posterior else np.empty(0)
    return {
        "goodness": found.summary(),
        "extra_noise_dominates": sd.size > 0 and dominates(found.own_noise_N, sd),
    }


def _best(hypothesis: Hypothesis, measurement: Measurement, x: Array) -> dict[str, float]:
    """Natural parameters of the draw with the largest posterior density."""
    values = hypothesis.natural(x, measurement)[0]
    return {_short(hypothesis, n): float(v) for n, v in zip(hypothesis.natural_names, values, strict=True)}

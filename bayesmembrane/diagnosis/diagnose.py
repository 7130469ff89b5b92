"""What a curve says of the model it was given: adequate, or what is missing, or that this cannot be told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import enough_points
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import thinned, thinning_sentence
from bayesmembrane.diagnosis.candidates import Candidate, Search, absorbed, available
from bayesmembrane.diagnosis.description import describe
from bayesmembrane.diagnosis.detection import Detection, detect
from bayesmembrane.diagnosis.heldout import Error, HeldOut, error_of, held_out, validate
from bayesmembrane.diagnosis.saturated import reference_basis
from bayesmembrane.diagnosis.scores import Signature, angle, signatures, smallest_sizes
from bayesmembrane.diagnosis.separation import Experiment, experiments
from bayesmembrane.diagnosis.sudden import sudden
from bayesmembrane.diagnosis.trace import EARNED_SHARE, LEVEL, Judged, Tell, Tracer
from bayesmembrane.diagnosis.verdict import Verdict, explained, visible
from bayesmembrane.diagnosis.whitening import OwnNoise, own_noise
from bayesmembrane.diagnosis.wording import energy_sentence, form_sentence, noise_sentence, sentence_of
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api

VERDICTS = ("adequate", "named", "ambiguous", "material", "unknown")
NEAR = 20.0  # degrees between signatures below which a protocol cannot separate two effects
BETTER = 1.0  # ln of the Bayes factor by which another optimum of the plain model counts as better
SPARE = 3  # points beyond the parameters, at least


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The answer.

    Attributes
    ----------
    verdict : one of `VERDICTS`
    effects : names; of a pair both, of an ambiguous answer all in the set
    material : the better energy if that is the verdict, else ""
    sentence : what an engineer should read
    detection : tests of the model as given
    null, best : the model as given, and the most probable one
    ranking : every candidate that was refitted, the most probable first
    members : the candidates that the verdict rests on
    confounded : (effect, effect, degrees) that this protocol cannot separate
    noise : the measurement's own
    power : by effect, the smallest |size| that this measurement would have shown, SI
    absorbed : sentences on what the material absorbs without trace
    before, after : errors in sample
    validation : errors on points that were set aside, or None
    experiments : what to measure next where rivals are left
    thinning : what is said of readings that were left out, since there were too many; else ""
    """

    verdict: str
    effects: tuple[str, ...]
    material: str
    sentence: str
    detection: Detection
    null: Candidate
    best: Candidate
    ranking: tuple[Judged, ...]
    members: tuple[Judged, ...]
    confounded: tuple[tuple[str, str, float], ...]
    noise: OwnNoise
    power: Mapping[str, float]
    absorbed: tuple[str, ...]
    before: Error
    after: Error
    validation: HeldOut | None
    experiments: tuple[Experiment, ...]
    thinning: str = ""

    @property
    def hypothesis(self) -> Hypothesis:
        """The model that the verdict asks for; the given one where nothing can be named."""
        return self.best.hypothesis if self.verdict in ("named", "material") else self.null.hypothesis

    def summary(self) -> dict[str, Any]:
        """Plain values for the JSON answer of ``diagnose``."""
        reference = self.null.log_evidence
        thinning = {"thinning": self.thinning} if self.thinning else {}
        return thinning | {
            "verdict": self.verdict,
            "effects": list(self.effects),
            "material": self.material,
            "sentence": self.sentence,
            "p_value": self.detection.p_value,
            "tests": {
                "lack_of_fit": {
                    "ratio": self.detection.lack_of_fit.ratio,
                    "p_value": self.detection.lack_of_fit.p_value,
                },
                "score": asdict(self.detection.score),
                "periodicity": None if self.detection.periodicity is None else asdict(self.detection.periodicity),
            },
            "ranking": [
                {
                    "effect": "+".join(j.candidate.names) or j.candidate.hypothesis.material.name,
                    "material": j.candidate.hypothesis.material.name,
                    "log_bayes_factor": j.log_evidence - reference,
                    "parameters": j.candidate.parameters,
                    "unexplained": j.unexplained,
                    "explains": j.explains,
                    "at_bound": list(j.candidate.at_bound),
                }
                for j in self.ranking
            ],
            "confounded": [{"effects": [a, b], "degrees": round(v, 2)} for a, b, v in self.confounded],
            "error": {
                "before": asdict(self.before),
                "after": asdict(self.after),
                "heldout_before": None if self.validation is None else asdict(self.validation.before),
                "heldout_after": None if self.validation is None else asdict(self.validation.after),
                "heldout": "nothing" if self.validation is None else self.validation.where,
                "chosen_without_heldout": None if self.validation is None else self.validation.chosen,
                "heldout_coverage_90_before": None if self.validation is None else self.validation.covered_before,
                "heldout_coverage_90_after": None if self.validation is None else self.validation.covered_after,
            },
            "noise": {
                "sd_N": self.noise.sd,
                "rho": self.noise.rho,
                "stated": self.noise.stated,
                "times_stated": self.noise.excess,
            },
            "smallest_visible": dict(self.power),
            "absorbed": list(self.absorbed),
            "next_measurements": [
                {"what": e.what, "separation": None if np.isinf(e.separation) else e.separation, "sentence": e.sentence}
                for e in self.experiments
            ],
        }


def diagnose(
    measurement: Measurement,
    hypothesis: Hypothesis,
    *,
    seed: int = 0,
    solve: Solve = api.solve,
    tell: Tell | None = None,
) -> Diagnosis:
    """Whether ``hypothesis`` leaves structure in the residual, and which effect, pair or other energy explains it.

    A measurement of more readings than `thinning.MOST` is thinned, and so is what the answer holds by reading. Raises
    `SettingsError` if there are too few points to tell a misfit from noise, or no film reaches the data.
    """
    say: Tell = tell or (lambda _: None)
    whole, measurement = measurement, thinned(measurement)
    _enough(measurement, hypothesis)
    rng = np.random.default_rng([seed, 7])
    basis = reference_basis(measurement)
    search, null = _null(measurement, hypothesis, basis, seed, solve, say)
    effects = available(measurement, hypothesis)
    found = signatures(measurement, null, effects, search.noise, solve)
    say("testing the residual")
    detection = detect(measurement, null, basis, found, search.noise, rng)
    tracer = Tracer(search, basis, null)
    everything: list[Judged] = [tracer.judged(null)]
    verdict = Verdict("adequate", (everything[0],))
    if not detection.adequate:
        form = _form_left(tracer)
        verdict = replace(verdict, form=form)
        if form is None:
            singles = tracer.singles(visible(effects, found), say)
            if (better := _better_null(tracer.search, null, singles)) is not None:
                tracer = replace(tracer, null=better)
                found = signatures(measurement, better, effects, search.noise, solve)
                detection = detect(measurement, better, basis, found, search.noise, rng)
                everything = [tracer.judged(better)]
                verdict = Verdict("adequate", (everything[0],))
            if not detection.adequate:
                tracer, verdict, everything = explained(tracer, effects, singles, found, rng, say)
    told = _told(tracer, detection, verdict, everything, found, seed, say)
    thinning = thinning_sentence(whole, measurement)
    return replace(told, thinning=thinning, sentence=f"{told.sentence} {thinning}".rstrip())


def _better_null(search: Search, null: Candidate, singles: Sequence[Judged]) -> Candidate | None:
    """The plain model from where effects have led its material, if that is a better fit than the first search found.

    Else effects of no size would seem to explain the curve.
    """
    starts = [j.candidate.x[: null.x.size] for j in singles]
    found = search.fit(null.hypothesis, [null.x, *starts]) if starts else None
    return found if found is not None and found.log_evidence > null.log_evidence + BETTER else None


def _form_left(tracer: Tracer) -> float | None:
    """Part of the plain material's misfit that the given effects leave, if a machine that differs a little from the
    textbook leaves as much; else, or without effects, None.

    What a form leaves is no further effect: another one that takes it predicts worse.
    """
    given = tracer.null
    plain = replace(given.hypothesis, effects=())
    if not given.names or (alone := tracer.search.fit(plain, tracer.search.sane(plain))) is None:
        return None
    judged = replace(tracer, null=alone).judged(given)
    little = judged.explains and (judged.p_value > LEVEL or judged.unexplained <= EARNED_SHARE)
    return judged.unexplained if little else None


def _enough(measurement: Measurement, hypothesis: Hypothesis) -> None:
    enough_points(hypothesis, measurement)
    least = hypothesis.curve_size + SPARE
    if len(measurement) < least:
        raise SettingsError(
            f"{len(measurement)} points leave too little to tell what {hypothesis.label()} misses",
            remedy=f"use at least {least} points, or a material with fewer parameters",
        )


def _null(
    measurement: Measurement, hypothesis: Hypothesis, basis: Array, seed: int, solve: Solve, say: Tell
) -> tuple[Search, Candidate]:
    """The model as given, fitted; first with the reference's noise, then with one that knows the model's slopes."""
    say(f"fitting {hypothesis.label()}")
    search = Search(measurement, own_noise(measurement, basis), seed, solve)
    null = search.fit(hypothesis, search.sane(hypothesis))
    if null is None:
        raise SettingsError(
            f"no {hypothesis.label()} film reaches the data", remedy="use a shorter range or another material"
        )
    search = replace(search, noise=own_noise(measurement, np.column_stack([basis, null.slopes])))
    return search, search.fit(hypothesis, [null.x]) or null


# ---- what is said of it ----------------------------------------------------------------------------------------------


def _told(
    tracer: Tracer,
    detection: Detection,
    verdict: Verdict,
    everything: Sequence[Judged],
    found: Sequence[Signature],
    seed: int,
    say: Tell,
) -> Diagnosis:
    measurement, search, null = tracer.measurement, tracer.search, tracer.null
    known = verdict.verdict in ("named", "ambiguous", "material")
    best = verdict.members[0].candidate if known else null
    effects = tuple(dict.fromkeys(n for j in verdict.members for n in j.candidate.names)) if known else ()
    material = best.hypothesis.material.name if verdict.verdict == "material" else ""
    say("checking on points that were set aside")
    mask, where = held_out(measurement)
    rivals = [j.candidate for j in everything[:3]] if known else []
    validation = validate(search, mask, where, null, best, rivals)
    members = [j.candidate for j in verdict.members]
    several = verdict.verdict == "ambiguous" and len(members) > 1
    nexts = experiments(measurement, members, search.noise.sd, search.solve) if several else []
    sd = search.noise.each
    power = smallest_sizes(found, detection.score.critical)
    shown = measurement.rig.shown(measurement.specimen.thickness)
    moment = _moment(tracer, verdict, everything)
    shape = f"{describe(measurement, null.residual, detection.periodicity)} {moment}".rstrip()
    lost = tuple(e.absorbed for e in absorbed(measurement, null.hypothesis))
    before = error_of(null.residual, sd, null.x.size)
    after = error_of(best.residual, sd, best.x.size)
    partial = next((j for j in everything if j.candidate.names != null.names), None)
    sentence = sentence_of(
        verdict.verdict, members, null, detection, before, after, shape, power, nexts, partial, shown, moment
    )
    if verdict.form is not None:
        sentence = form_sentence(null, verdict.form, detection)
    if verdict.better is not None:
        sentence += energy_sentence(verdict.better, verdict.members[0])
    return Diagnosis(
        verdict=verdict.verdict,
        effects=effects,
        material=material,
        sentence=sentence + noise_sentence(search.noise),
        detection=detection,
        null=null,
        best=best,
        ranking=tuple(everything),
        members=verdict.members,
        confounded=_confounded(found),
        noise=search.noise,
        power=power,
        absorbed=lost,
        before=before,
        after=after,
        validation=validation,
        experiments=tuple(nexts),
    )


def _moment(tracer: Tracer, verdict: Verdict, everything: Sequence[Judged]) -> str:
    """A sentence on the sudden change that explains the curve, or that comes nearest where nothing does; "" if none."""
    m, step = tracer.measurement, verdict.step
    if step is None and verdict.verdict == "unknown":
        nearest = sudden(tracer.search, tracer.null)
        step = nearest if nearest is not None and nearest.gain > everything[0].gain else None
    return "" if step is None else step.sentence(m.time, m.rig.shown(m.specimen.thickness))


def _confounded(found: Sequence[Signature]) -> tuple[tuple[str, str, float], ...]:
    """Pairs of effects whose signatures come nearer than `NEAR` degrees for some shapes."""
    nearest: dict[tuple[str, str], float] = {}
    for a, b in combinations(found, 2):
        if a.effect.name == b.effect.name:
            continue
        one, two = sorted((a.effect.name, b.effect.name))
        fold = not (a.one_sided and b.one_sided)
        sign = (a.one_sided or 1) * (b.one_sided or 1)
        degrees = angle(a.direction, sign * b.direction, fold)
        nearest[one, two] = min(nearest.get((one, two), 90.0), degrees)
    return tuple((a, b, v) for (a, b), v in sorted(nearest.items(), key=lambda i: i[1]) if v < NEAR)

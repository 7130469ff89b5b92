"""What is said of several tests of one material, and the JSON answers of ``sample`` and ``fit`` on them."""

from __future__ import annotations

from typing import Any

from bayesmembrane.calibration.joint.claim import Joint
from bayesmembrane.calibration.joint.fit import JointFit
from bayesmembrane.calibration.joint.run import JointRun
from bayesmembrane.words.hypothesis import material_title
from bayesmembrane.words.language import listed, three_digits
from bayesmembrane.words.sampling import (
    convergence_sentence,
    convexity_sentence,
    failure_sentence,
    noise_sentence,
    smooth_sentence,
)
from bayesmembrane.words.seen import seen
from bayesmembrane.words.units import read_as_by_test


def document(run: JointRun) -> dict[str, Any]:
    """The JSON answer: what was stored, and what a reader must know before trusting it."""
    return {**run.summary(), "read_as": _read_as(run.joint), "sentences": list(sentences(run))}


def document_of_fit(found: JointFit) -> dict[str, Any]:
    """The JSON answer of ``fit`` on several tests."""
    return {**found.summary(), "read_as": _read_as(found.joint)}


def _read_as(joint: Joint) -> dict[str, dict[str, dict[str, float | str]]]:
    return read_as_by_test((part.label, part.measurement) for part in joint.parts)


def sentences(run: JointRun) -> tuple[str, ...]:
    """What a reader must know before trusting the numbers: of the walk once, and of each test; none if all is well."""
    said = [told for told in dict.fromkeys(convergence_sentence(p.quality) for p in run.parts) if told][:1]
    if failed := failure_sentence(run.parts[0].quality):
        said.append(failed)
    if pressed := convexity_sentence(run.status.get("checks", {}).get("ruled_out")):
        said.append(pressed)
    for label, part, test in zip(run.joint.labels, run.parts, run.joint.parts, strict=True):
        shown = test.measurement.rig.shown(test.measurement.specimen.thickness)
        each = noise_sentence(part.quality, shown), smooth_sentence(part.quality)
        said += [f"{label}: {told}" for told in each if told]
    return tuple(said)


def answer(run: JointRun) -> str:
    """What all tests together say of the film's stiffness."""
    gd = run.joint.material.shear_modulus(run.joint.films(run.draws()).T)
    modulus = gd / run.joint.thickness * 1e-6
    return (
        f"{material_title(run.joint.material.name)} on {listed(run.joint.labels)} together: the shear modulus is "
        f"{three_digits(float(modulus.mean()))} +- {three_digits(float(modulus.std()))} MPa."
    )


def fit_sentence(found: JointFit) -> str:
    """How well one energy fits all tests."""
    both = zip(found.parts, found.joint.parts, strict=True)
    tests = [f"{fitted.label} {seen(part.measurement).error(fitted.rmse_N)}" for fitted, part in both]
    return (
        f"{material_title(found.joint.material.name)} on {listed(found.joint.labels)} together leaves root mean square "
        f"residuals of {listed(tests)}."
    )

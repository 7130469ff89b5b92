"""What is said of a sampled run, and the JSON answer of ``sample``."""

from __future__ import annotations

from typing import Any

from bayesmembrane.calibration.quality import RULED_OUT, Quality
from bayesmembrane.calibration.run import Run
from bayesmembrane.calibration.sampling.convergence import LEAST_TAUS
from bayesmembrane.words.elastomer import stiffness_sentence
from bayesmembrane.words.moved import modulus_of
from bayesmembrane.words.units import SCALES, Units, read_as, size_in_words


def document(run: Run) -> dict[str, Any]:
    """The JSON answer of ``sample``: what was stored, and what a reader must know before trusting it."""
    shown = run.measurement.rig.shown(run.measurement.specimen.thickness)
    said = [*sentences(run.quality, shown), stiffness_sentence(1e6 * modulus_of(run)[0])]
    return {**run.summary(), "read_as": read_as(shown), "sentences": [s for s in said if s]}


def sentences(quality: Quality, shown: Units = SCALES) -> tuple[str, ...]:
    """What a reader must know before trusting the numbers, in the units of the rig; none if all is well."""
    said = (
        convergence_sentence(quality),
        failure_sentence(quality),
        convexity_sentence(quality.ruled_out),
        noise_sentence(quality, shown),
        smooth_sentence(quality),
    )
    return tuple(sentence for sentence in said if sentence)


def convergence_sentence(quality: Quality) -> str:
    """What the draws lack of what was wanted, and why the walk ended; "" if nothing."""
    if quality.converged:
        return ""
    why = "the run was interrupted" if quality.ended == "interrupted" else f"the limit of {quality.steps} steps"
    return (
        f"Not converged ({why}): ESS {quality.ess:.0f} of {quality.wanted:.0f} wanted, {quality.lengths:.0f} of "
        f"{LEAST_TAUS} autocorrelation times walked, R-hat {quality.r_hat:.3f}."
    )


def failure_sentence(quality: Quality) -> str:
    """What numerical failures may do to the posterior; "" if they are few."""
    if not quality.noteworthy_failures:
        return ""
    share = 100 * quality.failed / quality.evaluated
    return (
        f"{quality.failed} of {quality.evaluated} draws ({share:.2g} %) could not be solved to 1e-6 after every "
        "refinement and count as impossible; if they lie near the posterior, it is narrower than it should be."
    )


def convexity_sentence(gain: float | None) -> str:
    """That the convexity prior decides, and not the data; "" if a film beyond it would gain little.

    ``gain`` : in ln of the posterior density, of a film that it rules out over the best draw; None if nobody looked.
    """
    if gain is None or gain <= RULED_OUT:
        return ""
    return (
        "The convexity prior decides, and not the data: films that it rules out fit better (by at least "
        f"{gain:.3g} in ln of the posterior density), so that the draws lie at its edge, and the misfit counts as "
        "noise. Another energy may follow the data; --convexity none lifts the prior."
    )


def noise_sentence(quality: Quality, shown: Units = SCALES) -> str:
    """What an engineer should read when the inferred noise exceeds the stated one; "" if it does not."""
    if quality.own_noise is None or quality.extra_noise is None:
        return ""
    inferred, stated = (size_in_words(v, "N", shown) for v in (quality.extra_noise, quality.own_noise))
    return (
        f"The inferred extra noise ({inferred}) exceeds what the measurement states ({stated}): the model misses "
        "something, and its misfit is counted as noise."
    )


def smooth_sentence(quality: Quality) -> str:
    """That the misfit is smooth along the path, and what would allow for it; "" if it is not."""
    if not quality.smooth:
        return ""
    remedy = ", nor does a form error" if quality.noise == "form" else "; a form error would allow for it: --noise form"
    return (
        f"The misfit is smooth: neighbouring residuals are alike (correlation {quality.alike:.2f}, "
        f"p = {quality.alike_p:.2g}), which this noise does not explain{remedy}."
    )

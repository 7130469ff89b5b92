"""What a comparison says, in words, and the JSON answer of ``compare``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesmembrane.comparison.convexity_modes import WITHIN, ByMode, Missing
from bayesmembrane.comparison.evidence.estimate import WIDEST, Disagreement, Evidence
from bayesmembrane.comparison.prior_widths import Unknown, Widened
from bayesmembrane.comparison.result import Comparison, Row
from bayesmembrane.ground.registry import components
from bayesmembrane.words import noises
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import percent, spoken_parameter
from bayesmembrane.words.noises import best_noise
from bayesmembrane.words.sampling import sentences as quality_sentences

SEEN = 0.05  # of ln Z, below which a change is not named
DECIDED = 2.0  # standard errors of a difference, below which it is none


def document(found: Comparison) -> dict[str, Any]:
    """The JSON answer of ``compare`` on one range."""
    answer = found.summary()
    return {
        **answer,
        "table": [_row(row, r) for row, r in zip(answer["table"], found.rows, strict=True)],
        "reason": no_ranking(found),
        "sentence": preferred(best_noise(found)),
        "prior_sensitivity": survival(best_noise(found)),
        "out_of_reach": left_out(found),
        "beyond_the_range": beyond_range(found),
        "covered": covered(found),
        **noises.document(found),
    }


def document_of_ranges(found: Mapping[str, Comparison]) -> dict[str, Any]:
    """The JSON answer of ``compare``: that on the last range, and each range by its name."""
    answers = {name: document(comparison) for name, comparison in found.items()}
    return {**list(answers.values())[-1], "ranges": [{"range": n, **a} for n, a in answers.items()]}


def _row(answer: Mapping[str, Any], row: Row) -> dict[str, Any]:
    widths = zip(answer["prior_widths"], row.widths, strict=True)
    modes = zip(answer["convexity_modes"], row.modes, strict=True)
    return {
        **answer,
        "prior_widths": [{**values, "reason": unknown_width(w)} for values, w in widths],
        "convexity_modes": [{**values, "reason": missing_mode(m)} for values, m in modes],
        "notes": list(quality_sentences(row.quality)) if row.quality else [],
        "reason": remark(row),
    }


def sentences(found: Comparison) -> list[str]:
    """All that is to be said of one range: why there is no ranking, what is preferred, whether that survives.

    Then what the convexity prior asks beyond the range fitted, and what the search for modes has covered. Judged under
    several noise models, what is preferred and whether it survives is said of the most probable one.
    """
    best = best_noise(found)
    told = (no_ranking(found), preferred(best), left_out(found), survival(best), beyond_range(found), covered(found))
    return [s for s in (*told, noises.of_noise(found)) if s]


def called(row: Row) -> str:
    """The hypothesis in words; with noise model and convexity prior where its label has them to tell it apart."""
    own = row.hypothesis.label()
    return spoken(row.hypothesis) + row.label.removeprefix(own) if row.label.startswith(own) else row.label


# ---- why there is no number ------------------------------------------------------------------------------------------


def remark(row: Row) -> str:
    """Why a hypothesis has no evidence, or one in doubt; "" if all is well."""
    return row.failure or (doubt(row.evidence) if row.evidence else "")


def doubt(evidence: Evidence) -> str:
    """Why ln Z is not known well enough; "" if it is."""
    match evidence.disagreement:
        case Disagreement.NOT_FINITE:
            return "One of the two estimates of ln Z is not a finite number."
        case Disagreement.MISSED:
            return (
                "A search from points that fill the prior has found a mode that the draws have missed: with it ln Z is "
                f"larger by {evidence.missed:.1f} at least. Sample again with another seed."
            )
        case Disagreement.WIDE:
            return f"The joint standard error of ln Z, {evidence.total_sd:.2f}, is above {WIDEST:g}."
        case Disagreement.APART:
            return (
                f"Nested sampling and bridge sampling differ by {evidence.difference:.2f} in ln Z, which is "
                f"{evidence.difference / evidence.joint_sd:.1f} joint standard errors."
            )
    return ""


def unknown_width(widened: Widened) -> str:
    """Why the draws do not tell what another width of a prior would do; "" if they do."""
    start = f"Reweighted to {widened.factor:g} times the width,"
    match widened.unknown:
        case Unknown.NOT_COVERED:
            name = widened.parameter
            return f"Draws under the prior of {name} say nothing of one that allows more: sample again with it."
        case Unknown.FEW:
            return f"{start} the draws are worth only {widened.ess:.0f}: sample again with it."
        case Unknown.HEAVY:
            index = f"tail index {widened.tail_index:.2f}"
            return f"{start} a few draws far out count most ({index}): sample again with it."
    return ""


def missing_mode(by_mode: ByMode) -> str:
    """Why there is no evidence under a convexity mode; "" if there is."""
    match by_mode.missing:
        case Missing.PRIOR:
            return f"Too few films of the prior meet it: its mass is {by_mode.mass:.2g} +- {by_mode.mass_sd:.2g}."
        case Missing.DRAWS:
            return f"The weights of this mode rest on only {by_mode.ess:.0f} draws."
        case Missing.NONE:
            return "None of the films that come near the data meets it."
    return ""


def no_ranking(found: Comparison) -> str:
    """Why there is no ranking; "" if there is one."""
    if not found.fitted:
        return "None of the hypotheses could be fitted."
    doubtful = found.doubtful
    if not doubtful:
        return ""
    told = " ".join(f"{called(r)}: {doubt(r.evidence)}" for r in doubtful if r.evidence)
    return f"There is no ranking, because ln Z is not known well enough of {len(doubtful)} of them. {told}"


def left_out(found: Comparison) -> str:
    """Which hypotheses have no place although there is a ranking; "" if all have one."""
    unsure = [r for r in found.fitted if r.evidence is not None and not r.evidence.agreed]
    if not found.agreed or not unsure:
        return ""
    told = " ".join(f"{called(r)}: {doubt(r.evidence)}" for r in unsure if r.evidence)
    return f"Too far behind for its ln Z to matter, and without a place in the ranking: {told}"


def beyond_range(found: Comparison) -> str:
    """That the convexity prior looks farther than the points fitted, and what that changes; "" if it does not."""
    changes = [(r, c) for r in found.fitted if (c := _change_within(r)) is not None]
    if not changes:
        return ""
    mode = changes[0][0].hypothesis.convexity
    start = (
        f'The convexity prior "{mode}" looks to the end of the whole measured range, also where only a part of it is '
        "fitted"
    )
    row, change = max(changes, key=lambda c: abs(c[1]))
    if abs(change) < SEEN:
        return f"{start}; asked within the part alone, no ln Z would change by {SEEN:g} or more."
    more = "larger" if change > 0 else "smaller"
    return f"{start}; asked within the part alone, ln Z would be {more} by {abs(change):.2f} for {called(row)}" + (
        ", and by less for the others." if len(changes) > 1 else "."
    )


def _change_within(row: Row) -> float | None:
    """ln Z with convexity within the fitted range alone, minus ln Z as it is; None if that is not known."""
    by_mode = {m.mode: m.log_evidence for m in row.modes}
    there, here = by_mode.get(WITHIN), by_mode.get(row.hypothesis.convexity.name)
    return None if there is None or here is None else there - here


def covered(found: Comparison) -> str:
    """What the searches for modes have covered; "" if there were none."""
    known = [r.evidence.coverage for r in found.rows if r.evidence is not None and r.evidence.coverage is not None]
    if not known:
        return ""
    least = min(known, key=lambda c: c.points)
    return (
        f"Modes were searched for from {least.points} points that fill the prior of each hypothesis, independent of "
        f"its draws, with {min(c.ascents for c in known)} ascents at least: one that is higher than its surroundings "
        f"on {100 * least.volume:.2g} % of the prior would have been met with 99 %, a smaller one perhaps not."
    )


# ---- what is preferred -----------------------------------------------------------------------------------------------


def preferred(found: Comparison) -> str:
    """What evidence and leave-one-out prefer, by how much, and whether they disagree."""
    both = [r for r in found.rows if r.evidence is not None and r.loo is not None]
    if len(both) < 2 and len(found.fitted) > 1:
        return _by_evidence(found)
    if len(both) < 2:
        return "There are not two hypotheses to choose between."
    by_loo = sorted(both, key=lambda r: -r.loo.elpd if r.loo else 0.0)
    predicts, next_best = by_loo[0], by_loo[1]
    if not found.agreed:
        gap, se = _elpd_gap(predicts, next_best)
        return (
            f"The evidence gives no ranking; leave-one-out prefers {called(predicts)} to {called(next_best)} by "
            f"{gap:.1f} +- {se:.1f}{_weak(gap, se)}."
        )
    by_z = [r for r in found.ranking if r.loo is not None]
    if len(by_z) < 2:
        return f"Only of {called(by_z[0])} is the evidence known, and the others are far behind." if by_z else ""
    gap = _best(by_z[0])[0] - _best(by_z[1])[0]
    sd = float(np.hypot(_best(by_z[0])[1], _best(by_z[1])[1]))
    names = f"{called(by_z[0])} to {called(by_z[1])}"
    start = f"The evidence prefers {names} by {gap:.1f} +- {sd:.2g} in ln Z{_bayes(gap)}"
    if predicts is by_z[0]:
        d, se = _elpd_gap(predicts, next_best)
        return (
            f"{start}, and leave-one-out prefers it too, to {called(next_best)} by {d:.1f} +- {se:.1f}{_weak(d, se)}."
        )
    d, se = _elpd_gap(predicts, by_z[0])
    if d > DECIDED * se:
        return (
            f"{start}, but leave-one-out prefers {called(predicts)} to it by {d:.1f} +- {se:.1f}: evidence and "
            "prediction disagree, and of the two the evidence is the one that depends on the width of the priors."
        )
    return (
        f"{start}, and leave-one-out puts {called(predicts)} before it by {d:.1f} +- {se:.1f}{_weak(d, se)}: "
        "prediction does not contradict the evidence."
    )


def _by_evidence(found: Comparison) -> str:
    """What evidence alone prefers, where no point was left out."""
    if not found.ranking:
        return no_ranking(found)
    first = found.ranking[0]
    return (
        f"The evidence prefers {called(first)}, with a posterior probability of "
        f"{percent(first.posterior_probability or 0.0)}; prediction of points left out was not compared."
    )


def survival(found: Comparison) -> str:
    """Whether the first of the ranking stays first when any one prior is half or twice as wide."""
    fitted = sorted((r for r in found.fitted if r.evidence and r.evidence.agreed), key=lambda r: -_best(r)[0])
    if len(fitted) < 2:
        return ""
    first, second = fitted[:2]
    lead = _best(first)[0] - _best(second)[0]
    # The prior of the noise is the same for all: changing it for one alone would say nothing.
    changed = [(r, w) for r in fitted for w in r.widths if w.factor != 1.0 and not w.parameter.startswith("noise.")]
    known = [(r, w) for r, w in changed if w.unknown is None]
    if not changed:
        return ""
    unknown = len(changed) - len(known)
    if not known:
        return "What other widths of the priors would do to ln Z cannot be said from these draws."
    # The first can fall, and any other can rise.
    fall, down = max(((-w.change, w) for r, w in known if r is first), key=lambda c: c[0], default=(0.0, known[0][1]))
    rise, up = max(
        ((_best(r)[0] - _best(second)[0] + w.change, w) for r, w in known if r is not first),
        key=lambda c: c[0],
        default=(0.0, known[0][1]),
    )
    worst = lead - max(fall, rise)
    which = down if fall >= rise else up
    whose = f"{spoken_parameter(which.parameter)} of {_owner(which.parameter)}"
    rest = f" {unknown} of the changes cannot be told from these draws." if unknown else ""
    if worst > 0:
        return (
            f"{called(first)} stays first when any one prior is half or twice as wide: its lead of {lead:.1f} in ln Z "
            f"falls to {worst:.1f} at worst, with the prior of {whose} {which.factor:g} times as wide.{rest}"
        )
    return (
        f"The first place depends on the priors: with the prior of {whose} {which.factor:g} times as wide, "
        f"the lead of {called(first)} of {lead:.1f} in ln Z is lost by {-worst:.1f}.{rest}"
    )


def _owner(parameter: str) -> str:
    """The material or effect whose parameter ``yeoh.c3_c1`` is."""
    name = parameter.partition(".")[0]
    known = {**components("materials"), **components("effects")}
    return str(known[name].title) if name in known else name


def _best(row: Row) -> tuple[float, float]:
    assert row.evidence is not None
    return row.evidence.best


def _elpd_gap(a: Row, b: Row) -> tuple[float, float]:
    """elpd_a - elpd_b and its standard error, from the differences point by point."""
    assert a.loo is not None
    assert b.loo is not None
    d = a.loo.pointwise - b.loo.pointwise
    return float(np.sum(d)), float(np.sqrt(d.size * np.var(d)))


def _weak(gap: float, se: float) -> str:
    return "" if gap > DECIDED * se else ", which is no difference"


def _bayes(gap: float) -> str:
    return ", which decides little" if gap < 1.0 + WIDEST else ""

"""What is said of a comparison."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.comparison.convexity_modes import WITHIN, ByMode, Missing
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, Evidence, together
from bayesmembrane.comparison.evidence.target import Coverage, EvidenceEstimate
from bayesmembrane.comparison.leave_out.score import LeaveOneOut
from bayesmembrane.comparison.prior_widths import Unknown, Widened
from bayesmembrane.comparison.result import Row, ranked
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.words.comparison import (
    beyond_range,
    covered,
    document,
    doubt,
    left_out,
    missing_mode,
    no_ranking,
    preferred,
    remark,
    sentences,
    survival,
    unknown_width,
)


def row(label: str, z: float, elpd: float, sd: float = 0.1, off: float = 0.0) -> Row:
    rng = np.random.default_rng(len(label))
    points = elpd / 10 + 0.05 * rng.standard_normal(10)
    points += elpd / 10 - points.mean()
    loo = LeaveOneOut(elpd, 1.0, 0.01, points, np.zeros(10), ())
    pair = {NESTED: EvidenceEstimate(z + off, sd, 1, 1.0), BRIDGE: EvidenceEstimate(z, 0.01, 1, 1.0)}
    return Row(label, hypothesis("gent"), together(pair), loo)


def pair(a: float, sa: float, b: float, sb: float, mass: Mass | None = None) -> Evidence:
    return together({NESTED: EvidenceEstimate(a, sa, 1, 1.0), BRIDGE: EvidenceEstimate(b, sb, 1, 1.0)}, mass)


def test_why_ln_z_is_not_known_is_said_with_its_numbers():
    assert doubt(pair(-10.0, 0.1, -10.1, 0.01)) == ""
    assert doubt(pair(-10.0, 0.1, -10.5, 0.01)) == (
        "Nested sampling and bridge sampling differ by 0.50 in ln Z, which is 5.0 joint standard errors."
    )
    assert doubt(pair(-10.0, 0.3, -10.1, 0.1)) == "The joint standard error of ln Z, 0.32, is above 0.3."
    assert "not a finite number" in doubt(pair(-np.inf, 0.1, -10.0, 0.1))


def test_a_missed_mode_is_said_with_what_it_holds():
    found = together(
        {NESTED: EvidenceEstimate(-10, 0.1, 1, 1.0), BRIDGE: EvidenceEstimate(-10, 0.01, 1, 1.0, (), None, 2.34)}
    )
    assert "a mode that the draws have missed: with it ln Z is larger by 2.3 at least" in doubt(found)


def test_one_out_of_reach_is_named_beside_the_ranking():
    found = ranked([row("one", -10, 5), row("other", -12, 3), row("far", -50, 1, off=5.0)])
    assert no_ranking(found) == ""
    assert left_out(found).startswith("Too far behind for its ln Z to matter, and without a place in the ranking: far")
    assert preferred(found).startswith("The evidence prefers one to other by 2.0")
    assert left_out(found) in sentences(found)
    assert document(found)["out_of_reach"] == left_out(found)
    assert left_out(ranked([row("one", -10, 5), row("other", -12, 3)])) == ""


def test_how_far_convexity_looks_is_said_with_what_it_changes():
    def modes(within: float) -> tuple[ByMode, ...]:
        return tuple(ByMode(m, z, 0.1, 0.5, 0.01, 500.0, None) for m, z in (("reached", -10.0), (WITHIN, within)))

    one, other = replace(row("one", -10, 5), modes=modes(-10.47)), replace(row("other", -12, 3), modes=modes(-10.01))
    said = beyond_range(ranked([one, other]))
    assert said.startswith('The convexity prior "reached" looks to the end of the whole measured range')
    assert said.endswith("ln Z would be smaller by 0.47 for one, and by less for the others.")
    assert beyond_range(ranked([other])).endswith("no ln Z would change by 0.05 or more.")
    assert beyond_range(ranked([row("one", -10, 5)])) == ""


def test_what_the_search_has_covered_is_said():
    searched = replace(row("one", -10, 5).evidence, coverage=Coverage(4096, 34, 1, 0.001124))
    found = ranked([replace(row("one", -10, 5), evidence=searched), row("other", -12, 3)])
    assert "from 4096 points that fill the prior" in covered(found)
    assert "34 ascents at least: one that is higher than its surroundings on 0.11 % of the prior" in covered(found)
    assert covered(ranked([row("one", -10, 5)])) == ""


def test_no_ranking_is_said_with_every_hypothesis_in_doubt():
    found = ranked([row("one", -10, 5), row("other", -12, 3, off=2.0)])
    assert "of 1 of them. other: Nested sampling and bridge sampling differ by 2.00" in no_ranking(found)
    assert preferred(found).startswith("The evidence gives no ranking; leave-one-out prefers one to other by 2.0")
    assert document(found)["table"][1]["reason"] == remark(found.rows[1]) != ""
    lost = replace(row("third", -9, 1), evidence=None, failure="it cannot be fitted")
    assert no_ranking(ranked([lost])) == "None of the hypotheses could be fitted."
    assert remark(lost) == "it cannot be fitted"


@pytest.mark.parametrize(
    ("unknown", "words"),
    [
        (Unknown.NOT_COVERED, "Draws under the prior of gent.ln_jm say nothing of one that allows more"),
        (Unknown.FEW, "Reweighted to 2 times the width, the draws are worth only 3: sample"),
        (Unknown.HEAVY, "a few draws far out count most (tail index 0.81): sample again"),
        (None, ""),
    ],
)
def test_why_another_width_is_not_known(unknown, words):
    said = unknown_width(Widened("gent.ln_jm", 2.0, np.nan, np.nan, 3.2, 0.812, unknown))
    assert words in said
    assert bool(words) == bool(said)


@pytest.mark.parametrize(
    ("missing", "words"),
    [
        (Missing.PRIOR, "Too few films of the prior meet it: its mass is 0.02 +- 0.01."),
        (Missing.DRAWS, "The weights of this mode rest on only 7 draws."),
        (Missing.NONE, "None of the films that come near the data meets it."),
        (None, ""),
    ],
)
def test_why_a_mode_has_no_evidence(missing, words):
    assert missing_mode(ByMode("box", None, None, 0.02, 0.01, 7.1, missing)) == words


def test_words_for_agreement_and_disagreement_of_evidence_and_prediction():
    same = ranked([row("one", -10, 5), row("other", -15, 3)])
    assert "leave-one-out prefers it too, to other by 2.0" in preferred(same)
    apart = ranked([row("one", -10, 3), row("other", -15, 5)])
    assert "evidence and prediction disagree" in preferred(apart)
    close = ranked([row("one", -10, 5.0), row("other", -15, 5.02)])
    assert "prediction does not contradict the evidence" in preferred(close)
    little = ranked([row("one", -10, 5), row("other", -10.5, 3)])
    assert "which decides little" in preferred(little)


def test_the_ranking_is_said_to_survive_other_priors_or_not():
    widths = (Widened("gent.ln_jm", 2.0, -1.0, 0.1, 500.0, 0.1, None),)
    one, other = replace(row("one", -10, 5), widths=widths), row("other", -15, 3)
    assert "stays first" in survival(ranked([one, other]))
    assert "falls to 4.0 at worst, with the prior of ln Jm of Gent 2 times as wide" in survival(ranked([one, other]))
    rising = replace(other, widths=(replace(widths[0], change=6.0),))
    assert "is lost by 1.0" in survival(ranked([one, rising]))

"""What is said of a comparison."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.comparison.convexity_modes import ByMode, Missing
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, Evidence, together
from bayesmembrane.comparison.evidence.target import EvidenceEstimate
from bayesmembrane.comparison.leave_out.score import LeaveOneOut
from bayesmembrane.comparison.prior_widths import Unknown, Widened
from bayesmembrane.comparison.result import Row, ranked
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.words.comparison import (
    document,
    doubt,
    missing_mode,
    no_ranking,
    preferred,
    remark,
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
    assert "falls to 4.0 at worst, with the prior of gent.ln_jm 2 times as wide" in survival(ranked([one, other]))
    rising = replace(other, widths=(replace(widths[0], change=6.0),))
    assert "is lost by 1.0" in survival(ranked([one, rising]))

"""What decides is checked by importance sampling, and what cannot is not."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation import checking
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.case import OpenCase
from bayesmembrane.diagnosis.explanation.checking import weigh_by_draws
from bayesmembrane.diagnosis.explanation.grown import Grown
from bayesmembrane.diagnosis.thresholds import SAMPLED, SEARCH, VERDICT
from tests.diagnosis.explanation.shelf import candidate, claim


@pytest.mark.parametrize("structure", [False, True])
def test_of_what_leads_more_draws_are_made_than_of_what_may_decide(
    monkeypatch: pytest.MonkeyPatch, structure: bool
) -> None:
    """The null model, all that has a share, and, with more draws, what leads by then; each is first searched for to its
    end, and once. Beside what leaves structure only what leads is checked, and once.
    """
    ended: list[tuple[str, ...]] = []

    def all_polished(every: list[Candidate], steps: int) -> list[Candidate]:
        assert steps == SEARCH.iterations
        ended.extend(c.names for c in every)
        return every

    shares = {(): 1e-6, ("friction",): 0.9, ("mullins",): 0.09, ("tearing",): 0.005, ("rate",): 1e-5}
    drawn: list[tuple[tuple[str, ...], Any]] = []
    monkeypatch.setattr(checking, "checked", lambda _, c, drawing: drawn.append((c.names, drawing)) or c)
    monkeypatch.setattr(
        Grown, "shares", lambda out, _: {key: float(np.log(shares[c.names])) for key, c in out.found.items()}
    )
    monkeypatch.setattr(Grown, "seen", lambda _: {})
    case = SimpleNamespace(null=candidate(claim(), 0.0), tell=lambda _: None)
    over = 1.0 + BELIEFS.blurred + (0.01 if structure else -0.01)  # of what counts as noise, few points being left
    points = candidate(claim("friction"), 0.0)
    noise = 1.0 + VERDICT.chance * float(np.sqrt(2.0 / max(points.residual.size - points.x.size, 1)))
    squares = over * max(VERDICT.noise_chi2, noise) * max(points.residual.size - points.x.size, 1)
    search = SimpleNamespace(all_polished=all_polished, squares=lambda *_: squares)
    grown = Grown(cast(OpenCase, case), cast(Search, cast(Any, search)))
    for names in shares:
        grown.add(candidate(claim(*names), 0.0))
    weigh_by_draws(grown)
    weigh_by_draws(grown)
    assert sorted(ended) == [(), ("friction",), ("mullins",), ("tearing",)]
    del drawn[len(drawn) // 2 :]
    kinds = (SAMPLED.first, SAMPLED.last, SAMPLED.vague)
    first, last, vague = ([names for names, d in drawn if d is each] for each in kinds)
    assert first == ([] if structure else [(), ("friction",), ("mullins",), ("tearing",)])
    assert last == ([] if structure else [("friction",), ("mullins",)])
    assert vague == ([(), ("friction",), ("mullins",)] if structure else [])

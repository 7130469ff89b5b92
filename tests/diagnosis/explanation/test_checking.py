"""What decides is checked by importance sampling, and what cannot is not."""

from dataclasses import replace
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
from bayesmembrane.diagnosis.thresholds import SAMPLED, SEARCH, VERDICT, Drawing
from tests.diagnosis.explanation.shelf import candidate, claim

F, M, T, R = ("friction",), ("mullins",), ("tearing",), ("rate",)
SHARES = {(): 1e-6, F: 0.9, M: 0.09, T: 0.005, R: 1e-5}


def weighed(
    monkeypatch: pytest.MonkeyPatch, structured: tuple[tuple[str, ...], ...], first: str = "friction", then: str = ""
) -> tuple[dict[Drawing, list[tuple[str, ...]]], list[tuple[str, ...]]]:
    """Which sets were checked by each kind of drawing, and which were searched on to the end, in that order, where
    those ``structured`` leave more than noise. The ``first`` set leads, and ``then`` another one, once it was drawn
    from.
    """
    ended: list[tuple[str, ...]] = []
    drawn: dict[Drawing, list[tuple[str, ...]]] = {d: [] for d in (SAMPLED.first, SAMPLED.last, SAMPLED.vague)}

    def all_polished(every: list[Candidate], steps: int) -> list[Candidate]:
        assert steps == SEARCH.iterations
        ended.extend(c.names for c in every)
        return every

    def checked(_: Any, c: Candidate, drawing: Drawing) -> Candidate:
        drawn[drawing].append(c.names)
        return replace(c, by_draws=0.1)

    def shares(out: Grown, _: Any) -> dict[Any, float]:
        leads = then if then and any(F in each for each in drawn.values()) else first
        each = SHARES | {F: SHARES[(leads,) if leads else ()], ((leads,) if leads else ()): SHARES[F]}
        return {key: float(np.log(each[c.names])) for key, c in out.found.items()}

    def squares(c: Candidate, *_: Any) -> float:
        """A little more than is blurred, or a little less, of what counts as noise."""
        dof = max(c.residual.size - c.x.size, 1)
        noise = max(VERDICT.noise_chi2, 1.0 + VERDICT.chance * float(np.sqrt(2.0 / dof)))
        return dof * noise * (1.0 + BELIEFS.blurred + (0.01 if c.names in structured else -0.01))

    monkeypatch.setattr(checking, "checked", checked)
    monkeypatch.setattr(Grown, "shares", shares)
    monkeypatch.setattr(Grown, "seen", lambda _: {})
    case = SimpleNamespace(null=candidate(claim(), 0.0), tell=lambda _: None)
    grown = Grown(
        cast(OpenCase, case), cast(Search, cast(Any, SimpleNamespace(all_polished=all_polished, squares=squares)))
    )
    for names in SHARES:
        grown.add(candidate(claim(*names), 0.0))
    weigh_by_draws(grown)
    return drawn, ended


def test_of_what_leads_more_draws_are_made_than_of_what_may_decide(monkeypatch: pytest.MonkeyPatch) -> None:
    """The null model, all that has a share, and, with more draws, what leads by then; each is first searched for to its
    end, and once.
    """
    drawn, ended = weighed(monkeypatch, ())
    assert drawn == {SAMPLED.first: [(), F, M, T], SAMPLED.last: [F, M], SAMPLED.vague: []}
    assert sorted(ended) == [(), F, M, T]


def test_beside_what_leaves_structure_only_what_leads_is_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is so far behind that draws will not bring it forward may leave noise."""
    drawn, ended = weighed(monkeypatch, (F, M, T))
    assert drawn == {SAMPLED.first: [], SAMPLED.last: [], SAMPLED.vague: [(), F, M]}
    assert sorted(ended) == [(), F, M, T]


@pytest.mark.parametrize("structured", [(F,), (F, M), (M, T, R)])
def test_all_is_checked_where_one_that_may_lead_leaves_noise(
    monkeypatch: pytest.MonkeyPatch, structured: tuple[tuple[str, ...], ...]
) -> None:
    drawn, _ = weighed(monkeypatch, structured)
    assert drawn == {SAMPLED.first: [(), F, M, T], SAMPLED.last: [F, M], SAMPLED.vague: []}


def test_all_is_checked_where_no_effect_leads(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, _ = weighed(monkeypatch, ((), F, M, T, R), first="")
    assert drawn[SAMPLED.vague] == []
    assert drawn[SAMPLED.last] == [(), M]


def test_all_is_checked_where_draws_bring_one_forward_that_leaves_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was checked already is not checked twice, but with more draws."""
    drawn, _ = weighed(monkeypatch, (F, M, T), then="rate")
    assert drawn[SAMPLED.vague][:2] == [(), F]
    assert drawn[SAMPLED.first] == [(), T]
    assert drawn[SAMPLED.last] == [R, M]

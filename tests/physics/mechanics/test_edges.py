"""Films ruled out by what they pass at their edges, against what their solutions show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.materials.yeoh import Yeoh
from bayesmembrane.physics.mechanics.request import Request, Spared
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.ritz.edges import ruled_out_at_the_edges
from bayesmembrane.physics.mechanics.solution import Curves, Status
from tests.physics.mechanics.films import MM, asked, every_material, prior_draws

both = pytest.mark.parametrize("spare", [Spared.NOT_CONVEX, Spared.NOT_ELLIPTIC])
RANGE = np.linspace(6.1, 91.5, 8) * MM


def wide_films(material: type[Material], count: int, seed: int, spare: Spared) -> Request:
    p, rng = prior_draws(material, count, seed=seed, wide=2.0), np.random.default_rng(seed)
    l0 = np.where(rng.random(count) < 0.5, 1.0, 1.0 + 0.5 * rng.random(count))
    return replace(asked(material, p, RANGE, l0, ratio=rng.uniform(1.5, 5.0)), spare=spare)


def least(curves: Curves, spare: Spared) -> Array:
    return np.fmin.reduce(curves.convexity if spare is Spared.NOT_CONVEX else curves.ellipticity, axis=1)


@both
@every_material
def test_what_the_edges_rule_out_no_solution_lets_pass(material, spare):
    question = wide_films(material, 400, 301, spare)
    out = ruled_out_at_the_edges(question)
    if not out.films.size:
        return
    solved = ritz.solve(replace(question, spare=Spared.NONE).of(out.films))
    passes = np.all(solved.ok, axis=1) & (least(solved, spare) >= 0)
    assert not np.any(passes), question.parameters[out.films[passes]]
    # Beyond the loss a stiffening film may be stable again, where loading does not lead.
    on_the_way = np.logical_and.accumulate(solved.ok, axis=1)
    assert not np.any(on_the_way & (out.status == Status.NOT_ELLIPTIC))


@both
@every_material
def test_a_prior_accepts_the_same_films_with_edges_and_without(material, spare, monkeypatch):
    question = wide_films(material, 200, 302, spare)
    looked = ritz.solve(question)
    nothing = ruled_out_at_the_edges(replace(question, spare=Spared.NONE))
    monkeypatch.setattr("bayesmembrane.physics.mechanics.ritz.solver.ruled_out_at_the_edges", lambda asked: nothing)
    plain = ritz.solve(question)
    np.testing.assert_array_equal(
        np.all(looked.ok, axis=1) & (least(looked, spare) >= 0),
        np.all(plain.ok, axis=1) & (least(plain, spare) >= 0),
    )
    kept = np.setdiff1d(np.arange(200), ruled_out_at_the_edges(question).films)
    np.testing.assert_array_equal(looked.force[kept], plain.force[kept])


@both
def test_most_of_what_a_wide_prior_of_yeoh_rules_out_is_seen_at_the_edges(spare):
    question = wide_films(Yeoh, 400, 303, spare)
    out = ruled_out_at_the_edges(question).films
    plain = ritz.solve(replace(question, spare=Spared.NONE))
    assert len(out) > 0.5 * np.count_nonzero(~np.all(plain.ok, axis=1) | (least(plain, spare) < 0)) > 50


def test_a_film_ruled_out_at_its_edges_has_margins_and_no_force():
    question = replace(asked(Yeoh, [[5.0, -2.0, 0.01], [8.84, -0.63, 0.0563]], RANGE), spare=Spared.NOT_CONVEX)
    curves = ritz.solve(replace(question, sensitivities=True))
    assert np.all(curves.convexity[0] < 0)
    assert np.all(np.isnan(curves.force[0]))
    assert np.all(np.isnan(curves.sensitivity[0]))
    assert curves.status[0, -1] == Status.NOT_ELLIPTIC
    assert np.all(curves.ok[1])
    assert np.all(np.isfinite(curves.sensitivity[1]))


@pytest.mark.parametrize(("slack", "spare"), [(0.9, Spared.NOT_CONVEX), (1.0, Spared.NONE)])
def test_edges_say_nothing_of_a_film_clamped_slack_or_spared_by_nobody(slack, spare):
    question = replace(asked(Yeoh, [[5.0, -2.0, 0.01]], RANGE, slack), spare=spare)
    assert not ruled_out_at_the_edges(question).films.size
    assert ruled_out_at_the_edges(replace(question, prestretch=np.ones(1), spare=Spared.NOT_CONVEX)).films.size

"""What the Ritz method cannot bring to 1e-6 is shot, and nothing else is touched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.physics.materials.ogden import Ogden
from bayesmembrane.physics.materials.yeoh import Yeoh
from bayesmembrane.physics.mechanics import Status, fallback, request, solve
from bayesmembrane.physics.mechanics.api import unaided
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.shooting import solver as shooting
from tests.physics.mechanics.films import FIFTEEN, RADII, asked, every_material, prior_draws, silicone

FAILED = (Status.UNRESOLVED, Status.ITERATION_LIMIT)


@every_material
def test_nothing_changes_where_ritz_is_content(material):
    question = replace(asked(material, silicone(material), FIFTEEN), sensitivities=True)
    one, other = fallback.solve(question), ritz.solve(question)
    for name in ("force", "sensitivity", "status", "slope"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("material", [Ogden, Yeoh])
def test_only_failed_deflections_are_replaced_and_by_the_forces_of_shooting(material, monkeypatch):
    question = replace(asked(material, prior_draws(material, 8, seed=401), FIFTEEN), sensitivities=True)
    honest = ritz.solve(question)
    spoilt = honest.status.copy()
    spoilt[2, 3], spoilt[5, 10:] = Status.UNRESOLVED, Status.ITERATION_LIMIT
    broken = replace(honest, status=spoilt, force=np.where(spoilt == Status.OK, honest.force, np.nan))
    monkeypatch.setattr(ritz, "solve", lambda *_: broken)
    mended, shot = fallback.solve(question), shooting.solve(question)
    touched = np.isin(spoilt, FAILED)
    taken = touched & np.isin(shot.status, (Status.OK, Status.NOT_ELLIPTIC))
    np.testing.assert_array_equal(mended.force[taken], shot.force[taken])
    np.testing.assert_array_equal(mended.sensitivity[taken], shot.sensitivity[taken])
    np.testing.assert_array_equal(mended.force[~touched], honest.force[~touched])
    np.testing.assert_array_equal(mended.status[touched & ~taken], spoilt[touched & ~taken])
    assert np.any(taken)


@every_material
def test_fewer_deflections_are_flagged_than_by_ritz_alone(material):
    question = asked(material, prior_draws(material, 100, seed=402), FIFTEEN)
    alone, both = ritz.solve(question), fallback.solve(question)
    assert np.isin(both.status, FAILED).sum() <= np.isin(alone.status, FAILED).sum()
    np.testing.assert_array_equal(both.force[alone.ok], alone.force[alone.ok])


def test_it_is_what_solve_does_by_default():
    p = prior_draws(Yeoh, 20, seed=403)
    np.testing.assert_array_equal(
        solve(request(Yeoh, p, FIFTEEN, **RADII)).force, fallback.solve(asked(Yeoh, p, FIFTEEN)).force
    )


def test_unaided_is_the_ritz_method_alone_whatever_stands_in_front_of_it():
    question, seen = asked(Yeoh, prior_draws(Yeoh, 20, seed=404), FIFTEEN), []

    def listening(put):
        seen.append(put.solver)
        return solve(put)

    alone = ritz.solve(question)
    for curves in (unaided(question), unaided(question, listening)):
        np.testing.assert_array_equal(curves.force, alone.force)
        np.testing.assert_array_equal(curves.status, alone.status)
    assert seen == ["ritz_alone"]

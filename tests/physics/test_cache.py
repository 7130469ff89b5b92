"""The cache gives the answers of the solver, recognises scaled copies, and survives damage and company."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bayesmembrane
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.physics import cache
from bayesmembrane.physics.cache import SMALL_BATCH, CachedSolver
from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.materials.ogden import Ogden
from bayesmembrane.physics.mechanics import solve
from bayesmembrane.physics.mechanics.solution import Curves
from tests.physics.mechanics.films import FIFTEEN, INNER, MM, OUTER, RADII, every_material, prior_draws, silicone

FIELDS = [name for name in Curves.__dataclass_fields__ if name != "sensitivity"]


def assert_same(one, other, rtol=1e-11):
    for name in FIELDS:
        # The variation of what is constant is round-off in part.
        atol = 1e-13 if name == "variation" else 0
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=rtol, atol=atol, err_msg=name)
    assert (one.sensitivity is None) == (other.sensitivity is None)
    if one.sensitivity is not None:
        np.testing.assert_allclose(one.sensitivity, other.sensitivity, rtol=rtol)
    assert one.status.dtype == one.note.dtype == np.int8


@every_material
@pytest.mark.parametrize("solver", ["ritz", "shooting"])
def test_cached_equals_direct(material, solver, tmp_path):
    question = {"prestretch": 1.02, "sensitivities": True, "solver": solver, **RADII}
    d = FIFTEEN[::4] * np.array([1, -1, 1, 1])
    direct = solve(material, silicone(material), d, **question)
    for folder in (None, tmp_path):
        remembered = CachedSolver(folder)
        assert_same(remembered(material, silicone(material), d, **question), direct)
        assert_same(remembered(material, silicone(material), d, **question), direct)
        assert (remembered.tally.misses, remembered.tally.hits) == (1, 1)
    from_disk = CachedSolver(tmp_path)
    assert_same(from_disk(material, silicone(material), d, **question), direct)
    assert (from_disk.tally.misses, from_disk.tally.from_disk) == (0, 1)


@every_material
def test_modulus_thickness_and_size_are_hits_and_rescaled(material):
    p, scales = silicone(material), np.array(material.scales)
    thicker = np.where(scales == 1, 2 * p, p)
    remembered = CachedSolver()
    remembered(material, p, FIFTEEN, sensitivities=True, **RADII)
    for films, size in ((thicker, 1.0), (p, 2.5), (thicker, 0.3)):
        question = {"inner_radius": size * INNER, "outer_radius": size * OUTER, "sensitivities": True}
        assert_same(
            remembered(material, films, size * FIFTEEN, **question),
            solve(material, films, size * FIFTEEN, **question),
            rtol=1e-9,
        )
    assert (remembered.tally.misses, remembered.tally.hits) == (1, 3)


def test_everything_else_is_a_miss():
    remembered, p = CachedSolver(), silicone(Gent)
    questions = [
        (p, FIFTEEN, RADII),
        (p * [1, 1.0001], FIFTEEN, RADII),
        (p, FIFTEEN * 1.0001, RADII),
        (p, -FIFTEEN, RADII),
        (p, FIFTEEN, {"inner_radius": INNER, "outer_radius": 1.01 * OUTER}),
        (p, FIFTEEN, {**RADII, "prestretch": 1.001}),
        (p, FIFTEEN, {**RADII, "solver": "shooting"}),
        (p, FIFTEEN, {**RADII, "sensitivities": True}),
    ]
    for films, deflection, options in questions:
        assert_same(remembered(Gent, films, deflection, **options), solve(Gent, films, deflection, **options))
    assert (remembered.tally.misses, remembered.tally.hits) == (len(questions), 0)
    assert CachedSolver()(NeoHookean, [7.5], FIFTEEN, **RADII).ok.all(), "materials are told apart"


def test_a_posterior_of_one_modulus_solves_once():
    films = np.random.default_rng(0).uniform(1, 20, (300, 1))
    remembered = CachedSolver()
    assert_same(remembered(NeoHookean, films, FIFTEEN, **RADII), solve(NeoHookean, films, FIFTEEN, **RADII), 1e-9)
    assert (remembered.tally.misses, remembered.tally.hits, remembered.tally.bypassed) == (1, 299, 0)


def test_the_tally_counts_what_was_done_since():
    remembered = CachedSolver()
    remembered(NeoHookean, [7.5], FIFTEEN, **RADII)
    before = dataclasses.replace(remembered.tally)
    remembered(NeoHookean, [[7.5], [8.5]], FIFTEEN, **RADII)
    remembered(NeoHookean, [7.5], 0.5 * FIFTEEN, **RADII)
    done = remembered.tally.since(before)
    assert (done.hits, done.misses, done.spared) == (2, 1, 1)
    cost = remembered.tally.seconds_solving / 2
    assert remembered.tally.seconds_saved == pytest.approx(cost - remembered.tally.seconds_looking)
    assert done.summary()["seconds_saved"] == done.seconds_saved


def test_draws_that_never_repeat_pass_by(tmp_path):
    films = prior_draws(Ogden, SMALL_BATCH + 1, seed=501)
    remembered = CachedSolver(tmp_path)
    assert_same(remembered(Ogden, films, FIFTEEN, **RADII), solve(Ogden, films, FIFTEEN, **RADII))
    assert (remembered.tally.misses, remembered.tally.bypassed) == (0, SMALL_BATCH + 1)
    assert not any(tmp_path.iterdir())


def test_films_without_a_modulus_pass_by():
    remembered = CachedSolver()
    assert not remembered(NeoHookean, [-1.0], FIFTEEN, **RADII).ok.any()
    assert remembered.tally.bypassed == 1


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 nonsense", None])
def test_a_damaged_entry_is_rebuilt(damage, tmp_path):
    direct = CachedSolver(tmp_path)(NeoHookean, [7.5], FIFTEEN, **RADII)
    (entry,) = tmp_path.iterdir()
    entry.write_bytes(entry.read_bytes()[: entry.stat().st_size // 2] if damage is None else damage)
    again = CachedSolver(tmp_path)
    assert_same(again(NeoHookean, [7.5], FIFTEEN, **RADII), direct)
    assert (again.tally.rebuilt, again.tally.misses) == (1, 1)
    healthy = CachedSolver(tmp_path)
    healthy(NeoHookean, [7.5], FIFTEEN, **RADII)
    assert (healthy.tally.rebuilt, healthy.tally.from_disk) == (0, 1)


def test_an_entry_under_the_wrong_name_is_not_believed(tmp_path):
    CachedSolver(tmp_path)(NeoHookean, [7.5], FIFTEEN, **RADII)
    (one,) = tmp_path.iterdir()
    CachedSolver(tmp_path)(NeoHookean, [7.5], FIFTEEN / 2, **RADII)
    (other,) = set(tmp_path.iterdir()) - {one}
    other.write_bytes(one.read_bytes())
    again = CachedSolver(tmp_path)(NeoHookean, [7.5], FIFTEEN / 2, **RADII)
    assert_same(again, solve(NeoHookean, [7.5], FIFTEEN / 2, **RADII))


def test_another_text_of_the_solver_is_a_miss(tmp_path, monkeypatch):
    CachedSolver(tmp_path)(NeoHookean, [7.5], FIFTEEN, **RADII)
    monkeypatch.setattr(cache, "_source", lambda material: f"{material.name} of tomorrow")
    later = CachedSolver(tmp_path)
    later(NeoHookean, [7.5], FIFTEEN, **RADII)
    assert later.tally.misses == 1


WRITER = """
import sys
from pathlib import Path
import numpy as np
from bayesmembrane.physics.cache import CachedSolver
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
cached = CachedSolver(Path(sys.argv[1]))
for round in range(3):
    for i in range(1, 9):
        cached(NeoHookean, [7.5], np.linspace(1e-3, 1e-3 * i, 5), inner_radius=0.01, outer_radius=0.035)
print(cached.tally.rebuilt, cached.tally.misses + cached.tally.hits)
"""


def test_several_processes_share_a_folder(tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(Path(bayesmembrane.__file__).parents[1])}
    command = [sys.executable, "-c", WRITER, str(tmp_path)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    writers = [subprocess.Popen(command, env=environment, **pipes) for _ in range(3)]
    for writer in writers:
        out, fault = writer.communicate(timeout=120)
        assert (writer.returncode, fault) == (0, "")
        assert out.split() == ["0", "24"], "nothing was found half written"
    assert len(list(tmp_path.glob("*.npz"))) == 8
    assert not list(tmp_path.glob("*.part"))
    reader = CachedSolver(tmp_path)
    for i in range(1, 9):
        d = np.linspace(MM, i * MM, 5)
        assert_same(reader(NeoHookean, [7.5], d, **RADII), solve(NeoHookean, [7.5], d, **RADII))
    assert (reader.tally.from_disk, reader.tally.misses) == (8, 0)


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path):
    in_the_way = tmp_path / "curves"
    in_the_way.write_text("a file")
    with pytest.raises(StorageError) as fault:
        CachedSolver(in_the_way / "deeper")(NeoHookean, [7.5], FIFTEEN, **RADII)
    assert "curve cache cannot be written" in str(fault.value)
    assert str(in_the_way) in str(fault.value)
    assert str(fault.value).endswith(".")


def test_a_full_disk_leaves_no_parts_behind(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache.np, "savez", full)
    with pytest.raises(StorageError, match="No space left"):
        CachedSolver(tmp_path)(NeoHookean, [7.5], FIFTEEN, **RADII)
    assert not list(tmp_path.iterdir())


def test_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(cache, "MOST_IN_MEMORY", 3)
    remembered = CachedSolver()
    for i in range(1, 6):
        remembered(NeoHookean, [7.5], i * MM, **RADII)
    remembered(NeoHookean, [7.5], 5 * MM, **RADII)
    remembered(NeoHookean, [7.5], 1 * MM, **RADII)
    assert (remembered.tally.hits, remembered.tally.misses) == (1, 6)


def test_the_tally_tells_what_was_gained():
    remembered = CachedSolver()
    for _ in range(20):
        remembered(Gent, silicone(Gent), FIFTEEN, **RADII)
    tally = remembered.tally
    assert (tally.hits, tally.misses) == (19, 1)
    assert tally.seconds_saved == pytest.approx(19 * tally.seconds_solving - tally.seconds_looking)


def test_a_hit_costs_less_than_a_solution():
    remembered = CachedSolver()
    for _ in range(300):
        remembered(Ogden, silicone(Ogden), FIFTEEN, solver="shooting", **RADII)
    assert remembered.tally.seconds_saved > 0

"""The cache gives the answers of the solver, recognises scaled copies, and survives damage and company."""

from __future__ import annotations

import dataclasses
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import bayesmembrane
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.physics import cache, curve_shelf
from bayesmembrane.physics.cache import SMALL_BATCH, CachedSolver
from bayesmembrane.physics.curve_shelf import FILE, CurveShelf
from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.materials.ogden import Ogden
from bayesmembrane.physics.mechanics import request, solve
from bayesmembrane.physics.mechanics.solution import Curves
from tests.physics.mechanics.films import FIFTEEN, INNER, MM, OUTER, RADII, every_material, prior_draws, silicone

FIELDS = [name for name in Curves.__dataclass_fields__ if name != "sensitivity"]


def assert_same(one, other, rtol=1e-11):
    for name in FIELDS:
        # The variation of what is constant is round-off in part.
        atol = 1e-12 if name == "variation" else 0
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=rtol, atol=atol, err_msg=name)
    assert (one.sensitivity is None) == (other.sensitivity is None)
    if one.sensitivity is not None:
        # Where a force hardly hangs on a parameter, its slope is a difference of larger ones.
        atol = rtol * np.max(np.abs(other.sensitivity))
        np.testing.assert_allclose(one.sensitivity, other.sensitivity, rtol=rtol, atol=atol)
    assert one.status.dtype == one.note.dtype == np.int8


@every_material
@pytest.mark.parametrize("solver", ["ritz", "shooting"])
def test_cached_equals_direct(material, solver, tmp_path):
    question = {"prestretch": 1.02, "sensitivities": True, "solver": solver, **RADII}
    d = FIFTEEN[::4] * np.array([1, -1, 1, 1])
    direct = solve(request(material, silicone(material), d, **question))
    for folder in (None, tmp_path):
        remembered = CachedSolver(folder)
        assert_same(remembered(request(material, silicone(material), d, **question)), direct)
        assert_same(remembered(request(material, silicone(material), d, **question)), direct)
        assert (remembered.tally.misses, remembered.tally.hits) == (1, 1)
    from_disk = CachedSolver(tmp_path)
    assert_same(from_disk(request(material, silicone(material), d, **question)), direct)
    assert (from_disk.tally.misses, from_disk.tally.from_disk) == (0, 1)


@every_material
def test_modulus_thickness_and_size_are_hits_and_rescaled(material):
    p, scales = silicone(material), np.array(material.scales)
    thicker = np.where(scales == 1, 2 * p, p)
    remembered = CachedSolver()
    remembered(request(material, p, FIFTEEN, sensitivities=True, **RADII))
    for films, size in ((thicker, 1.0), (p, 2.5), (thicker, 0.3)):
        question = {"inner_radius": size * INNER, "outer_radius": size * OUTER, "sensitivities": True}
        assert_same(
            remembered(request(material, films, size * FIFTEEN, **question)),
            solve(request(material, films, size * FIFTEEN, **question)),
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
        assert_same(
            remembered(request(Gent, films, deflection, **options)), solve(request(Gent, films, deflection, **options))
        )
    assert (remembered.tally.misses, remembered.tally.hits) == (len(questions), 0)
    assert CachedSolver()(request(NeoHookean, [7.5], FIFTEEN, **RADII)).ok.all(), "materials are told apart"


def test_a_posterior_of_one_modulus_solves_once():
    films = np.random.default_rng(0).uniform(1, 20, (300, 1))
    remembered = CachedSolver()
    assert_same(
        remembered(request(NeoHookean, films, FIFTEEN, **RADII)),
        solve(request(NeoHookean, films, FIFTEEN, **RADII)),
        1e-9,
    )
    assert (remembered.tally.misses, remembered.tally.hits, remembered.tally.bypassed) == (1, 299, 0)


def test_who_asked_first_does_not_show():
    """To the last bit: runs that share a folder must not depend on their order."""
    films = np.random.default_rng(1).uniform(1, 20, (5, 1))
    one, other = CachedSolver(), CachedSolver()
    one(request(NeoHookean, films[:1], FIFTEEN, **RADII))
    other(request(NeoHookean, films[4:], FIFTEEN, **RADII))
    for name in FIELDS:
        a, b = (getattr(solver(request(NeoHookean, films, FIFTEEN, **RADII)), name) for solver in (one, other))
        np.testing.assert_array_equal(a, b, err_msg=name)


def test_the_tally_counts_what_was_done_since():
    remembered = CachedSolver()
    remembered(request(NeoHookean, [7.5], FIFTEEN, **RADII))
    before = dataclasses.replace(remembered.tally)
    remembered(request(NeoHookean, [[7.5], [8.5]], FIFTEEN, **RADII))
    remembered(request(NeoHookean, [7.5], 0.5 * FIFTEEN, **RADII))
    done = remembered.tally.since(before)
    assert (done.hits, done.misses, done.spared) == (2, 1, 1)
    cost = remembered.tally.seconds_solving / 2
    assert remembered.tally.seconds_saved == pytest.approx(cost - remembered.tally.seconds_looking)
    assert done.summary()["seconds_saved"] == done.seconds_saved


def test_draws_that_never_repeat_pass_by(tmp_path):
    films = prior_draws(Ogden, SMALL_BATCH + 1, seed=501)
    remembered = CachedSolver(tmp_path)
    assert_same(remembered(request(Ogden, films, FIFTEEN, **RADII)), solve(request(Ogden, films, FIFTEEN, **RADII)))
    assert (remembered.tally.misses, remembered.tally.bypassed) == (0, SMALL_BATCH + 1)
    assert not any(tmp_path.iterdir())


def test_films_without_a_modulus_pass_by():
    remembered = CachedSolver()
    assert not remembered(request(NeoHookean, [-1.0], FIFTEEN, **RADII)).ok.any()
    assert remembered.tally.bypassed == 1


@pytest.mark.parametrize("damage", [b"PK\x03\x04 nonsense", None])
def test_a_damaged_file_is_rebuilt(damage, tmp_path):
    asked = request(NeoHookean, [7.5], FIFTEEN, **RADII)
    direct = CachedSolver(tmp_path)(asked)
    file = tmp_path / FILE
    file.write_bytes(b"x" * 3000 + file.read_bytes()[3000:] if damage is None else damage)
    again = CachedSolver(tmp_path)
    assert_same(again(asked), direct)
    assert (again.tally.rebuilt > 0, again.tally.misses) == (True, 1)
    healthy = CachedSolver(tmp_path)
    healthy(asked)
    assert (healthy.tally.rebuilt, healthy.tally.from_disk) == (0, 1)


def test_a_damaged_entry_is_rebuilt(tmp_path):
    asked = request(NeoHookean, [7.5], FIFTEEN, **RADII)
    direct = CachedSolver(tmp_path)(asked)
    with closing(sqlite3.connect(tmp_path / FILE)) as file, file:
        file.execute("UPDATE curves SET entry = substr(entry, 1, 300)")
    again = CachedSolver(tmp_path)
    assert_same(again(asked), direct)
    assert (again.tally.rebuilt, again.tally.misses) == (1, 1)


def test_the_file_is_bounded_and_the_oldest_go(tmp_path):
    shelf = CurveShelf(tmp_path, most_bytes=400_000)
    entry = {"force": np.random.default_rng(0).standard_normal(2000)}
    for i in range(60):
        shelf.write(f"{i}".encode(), entry)
        assert shelf.read(b"0") is not None, "what is asked for again and again stays"
    assert shelf.path.stat().st_size < 450_000
    assert shelf.read(b"1") is None
    assert shelf.read(b"59") is not None


def test_another_text_of_the_solver_is_a_miss(tmp_path, monkeypatch):
    CachedSolver(tmp_path)(request(NeoHookean, [7.5], FIFTEEN, **RADII))
    monkeypatch.setattr(cache, "_source", lambda material: f"{material.name} of tomorrow")
    later = CachedSolver(tmp_path)
    later(request(NeoHookean, [7.5], FIFTEEN, **RADII))
    assert later.tally.misses == 1


WRITER = """
import sys
from contextlib import closing
from pathlib import Path
import numpy as np
from bayesmembrane.physics.cache import CachedSolver
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.mechanics import request
cached = CachedSolver(Path(sys.argv[1]))
for round in range(3):
    for i in range(1, 9):
        cached(request(NeoHookean, [7.5], np.linspace(1e-3, 1e-3 * i, 5), 0.01, 0.035))
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
    assert [p.name for p in tmp_path.iterdir()] == [FILE]
    reader = CachedSolver(tmp_path)
    for i in range(1, 9):
        d = np.linspace(MM, i * MM, 5)
        assert_same(reader(request(NeoHookean, [7.5], d, **RADII)), solve(request(NeoHookean, [7.5], d, **RADII)))
    assert (reader.tally.from_disk, reader.tally.misses) == (8, 0)


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path):
    in_the_way = tmp_path / "curves"
    in_the_way.write_text("a file")
    with pytest.raises(StorageError) as fault:
        CachedSolver(in_the_way / "deeper")(request(NeoHookean, [7.5], FIFTEEN, **RADII))
    assert "curve cache cannot be written" in str(fault.value)
    assert str(in_the_way) in str(fault.value)
    assert str(fault.value).endswith(".")


def test_a_full_disk_is_a_sentence(tmp_path, monkeypatch):
    class Full:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            return False

        def close(self):
            pass

        def executescript(self, *_):
            raise sqlite3.OperationalError("database or disk is full")

    monkeypatch.setattr(curve_shelf.sqlite3, "connect", lambda *_, **__: Full())
    with pytest.raises(StorageError, match="disk is full"):
        CachedSolver(tmp_path)(request(NeoHookean, [7.5], FIFTEEN, **RADII))


def test_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(cache, "MOST_IN_MEMORY", 3)
    remembered = CachedSolver()
    for i in range(1, 6):
        remembered(request(NeoHookean, [7.5], i * MM, **RADII))
    remembered(request(NeoHookean, [7.5], 5 * MM, **RADII))
    remembered(request(NeoHookean, [7.5], 1 * MM, **RADII))
    assert (remembered.tally.hits, remembered.tally.misses) == (1, 6)


def test_the_tally_tells_what_was_gained():
    remembered = CachedSolver()
    for _ in range(20):
        remembered(request(Gent, silicone(Gent), FIFTEEN, **RADII))
    tally = remembered.tally
    assert (tally.hits, tally.misses) == (19, 1)
    assert tally.seconds_saved == pytest.approx(19 * tally.seconds_solving - tally.seconds_looking)


def test_a_hit_costs_less_than_a_solution():
    remembered = CachedSolver()
    for _ in range(300):
        remembered(request(Ogden, silicone(Ogden), FIFTEEN, solver="shooting", **RADII))
    assert remembered.tally.seconds_saved > 0

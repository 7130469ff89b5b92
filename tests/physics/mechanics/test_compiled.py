"""Kernels bound to a material: right physics, one name per text, kept on disk, also where nothing may be written."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bayesmembrane
from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.mechanics import compiled
from bayesmembrane.physics.mechanics.compiled import bind
from tests.physics.mechanics.films import every_material, prior_draws

derivatives = None
FACTOR = 1.0


def scaled_energy(p, l1, l2):
    return FACTOR * derivatives(p, l1, l2)[0]


def twice(p, l1, l2):
    return 2.0 * scaled_energy(p, l1, l2)


@every_material
def test_bound_kernels_see_the_physics_of_their_material(material):
    p = prior_draws(material, 1, seed=301)[0]
    kernels = bind((scaled_energy, twice), material)
    with np.errstate(all="ignore"):
        expected = material.derivatives(p, 1.1, 1.2)[0]
    assert kernels.twice(p, 1.1, 1.2) == pytest.approx(2 * expected, rel=1e-13)


def test_constants_replace_globals():
    p = np.array([7.5])
    one, three = bind((scaled_energy,), NeoHookean), bind((scaled_energy,), NeoHookean, FACTOR=3.0)
    assert three.scaled_energy(p, 1.1, 1.2) == pytest.approx(3 * one.scaled_energy(p, 1.1, 1.2))


def test_names_tell_materials_constants_and_borrowed_texts_apart(monkeypatch, tmp_path):
    def name(material, **constants):
        bind.cache_clear()
        return bind((scaled_energy,), material, **constants).scaled_energy.py_func.__name__

    names = [name(NeoHookean), name(Gent), name(NeoHookean, FACTOR=2.0)]
    assert len(set(names)) == 3
    assert name(NeoHookean) == names[0]
    (tmp_path / "ritz").mkdir()
    shutil.copy(Path(compiled.__file__).with_name("ritz") / "simd.py", tmp_path / "ritz" / "simd.py")
    with (tmp_path / "ritz" / "simd.py").open("a") as file:
        file.write("# another text\n")
    monkeypatch.setattr(compiled, "__file__", str(tmp_path / "compiled.py"))
    assert name(NeoHookean) != names[0]
    bind.cache_clear()


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    package = str(Path(bayesmembrane.__file__).parents[1])
    variables = {**os.environ, "PYTHONPATH": package, **environment}
    return subprocess.run([sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=True)


LOCKS = """
from bayesmembrane.physics.mechanics import locking
locking.locking_deflection(17.42, 1.0, 3.5)
print(sum(locking._lock_all.stats.cache_hits.values()), end="")
"""


def test_what_one_process_compiles_the_next_one_reads(tmp_path):
    def kept() -> dict[Path, int]:
        return {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.nb?")}

    assert not kept()
    run(LOCKS, NUMBA_CACHE_DIR=str(tmp_path))
    before = kept()
    assert before
    assert run(LOCKS, NUMBA_CACHE_DIR=str(tmp_path)).stdout == "1"
    assert kept() == before

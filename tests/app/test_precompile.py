"""What is compiled ahead: the solvers of every ordinary material, every effect, every noise model."""

from contextlib import contextmanager
from typing import Any

import pytest

from bayesmembrane.app import precompile
from bayesmembrane.ground.compiling import compilation
from bayesmembrane.ground.jobs import silent, workers
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis


def test_every_ordinary_material_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    @contextmanager
    def here() -> Any:
        with workers(count=1) as submit:
            yield submit

    monkeypatch.setattr(precompile, "workers", here)
    monkeypatch.setattr(precompile, "_material", lambda name, tell: asked.append(name))
    for part in ("_effects", "_noises"):
        monkeypatch.setattr(precompile, part, lambda tell, part=part: asked.append(part))
    precompile.main()
    assert asked == [*ordinary_materials(), "_effects", "_noises"]


def test_nothing_is_left_to_be_compiled_for_films_with_effects() -> None:
    precompile._effects(silent)
    m = precompile._read("synthetic_cyclic")
    claim = hypothesis("neo_hookean", ["mullins", "viscoelastic", "tearing", "machine_compliance"])
    x = [[float(p.prior.quantile(0.6)) for p in claim.parameters]]
    with compilation() as found:
        assert Forward(claim, m, m.deflection)(x, sensitivities=True, reached=False).force.shape == (1, len(m))
    assert found.seconds == 0.0

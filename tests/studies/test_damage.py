"""A small fixed part of `make study-damage`: every stored file, every kind of damage once."""

from pathlib import Path

import pytest

from tests.short_walks import shorten
from tests.studies import damage


def test_damage_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(damage, "shorten", lambda: shorten(monkeypatch.setattr))
    found = damage.damaged(damage.stored(tmp_path), len(damage.DAMAGES), 3)
    assert {"run.toml", "status.json", "posterior.nc", "predictions.nc", "fit.json", "fit.npz"} <= set(found)
    for name, count in found.items():
        assert set(count) <= {"told", "as it was"}, (name, count)
    assert sum(count["told"] for count in found.values()) > 50

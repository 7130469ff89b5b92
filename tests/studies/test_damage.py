"""A small fixed part of `make study-damage`: every stored file, every kind of damage once."""

from collections import Counter
from pathlib import Path

import pytest

from bayesmembrane.ground.stored import read, store
from tests.report.sections.test_evidence import compared
from tests.short_walks import shorten
from tests.studies import damage
from tests.studies.damage_more import File, campaign


def test_damage_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(damage, "shorten", lambda: shorten(monkeypatch.setattr))
    found = damage.damaged(damage.stored(tmp_path), len(damage.DAMAGES), 3)
    assert {"run.toml", "status.json", "posterior.nc", "predictions.nc", "fit.json", "fit.npz"} <= set(found)
    for name, count in found.items():
        assert set(count) <= {"told", "as it was"}, (name, count)
    assert sum(count["told"] for count in found.values()) > 50


def test_damage_of_a_campaign_and_of_answers_is_told(tmp_path: Path) -> None:
    folder = store(tmp_path / "answer", "comparison", compared(), {})
    answer = [File(end, folder / f"comparison.{end}", lambda: read(folder, "comparison")) for end in ("json", "npz")]
    found = damage.damaged_more([*answer, *campaign(tmp_path / "night")], len(damage.DAMAGES), 3)
    for name, count in found.items():
        assert set(count) <= set(damage.GOOD), (name, count)
    assert found["campaign: plan.json"]["told"] > 5
    assert found["campaign: records/KEY.json"]["passed over"] > 5


def test_what_is_not_damaged_again_stays_in_the_table() -> None:
    before = damage.table({n: damage.row(n, Counter(told=40)) for n in ("fit.json", "run.toml")}, 40, 0)
    rows = damage.merged({"run.toml": Counter(told=499, nothing=1)}, before)
    assert rows == {
        "fit.json": "| fit.json | 40 | 40 | 0 | 0 | 0 | 0 |",
        "run.toml": "| run.toml | 500 | 499 | 0 | 0 | 0 | 1 |",
    }

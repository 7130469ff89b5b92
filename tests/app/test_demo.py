"""The demonstration is a list of verbs, and its page is made of what they left in its folder."""

from __future__ import annotations

import json
import pickle
from functools import partial
from pathlib import Path

import pytest

from bayesmembrane.app import demo
from bayesmembrane.app.analyses import Work
from bayesmembrane.app.folders import lying
from bayesmembrane.ground.jobs import workers
from bayesmembrane.ground.registry import material, ordinary_materials
from bayesmembrane.report.page import TWIN


def test_the_verbs_can_be_sent_to_other_processes() -> None:
    for some in demo.verbs():
        assert pickle.loads(pickle.dumps(some)).keys() == some.keys()
    runs, loops, valleys = demo.verbs()
    assert "reconstruct" in runs
    assert set(ordinary_materials()) == {label.partition(",")[0] for label in runs} - {"reconstruct"}
    assert next(iter(loops)).endswith(demo.LONGEST)
    largest = max(ordinary_materials().values(), key=lambda kind: len(kind.field_names())).name
    assert next(iter(runs)) == f"{largest}, {demo.RANGES[-1]}"  # all that is compared waits for it
    assert (len(loops), len(valleys)) == (len(demo.LOOPS), len(demo.VALLEYS))


@pytest.mark.usefixtures("short_walks")
def test_a_short_demonstration_and_its_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One material on both ranges, fitted, sampled, followed and compared; the page alone from the folder."""
    one = "neo_hookean"
    monkeypatch.setattr(demo, "ordinary_materials", lambda: {one: material(one)})
    first = {f"{one}, {where}": partial(demo.calibrate, one, where) for where in demo.RANGES}
    monkeypatch.setattr(demo, "workers", partial(workers, count=1))  # a fresh process takes longer than its work here
    monkeypatch.setattr(demo, "verbs", lambda: (first, {}, {"valleys": partial(demo.follow_valleys, one)}))
    told: set[str] = set()
    work = Work(0, tmp_path / "chains", 100.0, lambda label, now: told.add(label))
    answer = demo.demo(tmp_path / "page", work)
    assert {*first, "valleys"} <= told
    assert Path(answer["report"]).is_file()
    assert [Path(run).is_dir() for run in answer["runs"]] == [True, True]
    kinds = [each.kind for each in lying([tmp_path / "chains"])]
    assert sorted(kinds) == ["beside_paper"] * 2 + ["comparison"] + ["fit"] * 2 + ["run"] * 2 + ["valleys"]
    page = json.loads((tmp_path / "page" / TWIN).read_text(encoding="utf-8"))
    assert page["title"] == demo.TITLE
    rows = page["tables"]["losses"]
    assert len(rows) == 2

"""Plans: complete, with seeds from content, so that what is added changes nothing else."""

from pathlib import Path

import pytest

from bayesmembrane.campaign.file import read_campaign
from bayesmembrane.campaign.plan import Plan, read_plan, write_plan
from bayesmembrane.campaign.planning import plan
from bayesmembrane.campaign.task import READ, Task
from bayesmembrane.ground.errors import SettingsError, StorageError
from tests.campaign.films import write_campaign, write_film

ALL = 'wanted = ["sample", "compare", "diagnose", "valleys", "loop"]'


def made(file: Path) -> Plan:
    return plan(read_campaign(file), file)


def by_key(found: Plan) -> dict[str, Task]:
    return {task.key: task for task in found.tasks}


def test_every_combination_is_asked_once(tmp_path: Path) -> None:
    hypotheses = (
        'materials = ["neo_hookean", "yeoh"]\neffects = ["", "force_offset"]\nnoise = ["white", "ar1"]\n'
        'convexity = ["reached"]\nmax_deflection_mm = ["all", 800]'
    )
    found = made(write_campaign(tmp_path, hypotheses=hypotheses, analyses=ALL))
    count = {a: sum(t.analysis == a for t in found.tasks) for a in ("sample", "compare", "valleys", "diagnose", "loop")}
    assert count == {"sample": 32, "compare": 4, "valleys": 32, "diagnose": 4, "loop": 4}
    assert len(by_key(found)) == len(found.tasks)
    samples = {t.key for t in found.tasks if t.analysis == "sample"}
    compares = [t for t in found.tasks if t.analysis == "compare"]
    assert all(set(t.needs) <= samples and len(t.needs) == 8 for t in compares)


def test_adding_a_hypothesis_or_a_film_changes_no_other_run(tmp_path: Path) -> None:
    few = by_key(made(write_campaign(tmp_path)))
    hypotheses = 'materials = ["yeoh", "neo_hookean"]\nconvexity = ["none", "box", "reached"]'
    more = by_key(made(write_campaign(tmp_path, films=("0", "a", "b"), hypotheses=hypotheses)))
    assert all(more[key] == task for key, task in few.items())
    assert len(more) > len(few)


def test_the_frame_of_a_blank_run_is_in_every_hypothesis_named_or_not(tmp_path: Path) -> None:
    (tmp_path / "ring.csv").write_text("deflection_mm,force_N\n5,0.1\n10,0.5\n20,2\n30,4\n")
    (tmp_path / "frame.csv").write_text("deflection_mm,force_N\n0,0\n0.05,1\n0.1,2\n0.2,4\n")
    (tmp_path / "ring.toml").write_text(
        "[specimen]\nthickness_um = 50\n[rig]\nkind = 'annulus'\ninner_radius_mm = 10\nouter_radius_mm = 35\n"
        "[measurement]\nblank_run = 'frame.csv'\n"
    )
    effects = ["", "machine_compliance", "force_offset", "machine_compliance+force_offset"]
    hypotheses = f'materials = ["neo_hookean"]\neffects = {effects}'
    asked = {"hypotheses": hypotheses, "analyses": ALL, "measurements": 'curves = ["ring.csv"]'}
    tasks = made(write_campaign(tmp_path, **asked)).tasks
    assert not [t.fault for t in tasks if t.fault]
    assert [t.claims[0]["effects"] for t in tasks if t.analysis == "sample"] == [[], ["force_offset"]]
    (compared,) = (t for t in tasks if t.analysis == "compare")
    assert [c["effects"] for c in compared.claims] == [[], ["force_offset"]]


def test_seeds_follow_from_the_seed_of_the_campaign_and_the_data(tmp_path: Path) -> None:
    file = write_campaign(tmp_path)
    first, again = made(file), made(file)
    other = plan(read_campaign(file), file, seed=5)
    assert first == again
    assert {t.seed for t in first.tasks}.isdisjoint(t.seed for t in other.tasks)
    assert len({(t.data, t.seed) for t in first.tasks}) == len({t.data for t in first.tasks}) == 2


def test_a_file_that_cannot_be_read_is_refused_and_the_others_are_not(tmp_path: Path) -> None:
    file = write_campaign(tmp_path)
    write_film(tmp_path / "films", "bad").write_text("stretch,nominal_stress_MPa\n1.1,x\n")
    found = made(file)
    (refused,) = (t for t in found.tasks if t.fault)
    assert refused.analysis == READ
    assert "bad.csv" in refused.fault
    assert sum(not t.fault for t in found.tasks) == 4


def test_a_range_that_leaves_nothing_is_refused(tmp_path: Path) -> None:
    hypotheses = 'materials = ["neo_hookean"]\nmax_deflection_mm = ["all", 1e-3]'
    found = made(write_campaign(tmp_path, hypotheses=hypotheses))
    assert sum(bool(t.fault) for t in found.tasks) == 2
    assert sum(not t.fault for t in found.tasks) == 2


def test_a_pattern_that_means_nothing_is_told(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="nothing\\*"):
        made(write_campaign(tmp_path, measurements='curves = ["nothing*.csv"]'))


def test_brackets_in_a_name_mean_themselves(tmp_path: Path) -> None:
    write_film(tmp_path / "films", "film [1]")
    found = made(write_campaign(tmp_path, measurements='curves = ["films/film [1].csv"]'))
    assert {Path(t.curve).name for t in found.tasks} == {"film [1].csv"}


def test_a_stored_plan_is_the_same(tmp_path: Path) -> None:
    found = made(write_campaign(tmp_path, analyses=ALL))
    write_plan(tmp_path / "night", found)
    assert read_plan(tmp_path / "night") == found


def test_a_damaged_plan_and_a_foreign_folder_are_told(tmp_path: Path) -> None:
    found = made(write_campaign(tmp_path))
    with pytest.raises(StorageError, match="no campaign"):
        write_plan(tmp_path, found)
    write_plan(tmp_path / "night", found)
    for text in ("", "{", "[]", '{"tasks": 3}', '{"tasks": [{"what": 1}]}'):
        (tmp_path / "night" / "plan.json").write_text(text)
        with pytest.raises(StorageError, match="damaged"):
            read_plan(tmp_path / "night")
    with pytest.raises(StorageError, match="no campaign"):
        read_plan(tmp_path)

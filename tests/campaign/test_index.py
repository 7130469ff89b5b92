"""The index says what plan and records say, whatever happens to it, and the page shows that."""

import json
import re
import sqlite3
from pathlib import Path

import pytest

from bayesmembrane.campaign.drive import Session, drive
from bayesmembrane.campaign.file import read_campaign
from bayesmembrane.campaign.index import INDEX, opened, rebuild
from bayesmembrane.campaign.page import write_morning_page
from bayesmembrane.campaign.plan import Plan, write_plan
from bayesmembrane.campaign.planning import plan
from bayesmembrane.campaign.pool import LocalPool
from bayesmembrane.campaign.record import DONE, FAILED, REFUSED, WAITING, Record, read_records, write_now, write_record
from bayesmembrane.campaign.status import standing
from bayesmembrane.ground.errors import StorageError
from tests.campaign.doing import sampled
from tests.campaign.films import planned, write_campaign

ALL = 'wanted = ["sample", "compare", "diagnose"]\npages = false'


def recorded(campaign: Path, made: Plan) -> None:
    """A record for every task: two went wrong, one walked too short."""
    rows = [{"log_evidence": {"nested": -3.0 - i}, "log_evidence_sd": {"nested": 0.1}, "agreed": True,
             "probability": 0.5, "reason": ""} for i in range(2)]  # fmt: skip
    for i, task in enumerate(t for t in made.tasks if not t.fault):
        found = {
            "sample": sampled(task) | {"converged": i != 2, "failed": 0.05 if i == 3 else 0.0},
            "compare": {"rows": rows, "agreed": True, "sentence": ""},
            "diagnose": {"verdict": "adequate", "sentence": "It fits <well>.", "effects": [], "material": ""},
        }[task.analysis]
        state, reason = [(FAILED, "OSError: <disk> & co"), (REFUSED, "no such film")][i] if i < 2 else (DONE, "")
        write_record(campaign, Record(task.key, state, reason, "", found if state == DONE else {}, "films/x"))


@pytest.fixture
def night(tmp_path: Path) -> tuple[Path, Plan]:
    file = write_campaign(tmp_path, analyses=ALL, films=("a", "b", "c"))
    made = plan(read_campaign(file), file)
    write_plan(tmp_path / "night", made)
    recorded(tmp_path / "night", made)
    return tmp_path / "night", made


def rows_of(campaign: Path) -> list[object]:
    with opened(campaign) as index:
        return [index.counts(), index.reasons(), index.sampled(), [*index.entries()]]


def test_a_removed_or_damaged_index_is_made_again_the_same(night: tuple[Path, Plan]) -> None:
    campaign, _ = night
    before = rows_of(campaign)
    whole = (campaign / INDEX).read_bytes()
    odd = whole.replace(b"CREATE TABLE tasks", b"CR\xbbATE TABLE tasks")
    assert odd != whole
    for damage in (b"", b"SQLite format 3\0 and nothing", whole[: len(whole) // 2], whole[:100] + b"\0" * 400, odd):
        (campaign / INDEX).write_bytes(damage)
        assert rows_of(campaign) == before
    (campaign / INDEX).unlink()
    assert rows_of(campaign) == before


def test_an_index_behind_its_records_is_made_again(night: tuple[Path, Plan]) -> None:
    campaign, made = night
    assert standing(campaign).total[FAILED] == 1
    (failed,) = (r for r in read_records(campaign).values() if r.state == FAILED)
    write_record(campaign, Record(failed.key, DONE, found=sampled(made.tasks[0])))
    assert standing(campaign).total[FAILED] == 0


def test_notes_of_a_client_equal_what_is_made_from_the_records(tmp_path: Path) -> None:
    from tests.campaign.doing import faulty

    campaign, made = planned(tmp_path, 6)
    drive(campaign, made, lambda: LocalPool(1), Session(faulty))
    noted = rows_of(campaign)
    rebuild(campaign, made)
    assert rows_of(campaign) == noted


def test_a_damaged_record_makes_its_task_wait_again(night: tuple[Path, Plan]) -> None:
    campaign, made = night
    path = campaign / "records" / f"{made.tasks[-1].key}.json"
    for text in ("", "{", "[1]", '{"key": "x"}', '{"key": 1, "state": "odd"}'):
        path.write_text(text)
        rebuild(campaign, made)
        assert standing(campaign).total[WAITING] == 1


def test_status_counts_what_runs_and_forgets_who_died(night: tuple[Path, Plan]) -> None:
    campaign, made = night
    (campaign / "records" / f"{made.tasks[-1].key}.json").unlink()
    write_now(campaign, made.tasks[-1].key, {"doing": "sampling", "ess": 30.0, "wanted": 50.0, "tau": 3.0})
    found = standing(campaign)
    assert (found.total["running"], found.total[WAITING]) == (1, 0)
    assert (found.running[0].ess, found.running[0].tau) == (30.0, 3.0)
    note = campaign / "now" / f"{made.tasks[-1].key}.json"
    note.write_text(re.sub(r':\d+"', ':999999999"', note.read_text()))
    assert standing(campaign).total[WAITING] == 1
    json.dumps(found.document())


def test_a_folder_without_a_campaign_is_told(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="no campaign"):
        standing(tmp_path)


def test_an_index_of_another_version_is_replaced(night: tuple[Path, Plan]) -> None:
    campaign, _ = night
    before = rows_of(campaign)
    with sqlite3.connect(campaign / INDEX) as connection:
        connection.execute("PRAGMA user_version = 99")
        connection.execute("DELETE FROM tasks")
    connection.close()
    assert rows_of(campaign) == before


# ---- the page --------------------------------------------------------------------------------------------------------


def test_the_page_has_a_row_for_every_hypothesis_on_every_measurement(night: tuple[Path, Plan]) -> None:
    campaign, _ = night
    page = write_morning_page(campaign)
    text, twin = page.read_text(), json.loads(page.with_name("report.json").read_text())
    assert len(twin["rows"]) == 6 == text.count("<tr data-state=")
    assert sorted(row["state"] for row in twin["rows"]) == ["done"] * 4 + ["failed", "refused"]
    assert all(row["log_evidence"] is not None and row["verdict"] == "adequate" for row in twin["rows"])
    assert "OSError: &lt;disk&gt; &amp; co" in text
    assert "1 of 4 runs ended before they converged" in text
    assert "In 1 runs more than 1 % of the proposals could not be solved" in text
    assert text.index("What is missing, and why") < text.index("<table")
    assert 'href="../films/x"' in text


def test_the_page_can_lie_elsewhere_and_is_never_written_over_anything_else(
    night: tuple[Path, Plan], tmp_path: Path
) -> None:
    campaign, _ = night
    page = write_morning_page(campaign, tmp_path / "there" / "page")
    assert write_morning_page(campaign, tmp_path / "there" / "page") == page
    link = re.findall(r'href="([^"]+)/films/x"', page.read_text())[0]
    assert (page.parent / link).resolve() == campaign.resolve()
    page.write_text("mine")
    with pytest.raises(StorageError, match="no report of ours"):
        write_morning_page(campaign, page.parent)


def test_a_campaign_of_one_run_and_one_that_has_not_begun_have_a_page(tmp_path: Path) -> None:
    campaign, made = planned(tmp_path, 1)
    assert "1 waiting" in write_morning_page(campaign).read_text()
    write_record(campaign, Record(made.tasks[0].key, DONE, found=sampled(made.tasks[0])))
    assert "1 done" in write_morning_page(campaign).read_text()

"""Driving: whatever dies, every task comes to its end once, and with the answer that it has when nothing dies."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest

from bayesmembrane.campaign.drive import DEADLINE, FINISHED, INTERRUPTED, Ended, Session, drive, next_time
from bayesmembrane.campaign.interrupt import until
from bayesmembrane.campaign.plan import Plan, write_plan
from bayesmembrane.campaign.pool import DEATHS, LocalPool, WorkerDiedError
from bayesmembrane.campaign.record import DONE, FAILED, PREEMPTED, REFUSED, WAITING, read_now, read_records
from bayesmembrane.campaign.status import standing
from bayesmembrane.campaign.work import Perform
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.locks import held, is_held
from tests.campaign.doing import deadly, deadly_once, deaf, faulty, quick, slow, suicide
from tests.campaign.films import planned

ROOT = Path(__file__).resolve().parents[2]


def driven(campaign: Path, plan: Plan, perform: Perform, workers: int = 2) -> Ended:
    return drive(campaign, plan, lambda: LocalPool(workers), Session(perform))


def answers(campaign: Path) -> dict[str, str]:
    """What was found, by key, as text: equal to the last bit or not."""
    return {key: json.dumps(dict(r.found)) for key, r in read_records(campaign).items()}


def test_the_answers_do_not_depend_on_the_number_of_workers(tmp_path: Path) -> None:
    one, plan = planned(tmp_path / "1", 6)
    ended = driven(one, plan, quick, 1)
    assert (ended.how, ended.states) == (FINISHED, {DONE: 6})
    three = tmp_path / "3"
    write_plan(three, plan)
    driven(three, plan, quick, 3)
    assert len(answers(one)) == 6
    assert answers(one) == answers(three)


def test_what_is_done_is_not_done_again(tmp_path: Path) -> None:
    campaign, plan = planned(tmp_path, 3)
    driven(campaign, plan, quick)
    before = {p: p.stat().st_mtime_ns for p in (campaign / "records").iterdir()}
    assert driven(campaign, plan, deadly).states == {DONE: 3}
    assert {p: p.stat().st_mtime_ns for p in (campaign / "records").iterdir()} == before


def test_a_worker_that_dies_costs_an_attempt_and_nothing_else(tmp_path: Path) -> None:
    calm, plan = planned(tmp_path / "calm", 4)
    driven(calm, plan, quick)
    shot = tmp_path / "shot"
    write_plan(shot, plan)
    assert driven(shot, plan, deadly_once).states == {DONE: 4}
    assert answers(shot) == answers(calm)


def test_what_kills_every_worker_fails_alone(tmp_path: Path) -> None:
    campaign, plan = planned(tmp_path, 4)
    ended = driven(campaign, plan, deadly)
    assert ended.states == {DONE: 2, FAILED: 2}
    assert all(f"{DEATHS} workers died" in r.reason for r in read_records(campaign).values() if r.state == FAILED)


def test_faults_are_recorded_and_only_what_resuming_may_mend_is_tried_again(tmp_path: Path) -> None:
    campaign, plan = planned(tmp_path, 6)
    assert driven(campaign, plan, faulty).states == {DONE: 2, FAILED: 2, REFUSED: 2}
    records = read_records(campaign)
    assert all("ZeroDivisionError: nobody" in r.reason and "faulty" in r.trace for r in records.values() if r.trace)
    assert {reason for _, reason, _ in standing(campaign).reasons} == {
        "this film cannot be; choose another.",
        "ZeroDivisionError: nobody foresaw this",
    }
    assert driven(campaign, plan, quick).states == {DONE: 4, REFUSED: 2}


def test_what_needs_others_waits_for_them(tmp_path: Path) -> None:
    campaign, plan = planned(tmp_path, 3)
    first, second, third = plan.tasks
    tasks = (replace(first, needs=(second.key,)), replace(second, needs=(third.key,)), third)
    driven(campaign, replace(plan, tasks=tasks), quick)
    when = {key: (campaign / "records" / f"{key}.json").stat().st_mtime_ns for key in (t.key for t in tasks)}
    assert when[third.key] < when[second.key] < when[first.key]


def test_what_needs_something_that_failed_waits_on(tmp_path: Path) -> None:
    campaign, plan = planned(tmp_path, 2)
    odd = next(t for t in plan.tasks if t.seed % 2)
    even = next(t for t in plan.tasks if not t.seed % 2)
    ended = driven(campaign, replace(plan, tasks=(odd, replace(even, needs=(odd.key,)))), deadly)
    assert ended.states == {FAILED: 1, WAITING: 1}


# ---- stopping --------------------------------------------------------------------------------------------------------


def test_a_deadline_stops_and_resuming_goes_on_to_the_same_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign, plan = planned(tmp_path, 6)
    began = time.time()
    monkeypatch.setattr("bayesmembrane.campaign.drive.next_time", lambda clock: began + 3.0)
    ended = drive(campaign, plan, lambda: LocalPool(2), Session(slow, deadline="07:30"))
    assert ended.how == DEADLINE
    assert ended.states[DONE] + ended.states.get(PREEMPTED, 0) + ended.states.get(WAITING, 0) == 6
    assert ended.states[DONE] < 6
    assert ended.states.get(PREEMPTED, 0) <= 2, "what had not begun waits on"
    assert not read_now(campaign)
    assert driven(campaign, plan, slow).states == {DONE: 6}
    calm, _ = planned(tmp_path / "calm", 6)
    driven(calm, plan, quick)
    assert answers(campaign) == answers(calm)


def test_work_that_hears_nothing_is_ended_after_the_deadline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Or this test would take an hour."""
    campaign, plan = planned(tmp_path, 3)
    monkeypatch.setattr("bayesmembrane.campaign.drive.GRACE", 1.0)
    monkeypatch.setattr("bayesmembrane.campaign.drive.next_time", lambda clock: time.time() + 3.0)
    ended = drive(campaign, plan, lambda: LocalPool(2), Session(deaf, deadline="07:30"))
    assert ended.how == DEADLINE
    assert set(ended.states) <= {PREEMPTED, WAITING}
    assert driven(campaign, plan, quick).states == {DONE: 3}


def test_the_next_time_of_a_clock_is_today_or_tomorrow() -> None:
    evening = datetime(2026, 3, 1, 18, 0)
    assert datetime.fromtimestamp(next_time("07:30", evening)) == datetime(2026, 3, 2, 7, 30)
    assert datetime.fromtimestamp(next_time("18:00:05", evening)) == datetime(2026, 3, 1, 18, 0, 5)
    assert datetime.fromtimestamp(next_time("18:00", evening)) == datetime(2026, 3, 2, 18, 0)


SCRIPT = """
import sys
from pathlib import Path
from bayesmembrane.campaign.drive import Session, drive
from bayesmembrane.campaign.plan import read_plan
from bayesmembrane.campaign.pool import LocalPool
from tests.campaign import doing

if __name__ == "__main__":
    import signal
    signal.signal(signal.SIGINT, signal.default_int_handler)
    folder = Path(sys.argv[1])
    ended = drive(folder, read_plan(folder), lambda: LocalPool(2), Session(doing.slow))
    print(ended.how)
"""


def process(campaign: Path) -> subprocess.Popen[str]:
    script = campaign.parent / "client.py"
    script.write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, str(script), str(campaign)], env=environment, stdout=subprocess.PIPE, text=True
    )


def wait_for(what: Callable[[], bool], seconds: float = 120.0) -> None:
    until_then = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < until_then, "it never came"
        time.sleep(0.02)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_makes_the_tasks_stop_and_the_client_say_so(tmp_path: Path, number: int) -> None:
    campaign, _ = planned(tmp_path, 8)
    client = process(campaign)
    wait_for(lambda: len(read_now(campaign)) == 2)
    client.send_signal(number)
    out, _ = client.communicate(timeout=120)
    assert out.strip() == INTERRUPTED
    assert standing(campaign).total[DONE] < 8
    assert not is_held(campaign / "owner.lock")


def test_a_killed_client_takes_its_workers_with_it_and_resuming_gives_the_same_answers(tmp_path: Path) -> None:
    campaign, plan = planned(tmp_path, 8)
    for _ in range(2):
        client = process(campaign)
        wait_for(lambda: len(read_now(campaign)) == 2)
        pids = {int(n["worker"].rpartition(":")[2]) for n in read_now(campaign).values()}
        client.kill()
        client.communicate(timeout=60)
        wait_for(lambda pids=pids: not any(_runs(pid) for pid in pids))  # type: ignore[misc]
    assert standing(campaign).active is False
    assert driven(campaign, plan, slow).states == {DONE: 8}
    calm, _ = planned(tmp_path / "calm", 8)
    driven(calm, plan, quick)
    assert answers(campaign) == answers(calm)
    ends = {p.stem: p.read_text() for p in (campaign / "films").glob("*.ends")}
    assert ends == {t.key: "x" for t in plan.tasks}


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split(")")[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_two_clients_on_one_campaign_are_told(tmp_path: Path) -> None:
    campaign, plan = planned(tmp_path, 1)
    with held(campaign / "owner.lock"), pytest.raises(StorageError, match="another process"):
        driven(campaign, plan, quick)
    assert driven(campaign, plan, quick).states == {DONE: 1}


# ---- what it is made of ----------------------------------------------------------------------------------------------


def test_a_thread_is_interrupted_as_by_ctrl_c() -> None:
    caught: list[str] = []
    due = threading.Event()

    def endless() -> str:
        try:
            due.set()
            while True:
                time.sleep(0.01)
        except KeyboardInterrupt:
            return "stored"

    def inside() -> None:
        caught.append(until(due.is_set, endless, every=0.01))

    thread = threading.Thread(target=inside)
    thread.start()
    thread.join(timeout=60)
    assert caught == ["stored"]


def test_work_that_ends_by_itself_is_not_interrupted() -> None:
    assert until(lambda: False, lambda: 3, every=0.01) == 3
    with pytest.raises(ZeroDivisionError):
        until(lambda: False, lambda: 1 // 0, every=0.01)


def test_a_lock_has_one_owner_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with held(path) as ours:
        assert ours
        assert is_held(path)
        with held(path) as second:
            assert not second
    assert not is_held(path)
    with held(path) as again:
        assert again


def test_a_pool_goes_on_after_what_killed_its_worker_each_time() -> None:
    pool = LocalPool(1)
    with pytest.raises(WorkerDiedError, match="-9"):
        pool.submit(suicide).result(timeout=300)
    assert pool.submit(len, "abc").result(timeout=300) == 3
    pool.close()

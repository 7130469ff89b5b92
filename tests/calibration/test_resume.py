"""A run that is stopped anywhere ends as if it had not been; one that would not go on alike is refused, and why."""

import json
import os
import shutil
import signal
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration import run as run_module
from bayesmembrane.calibration import store as store_module
from bayesmembrane.calibration.posterior import Evaluation, Outcome, Outcomes, Posterior
from bayesmembrane.calibration.run import Run, RunSettings, load_run, sample
from bayesmembrane.calibration.sampling import walk
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.proposals import learned, mixture
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.calibration.store import differences
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import SettingsError, StorageError
from bayesmembrane.ground.locks import alone
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.words.sampling import sentences

CLAIM = hypothesis("neo_hookean")
FEW = Settings(ess=1e6, walkers=8, chunk=30, most_steps=70, sampler="emcee")  # over lessons at 22 and 44


def strip(shift: float = 0.0) -> Measurement:
    """A rubber band: no solver, so that a step takes a millisecond."""
    stretch = np.linspace(1.1, 2.5, 12)
    force = 0.3 * (stretch - stretch**-2) + shift + 2e-3 * np.random.default_rng(31).standard_normal(12)
    return Measurement(stretch, force, Uniaxial(), Specimen("band", 5e-4))


class KilledError(Exception):
    """Stands for the end of the process: nothing of the program handles it."""


class Dying:
    """Lets ``fatal`` calls of an evaluation pass, and none after."""

    def __init__(self, fatal: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.left, self.evaluate = fatal, Posterior.evaluate
        monkeypatch.setattr(Posterior, "evaluate", lambda posterior, x: self(posterior, x))

    def __call__(self, posterior: Posterior, x: np.ndarray) -> object:
        self.left -= 1
        if self.left < 0:
            raise KilledError
        return self.evaluate(posterior, x)


@pytest.fixture(scope="module", autouse=True)
def _cheap_lessons_and_many_segments() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(walk, "SAVE_AFTER", 0.02)
        patch.setattr(learned, "FIRST_LESSON", 22)
        patch.setattr(mixture, "COUNTS", (1,))
        yield


@pytest.fixture(scope="module")
def whole(_cheap_lessons_and_many_segments: None, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Never stopped."""
    return sample(strip(), CLAIM, how(tmp_path_factory.mktemp("whole")))


def how(out: Path, settings: Settings = FEW, **more: object) -> RunSettings:
    return RunSettings(3, out, settings=settings, predictions=False, **more)  # type: ignore[arg-type]


def alike(one: Run, other: Run) -> None:
    """All draws and all numbers, but for the time that it took."""
    assert one.path is not None
    assert other.path is not None
    a, b = Segments(one.path).read(), Segments(other.path).read()
    assert a is not None
    assert b is not None
    assert np.array_equal(a.x, b.x)
    assert np.array_equal(a.log_posterior, b.log_posterior)
    assert a.counts == b.counts
    assert a.counts.examples == b.counts.examples  # type: ignore[attr-defined]
    assert a.lessons == b.lessons
    assert {**one.status, "seconds": 0} == {**other.status, "seconds": 0}
    for group in one.data.groups():
        for name, values in one.data[group].data_vars.items():
            assert np.array_equal(values.values, other.data[group][name].values, equal_nan=True), (group, name)


@pytest.mark.parametrize("killed_at", [80, *(pytest.param(step, marks=pytest.mark.study) for step in (120, 170))])
def test_killed_and_continued_is_never_killed(
    whole: Run, killed_at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within the walk, at lessons and after them, also twice; learned proposals and generators included."""
    for fatal in (killed_at, 12):
        with monkeypatch.context() as patch:
            Dying(fatal, patch)
            with pytest.raises(KilledError):
                sample(strip(), CLAIM, how(tmp_path))
    done = sample(strip(), CLAIM, how(tmp_path))
    assert done.finished
    alike(done, whole)
    alike(load_run(done.path), load_run(whole.path))  # type: ignore[arg-type]


@pytest.mark.parametrize("steps", [1, 22, *(pytest.param(step, marks=pytest.mark.study) for step in (21, 51))])
def test_stopped_and_continued_is_never_stopped(whole: Run, steps: int, tmp_path: Path) -> None:
    left = iter(range(steps))
    partial = sample(strip(), CLAIM, how(tmp_path), stop=lambda: next(left, None) is None)
    assert partial.interrupted
    assert not partial.finished
    assert partial.status["steps"] == steps + 1  # the starts count
    assert load_run(partial.path).interrupted  # type: ignore[arg-type]
    alike(sample(strip(), CLAIM, how(tmp_path)), whole)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_walk_after_its_step_and_everything_is_stored(
    whole: Run, number: int, tmp_path: Path
) -> None:
    def stop() -> bool:
        segments = list(tmp_path.glob("*/segments/*.seg"))
        if len(segments) > 2:
            os.kill(os.getpid(), number)
        return False

    partial = sample(strip(), CLAIM, how(tmp_path), stop=stop)
    assert partial.interrupted
    assert partial.path is not None
    walked = Segments(partial.path).read()
    assert walked is not None
    assert walked.steps == partial.status["steps"]
    alike(sample(strip(), CLAIM, how(tmp_path)), whole)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.study), signal.SIGTERM])
def test_a_signal_as_soon_as_the_starts_are_kept_leaves_a_stored_run(
    whole: Run, number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = Segments.write

    def signalled(segments: Segments, part: Chains) -> None:
        write(segments, part)
        os.kill(os.getpid(), number)

    with monkeypatch.context() as patch:
        patch.setattr(Segments, "write", signalled)
        partial = sample(strip(), CLAIM, how(tmp_path))
    assert partial.interrupted
    assert partial.path is not None
    assert load_run(partial.path).status["steps"] == 1  # the starts
    alike(sample(strip(), CLAIM, how(tmp_path)), whole)


def test_in_a_thread_only_the_callable_stops(tmp_path: Path) -> None:
    found: list[Run] = []
    thread = threading.Thread(target=lambda: found.append(sample(strip(), CLAIM, how(tmp_path), stop=lambda: True)))
    thread.start()
    thread.join()
    assert found[0].interrupted


def test_more_draws_go_on_from_fewer_and_leave_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By name in the same folder, else in a new one beside; as far as both go they are the same walk."""
    short, long = replace(FEW, most_steps=30), FEW
    first = sample(strip(), CLAIM, how(tmp_path, short))
    before = load_run(first.path)  # type: ignore[arg-type]
    with monkeypatch.context() as patch:
        patch.setattr(walk, "try_points", None)
        more = sample(strip(), CLAIM, how(tmp_path, long))
    assert more.path != first.path
    assert more.status["steps"] == 70
    alike(load_run(first.path), before)  # type: ignore[arg-type]
    named = sample(strip(), CLAIM, how(tmp_path, short, name="named"))
    again = sample(strip(), CLAIM, how(tmp_path, long, name="named"))
    assert again.path == named.path
    alike(again, more)
    assert sample(strip(), CLAIM, how(tmp_path, short, name="named")).status == again.status, "it has them already"
    direct = sample(strip(), CLAIM, how(tmp_path / "direct", long))
    a, b = (Segments(run.path).read() for run in (again, direct))  # type: ignore[arg-type]
    assert a is not None
    assert b is not None
    assert np.array_equal(a.x, b.x)


def test_who_is_killed_while_it_takes_over_a_shorter_run_takes_the_rest_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing of the shorter run is walked again."""
    with monkeypatch.context() as patch:
        patch.setattr(walk, "SAVE_AFTER", 0.0)
        first = sample(strip(), CLAIM, how(tmp_path, replace(FEW, most_steps=30)))
    write, left = Segments.write, iter(range(7))

    def some(segments: Segments, part: Chains) -> None:
        if next(left, None) is None:
            raise KilledError
        write(segments, part)

    with monkeypatch.context() as patch:
        patch.setattr(Segments, "write", some)
        with pytest.raises(KilledError):
            sample(strip(), CLAIM, how(tmp_path))
    (begun,) = (p.parent for p in tmp_path.glob("*/segments") if p.parent != first.path)
    assert (Segments(begun).steps, Segments(first.path).steps) == (7, 30)  # type: ignore[arg-type]
    with monkeypatch.context() as patch:
        patch.setattr(walk, "try_points", None)
        patch.setattr(walk, "begun", None)
        more = sample(strip(), CLAIM, how(tmp_path))
    assert more.path == begun
    alike(more, sample(strip(), CLAIM, how(tmp_path / "direct")))


def test_what_differs_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left = iter(range(20))
    partial = sample(strip(), CLAIM, how(tmp_path, name="run"), stop=lambda: next(left, None) is None)

    def refused(says: str, measurement: Measurement | None = None, **more: object) -> None:
        measurement = measurement or strip()
        with pytest.raises(StorageError, match=says) as fault:
            sample(measurement, CLAIM, replace(how(tmp_path, name="run"), **more))  # type: ignore[arg-type]
        assert f"--fork {partial.path}" in str(fault.value)

    refused("another run: seed 3 there, 4 asked", seed=4)
    refused(r"another run: data\.sha256 [0-9a-f]{12}\.\.\. there", strip(1e-3))
    refused(r"sampling\.walkers 8 there, 16 asked", settings=replace(FEW, walkers=16))
    with monkeypatch.context() as patch:
        patch.setattr(store_module, "code_of", lambda *_: "0" * 64)
        refused(r"code\.sha256 [0-9a-f]{12}\.\.\. there, 0{12}\.\.\. asked")
    with monkeypatch.context() as patch:
        patch.setattr(store_module, "_version", lambda package: "0.0")
        refused(r"other versions .* versions\.numpy .* there, 0\.0 asked")
    with monkeypatch.context() as patch:
        evaluate = Posterior.evaluate

        def other(posterior: Posterior, x: np.ndarray) -> object:
            found = evaluate(posterior, x)
            return replace(found, log_prior=found.log_prior + 0.01)

        patch.setattr(Posterior, "evaluate", other)
        refused("ln p of a stored point was .* and is now")
    assert sample(strip(), CLAIM, how(tmp_path, name="run")).finished


def test_hypotheses_that_differ_are_told_by_their_part() -> None:
    asked = store_module.describe(strip(), CLAIM, FEW, 0)
    other = store_module.describe(strip(), hypothesis("neo_hookean", noise="ar1_readings"), FEW, 0)
    assert any(d.startswith("hypothesis.noise") for d in differences(asked, other))
    assert differences(asked, asked) == []


def test_a_fork_begins_where_the_old_run_ended(whole: Run, tmp_path: Path) -> None:
    """With other data, too; where the old ends are impossible other draws stand in, and else it is refused."""
    assert whole.path is not None
    old = Segments(whole.path).read()
    assert old is not None
    other = strip(1e-3)
    run = sample(other, CLAIM, how(tmp_path, fork=whole.path))
    assert run.path is not None
    new = Segments(run.path).read()
    assert new is not None
    assert np.array_equal(np.unique(new.x[:, 0].reshape(-1, 2)), np.unique(old.x[:, -1].reshape(-1, 2)))
    assert run.settings["forked"]["run"] == whole.name
    assert run.settings["data"]["sha256"] == other.data_hash
    with pytest.raises(StorageError, match="the coordinates"):
        sample(other, hypothesis("mooney_rivlin"), how(tmp_path, fork=whole.path))
    with pytest.raises(StorageError, match="no run to begin"):
        sample(other, CLAIM, how(tmp_path, fork=tmp_path / "nothing"))
    fewer = replace(FEW, walkers=2000)
    with pytest.raises(SettingsError, match="are possible now"):
        sample(other, CLAIM, how(tmp_path, fewer, fork=whole.path))


def test_two_at_once_are_told_apart_and_a_dead_owner_holds_nothing(tmp_path: Path) -> None:
    left = iter(range(20))
    partial = sample(strip(), CLAIM, how(tmp_path), stop=lambda: next(left, None) is None)
    assert partial.path is not None
    lock = partial.path / "segments" / "lock"
    with alone(lock, "this run"), pytest.raises(StorageError, match=f"another process .{os.getpid()} on .*this run"):
        sample(strip(), CLAIM, how(tmp_path))
    assert lock.exists()
    assert sample(strip(), CLAIM, how(tmp_path)).finished


def test_a_disk_that_is_full_loses_nothing(whole: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write, left = Segments.write, iter(range(3))

    def full(segments: Segments, part: object) -> None:
        if next(left, None) is None:
            raise StorageError("a segment of the run cannot be written (No space left on device)")
        write(segments, part)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(Segments, "write", full)
        with pytest.raises(StorageError, match="No space left"):
            sample(strip(), CLAIM, how(tmp_path))
    assert len(list(tmp_path.glob("*/segments/*.seg"))) == 3
    alike(sample(strip(), CLAIM, how(tmp_path)), whole)


Damage = Callable[[bytes], bytes]
DAMAGES: dict[str, Damage] = {
    "empty": lambda b: b"",
    "cut": lambda b: b[: len(b) // 2],
    "not text": lambda b: b"\xff\xfe" + b[2:],
    "a bit": lambda b: b[: len(b) // 2] + bytes([b[len(b) // 2] ^ 1]) + b[len(b) // 2 + 1 :],
    "edited": lambda b: b.replace(b"1", b"2", 1),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_segment_is_a_sentence_and_what_was_before_it_is_kept(
    whole: Run, damage: str, tmp_path: Path
) -> None:
    assert whole.path is not None
    folder = shutil.copytree(whole.path, tmp_path / whole.path.name)
    (folder / "status.json").unlink()
    *_, last = Segments(folder).paths
    last.write_bytes(DAMAGES[damage](last.read_bytes()))
    with pytest.raises(StorageError, match=r"a segment of the run cannot be read .* goes on from the one before"):
        sample(strip(), CLAIM, how(tmp_path))
    last.unlink()
    alike(sample(strip(), CLAIM, how(tmp_path)), whole)


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", ["run.toml", "status.json", "posterior.nc"])
def test_other_files_are_told_when_read_and_mended_from_the_segments(
    whole: Run, name: str, damage: str, tmp_path: Path
) -> None:
    assert whole.path is not None
    folder = shutil.copytree(whole.path, tmp_path / whole.path.name)
    path = folder / name
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    with pytest.raises(StorageError, match="damaged"):
        load_run(folder)
    alike(sample(strip(), CLAIM, how(tmp_path)), whole)
    alike(load_run(folder), whole)


def test_segments_without_their_run_are_not_taken_for_another(whole: Run, tmp_path: Path) -> None:
    assert whole.path is not None
    folder = shutil.copytree(whole.path, tmp_path / "run")
    (folder / "run.toml").unlink()
    with pytest.raises(StorageError, match=r"files that are no run|another run"):
        sample(strip(), CLAIM, replace(how(tmp_path, name="run"), seed=4))
    assert json.loads((folder / "status.json").read_text())["steps"] == 70


def test_what_was_walked_is_kept_before_anything_else_can_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def killed(*_: object) -> None:
        raise KilledError

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "outcome", killed)
        with pytest.raises(KilledError):
            sample(strip(), CLAIM, how(tmp_path))
    (folder,) = tmp_path.iterdir()
    walked = Segments(folder).read()
    assert walked is not None
    assert walked.steps == 70


def test_failures_are_counted_with_an_example_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A point of every outcome but ok; and a share of failures above the stated one is said."""
    evaluate, seen = Posterior.evaluate, []

    def some_fail(posterior: Posterior, x: np.ndarray) -> Evaluation:
        found = evaluate(posterior, x)
        fails = (x[:, 0] == np.max(x[:, 0])) & (len(x) == 4)  # of half an ensemble that moves; starts are possible
        seen.append(x[fails])
        outcome = np.where(fails, Outcome.UNRESOLVED, found.outcome).astype(np.int8)
        return replace(found, log_likelihood=np.where(fails, -np.inf, found.log_likelihood), outcome=outcome)

    monkeypatch.setattr(Posterior, "evaluate", some_fail)
    left = iter(range(25))
    run = sample(strip(), CLAIM, how(tmp_path), stop=lambda: next(left, None) is None)
    failures = load_run(run.path).status["failures"]  # type: ignore[arg-type]
    assert failures["share"] == pytest.approx(run.status["tally"]["unresolved"] / run.status["evaluations"])
    assert failures["noteworthy"]
    example = np.array([failures["examples"]["unresolved"][name] for name in CLAIM.names])
    assert any(np.any(np.all(x == example, axis=1)) for x in seen)
    assert any("could not be solved" in sentence for sentence in sentences(run.quality))


def test_a_walk_is_read_in_parts(whole: Run) -> None:
    assert whole.path is not None
    chains = Segments(whole.path).read()
    assert chains is not None
    for every, first in ((1, 0), (3, 0), (7, 20), (100, 5)):
        parts = list(Segments(whole.path).thinned(every, first))
        assert np.array_equal(np.concatenate(parts, axis=1), chains.x[:, first::every])
    tau = int(np.ceil(max(whole.status["tau"].values())))
    walked = np.concatenate(list(whole.walk()), axis=1)
    assert np.array_equal(walked, chains.x[:, whole.status["burn"] :: tau])


def test_a_long_walk_is_never_held_whole(tmp_path: Path) -> None:
    """Forty segments, and no more memory than for a few of them."""
    rng, size = np.random.default_rng(0), 0
    states = tuple(np.random.RandomState(e).get_state() for e in range(2))
    segments = Segments(tmp_path)
    for _ in range(40):
        x = rng.standard_normal((2, 500, 16, 3))
        size += x.nbytes
        segments.write(Chains(x, x[..., 0], states, Outcomes(), 0.0))
    tracemalloc.start()
    count = sum(part.size for part in segments.thinned(10))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count == 2 * 2000 * 16 * 3
    assert peak < size / 4

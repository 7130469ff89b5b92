"""What a power cut may leave of a run: every such state is read, and the run goes on and ends as it would have."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bayesmembrane.calibration.run import Run, load_run, sample
from bayesmembrane.calibration.sampling import walk
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.ground import files
from bayesmembrane.ground.errors import StorageError
from tests.calibration.test_resume import CLAIM, how, strip

TINY = Settings(ess=1e6, walkers=8, chunk=20, most_steps=20, sampler="emcee")

Tree = dict[Path, bytes | None]
"""Files with what they hold, and folders (None), by path."""


@dataclass
class Recorder:
    """Notes what is done to the disk: folders made, files begun, renamed and removed, and what was synced when.

    A file system may put off what is done in a folder until that is synced, each thing by itself, and the content of a
    file until that is synced; a rename is done or not.
    """

    root: Path
    done: list[tuple[str, Path, Any]] = field(default_factory=list)

    def record(self, patch: pytest.MonkeyPatch) -> None:
        mkstemp, sync, replace, mkdir = tempfile.mkstemp, files._sync, Path.replace, Path.mkdir

        def begin(**more: Any) -> tuple[int, str]:
            handle, name = mkstemp(**more)
            self.done.append(("begin", Path(name), None))
            return handle, name

        def synced(path: Path) -> None:
            sync(path)
            self.done.append(("sync", path, path.read_bytes() if path.is_file() else None))

        def rename(path: Path, target: Path) -> Path:
            found = replace(path, target)
            self.done.append(("rename", path, target))
            return found

        def make(path: Path, *given: Any, **more: Any) -> None:
            mkdir(path, *given, **more)
            self.done.append(("make", path, None))

        patch.setattr(files.tempfile, "mkstemp", begin)
        patch.setattr(files, "_sync", synced)
        patch.setattr(Path, "replace", rename)
        patch.setattr(Path, "mkdir", make)

    def states(self) -> Iterator[Tree]:
        """Every state that a cut after any of the recorded operations may leave, each once."""
        seen = set()
        for end in range(len(self.done) + 1):
            for tree in _after(self.done[:end]):
                key = tuple(sorted((str(path.relative_to(self.root)), content) for path, content in tree.items()))
                if key not in seen:
                    seen.add(key)
                    yield tree


def _after(done: list[tuple[str, Path, Any]]) -> Iterator[Tree]:
    sure: Tree = {}
    pending: list[tuple[str, Path, Any]] = []  # in folders that were not synced since
    contents: dict[Path, bytes] = {}  # synced, by the name that the file began with
    named: dict[Path, Path] = {}  # where it is now -> what it began as
    for kind, path, more in done:
        if kind == "sync" and more is None:
            settled = [p for p in pending if p[1].parent == path]
            sure = _applied(sure, settled)
            pending = [p for p in pending if p[1].parent != path]
        elif kind == "sync":
            contents[named.get(path, path)] = more
        else:
            pending.append((kind, path, more))
            if kind == "rename":
                named[more] = named.pop(path, path)
    for chosen in product((False, True), repeat=len(pending)):
        tree = _applied(sure, [p for p, yes in zip(pending, chosen, strict=True) if yes])
        lost = [p for p, began in tree.items() if began is not None and Path(os.fsdecode(began)) not in contents]
        for cut in product((0.0, 0.5, 1.0), repeat=len(lost)):
            whole = {
                p: None if b is None else contents.get(Path(os.fsdecode(b)), b"half of it") for p, b in tree.items()
            }
            for p, part in zip(lost, cut, strict=True):
                content = whole[p] or b""
                whole[p] = content[: int(part * len(content))]
            yield {p: c for p, c in whole.items() if all(up in whole for up in p.parents if _inside(up, whole))}


def _inside(folder: Path, tree: Tree) -> bool:
    """Whether a folder is one of those that the run made: those above were there before."""
    top = min((len(p.parts) for p in tree), default=0)
    return len(folder.parts) >= top


def _applied(tree: Tree, operations: list[tuple[str, Path, Any]]) -> Tree:
    """A file is known by the name that it began with, until its content is filled in."""
    tree = dict(tree)
    for kind, path, more in operations:
        if kind == "make":
            tree[path] = None
        elif kind == "begin":
            tree[path] = os.fsencode(path)
        else:
            # Also where its beginning is not on the disk: the rename brings the file along.
            tree[more] = tree.pop(path, os.fsencode(path))
    return tree


def _put(tree: Tree, root: Path, place: Path) -> None:
    for path, content in sorted(tree.items(), key=lambda item: len(item[0].parts)):
        target = place / path.relative_to(root)
        if content is None:
            target.mkdir(parents=True, exist_ok=True)
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recorder, Run]:
    """A run with many segments, from the first folder to the last file."""
    root = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(walk, "SAVE_AFTER", 0.0)
        recorder = Recorder(root)
        recorder.record(patch)
        run = sample(strip(), CLAIM, how(root / "out", TINY))
    return recorder, run


def test_no_state_loses_what_was_complete(recorded: tuple[Recorder, Run]) -> None:
    """What is read is a beginning of the walk, no shorter than what was synced before, and never refused."""
    recorder, run = recorded
    assert run.path is not None
    whole = Segments(run.path).read()
    assert whole is not None
    states = 0
    for number, tree in enumerate(recorder.states()):
        place = recorder.root / "states" / str(number)
        _put(tree, recorder.root, place)
        folder = place / run.path.relative_to(recorder.root)
        found = Segments(folder).read()
        steps = 0 if found is None else found.steps
        complete = sum(1 for path in tree if path.suffix == ".seg")
        assert steps == complete, "every segment has one step here"
        if found is not None:
            assert np.array_equal(found.x, whole.x[:, :steps])
        with suppress(StorageError):  # and nothing else
            load_run(folder)
        states += 1
    assert states > 60


def test_every_kind_of_state_goes_on_to_the_same_end(
    recorded: tuple[Recorder, Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the beginning, of one checkpoint in the middle, and of the end."""
    recorder, run = recorded
    assert run.path is not None
    trees = list(recorder.states())
    middle = len(trees) // 2
    chosen = [*trees[:8:2], *trees[middle : middle + 4], *trees[-6:]]
    for number, tree in enumerate(chosen):
        place = recorder.root / "chosen" / str(number)
        _put(tree, recorder.root, place)
        place.joinpath("out").mkdir(parents=True, exist_ok=True)
        done = sample(strip(), CLAIM, how(place / "out", TINY))
        assert done.finished
        assert np.array_equal(done.draws(), run.draws())
        assert done.status["evaluations"] == run.status["evaluations"]
        assert not [p for p in done.path.rglob(".*") if p.is_file()], "nothing is left lying about"  # type: ignore[union-attr]


def test_a_writer_that_did_not_sync_would_be_found(tmp_path: Path) -> None:
    """The recorder sees what a rename before a sync may leave."""
    part, path = tmp_path / "out" / ".a", tmp_path / "out" / "a"
    recorder = Recorder(tmp_path, [("make", tmp_path / "out", None), ("sync", tmp_path, None)])
    recorder.done += [("begin", part, None), ("rename", part, path), ("sync", path.parent, None)]
    assert any(tree.get(path) == b"" for tree in recorder.states())
    recorder.done.insert(3, ("sync", part, b"all of it"))
    assert all(tree.get(path, b"all of it") == b"all of it" for tree in recorder.states())

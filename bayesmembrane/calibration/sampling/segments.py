"""A walk on the disk: segments that are seen only when they are complete, each with a checksum of itself.

segments/<first step>.seg    a line of JSON (which steps, the checksum, that of the segment before) and an npz archive
segments/lock                held by the process that walks

A segment is written beside its place, synced and renamed (`ground.files`), and never changed again: whatever kills the
program, what was complete stays, and the walk goes on from there.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import Outcomes
from bayesmembrane.calibration.sampling.chains import Chains, joined
from bayesmembrane.calibration.sampling.proposals.bend import Bend
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import remove_parts, write_whole
from bayesmembrane.ground.parameters import Array

FOLDER, LOCK, FORMAT = "segments", "lock", 1
TOGETHER = 2**24  # bytes of segments that are joined at once
_FAULTS = (OSError, KeyError, ValueError, TypeError, IndexError, AttributeError, EOFError, zipfile.BadZipFile)


@dataclass(frozen=True)
class Head:
    """The first line of a segment: of which walk, its first step and how many, and the checksums of the one before
    ("" if there is none) and of itself.
    """

    walk: str
    first: int
    steps: int
    before: str
    sha256: str = ""

    @property
    def end(self) -> int:
        """The first step that is not in it."""
        return self.first + self.steps

    def checksum(self, payload: bytes) -> str:
        """Of the line and what follows it."""
        found = hashlib.sha256(json.dumps([self.walk, self.first, self.steps, self.before]).encode())
        found.update(payload)
        return found.hexdigest()


@dataclass
class Segments:
    """The segments in the folder of a run, and which ``walk`` they are part of, for who writes.

    Whoever writes holds the lock of the folder (`store.claimed`); anybody may read.
    """

    run: Path
    walk: str = ""

    @property
    def folder(self) -> Path:
        return self.run / FOLDER

    @property
    def paths(self) -> list[Path]:
        """In order; none if nothing was walked."""
        return sorted(self.folder.glob("*.seg"))

    def write(self, part: Chains) -> None:
        """Append what was walked since the last segment; raises `StorageError`, and what is there stays."""
        paths = self.paths
        last = _head(paths[-1]) if paths else None
        first, before = (0, "") if last is None else (last.end, last.sha256)
        payload = _packed(part)
        head = Head(self.walk, first, part.steps, before)
        line = {"format": FORMAT, **asdict(head), "sha256": head.checksum(payload)}
        content = json.dumps(line).encode() + b"\n" + payload
        write_whole(self.folder / f"{first:010d}.seg", lambda p: p.write_bytes(content), "a segment of the run")

    def __iter__(self) -> Iterator[Chains]:
        """The parts of the walk one after the other, each checked; raises `StorageError` for one that is damaged."""
        end, before = 0, ""
        for path in self.paths:
            head, part = _read(path)
            if head.first != end or head.before != before or (self.walk and head.walk != self.walk):
                raise _damaged(path, "it does not follow on the one before")
            end, before = head.end, head.sha256
            yield part

    def read(self) -> Chains | None:
        """The whole walk, a long one in files without names (`growing`); None if there is none.

        Raises `StorageError` as iterating does.
        """
        some: list[Chains] = []
        for part in self:
            some.append(part)
            if sum(p.x.nbytes for p in some[1:]) > TOGETHER:
                some = [joined(some)]
        return joined(some) if some else None

    def thinned(self, every: int, first: int = 0) -> Iterator[Array]:
        """(E, n, walkers, k) the steps ``first``, ``first`` + ``every``, ... of each segment that holds some; one
        segment is held at a time.

        Raises `StorageError` as iterating does.
        """
        at = 0
        for part in self:
            begin = first - at if at < first else -(at - first) % every
            if begin < part.steps:
                yield part.x[:, begin::every]
            at += part.steps

    @property
    def steps(self) -> int:
        """How many are stored."""
        return _head(self.paths[-1]).end if self.paths else 0

    def take(self, longer: Segments) -> None:
        """Append what ``longer``, the same walk, has beyond the end of this one, as far as its segments begin there."""
        steps, at = self.steps, 0
        for part in longer:
            if at == steps:
                self.write(part)
                steps += part.steps
            at += part.steps

    @property
    def end(self) -> str:
        """The checksum of the last segment, which names the whole walk; "" if there is none."""
        return _head(self.paths[-1]).sha256 if self.paths else ""

    def same_walk(self) -> bool:
        """Whether what lies here is part of ``walk``, as nothing is."""
        return all(_head(path).walk == self.walk for path in self.paths[:1])

    def clean(self) -> None:
        """Remove what a process that was killed left of segments it had not completed; for the holder of the lock."""
        remove_parts(self.folder, "*.seg")


def _packed(part: Chains) -> bytes:
    states: dict[str, Any] = {}
    for e, (_, key, position, has_gauss, gauss) in enumerate(part.random_states):
        states |= {f"key{e}": key, f"rest{e}": np.array([position, has_gauss, gauss])}
    about = {
        "counts": part.counts,
        "examples": getattr(part.counts, "examples", {}),
        "seconds": part.seconds,
        "lessons": part.lessons,
        "look": part.look,
        "leapt": part.leapt,
    }
    if part.mixture is not None and part.offered is not None:
        g = part.mixture
        about["degrees"] = g.degrees
        states |= {"offered": part.offered, "log_weights": g.log_weights, "means": g.means, "roots": g.roots}
        if (b := g.bend) is not None:
            about["bend"] = b.degree
            states |= {"centre": b.centre, "root": b.root, "inverse": b.inverse, "coefficients": b.coefficients}
    file = io.BytesIO()
    np.savez(file, x=part.x, log_posterior=part.log_posterior, about=np.array(json.dumps(about)), **states)
    return file.getvalue()


def _unpacked(payload: bytes) -> Chains:
    with np.load(io.BytesIO(payload), allow_pickle=False) as f:
        about = json.loads(str(f["about"]))
        x = f["x"]
        states = tuple(
            ("MT19937", f[f"key{e}"], int(rest[0]), int(rest[1]), float(rest[2]))
            for e, rest in ((e, f[f"rest{e}"]) for e in range(len(x)))
        )
        lessons = tuple(int(s) for s in about["lessons"])
        counts, seconds, look = Outcomes(about["counts"]), float(about["seconds"]), int(about["look"])
        counts.examples = {str(label): tuple(map(float, at)) for label, at in about["examples"].items()}
        chains = Chains(x, f["log_posterior"], states, counts, seconds, lessons, look, leapt=int(about.get("leapt", 0)))
        if "degrees" not in about:
            return chains
        bend = None
        if "bend" in about:
            bend = Bend(f["centre"], f["root"], f["inverse"], f["coefficients"], int(about["bend"]))
        mixture = Mixture(f["log_weights"], f["means"], f["roots"], float(about["degrees"]), bend)
        return replace(chains, mixture=mixture, offered=f["offered"])


def _read(path: Path) -> tuple[Head, Chains]:
    """A segment, checked against its checksum."""
    try:
        line, _, payload = path.read_bytes().partition(b"\n")
        head = _parsed(line)
        if head.checksum(payload) == head.sha256:
            return head, _unpacked(payload)
    except OSError as error:
        raise _damaged(path, error.strerror or str(error)) from None
    except _FAULTS:
        pass  # told below
    raise _damaged(path, "its content is not what was written")


def _head(path: Path) -> Head:
    try:
        with path.open("rb") as file:
            return _parsed(file.readline(1000))
    except _FAULTS:
        raise _damaged(path, "its content is not what was written") from None


def _parsed(line: bytes) -> Head:
    content = json.loads(line)
    if content["format"] != FORMAT:
        raise ValueError
    return Head(
        str(content["walk"]),
        int(content["first"]),
        int(content["steps"]),
        str(content["before"]),
        str(content["sha256"]),
    )


def _damaged(path: Path, reason: str) -> StorageError:
    return StorageError(
        f"a segment of the run cannot be read ({reason})",
        str(path),
        "remove it and those with larger numbers, and sample again: the run goes on from the one before",
    )

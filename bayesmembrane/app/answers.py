"""An answer of a verb: the result, its JSON document, and the folder in which both are stored."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from bayesmembrane.calibration.fingerprint import fingerprint
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.files import ensure_writable
from bayesmembrane.ground.pieces import drop, keeping
from bayesmembrane.ground.stored import answer, read, store
from bayesmembrane.physics.hypothesis import Hypothesis

Result = TypeVar("Result")

LONGEST = 60  # characters of specimen and of hypothesis in the name of a folder


@dataclass(frozen=True, eq=False)
class Answer(Generic[Result]):
    """What a verb found.

    result : the frozen values
    document : the JSON answer; ``stored`` is its folder, None if it was not stored
    """

    result: Result
    document: dict[str, Any]

    @property
    def folder(self) -> Path | None:
        """Where it is stored."""
        stored = self.document["stored"]
        return None if stored is None else Path(stored)

    def also(self, **fields: Any) -> Answer[Result]:
        """The same with more fields in its document."""
        return replace(self, document={**self.document, **fields})


@dataclass(frozen=True)
class Asked:
    """What the folder of an answer is called after.

    verb : that was asked
    specimen, model, end : film, hypothesis, and largest deflection in m; "" and nan where there is none
    fingerprint : of all that the answer depends on
    """

    verb: str
    specimen: str
    model: str
    end: float
    fingerprint: str

    @property
    def name(self) -> str:
        """``film-1_yeoh_35.1mm_fit_3f2a9c41``: specimen, hypothesis, range, verb, fingerprint."""
        reach = f"{1e3 * self.end:.4g}mm" if np.isfinite(self.end) else ""
        specimen = re.sub(r"[^a-z0-9]+", "-", self.specimen.lower()).strip("-")
        parts = (specimen[:LONGEST], self.model[:LONGEST], reach, self.verb, self.fingerprint[:8])
        return "_".join(part for part in parts if part)


def asked(
    verb: str,
    by: Callable[..., Any],
    measurements: Sequence[Measurement],
    hypotheses: Sequence[Hypothesis],
    settings: Mapping[str, Any],
    also: Iterable[type[Any]] = (),
) -> Asked:
    """A verb asked about hypotheses on one film; ``by`` is what computes, ``settings`` are plain, the seed among them.

    The fingerprint covers the code that ``by`` reaches, and the materials and effects that it may try (``also``).
    """
    last = max(measurements, key=lambda m: float(np.max(m.deflection)))
    options = {name: value for name, value in settings.items() if name != "seed"}
    found = fingerprint(by.__module__, hypotheses, measurements, options, settings["seed"], also)
    models = "-".join(h.label() for h in hypotheses)
    return Asked(verb, last.specimen.name, models, float(np.max(last.deflection)), found)


def held(kind: str, what: Asked, out: str | Path | None) -> Answer[Any] | None:
    """The answer that `kept` stored when the same was asked; None if there is none, or it cannot be read any more.

    Raises `StorageError` where there is none, and none could be stored: nobody should wait for that.
    """
    if out is None:
        return None
    folder = Path(out) / what.name
    with suppress(BayesmembraneError):  # damaged, or made of runs that were sampled anew: it is made again
        document = answer(folder, kind)
        if document is not None:
            return Answer(read(folder, kind), {**document, "stored": str(folder)})
    ensure_writable(Path(out))
    return None


def in_pieces(what: Asked, out: str | Path | None) -> AbstractContextManager[None]:
    """Inside, pieces of the answer are kept in its folder until `kept` stores it whole: who is killed goes on there."""
    return keeping(None if out is None else Path(out) / what.name, what.fingerprint)


def kept(kind: str, result: Result, document: Mapping[str, Any], what: Asked, out: str | Path | None) -> Answer[Result]:
    """The answer, stored in its own folder inside ``out`` unless that is None; its pieces go.

    Raises `StorageError` if it cannot be written.
    """
    if out is None:
        return Answer(result, {**document, "stored": None})
    folder = Path(out) / what.name
    whole = {**document, "stored": str(folder)}
    store(folder, kind, result, whole)
    drop(folder)
    return Answer(result, whole)

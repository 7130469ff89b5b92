"""The JSON answer of every result, by its type: plain values, as the contract of the command line names them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.calibration.run import Run
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.diagnosis.diagnose import Diagnosis
from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.plain import plain
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.valleys.beside import Beside
from bayesmembrane.valleys.result import Valleys
from bayesmembrane.words import sampling


def document(result: Any) -> dict[str, Any]:
    """What ``--json`` prints of a result, with nan and infinity as None; raises `SettingsError` for another type."""
    return dict(plain(_document(result)))


def _document(result: Any) -> Mapping[str, Any]:
    match result:
        case Fit() | Valleys() | Beside() | Diagnosis():
            return result.summary()
        case Run():
            return sampling.document(result)
        case Comparison():
            return sampling.with_notes(result)
        case Reconstruction():
            return result.to_json_dict()
        case Loop():
            return {
                "rounds": [r.summary() for r in result.rounds],
                "sentence": result.sentence,
                "left": None if result.left is None else result.left.sentence,
            }
        case Mapping() if result and all(isinstance(c, Comparison) for c in result.values()):
            answers = {name: sampling.with_notes(c) for name, c in result.items()}
            return {**list(answers.values())[-1], "ranges": [{"range": n, **a} for n, a in answers.items()]}
    raise SettingsError(f"a {type(result).__name__} is no result of a verb", remedy="give what fit or sample returned")

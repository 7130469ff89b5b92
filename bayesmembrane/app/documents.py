"""The JSON answer of every result, by its type: plain values, as the contract of the command line names them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.calibration.hierarchy.population import Population
from bayesmembrane.calibration.joint.fit import JointFit
from bayesmembrane.calibration.joint.run import JointRun
from bayesmembrane.calibration.run import Run
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.diagnosis.joint.diagnose import JointDiagnosis
from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.plain import plain
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.valleys.beside import Beside
from bayesmembrane.valleys.result import Valleys
from bayesmembrane.words import (
    comparison,
    diagnosis,
    joint,
    joint_diagnosis,
    loop,
    population,
    reconstruction,
    sampling,
    valleys,
)
from bayesmembrane.words.units import read_as


def document(result: Any) -> dict[str, Any]:
    """What ``--json`` prints of a result, with nan and infinity as None; raises `SettingsError` for another type."""
    return dict(plain(_document(result)))


def _document(result: Any) -> Mapping[str, Any]:
    match result:
        case Fit():
            known = {} if result.rig is None else {"read_as": read_as(result.rig.shown(result.thickness))}
            return {**result.summary(), **known}
        case JointFit():
            return joint.document_of_fit(result)
        case Population():
            return {**result.summary(), "sentences": list(population.sentences(result))}
        case JointRun():
            return joint.document(result)
        case Run():
            return sampling.document(result)
        case Valleys() | Beside():
            return valleys.document(result)
        case Diagnosis():
            return diagnosis.document(result)
        case JointDiagnosis():
            return joint_diagnosis.document(result)
        case Loop():
            return loop.document(result)
        case Comparison():
            return comparison.document(result)
        case Reconstruction():
            return reconstruction.document(result)
        case Mapping() if result and all(isinstance(c, Comparison) for c in result.values()):
            return comparison.document_of_ranges(result)
    raise SettingsError(f"a {type(result).__name__} is no result of a verb", remedy="give what fit or sample returned")

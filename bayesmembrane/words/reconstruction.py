"""What a reconstruction says of printed rows, in words, and the JSON answer of ``reconstruct``."""

from __future__ import annotations

from typing import Any

from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.reconstruction.rows import Suspect


def document(found: Reconstruction) -> dict[str, Any]:
    """The JSON answer of ``reconstruct``."""
    values = found.summary()
    rows = zip(values["suspect_rows"], found.suspects, strict=True)
    return {**values, "suspect_rows": [{**row, "reason": contradiction(s)} for row, s in rows]}


def contradiction(found: Suspect) -> str:
    """Why a printed row is suspect, as a clause."""
    if not found.simulated:
        return "the forward model has no force over the whole range for the printed parameters"
    told = ", ".join(
        f"over {p.range} printed {p.printed} N, predicted {p.predicted:.4g} +- {p.sd:.1g} N" for p in found.losses
    )
    return f"the other rows contradict its losses: {told}"

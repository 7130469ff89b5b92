"""Measurements on which the program once failed, where they lie beside the project."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"
Run = Callable[..., tuple[int, str, str]]


@pytest.mark.skipif(not CASES.is_dir(), reason="the cases do not lie beside the project")
@pytest.mark.parametrize("case", sorted(p.name for p in CASES.glob("*/")) if CASES.is_dir() else ["absent"])
def test_a_case_that_once_failed_is_answered(run: Run, case: str) -> None:
    """With the energy of which its name begins: a Gent film near its locking ended in a traceback."""
    folder, material = CASES / case, case.partition("_")[0]
    wanted = ["diagnose", folder / "curve.csv", "--specimen", folder / "specimen.toml", "--material", material]
    status, out, err = run(*wanted, "--quick", "--json")
    assert status == 0, err
    answer = json.loads(out)
    assert answer["verdict"] in {"adequate", "named", "ambiguous", "material", "unknown"}
    assert 0.99 < sum(answer["probabilities"]["energies"].values()) < 1.01

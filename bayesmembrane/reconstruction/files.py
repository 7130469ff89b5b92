"""The reconstructed curve as measurements that ship: CSV, TOML and covariance, labelled as reconstructed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from bayesmembrane.data.published import PublishedTable
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import write_text
from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.result import Reconstruction

STEM = "elastosil_50um"
WHOLE = "first_loading"
STATEMENT = (
    "RECONSTRUCTED, not raw data: these forces were never printed; they are inferred from the 30 losses and 15 "
    "parameter sets that the paper prints, and from the forward model, by `bayesmembrane reconstruct`"
)
_OURS = STATEMENT.partition(":")[0]
METHOD = (
    "a loss is the Euclidean distance between measured and simulated forces, so the losses locate the measured curve; "
    "number and first position of the evenly spaced deflections are inferred too. One curve for both ranges, of one of "
    "several families: smooth in force, smooth in the logarithm of force over a neo-Hookean one with and without "
    "offsets of the zeros, or a strain energy with effects of the rig and an error of its form. Forces and covariance "
    "are mean and covariance of their mixture, and hold what the losses leave open: family, curve, positions, load "
    "cell. See docs/reconstruction.md"
)
SOURCE = 'Claudia Grabs and Werner Wirges, "Data-Based Approach to Hyperelastic Membranes", results table; cite it'
LICENCE = "the inferred numbers: MIT, as the package; the printed ones are facts quoted from the paper"


def write_reconstruction(found: Reconstruction, table: PublishedTable, folder: Path) -> tuple[Path, ...]:
    """Write one measurement per range and one of all ranges, by deflection; those of an earlier one are replaced.

    Each is ``elastosil_50um_<range>.csv`` (deflection_mm, force_N, force_sd_N) with a TOML and a covariance in N^2.
    Raises `StorageError` if the folder cannot be written, or a file of that name lies there that is no reconstruction.
    """
    starts = np.cumsum([0, *(r.deflection.size for r in found.ranges)])
    parts: dict[str, NDArray[np.intp]] = {
        r.name.lower(): np.arange(a, a + r.deflection.size)
        for r, a in zip(found.ranges, starts[:-1].tolist(), strict=True)
    }
    parts[WHOLE] = np.argsort(found.deflection, kind="stable")
    texts = [_texts(found, table, folder, name, order) for name, order in parts.items()]
    for part in texts:
        refuse_others(part)
    return tuple(write_text(path, text, "the file") for part in texts for path, text in part.items())


def _texts(
    found: Reconstruction, table: PublishedTable, folder: Path, name: str, order: NDArray[np.intp]
) -> dict[Path, str]:
    """The three files of one measurement."""
    curve = folder / f"{STEM}_{name}.csv"
    covariance = folder / f"{STEM}_{name}_covariance.csv"
    matrix = found.covariance[np.ix_(order, order)]
    columns = 1e3 * found.deflection[order], found.force[order], np.sqrt(np.diag(matrix))
    head = f"# covariance of force, N^2; rows and columns in the order of {curve.name}; reconstructed\n"
    return {
        curve: "deflection_mm,force_N,force_sd_N\n" + _rows(np.column_stack(columns), "{:.6f}"),
        covariance: head + _rows(matrix, "{:.9e}"),
        curve.with_suffix(".toml"): tomli_w.dumps(_description(found, table, covariance.name)),
    }


def refuse_others(files: dict[Path, str]) -> None:
    """Raise `StorageError` if one of these files of a measurement exists, and no TOML there says that it is ours."""
    (toml,) = (path for path in files if path.suffix == ".toml")
    if toml.is_file() and _OURS in toml.read_text(encoding="utf-8", errors="replace"):
        return
    for path in files:
        if path.exists():
            raise StorageError("the file exists already, and is no reconstruction", str(path), "choose another folder")


def _rows(values: Array, form: str) -> str:
    return "".join(",".join(form.format(v) for v in row) + "\n" for row in values)


def _description(found: Reconstruction, table: PublishedTable, covariance: str) -> dict[str, Any]:
    counts = ", ".join(
        f"{r.name}: {r.deflection.size} points (probability {r.n_points[r.deflection.size]:.3f}) from "
        f"{1e3 * r.first:.2f} +- {1e3 * r.first_sd:.2f} mm"
        for r in found.ranges
    )
    doubtful = "; ".join(
        f"{s.material} {s.column}: " + ", ".join(f"{c.entry} {c.printed} -> {c.consistent:g}" for c in s.corrections)
        for s in found.suspects
    )
    return {
        "specimen": {"name": "ELASTOSIL Film 2030, specimen 1", "thickness_um": _short(1e6 * table.thickness)},
        "rig": {
            "kind": "annulus",
            "inner_radius_mm": _short(1e3 * table.inner_radius),
            "outer_radius_mm": _short(1e3 * table.outer_radius),
        },
        "measurement": {"covariance": covariance},
        "origin": {
            "statement": STATEMENT,
            "method": METHOD,
            "positions": counts,
            "printed_rows_set_aside": doubtful or "none",
            "source": SOURCE,
            "licence": LICENCE,
        },
    }


def _short(value: float) -> float:
    return float(f"{value:.12g}")

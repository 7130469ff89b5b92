"""``reconstruct``: the curve behind the paper's losses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from bayesmembrane.app.options import CHAINS, OutputOptions
from bayesmembrane.app.terminal import answer, say, status, table

place = 4


def verb(
    output: OutputOptions,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder of the answer; curve, TOML and covariance are written here too. Without: chains."
        ),
    ] = None,
) -> None:
    """The measured curve behind the paper's published losses, and which printed numbers contradict the others."""
    from bayesmembrane.app import analyses
    from bayesmembrane.data.published import read_published_table
    from bayesmembrane.reconstruction.files import write_reconstruction

    with status("Locating the curve from 30 losses"):
        found = analyses.reconstruct(analyses.Work(output.seed, folder or CHAINS))
    document = found.document
    if folder is not None:
        document |= {"files": [str(f) for f in write_reconstruction(found.result, read_published_table(), folder)]}
    answer(document, output.as_json, lambda: show(document))


def show(document: dict[str, Any]) -> None:
    """Both ranges and the suspect rows, on the terminal."""
    for name in ("OP1", "OP2"):
        part = document[name]
        rows = zip(part["deflection_mm"], part["force_N"], part["sd_N"], strict=True)
        cells = [[f"{d:.2f}", f"{f:.4f}", f"{s:.4f}"] for d, f, s in rows]
        first, counts = part["first_mm"], part["n_points"]
        likely = max(counts, key=counts.get)
        title = (
            f"{name}: {likely} points (probability {counts[likely]:.3f}), "
            f"the first at {first['mean']:.2f} +- {first['sd']:.2f} mm"
        )
        table(title, ["deflection, mm", "force, N", "sd, N"], cells)
    cells = [[f["title"], f"{f['probability']:.3f}"] for f in document["families"].values()]
    table("What the curve may be", ["family", "probability"], cells)
    for row in document["suspect_rows"]:
        changes = "; ".join(f"{c['entry']}: {c['printed']} -> {c['consistent']}" for c in row["corrections"])
        say(f"{row['material']}, {row['column']}: {row['reason']} Consistent would be {changes}.")

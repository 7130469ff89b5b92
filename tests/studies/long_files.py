"""An export of 200 000 rows through every verb: processor time and memory of each.

    python -m tests.studies.long_files [--rows 200000] [--table docs/studies/long_files.md]

A strip is drawn to three rising peaks and let back, and read a thousand times a second; its stress is Gent's, in closed
form, with white noise of 0.2 % of the largest. The file is written as machines write it, with a preamble and decimal
commas. Every verb is a process of its own; its memory is the largest resident set of it or of a process that it starts.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROWS, SEED = 200_000, 20261125
LENGTH, WIDTH, THICKNESS = 50.0, 10.0, 0.5  # mm
MU, LIMIT = 0.4, 40.0  # MPa and the limit of I1 - 3
PEAKS = (1.5, 2.0, 2.5)  # stretches
NOISE = 2e-3
GIB = 2**30
VERBS = (
    "fit --material gent",
    "sample --material gent",
    "valleys --material gent",
    "compare --materials neo_hookean,gent",
    "diagnose",
    "loop",
)


@dataclass(frozen=True)
class Cost:
    """What a command took: s of a processor with its children's, and GiB at most."""

    seconds: float
    memory: float


def export(path: Path, rows: int) -> None:
    """Write the machine's file: a preamble, then time, travel and force."""
    rng = np.random.default_rng(SEED)
    corners = np.array([1.0] + [s for peak in PEAKS for s in (peak, 1.0)])
    along = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    stretch = np.interp(np.linspace(0.0, along[-1], rows), along, corners)
    stress = MU * (stretch - stretch**-2) / (1.0 - (stretch**2 + 2.0 / stretch - 3.0) / LIMIT)
    stress += NOISE * np.max(stress) * rng.standard_normal(rows)
    lines = ["Prüfung;Zugversuch", f"Probenbreite;{WIDTH:g};mm".replace(".", ","), "", "Zeit;Weg;Kraft", "s;mm;N"]
    time, travel, force = np.arange(rows) / 1000.0, LENGTH * (stretch - 1.0), stress * WIDTH * THICKNESS
    lines += [f"{t:.3f};{x:.5f};{f:.5f}".replace(".", ",") for t, x, f in zip(time, travel, force, strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def spent(words: tuple[str, ...], folder: Path) -> Cost:
    """Run the command in ``folder``; an answer that is not zero ends the study with what it said."""
    with (folder / "said.txt").open("w+", encoding="utf-8") as said:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "tests.studies.long_files", "--meter", *words]
        done = subprocess.run(command, cwd=folder, stdout=said, stderr=subprocess.STDOUT, env=_environment())
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        said.seek(0)
        text = said.read()
    if done.returncode:
        raise SystemExit(f"{' '.join(words)} ended with {done.returncode}:\n{text[-4000:]}")
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Cost(seconds, float(text.rsplit("peak ", 1)[1]) / GIB)


def metered(words: list[str]) -> int:
    """The command in a process that does nothing else and has little itself: its peak is that of the verb."""
    done = subprocess.run([sys.executable, "-m", "bayesmembrane", *words])
    print(f"\npeak {1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss}")
    return done.returncode


def _environment() -> dict[str, str]:
    here = Path(__file__).resolve().parents[2]
    return os.environ | {"PYTHONPATH": str(here), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def table(costs: dict[str, Cost], rows: int, size: float) -> str:
    """Markdown."""
    lines = [
        "# Long files",
        "",
        f"`python -m tests.studies.long_files --rows {rows}`: an export of {rows} rows ({size:.1f} MB; three triangles "
        "of a strip, a preamble, decimal commas) through every verb, each a process of its own. Seconds of a "
        "processor, on a machine that others used as well, with reading the file and starting; memory is the largest "
        "resident set.",
        "",
        "Of a file 20 000 readings at most are used, turning points and holds among them; diagnosis, valleys and "
        "comparison take 1500 of these. Each answer says so.",
        "",
        "| command | CPU s | GiB at most |",
        "| --- | --- | --- |",
    ]
    lines += [f"| `{name}` | {c.seconds:.1f} | {c.memory:.2f} |" for name, c in costs.items()]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=ROWS)
    parser.add_argument("--table", type=Path, default=None)
    parser.add_argument("--meter", nargs=argparse.REMAINDER, default=None, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.meter is not None:
        return metered(asked.meter)
    costs = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        export(folder / "machine.txt", asked.rows)
        size = (folder / "machine.txt").stat().st_size / 1e6
        sizes = f"--gauge-length-mm {LENGTH:g} --width-mm {WIDTH:g} --thickness-um {1e3 * THICKNESS:g}"
        taken = f"import machine.txt --rig uniaxial {sizes} --out curve.csv"
        costs["import"] = spent(tuple(taken.split()), folder)
        for command in VERBS:
            verb, *options = command.split()
            # Where nothing is said, answers and pages go into folders of their own beside the curve.
            costs[command] = spent((verb, "curve.csv", "--specimen", "curve.toml", *options), folder)
            print(table(costs, asked.rows, size), flush=True)
    if asked.table is not None:
        asked.table.write_text(table(costs, asked.rows, size), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

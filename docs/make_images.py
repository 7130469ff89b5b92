"""Pictures of the README and of docs/valleys.md, from the runs of the demonstration.

python docs/make_images.py [FOLDER]      chains/demo unless another is named
"""

from __future__ import annotations

import sys
from pathlib import Path

from bayesmembrane.app.demo import shipped_measurement
from bayesmembrane.calibration.run import load_run
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.report.runs import read
from bayesmembrane.report.sections.curves import first_look, look_of
from bayesmembrane.report.sections.valleys.figures import valley_picture
from bayesmembrane.valleys.follow import valleys_of

RANGES = ("op1", "op2")
MATERIALS = ("neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden")
IMAGES = Path(__file__).parent / "images"
VALLEYS = "mooney_rivlin"


def main(chains: Path) -> None:
    folders = [[chains / f"elastosil_50um_{r}_{m}" for m in MATERIALS] for r in RANGES]
    looks = [look_of([read(f) for f in group if (f / "status.json").exists()]) for group in folders]
    _write("first_look.png", first_look(looks, "png").data)
    runs = [load_run(chains / f"elastosil_50um_{r}_{VALLEYS}") for r in RANGES]
    measurements = [shipped_measurement(r.upper()) for r in RANGES]
    found = valleys_of(measurements, hypothesis(VALLEYS), draws=[run.draws() for run in runs])
    _write("valleys.png", valley_picture(found).data)


def _write(name: str, data: bytes) -> None:
    IMAGES.mkdir(parents=True, exist_ok=True)
    (IMAGES / name).write_bytes(data)
    print(f"{IMAGES / name}: {len(data) // 1000} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("chains/demo"))

"""The picture in the README, from the runs that `make demo` stored: python docs/make_images.py [CHAINS]."""

from __future__ import annotations

import sys
from pathlib import Path

from bayesmembrane.reporting.figures import first_look
from bayesmembrane.reporting.page import look_of
from bayesmembrane.reporting.reading import read

RANGES = ("op1", "op2")
MATERIALS = ("neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden")
TARGET = Path(__file__).parent / "images" / "first_look.png"


def main(chains: Path) -> None:
    folders = [[chains / f"elastosil_50um_{r}_{m}" for m in MATERIALS] for r in RANGES]
    looks = [look_of([read(f) for f in group if (f / "status.json").exists()]) for group in folders]
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_bytes(first_look(looks, "png").data)
    print(f"{TARGET}: {TARGET.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("chains"))

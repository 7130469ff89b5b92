"""Every convexity statement of "Data-Based Approach to Hyperelastic Membranes" (Grabs and Wirges), put to the test.

``python -m tests.reference.paper_convexity`` writes data/paper_convexity.csv anew; test_paper_convexity.py pins it.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayesmembrane.ground.registry import material
from bayesmembrane.physics.mechanics.convexity import box_convexity, box_ellipticity

FILE = Path(__file__).parents[2] / "data" / "paper_convexity.csv"
THICKNESS = 50e-6
MPA = 1e6


@dataclass(frozen=True)
class Statement:
    """What the paper says of one set of 3-D constants (MPa; exponents and Gent's limit dimensionless).

    ``claimed`` is True or False where the paper says convex or not convex, None where it gives the set without a word.
    ``edge``: the statement is about the line l2 = 1 of the box, not about all of it.
    """

    text: str
    material: str
    constants: tuple[float, ...]
    claimed: bool | None
    box: tuple[float, float] = (1.0, 8.0)
    edge: bool = False


def in_two_mu_over_alpha_squared(mu: tuple[float, ...], alpha: tuple[float, ...]) -> tuple[float, ...]:
    """Constants of sum mu_i / a_i (...) if the printed ones are those of sum 2 mu_i / a_i^2 (...)."""
    return (*(2 * m / a for m, a in zip(mu, alpha, strict=True)), *alpha)


SETS = {
    1: ((0.76332, 0.36977, 0.37006), (2.0555, 20.3664, -10.1800)),
    2: ((-0.48953, 0.73743, -0.60229), (1.30073, 2.95646, 1.35266)),
    3: ((-3.9516, -0.3780, 5.4001), (-2.3069, -1.3507, -3.8342)),
    4: ((0.69, 0.01, -0.0122), (1.3, 4.0, -2.0)),
    5: ((0.618, 0.0012, -0.01), (1.3, 5.0, -2.0)),
    6: ((0.355, 0.0005, -0.00413), (2.11, 2.58, -3.67)),
}
CONVEX_SETS = (2, 4, 5, 6)

STATEMENTS = (
    Statement("initial parameters, convex (figure)", "neo_hookean", (0.15,), True),
    Statement("convex for positive stretches if C10 > 0", "neo_hookean", (0.15,), True, (0.1, 10.0)),
    Statement("initial parameters, convex (figure)", "mooney_rivlin", (0.14, 0.01), True),
    Statement("the other sign of C01, not convex", "mooney_rivlin", (0.16, -0.01), False),
    Statement("the other sign of C01, yet convex near l2 = 1", "mooney_rivlin", (0.16, -0.01), True, edge=True),
    Statement("initial parameters as misprinted in the summary table", "mooney_rivlin", (0.14, 0.1), None),
    Statement("table of Mooney-Rivlin values, row Comp", "mooney_rivlin", (0.96496, -0.95833), None),
    Statement("table of Mooney-Rivlin values, row Putra", "mooney_rivlin", (0.1147, -0.0161), None),
    Statement("table of Mooney-Rivlin values, row GRNN", "mooney_rivlin", (0.2393, 0.1134), None),
    Statement("initial parameters, convex on the domain", "gent", (0.3 / 2, 50.0), True),
    Statement("convex on the domain, compression included", "gent", (0.3 / 2, 50.0), True, (0.1, 10.0)),
    Statement("initial parameters, convex on [1, 8]^2", "yeoh", (0.15, -0.0015, 0.000015), True),
    Statement("table of Yeoh values, row FEMYeohOgden", "yeoh", (0.6465, -0.3968, 0.2040), None),
    Statement("table of Yeoh values, row Comp", "yeoh", (0.24162, 0.19977, -0.00541), None),
    Statement(
        "row Comp is not suitable for larger deformation", "yeoh", (0.24162, 0.19977, -0.00541), False, (1.0, 5.0)
    ),
    Statement("table of Yeoh values, row YeohWelsim", "yeoh", (0.57382, -0.0747, 0.01132), None),
    Statement("table of Yeoh values, row Bergstrom", "yeoh", (0.173146, -0.00074, 0.000034), None),
    *(
        Statement(f"Ogden set ({k}), as printed", "ogden", (*mu, *alpha), k in CONVEX_SETS)
        for k, (mu, alpha) in SETS.items()
    ),
    *(
        Statement(f"Ogden set ({k}), if printed for 2 mu / a^2", "ogden", in_two_mu_over_alpha_squared(*SETS[k]), None)
        for k in (1, 3)
    ),
)

# The optimised parameters of the results table, printed in N/m; the paper says nothing of their convexity.
RESULTS = (
    Statement("result OP1", "neo_hookean", (7.6191,), None),
    Statement("result OP2", "neo_hookean", (13.245621,), None),
    Statement("result OP1", "mooney_rivlin", (6.21436, 1.4703426), None),
    Statement("result OP2", "mooney_rivlin", (13.459625, -0.1179734), None),
    Statement("result OP1", "gent", (7.6059127, 523.010), None),
    Statement("result OP2", "gent", (5.312, 17.42), None),
    Statement("result OP1", "yeoh", (8.821764, -0.65316385, 0.06163691), None),
    Statement("result OP2", "yeoh", (8.840838, -0.6303258, 0.05632747), None),
    Statement("result OP1", "ogden", (27.999382, 0.03160439, -0.48299527, 1.1806412, 4.9906154, -1.9481684), None),
    Statement("result OP2", "ogden", (11.060008, 0.1959017, -0.3679535, 1.5196142, 5.805068, -1.1529809), None),
)


def rows() -> list[dict[str, str]]:
    """The table, one row a statement."""
    unit = {m: np.where(np.array(material(m).scales) == 1, MPA, 1.0) for m in {s.material for s in STATEMENTS}}
    table = []
    for s in STATEMENTS:
        table.append(row(s, material(s.material).from_3d(np.array(s.constants) * unit[s.material], THICKNESS)))
    for s in RESULTS:
        table.append(row(s, material(s.material).from_vector(s.constants)))
    return table


def row(statement, film) -> dict[str, str]:
    mpa = film.to_3d(THICKNESS) / np.where(np.array(film.scales) == 1, MPA, 1.0)
    low, high = statement.box
    convex, margin, worst = on_edge(film, low, high) if statement.edge else on_box(film, low, high)
    elliptic = box_ellipticity(film, low, high)
    holds = "not stated" if statement.claimed is None else str(statement.claimed == convex).lower()
    return {
        "statement": statement.text,
        "material": statement.material,
        "constants_3d_MPa": joined(mpa),
        "parameters_N_per_m": joined(film.vector),
        "box": f"[{low:g};{high:g}]" + (" x {1}" if statement.edge else "^2"),
        "claimed_convex": "" if statement.claimed is None else str(statement.claimed).lower(),
        "convex": str(convex).lower(),
        "margin": f"{margin:.6g}",
        "worst_l1": f"{worst[0]:.4f}",
        "worst_l2": f"{worst[1]:.4f}",
        "elliptic": "" if statement.edge else str(elliptic.elliptic).lower(),
        "elliptic_margin": "" if statement.edge else f"{elliptic.margin:.6g}",
        "holds": holds,
    }


def on_box(film, low, high):
    answer = box_convexity(film, low, high)
    return answer.convex, answer.margin, answer.worst


def on_edge(film, low, high):
    """The same on the line l2 = 1, the weakest reading of "near l2 = 1"."""
    l1 = np.linspace(low, high, 70001)
    least = np.linalg.eigvalsh(film.hessian(l1, 1.0))[:, 0] / film.shear_modulus(film.vector)
    k = int(np.argmin(least))
    return bool(least[k] >= 0), float(least[k]), (float(l1[k]), 1.0)


def joined(values) -> str:
    return ";".join(f"{v:.8g}" for v in values)


def text() -> str:
    """The table as CSV."""
    table = rows()
    out = io.StringIO()
    writer = csv.DictWriter(out, fieldnames=list(table[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    return out.getvalue()


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
    print(f"wrote {FILE}")

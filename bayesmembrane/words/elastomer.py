"""Whether a modulus is one that an elastomer has: a wrong unit changes nothing else that could be seen."""

from __future__ import annotations

from bayesmembrane.words.language import three_digits

SOFTEST, STIFFEST = 1e2, 1e8
"""Pa: shear moduli of gels begin above the first, those of filled rubber end below a tenth of the second."""


def stiffness_sentence(modulus: float) -> str:
    """What to check where no elastomer has the initial shear ``modulus`` (Pa); "" if one may."""
    if not modulus > 0 or SOFTEST <= modulus <= STIFFEST:
        return ""
    return (
        f"The initial shear modulus is {three_digits(1e-6 * modulus)} MPa, which no elastomer has: check the units of "
        "the forces, and of the thickness."
    )

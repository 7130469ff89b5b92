"""Scales of the errors that are not known beforehand: the values looked at, all equally probable."""

from __future__ import annotations

from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.fit import knob_grid, knobs_at
from bayesmembrane.reconstruction.model import Knobs

NUGGET = 5e-3  # N: a load cell of a few kN resolves millinewtons
ROUNDING = (5e-5, 1.5e-4, 4.5e-4)
SOLVER = (3e-4, 7e-4, 1.6e-3)


def middle(family: CurveFamily, ranges: int) -> Knobs:
    """The setting that is used where one must do."""
    return knobs_at(family.middle, NUGGET, ROUNDING[1], (SOLVER[1],) * ranges)


def all_scales(family: CurveFamily, ranges: int) -> list[Knobs]:
    """Every combination."""
    return knob_grid(family.sizes, (NUGGET,), ROUNDING, SOLVER, ranges)


def solver_scales(family: CurveFamily, ranges: int) -> list[Knobs]:
    """Every error of the simulations, all else in the middle."""
    return knob_grid((family.middle,), (NUGGET,), ROUNDING[1:2], SOLVER, ranges)

"""Forces of a clamped annular membrane, by two independent principles."""

from bayesmembrane.physics.mechanics.api import SOLVERS, Request, Spared, force_curve, profile, profiles, request, solve
from bayesmembrane.physics.mechanics.solution import Curves, Note, Profile, Status

__all__ = [
    "SOLVERS",
    "Curves",
    "Note",
    "Profile",
    "Request",
    "Spared",
    "Status",
    "force_curve",
    "profile",
    "profiles",
    "request",
    "solve",
]

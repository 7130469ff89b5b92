"""Forces of a clamped annular membrane, by two independent principles."""

from bayesmembrane.mechanics.api import SOLVERS, force_curve, profile, solve
from bayesmembrane.mechanics.solution import Curves, Note, Profile, Status

__all__ = ["SOLVERS", "Curves", "Note", "Profile", "Status", "force_curve", "profile", "solve"]

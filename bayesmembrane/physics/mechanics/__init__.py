"""Forces of a clamped annular membrane, by two independent principles."""

from bayesmembrane.physics.mechanics.api import SOLVERS, force_curve, profile, solve
from bayesmembrane.physics.mechanics.solution import Curves, Note, Profile, Status

__all__ = ["SOLVERS", "Curves", "Note", "Profile", "Status", "force_curve", "profile", "solve"]

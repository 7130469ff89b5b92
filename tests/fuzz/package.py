"""Everything that the fuzz takes from the package, in one place."""

from bayesmembrane.app.cli import main
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.convexity import MODES

CONVEXITY = tuple(MODES)
__all__ = ["CONVEXITY", "components", "main"]

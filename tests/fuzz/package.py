"""Everything that the fuzz takes from the package, in one place."""

from bayesmembrane.cli import main
from bayesmembrane.hypothesis import CONVEXITY
from bayesmembrane.registry import components

__all__ = ["CONVEXITY", "components", "main"]

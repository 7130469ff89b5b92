"""The command line, killed by SIGKILL as soon as so many pieces of an answer are kept (0: never); names on stderr.

python -m tests.app.killed PIECES VERB ...
"""

import os
import signal
import sys
from pathlib import Path
from typing import Any
from unittest.mock import patch

from bayesmembrane.app.cli import main
from bayesmembrane.ground import stored
from tests.short_walks import shorten


def killed(most: int) -> None:
    """`main` with the words that are left, until ``most`` pieces are there."""
    kept: list[str] = []

    def counted(folder: Path, name: str, made: Any, answer: Any) -> Path:
        done = stored.store(folder, name, made, answer)
        kept.append(name)
        print(f"piece {name}", file=sys.stderr, flush=True)
        if len(kept) == most:
            os.kill(os.getpid(), signal.SIGKILL)
        return done

    with patch("bayesmembrane.ground.pieces.store", counted):
        main()


if __name__ == "__main__":
    shorten()
    number = int(sys.argv.pop(1))
    killed(number)

"""The command line, killed by SIGKILL as soon as so many pieces of an answer are kept (0: never); names on stderr.

python -m tests.app.killed PIECES VERB ...
python -m tests.app.killed PIECES tasks CAMPAIGN    its tasks, one after the other, as a worker does them
"""

import os
import signal
import sys
from pathlib import Path
from typing import Any
from unittest.mock import patch

from bayesmembrane.app.cli import main
from bayesmembrane.app.tasks import perform
from bayesmembrane.campaign.plan import read_plan
from bayesmembrane.campaign.work import Order, execute
from bayesmembrane.ground import stored
from tests.short_walks import shorten


def tasks(campaign: Path) -> None:
    """All tasks of a campaign."""
    for task in read_plan(campaign).tasks:
        execute(Order(campaign.resolve(), "night", perform), task)


def killed(most: int) -> None:
    """`main` or `tasks` with the words that are left, until ``most`` pieces are there."""
    kept: list[str] = []

    def counted(folder: Path, name: str, made: Any, answer: Any) -> Path:
        done = stored.store(folder, name, made, answer)
        kept.append(name)
        print(f"piece {name}", file=sys.stderr, flush=True)
        if len(kept) == most:
            os.kill(os.getpid(), signal.SIGKILL)
        return done

    with patch("bayesmembrane.ground.pieces.store", counted):
        tasks(Path(sys.argv[2])) if sys.argv[1] == "tasks" else main()


if __name__ == "__main__":
    shorten()
    number = int(sys.argv.pop(1))
    killed(number)

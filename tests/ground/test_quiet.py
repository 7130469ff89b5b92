"""arviz is imported in one place, where its daily warning is kept silent and nobody's filters are touched."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

IMPORT = """
import warnings
warnings.simplefilter("error")
before = list(warnings.filters)
from bayesmembrane.ground.quiet import arviz
assert arviz.ess
assert warnings.filters == before
"""

RACE = """
import pathlib
replace, times = pathlib.Path.replace, []

def gone(part, target):
    if part.name.startswith("daily_warning") and not times:
        times.append(target)
        replace(part, target)  # the other process was first
        raise FileNotFoundError(str(part))
    return replace(part, target)

pathlib.Path.replace = gone
from bayesmembrane.ground.quiet import arviz
assert arviz.ess and times
"""


LATER = """
import sys
from bayesmembrane.app import analyses
assert "arviz" not in sys.modules
from bayesmembrane.ground.quiet import arviz
assert "arviz" not in sys.modules
assert arviz.ess is sys.modules["arviz"].ess
"""


def run(program: str, home: Path) -> subprocess.CompletedProcess[str]:
    """``program`` in a fresh process, on a day on which arviz has not warned yet."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(home), "MPLCONFIGDIR": str(home / "mpl")}
    return subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=300, check=False
    )


def test_the_daily_warning_is_silent_and_the_user_s_filters_stay(tmp_path: Path) -> None:
    done = run(IMPORT, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == done.stderr == ""
    assert list(tmp_path.rglob("daily_warning")), "arviz would have warned"


def test_it_is_imported_when_it_is_used(tmp_path: Path) -> None:
    """A fit uses none of it, and its import is the longest of all."""
    done = run(LATER, tmp_path)
    assert done.returncode == 0, done.stderr


def test_two_processes_at_midnight_both_get_it(tmp_path: Path) -> None:
    done = run(RACE, tmp_path)
    assert done.returncode == 0, done.stderr


def test_where_nothing_can_be_written_it_is_there_all_the_same(tmp_path: Path) -> None:
    done = run("import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n" + IMPORT, tmp_path)
    assert done.returncode == 0, done.stderr

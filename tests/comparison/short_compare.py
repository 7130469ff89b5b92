"""The command line with short walks, in the processes that it starts, too: they run what stands here at the top."""

import signal
import sys

from bayesmembrane.app.cli import main
from tests.short_walks import shorten

shorten()

if __name__ == "__main__":
    # A job that a script puts into the background ignores interruptions; this one must not.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main())

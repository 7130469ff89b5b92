"""Workers of a Dask cluster, as an `Executor`: the scheduler hands a dead worker's task to another one.

The workers see the folder of the campaign under the same path as the client, and have this package installed.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from bayesmembrane.ground.errors import SettingsError

Result = TypeVar("Result")

PATIENCE = 30.0  # s for the scheduler to answer
AHEAD = 2000  # tasks at the scheduler: enough for a cluster that grows with what waits there


class DaskCluster:
    """An `Executor` on the Dask scheduler at ``address`` ("tcp://node1:8786", or the path of a scheduler file).

    Raises `SettingsError` if dask.distributed is not installed, or nobody answers there.
    """

    ahead = AHEAD

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise SettingsError(
                "a cluster needs dask.distributed, which is not installed",
                "--cluster",
                'install it: pip install "bayesmembrane[cluster]"',
            ) from None
        where = {"scheduler_file": address} if address.endswith(".json") else {"address": address}
        try:
            self._client: Any = Client(**where, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise SettingsError(
                f'no Dask scheduler answers at "{address}" ({error})', "--cluster", "start one: dask scheduler"
            ) from None
        self._tasks = self._client.get_executor(pure=False)

    def submit(self, work: Callable[..., Result], *given: Any) -> Future[Result]:
        """See `pool.Executor`; `distributed.KilledWorker` stands for `WorkerDiedError`."""
        future: Future[Result] = self._tasks.submit(work, *given)
        return future

    def workers(self) -> int:
        """See `pool.Executor`."""
        return sum(self._client.nthreads().values())

    def abandon(self) -> None:
        """See `pool.Executor`. What a worker has begun stops by itself, as soon as it looks at the session."""
        self._tasks.shutdown(wait=False)
        self._client.close(timeout=5)

    def close(self) -> None:
        """See `pool.Executor`."""
        self._client.close(timeout=5)

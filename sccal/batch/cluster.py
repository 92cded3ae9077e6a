"""Work on a Dask cluster: the same tasks; results come back as bytes and are written here, so no folder is shared."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import sccal
from sccal.errors import SccalError, UsageError

Result = TypeVar("Result")
RETRIES = 3
"""How often a run is begun anew when its worker is lost."""
CONNECT_S = 10.0


class Cluster:
    """The workers of one scheduler, ``tcp://host:8786``.

    Raises UsageError where there is no such scheduler, the extra is not installed, or workers have another sccal.
    """

    def __init__(self, address: str) -> None:
        try:
            import dask
            import distributed
        except ImportError as error:
            raise UsageError(f"--scheduler {address}: needs Dask; pip install 'sccal-robotics[dask]'") from error
        self._distributed: Any = distributed
        self._address = address
        settings = {
            "distributed.comm.timeouts.connect": CONNECT_S,
            "distributed.scheduler.allowed-failures": RETRIES,
            "distributed.logging": {"distributed": "error"},
        }
        dask.config.set(settings)
        try:
            self._client: Any = self._distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            why = str(error) or type(error).__name__
            raise UsageError(f"--scheduler {address}: cannot be reached within {CONNECT_S:.0f} s ({why})") from error
        try:
            self._require_same_version()
        except BaseException:
            self.close()
            raise

    def results(self, tasks: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result | SccalError]]:
        """As they are done; a task whose worker is lost is begun anew elsewhere."""
        futures = {
            self._client.submit(_done, task, pure=False, retries=RETRIES): place for place, task in enumerate(tasks)
        }
        for future in self._distributed.as_completed(list(futures), loop=self._client.loop):
            place = futures.pop(future)
            try:
                result = future.result()
            except Exception as error:  # what the cluster itself raises: workers lost again and again, no memory
                result = SccalError(f"no result from {self._address} ({type(error).__name__}: {error})")
            future.release()
            yield place, result

    def close(self) -> None:
        """The cluster stays; only the line to it is cut."""
        self._client.close(timeout=CONNECT_S)

    def stop(self) -> None:
        """What is not done yet is dropped there with the line."""
        self.close()

    def _require_same_version(self) -> None:
        try:
            found = self._client.run(version_there)
        except Exception as error:
            raise UsageError(
                f"--scheduler {self._address}: its workers have no sccal to run ({error}); install {sccal.__version__}"
            ) from error
        if not found:
            raise UsageError(f"--scheduler {self._address}: no worker is connected to it; start some")
        others = {where: version for where, version in found.items() if version != sccal.__version__}
        if others:
            where, version = next(iter(others.items()))
            raise UsageError(
                f"--scheduler {self._address}: {len(others)} of {len(found)} workers have another sccal "
                f"({where}: {version}, here: {sccal.__version__}); install the same everywhere"
            )


def version_there() -> str:
    """Of sccal, where this is called."""
    return sccal.__version__


def _done(task: Callable[[], Result]) -> Result:
    return task()

"""A Dask cluster as an executor, where Dask is installed."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from decmcts.errors import InputError

CONNECT_S = 10.0


@contextmanager
def cluster_at(address: str) -> Iterator[Executor]:
    """Yield what computes by the workers of a cluster, each of which has this version installed.

    Raises
    ------
    InputError
        Where Dask is not installed, or no scheduler answers at the address.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError("a cluster needs Dask", advice="pip install 'decmcts[cluster]'") from None
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        why = " ".join(str(error).split())
        raise InputError(
            f"no cluster at {address}: {why}", advice="name its scheduler: tcp://HOST:8786"
        ) from error
    with client:
        yield client.get_executor()

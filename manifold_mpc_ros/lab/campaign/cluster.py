# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The same chunks on a Dask cluster that is there already.

A worker that dies loses nothing: the scheduler gives its chunks to another one, and a chunk is a
function of its names alone.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from manifold_mpc_ros.cli.extras import require
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.campaign.case import CaseName
from manifold_mpc_ros.lab.campaign.chunks import (
    CHUNK,
    CampaignError,
    ChunkRunner,
    Chunks,
    Work,
    in_chunks,
)
from manifold_mpc_ros.lab.campaign.outcome import Outcome
from manifold_mpc_ros.lab.campaign.software import software

CONNECT_LIMIT_S = 30.0

# A controller is not for two threads at once, and a Dask worker may have several.
_of_thread = threading.local()


class Cluster:
    """A connection to a Dask scheduler, which is left as it was found."""

    def __init__(self, client: Any, address: str) -> None:
        """Keep a client that is connected."""
        self._client, self._address = client, address

    @property
    def threads(self) -> int:
        """Cases that the workers run at a time."""
        return sum(self._client.nthreads().values())

    def run(self, work: Work, names: Sequence[CaseName]) -> Chunks:
        """Yield the outcomes of all cases, a chunk at a time, in whatever order they end.

        Closing the iterator cancels what has not been run.

        Raises CampaignError when a case raises, naming it; when a chunk ended several workers,
        when the scheduler is lost, or when a worker has other software than this process.
        """
        from distributed import as_completed
        chunks = in_chunks(names, CHUNK)
        futures = self._client.map(
            _run_chunk, chunks, work=work, expected=software(), pure=False)
        try:
            for _, outcomes in as_completed(futures, with_results=True):
                yield outcomes
        except ManifoldMpcError:
            raise
        except Exception as error:
            what = ' '.join(str(error).split()) or 'no reason given'
            raise CampaignError(
                f'the cluster at {self._address} could not go on: {type(error).__name__}: {what}'
            ) from error
        finally:
            self._client.cancel(futures)


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """Connect to a scheduler that has a worker, disconnect at the end; raises ManifoldMpcError."""
    require('--scheduler', 'distributed')
    from distributed import Client
    try:
        client = Client(address, timeout=CONNECT_LIMIT_S, name='manifold-mpc')
    except (OSError, ValueError, TimeoutError) as error:
        raise CampaignError(
            f'no Dask scheduler at {address!r} (tcp://HOST:PORT): {_first_line(error)}') from None
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_LIMIT_S)
        except TimeoutError:
            raise CampaignError(
                f'the Dask scheduler at {address} has no workers: start some with '
                f'dask worker {address}') from None
        yield Cluster(client, address)


def _run_chunk(names: Sequence[CaseName], *, work: Work, expected: dict[str, str]
               ) -> list[Outcome]:
    """Run a chunk in a thread of a Dask worker, with that thread's own controller."""
    here = software()
    for name, version in expected.items():
        if here[name] != version:
            raise CampaignError(
                f'a worker has {name} {here[name]} where this process has {version}: '
                'install the same everywhere, or the table would depend on who ran what')
    runner: ChunkRunner | None = getattr(_of_thread, 'runner', None)
    if runner is None or runner.work != work:
        runner = _of_thread.runner = ChunkRunner(work)
    return runner.run(names)


def _first_line(error: Exception) -> str:
    """Return the first line of an error's text, or its name."""
    return (str(error).splitlines() or [''])[0] or type(error).__name__

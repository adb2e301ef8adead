# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The record of a campaign while it runs: what is in it is done, what is not is still to do.

One line a chunk, appended when the chunk has ended: a checksum and JSON, numbers with all their
digits. A process that is killed leaves at most one torn line, which is cut off; a damaged line is
left out and its cases are run again. One process writes at a time.
"""

from __future__ import annotations

import fcntl
import json
import os
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from manifold_mpc_ros.lab.campaign.chunks import CampaignError
from manifold_mpc_ros.lab.campaign.outcome import Outcome
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan

JOURNAL, PLAN = 'loops.jsonl', 'campaign.yaml'


class Journal:
    """A campaign's folder, open for one process.

    ``outcomes`` maps the names of the cases that are done to what came of them.

    Raises CampaignError when the folder holds another campaign, one of other software, or one that
    is running.
    """

    def __init__(self, folder: Path, plan: CampaignPlan, software: dict[str, str], *,
                 overwrite: bool = False) -> None:
        """Open or begin the record of a plan; ``overwrite`` begins it anew."""
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.outcomes: dict[str, Outcome] = {}
        self._file = (folder / JOURNAL).open('a+b')
        try:
            self._lock()
            if overwrite:
                self._file.truncate(0)
            self._read({'campaign': plan.digest, **software})
        except BaseException:
            self._file.close()
            raise
        (folder / PLAN).write_text(plan.as_yaml(), encoding='utf-8')

    def __enter__(self) -> Journal:
        """Return the journal."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        """Close it; everything is on the disk."""
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def append(self, outcomes: Iterable[Outcome]) -> None:
        """Record a chunk that has ended; it outlives this process from here on."""
        chunk = list(outcomes)
        self._write([vars(outcome) for outcome in chunk])
        self.outcomes.update({outcome.name: outcome for outcome in chunk})

    def _lock(self) -> None:
        """Keep other processes out until this one ends."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CampaignError(f'{self.folder}: another process is running this campaign'
                                ) from None

    def _read(self, header: dict[str, str]) -> None:
        """Read what is there and check whose it is; or begin with the header."""
        self._file.seek(0)
        data = self._file.read()
        complete = data.rfind(b'\n') + 1
        self._file.truncate(complete)
        lines = data[:complete].splitlines()
        if not lines:
            self._write(header)
            return
        found = _parsed(lines[0])
        if not isinstance(found, dict):
            raise CampaignError(
                f'{self.folder / JOURNAL}: not the record of a campaign; --overwrite replaces it')
        for name, value in header.items():
            if found.get(name) != value:
                what = ('another campaign' if name == 'campaign' else
                        f'this campaign run with {name} {found.get(name)}, now {value}')
                raise CampaignError(f'{self.folder}: holds {what}; --overwrite begins anew, '
                                    '--output names another folder')
        for chunk in map(_parsed, lines[1:]):
            for record in chunk or []:
                outcome = Outcome(**dict(_with_tuples(record)))
                self.outcomes.setdefault(outcome.name, outcome)

    def _write(self, value: Any) -> None:
        """Append one line."""
        text = json.dumps(value, separators=(',', ':')).encode()
        self._file.write(b'%08x %s\n' % (zlib.crc32(text), text))
        self._file.flush()


def _parsed(line: bytes) -> Any:
    """Return the value of a line, None when it is damaged."""
    checksum, _, text = line.partition(b' ')
    return json.loads(text) if checksum == b'%08x' % zlib.crc32(text) else None


def _with_tuples(record: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the fields of an outcome as they were before JSON made lists of them."""
    for key, value in record.items():
        yield key, tuple(value) if isinstance(value, list) else value

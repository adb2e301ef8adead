# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The two storages of rosbag2 as `rosbags` writes them, with what a recorder needs beyond it.

Added to MCAP: the time of publication, a checksum for each chunk (a flipped bit is then found),
small chunks, and a step back where the disk is full. Added to sqlite3: transactions that end
before the recording does. A process that is killed loses at most what came after the last flush.
The package mcap has no step back, and writes no metadata.yaml (docs/libraries.md).
"""

from __future__ import annotations

import os
from binascii import crc32
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import (
    McapWriter,
    PendingChunk,
    write_record,
    write_uint16,
    write_uint32,
    write_uint64,
)
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

#: Size of a chunk that ends it [byte].
CHUNK_BYTES = 1 << 14
_MESSAGE = 0x05
#: Where a chunk record has its checksum: opcode, length, two times, uncompressed size.
_CRC_OFFSET = 1 + 8 + 8 + 8 + 8


class _FirstFile:
    """A bag's folder to the storages: they name their file after it, rosbag2 numbers it too.

    ``ros2 bag reindex`` finds no file without a number.
    """

    def __init__(self, folder: Path) -> None:
        """Name the file."""
        self._folder = folder
        self.name = f'{folder.name}_0'

    def __truediv__(self, name: str) -> Path:
        """Return the path of a file in the folder."""
        return self._folder / name


class RecordingMcap(McapWriter):
    """MCAP storage that can be flushed, and stepped back when a flush failed."""

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        """Create the file."""
        super().__init__(_FirstFile(path), compression)  # type: ignore[arg-type]
        self.published_ns = 0

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Add a message to the chunk; `published_ns` is its time of publication."""
        chunk = self.chunk
        for holder in (self, chunk):
            holder.message_start_time = min(timestamp, holder.message_start_time)
            holder.message_end_time = max(timestamp, holder.message_end_time)
        self.channel_stats[connection.id] += 1
        chunk.msgs[connection.id].append((timestamp, chunk.bio.tell()))
        record = BytesIO()
        write_uint16(record, connection.id)
        write_uint32(record, 0)
        write_uint64(record, timestamp)
        write_uint64(record, self.published_ns)
        record.write(data)
        write_record(chunk.bio, _MESSAGE, record)

    @property
    def due(self) -> bool:
        """Whether the chunk is large enough to be written."""
        return self.chunk.bio.tell() > CHUNK_BYTES

    def flush(self) -> None:
        """Write the pending chunk; when that fails, it is pending still and the file as before."""
        if not self.chunk.bio.tell():
            return
        start, pending, chunks = self.bio.tell(), self.chunk, len(self.chunks)
        try:
            self.close_chunk()
            self.bio.flush()
        except OSError:
            self._step_back(start, pending, chunks)
            raise

    def close_chunk(self) -> None:
        """Write the pending chunk with its checksum."""
        start, checksum = self.bio.tell(), crc32(self.chunk.bio.getbuffer())
        super().close_chunk()
        end = self.bio.tell()
        self.bio.seek(start + _CRC_OFFSET)
        write_uint32(self.bio, checksum)
        self.bio.seek(end)

    def reopen(self) -> BinaryIO:
        """Return the file, open for changes."""
        return self.path.open('r+b')

    def _step_back(self, size: int, pending: PendingChunk, chunks: int) -> None:
        """Cut the file to what it was before a write failed."""
        with suppress(OSError):
            self.bio.close()
        os.truncate(self.path, size)
        self.bio = self.reopen()  # type: ignore[assignment]
        self.bio.seek(size)
        self.chunk = pending
        del self.chunks[chunks:]


class RecordingSqlite3(Sqlite3Writer):
    """sqlite3 storage that can be flushed; it has no field for the time of publication."""

    published_ns = 0
    due = False

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        """Create the database."""
        super().__init__(_FirstFile(path), compression)  # type: ignore[arg-type]

    def flush(self) -> None:
        """End the transaction; the next message begins another."""
        self.conn.commit()

    def counts(self) -> dict[int, int]:
        """Return the number of messages by connection, as the file has them."""
        return dict(self.conn.execute(
            'SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id').fetchall())


class RecordingWriter(Writer):
    """The writer of `rosbags` on the storages above."""

    STORAGE_PLUGINS = {  # noqa: RUF012  (as the class that it extends has it)
        StoragePlugin.MCAP: RecordingMcap,
        StoragePlugin.SQLITE3: RecordingSqlite3,
    }

# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The storage files of a bag: which there are, and each scanned, unpacked where it is compressed.

rosbag2 compresses with zstd whole files (``bag_0.mcap.zstd``) or each message; either is known by
its bytes, so that it is read without metadata.yaml too, and as far as it goes.
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path

from rosbags.rosbag2.storage_mcap import zstd  # type: ignore[attr-defined]

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.scan_mcap import Scan, scan_mcap
from manifold_mpc_ros.lab.recording.bags.scan_sqlite3 import scan_sqlite3

METADATA = 'metadata.yaml'
_SCANS: dict[str, tuple[str, Callable[[Path], Scan]]] = {
    '.mcap': ('mcap', scan_mcap),
    '.db3': ('sqlite3', scan_sqlite3),
}
_PACKED = ('.zstd', '.zst')
_ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_ROS_1_MAGIC = b'#ROSBAG V'
#: So much is decompressed at a time, and lost where a file is damaged [byte].
_PIECE = 1 << 12


def storage_files(path: Path) -> list[Path]:
    """Return the storage files of a folder in the order of time, or the one that is given.

    Where a file is there compressed and unpacked, the unpacked one counts.
    """
    if not path.exists():
        raise BagError(f'{path}: no such bag')
    if path.is_file():
        if not _is_storage(path):
            raise _no_bag(path, f'a folder with {METADATA}, or a file that ends in .mcap or .db3, '
                                'or so and in .zstd')
        return [path]
    files = {unpacked_name(file): file for file in sorted(path.iterdir(), reverse=True)
             if _is_storage(file)}
    if not files:
        older = next((file for file in path.iterdir() if file.suffix == '.bag'), path)
        raise _no_bag(older, 'no file in it ends in .mcap or .db3')
    return sorted(files.values(), key=_order)


def unpacked_name(file: Path) -> str:
    """Return the name of a storage file without the suffix of its compression."""
    return file.stem if file.suffix in _PACKED else file.name


def storage_of(file: Path) -> str:
    """Return rosbag2's name of a file's storage."""
    return _SCANS[Path(unpacked_name(file)).suffix][0]


def scan_file(file: Path) -> Scan:
    """Return what a storage file holds, as far as it goes; raises OSError."""
    scan = _SCANS[Path(unpacked_name(file)).suffix][1]
    if file.suffix not in _PACKED:
        found = scan(file)
    else:
        data, problem = _unpacked(file.read_bytes())
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder, unpacked_name(file))
            copy.write_bytes(data)
            found = scan(copy)
        found.problems[:0] = [problem] if problem else []
    _unpack_messages(found)
    return found


def _is_storage(file: Path) -> bool:
    """Whether a file's name is that of a storage file."""
    return Path(unpacked_name(file)).suffix in _SCANS


def _no_bag(path: Path, expected: str) -> BagError:
    """Return why something is no bag; one of ROS 1 is named with its converter."""
    if path.is_file():
        with path.open('rb') as file:
            if file.read(len(_ROS_1_MAGIC)) == _ROS_1_MAGIC:
                return BagError(f'{path}: a ROS 1 bag; convert it with: rosbags-convert '
                                f'--src {path.name} --dst {path.stem}')
    return BagError(f'{path}: not a bag ({expected})')


def _order(file: Path) -> tuple[int, str]:
    """Return what sorts ``bag_10`` behind ``bag_9``."""
    number = Path(unpacked_name(file)).stem.rpartition('_')[2]
    return (int(number) if number.isdecimal() else 0, file.name)


def _unpacked(data: bytes) -> tuple[bytes, str]:
    """Return what can be decompressed, and in words what is wrong with the rest."""
    parts: list[bytes] = []
    try:
        while data:
            frame, at = zstd.ZstdDecompressor(), 0
            while not frame.eof:
                if at >= len(data):
                    return b''.join(parts), 'the compressed file ends within its data'
                parts.append(frame.decompress(data[at:at + _PIECE]))
                at += _PIECE
            data = frame.unused_data + data[at:]
    except zstd.ZstdError as error:
        return b''.join(parts), f'the compressed file is damaged ({error})'
    return b''.join(parts), ''


def _unpack_messages(scan: Scan) -> None:
    """Decompress messages that are compressed one by one: all of them, or none is."""
    if not all(message.data.startswith(_ZSTD_MAGIC) for message in scan.messages):
        return
    unpacked = [(message, *_unpacked(message.data)) for message in scan.messages]
    scan.messages = [dataclasses.replace(message, data=data)
                     for message, data, problem in unpacked if not problem]
    if len(scan.messages) < len(unpacked):
        scan.problems.append(f'{len(unpacked) - len(scan.messages)} of {len(unpacked)} compressed '
                             'messages are damaged and left out')

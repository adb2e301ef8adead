# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A scan of a sqlite3 storage file that keeps what it can read."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from pathlib import Path

import yaml

from manifold_mpc_ros.lab.recording.bags.contents import BagTopic, RawMessage
from manifold_mpc_ros.lab.recording.bags.scan_mcap import Scan, qos_profiles

#: What the database left beside the file when its process was killed.
_LEFT_OVER = ('-journal', '-wal')


def scan_sqlite3(path: Path) -> Scan:
    """Return what a database holds; raises OSError, and nothing for what is in the file."""
    with path.open('rb') as file:
        if file.read(16) != b'SQLite format 3\x00':
            return Scan(problems=['the file does not begin like a sqlite3 database'])
    left = [suffix for suffix in _LEFT_OVER if path.with_name(path.name + suffix).is_file()]
    if not left:
        return _scan(f'file:{_quoted(path)}?immutable=1')
    with tempfile.TemporaryDirectory() as folder:
        # Opening ends the transaction that was open; the bag itself stays as it is.
        copy = Path(folder, path.name)
        for suffix in ('', *left):
            shutil.copyfile(path.with_name(path.name + suffix),
                            copy.with_name(copy.name + suffix))
        return _scan(f'file:{_quoted(copy)}')


def _scan(uri: str) -> Scan:
    """Read topics, messages and the copy of the metadata, each as far as it goes."""
    scan = Scan()
    connection = sqlite3.connect(uri, uri=True)
    try:
        connection.text_factory = lambda text: text.decode(errors='replace')
        for read in (_read_topics, _read_messages, _read_metadata):
            try:
                read(connection, scan)
            except (sqlite3.Error, ValueError, TypeError, OverflowError, MemoryError,
                    yaml.YAMLError) as error:
                words = ' '.join(str(error).split())
                problem = f'the database is damaged ({words})'
                if problem not in scan.problems:
                    scan.problems.append(problem)
    finally:
        connection.close()
    return scan


def _read_topics(connection: sqlite3.Connection, scan: Scan) -> None:
    """Read the topics; columns that an older schema lacks are empty."""
    columns = [row[1] for row in connection.execute('PRAGMA table_info(topics)')]
    wanted = [name if name in columns else "''" for name in (
        'offered_qos_profiles', 'type_description_hash')]
    for name, kind, qos, type_hash in connection.execute(
            f'SELECT name, type, {", ".join(wanted)} FROM topics ORDER BY id'):
        scan.topics[str(name)] = BagTopic(
            str(name), str(kind), str(type_hash), qos_profiles(str(qos)))


def _read_messages(connection: sqlite3.Connection, scan: Scan) -> None:
    """Read the messages in the order in which they were written."""
    lost = 0
    names = dict(connection.execute('SELECT id, name FROM topics').fetchall())
    for number, stamp, data in connection.execute(
            'SELECT topic_id, timestamp, data FROM messages ORDER BY id'):
        if number in names and isinstance(stamp, int) and isinstance(data, bytes):
            scan.messages.append(RawMessage(str(names[number]), stamp, stamp, data))
        else:
            lost += 1
    if lost:
        scan.problems.append(f'{lost} messages are damaged and left out')


def _read_metadata(connection: sqlite3.Connection, scan: Scan) -> None:
    """Read the copy of metadata.yaml."""
    row = connection.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND name = 'metadata'").fetchone()
    if row is not None:
        text = connection.execute(
            'SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1').fetchone()
        scan.metadata_text = str(text[0]) if text else ''


def _quoted(path: Path) -> str:
    """Return a path as it has to stand in a URI."""
    return str(path).replace('%', '%25').replace('?', '%3f').replace('#', '%23')

# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading any rosbag2 bag: a folder or a storage file, MCAP or sqlite3, whole or damaged.

What can be read is read, with one sentence about each thing that is wrong; a bag from which
nothing can be read is one BagError.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.rosbag2.storage_mcap import zstd  # type: ignore[attr-defined]

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.contents import (
    CUSTOM_CHECKSUMS,
    BagContents,
    BagTopic,
    Checksums,
    RawMessage,
)
from manifold_mpc_ros.lab.recording.bags.scan_mcap import Scan, qos_profiles, scan_mcap
from manifold_mpc_ros.lab.recording.bags.scan_sqlite3 import scan_sqlite3

_SCANS: dict[str, tuple[str, Callable[[Path], Scan]]] = {
    '.mcap': ('mcap', scan_mcap),
    '.db3': ('sqlite3', scan_sqlite3),
}
_METADATA = 'metadata.yaml'
_INFORMATION = 'rosbag2_bagfile_information'


def read_bag(path: str | Path) -> BagContents:
    """Return everything in a bag, in the order in which it was written.

    Arguments
    ---------
    path
        The folder with ``metadata.yaml``, or one storage file (``.mcap``, ``.db3``).

    Raises
    ------
    BagError
        When there is no bag, or not one topic of it can be read. Lesser damage becomes a
        warning of the result.

    """
    path = Path(path)
    warnings: list[str] = []
    try:
        files = _storage_files(path)
        metadata = _read_metadata(path, warnings)
        if str(metadata.get('compression_mode') or 'none').lower() != 'none':
            return _read_compressed(path, metadata)
        scans = [(file, _SCANS[file.suffix][1](file)) for file in files]
    except OSError as error:
        raise BagError(f'{error.filename or path}: {error.strerror or error}') from None
    for file, scan in scans:
        warnings += [f'{file.name}: {problem}' for problem in scan.problems]
    if not metadata:
        metadata = _copy_of_metadata([scan.metadata_text for _, scan in scans])
    topics = _topics(scans, metadata)
    if not topics:
        reasons = '; '.join(warnings) or 'it has no topics'
        raise BagError(f'{path}: nothing can be read from this bag: {reasons}')
    messages = tuple(message for _, scan in scans for message in scan.messages)
    custom = _custom(metadata)
    warnings += _differences(messages, metadata, custom)
    return BagContents(path, _SCANS[files[0].suffix][0], topics, messages, custom,
                       tuple(warnings))


def _storage_files(path: Path) -> list[Path]:
    """Return the storage files of a bag in the order of time."""
    if not path.exists():
        raise BagError(f'{path}: no such bag')
    if path.is_file():
        if path.name == _METADATA:
            return _storage_files(path.parent)
        if path.suffix not in _SCANS:
            raise BagError(f'{path}: not a bag (a folder with {_METADATA}, or a file that ends '
                           'in .mcap or .db3)')
        return [path]
    files = sorted((file for file in path.iterdir() if file.suffix in _SCANS), key=_order)
    packed = [file for file in path.iterdir() if file.suffix == '.zstd']
    if not files and not packed:
        raise BagError(f'{path}: not a bag (no file in it ends in .mcap or .db3)')
    return files


def _order(file: Path) -> tuple[int, str]:
    """Return what sorts ``bag_10`` behind ``bag_9``."""
    number = file.stem.rpartition('_')[2]
    return (int(number) if number.isdecimal() else 0, file.name)


def _read_metadata(path: Path, warnings: list[str]) -> Mapping[str, Any]:
    """Return what metadata.yaml says, empty when it is not there or damaged."""
    file = path / _METADATA if path.is_dir() else path.with_name(_METADATA)
    if path.is_file() and path.name != _METADATA:
        return {}
    if not file.is_file():
        warnings.append(f'{_METADATA} is missing (the recorder was killed?)')
        return {}
    try:
        information = _information(file.read_text(encoding='utf-8', errors='replace'))
    except ValueError as error:
        warnings.append(f'{_METADATA} is damaged ({error})')
        return {}
    return information


def _information(text: str) -> Mapping[str, Any]:
    """Return the mapping of metadata.yaml; raises ValueError."""
    try:
        document = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(' '.join(str(error).split())[:160]) from None
    if isinstance(document, Mapping):
        document = document.get(_INFORMATION, document)
    if not isinstance(document, Mapping) or 'topics_with_message_count' not in document:
        raise ValueError('it does not describe a bag')
    return document


def _copy_of_metadata(texts: list[str]) -> Mapping[str, Any]:
    """Return the metadata that the storage files keep a copy of, empty without one."""
    for text in reversed(texts):
        try:
            return _information(text)
        except ValueError:
            continue
    return {}


def _topics(
    scans: list[tuple[Path, Scan]], metadata: Mapping[str, Any],
) -> dict[str, BagTopic]:
    """Return the topics of the storage files, with the type hashes that metadata has."""
    topics = {name: topic for _, scan in scans for name, topic in scan.topics.items()}
    for entry in _entries(metadata):
        name = entry.get('name')
        topic = topics.get(str(name))
        if topic is not None:
            try:
                qos = topic.qos or qos_profiles(entry.get('offered_qos_profiles', ''))
            except yaml.YAMLError:
                qos = topic.qos
            topics[topic.name] = BagTopic(
                topic.name, topic.kind,
                topic.type_hash or str(entry.get('type_description_hash', '')), qos)
    return topics


def _entries(metadata: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return what metadata says about each topic, with its count; damaged entries left out."""
    given = metadata.get('topics_with_message_count')
    return [{**item['topic_metadata'], 'count': item.get('message_count')}
            for item in (given if isinstance(given, list) else ())
            if isinstance(item, Mapping) and isinstance(item.get('topic_metadata'), Mapping)]


def _custom(metadata: Mapping[str, Any]) -> dict[str, str]:
    """Return the custom data."""
    custom = metadata.get('custom_data')
    return {str(key): str(value) for key, value in custom.items()} \
        if isinstance(custom, Mapping) else {}


def _differences(
    messages: tuple[RawMessage, ...], metadata: Mapping[str, Any], custom: Mapping[str, str],
) -> list[str]:
    """Compare the messages with the counts and the checksums that the recorder noted."""
    counts: dict[str, int] = {}
    for message in messages:
        counts[message.topic] = counts.get(message.topic, 0) + 1
    found = [f'{entry.get("name")}: {counts.get(str(entry.get("name")), 0)} messages were read, '
             f'{entry["count"]} were recorded'
             for entry in _entries(metadata)
             if counts.get(str(entry.get('name')), 0) != entry['count']]
    try:
        recorded = json.loads(custom.get(CUSTOM_CHECKSUMS, '{}'))
        unequal = {name for name, value in Checksums.of(messages).values.items()
                   if name in recorded and recorded[name] != value}
    except (ValueError, TypeError):
        return [*found, 'the checksums of the recording are damaged']
    return found + [f'{name}: messages differ from what was recorded (checksum)'
                    for name in sorted(unequal)]


def _read_compressed(path: Path, metadata: Mapping[str, Any]) -> BagContents:
    """Read a bag whose files or messages are compressed, which has to be whole."""
    try:
        with Reader(path) as reader:
            topics = {connection.topic: BagTopic(connection.topic, connection.msgtype,
                                                 connection.digest)
                      for connection in reader.connections}
            messages = tuple(RawMessage(connection.topic, stamp, stamp, bytes(data))
                             for connection, stamp, data in reader.messages())
    except (ReaderError, ValueError, struct.error, EOFError, RuntimeError, KeyError,
            TypeError, zstd.ZstdError) as error:
        raise BagError(f'{path}: nothing can be read from this compressed bag: '
                       + ' '.join(str(error).split())) from None
    return BagContents(path, str(metadata.get('storage_identifier')), topics, messages,
                       _custom(metadata))

# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading any rosbag2 bag: a folder or a storage file, MCAP or sqlite3, whole or damaged.

What can be read is read, with one sentence about each thing that is wrong; a bag from which
nothing can be read is one BagError.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.contents import (
    CUSTOM_CHECKSUMS,
    BagContents,
    BagTopic,
    Checksums,
    RawMessage,
)
from manifold_mpc_ros.lab.recording.bags.scan_mcap import Scan, qos_profiles
from manifold_mpc_ros.lab.recording.bags.storage_files import (
    METADATA,
    scan_file,
    storage_files,
    storage_of,
    unpacked_name,
)

_INFORMATION = 'rosbag2_bagfile_information'


def read_bag(path: str | Path) -> BagContents:
    """Return everything in a bag, in the order in which it was written.

    Arguments
    ---------
    path
        The folder, its ``metadata.yaml``, or one storage file (``.mcap``, ``.db3``), compressed
        (``.zstd``) or not.

    Raises BagError when there is no bag, or not one topic of it can be read. Lesser damage becomes
    a warning of the result, and what is no damage but good to know a note.

    """
    path = Path(path)
    folder = path.parent if path.name == METADATA and path.is_file() else path
    try:
        files = storage_files(folder)
        metadata, problem = _read_metadata(folder, files)
        scans = [(file, scan_file(file)) for file in files]
    except OSError as error:
        raise BagError(f'{error.filename or path}: {error.strerror or error}') from None
    warnings = [f'{file.name}: {words}' for file, scan in scans for words in scan.problems]
    copy = {} if metadata else _copy_of_metadata([scan.metadata_text for _, scan in scans])
    metadata = metadata or copy
    notes: tuple[str, ...] = ()
    if problem and warnings and not copy:
        warnings.insert(0, problem)
    elif problem:  # the files are whole
        notes = (f'{problem}; its copy in the storage file was read' if copy else problem,)
    topics = _topics(scans, metadata)
    if not topics:
        reasons = '; '.join(warnings) or 'it has no topics'
        raise BagError(f'{path}: nothing can be read from this bag: {reasons}')
    messages = tuple(message for _, scan in scans for message in scan.messages)
    custom = _custom(metadata)
    # The copy in one of several files was written before the others.
    different = [] if copy and len(files) > 1 else _differences(
        topics, messages, metadata, custom)
    warnings += different and _missing(files, metadata) + different
    return BagContents(path, storage_of(files[0]), topics, messages, custom, tuple(warnings),
                       notes)


def _read_metadata(path: Path, files: Sequence[Path]) -> tuple[Mapping[str, Any], str]:
    """Return what metadata.yaml says, empty without it, and in words what is wrong with it.

    That beside a single storage file counts where the file is all that it describes.
    """
    file = (path if path.is_dir() else path.parent) / METADATA
    try:
        information = _information(file.read_text(encoding='utf-8', errors='replace'))
    except FileNotFoundError:
        return {}, f'{METADATA} is missing (the recorder was killed?)' if path.is_dir() else ''
    except ValueError as error:
        return {}, f'{METADATA} is damaged ({error})' if path.is_dir() else ''
    alone = path.is_dir() or [unpacked_name(each) for each in _listed(information)] == [
        unpacked_name(each) for each in files]
    return information if alone else {}, ''


def _listed(metadata: Mapping[str, Any]) -> list[Path]:
    """Return the storage files that metadata describes."""
    given = metadata.get('relative_file_paths')
    return [Path(str(each)) for each in (given if isinstance(given, list) else ())]


def _missing(files: Sequence[Path], metadata: Mapping[str, Any]) -> list[str]:
    """Return a sentence about each file that metadata describes and that is not there."""
    there = {unpacked_name(file) for file in files}
    return [f'{file.name}: the file is missing' for file in _listed(metadata)
            if unpacked_name(file) not in there]


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
    topics: Mapping[str, BagTopic], messages: tuple[RawMessage, ...],
    metadata: Mapping[str, Any], custom: Mapping[str, str],
) -> list[str]:
    """Compare what was read with the types, counts and checksums that the recorder noted."""
    counts: dict[str, int] = {}
    for message in messages:
        counts[message.topic] = counts.get(message.topic, 0) + 1
    found = [f'{entry.get("name")}: {counts.get(str(entry.get("name")), 0)} messages were read, '
             f'{entry["count"]} were recorded'
             for entry in _entries(metadata)
             if counts.get(str(entry.get('name')), 0) != entry['count']]
    found += [f'{name}: has the type {topics[name].kind}, {entry.get("type")} was recorded'
              for entry in _entries(metadata) if (name := str(entry.get('name'))) in topics
              and topics[name].kind != entry.get('type')]
    try:
        recorded = json.loads(custom.get(CUSTOM_CHECKSUMS, '{}'))
        unequal = {name for name, value in Checksums.of(messages).values.items()
                   if name in recorded and recorded[name] != value}
    except (ValueError, TypeError):
        return [*found, 'the checksums of the recording are damaged']
    return found + [f'{name}: messages differ from what was recorded (checksum)'
                    for name in sorted(unequal)]

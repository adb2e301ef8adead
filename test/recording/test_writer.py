# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The writer on a disk that fills up, and what it refuses."""

from __future__ import annotations

import errno
import io
from pathlib import Path
from typing import Any

import pytest
from synthetic import KINDS, run_messages, write_bag

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags import storage
from manifold_mpc_ros.lab.recording.bags.contents import BagTopic
from manifold_mpc_ros.lab.recording.bags.reader import read_bag
from manifold_mpc_ros.lab.recording.bags.writer import RESERVE_BYTES, BagWriter, remove_bag

MESSAGES = run_messages(100)


class SmallDisk(io.FileIO):
    """A file on a disk of this size, on which the folder's other files are as well."""

    size = 0

    def write(self, data: Any) -> int:
        others = sum(file.stat().st_size for file in Path(str(self.name)).parent.iterdir()
                     if file.name != Path(str(self.name)).name)
        left = self.size - others - self.tell()
        if len(data) > left:
            super().write(bytes(data)[:max(left, 0)])  # as a disk does: what fits
            raise OSError(errno.ENOSPC, 'No space left on device')
        return super().write(data)


@pytest.fixture
def small_disk(monkeypatch: pytest.MonkeyPatch) -> int:
    """Give MCAP files a disk with room for the reserve and 60 kB."""
    SmallDisk.size = RESERVE_BYTES + 60_000

    def on_small_disk(self: storage.RecordingMcap) -> io.BufferedWriter:
        return io.BufferedWriter(SmallDisk(str(self.path), 'r+'))

    original = storage.RecordingMcap.__init__

    def begin(self: storage.RecordingMcap, *arguments: Any) -> None:
        original(self, *arguments)
        at = self.bio.tell()
        self.bio.close()
        self.bio = on_small_disk(self)  # type: ignore[assignment]
        self.bio.seek(at)

    monkeypatch.setattr(storage.RecordingMcap, '__init__', begin)
    monkeypatch.setattr(storage.RecordingMcap, 'reopen', on_small_disk)
    return SmallDisk.size


def test_a_full_disk_leaves_a_whole_bag(small_disk: int, tmp_path: Path) -> None:
    path = tmp_path / 'bag'
    written = 0

    def write_all() -> None:
        nonlocal written
        for message in MESSAGES:
            writer.write(message)
            written += 1

    with BagWriter(path) as writer:
        for topic in dict.fromkeys(message.topic for message in MESSAGES):
            writer.add_topic(BagTopic(topic, KINDS[topic]))
        with pytest.raises(BagError, match=r'cannot write the bag: No space left on device'):
            write_all()
    contents = read_bag(path)
    assert contents.warnings == ()
    assert 20 < written < len(MESSAGES)
    assert list(contents.messages) == MESSAGES[:len(contents.messages)]
    assert len(contents.messages) >= written
    assert sum(file.stat().st_size for file in path.iterdir()) < small_disk


def test_what_was_flushed_is_there_when_the_process_is_killed(tmp_path: Path) -> None:
    for name in ('mcap', 'sqlite3'):
        writer = BagWriter(tmp_path / name, name)
        for topic in dict.fromkeys(message.topic for message in MESSAGES):
            writer.add_topic(BagTopic(topic, KINDS[topic]))
        for message in MESSAGES[:50]:
            writer.write(message)
        writer.flush()
        writer.write(MESSAGES[50])
        contents = read_bag(tmp_path / name)
        assert [(m.topic, m.data) for m in contents.messages] == [
            (m.topic, m.data) for m in MESSAGES[:50]]
        said = contents.warnings if name == 'mcap' else contents.notes
        assert said[0] == 'metadata.yaml is missing (the recorder was killed?)'
        writer.close()
        assert len(read_bag(tmp_path / name).messages) == 51


def test_closing_twice_is_closing_once(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as writer:
        writer.close()
    assert not (tmp_path / 'bag' / '.reserve').exists()


def test_a_bag_that_is_there_is_not_touched(tmp_path: Path) -> None:
    path = write_bag(tmp_path / 'bag', MESSAGES[:3])
    with pytest.raises(BagError, match='exists already, not overwriting'):
        BagWriter(path)
    assert len(read_bag(path).messages) == 4


def test_a_type_without_definition_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as writer:
        assert not writer.knows('my_msgs/msg/Thing')
        with pytest.raises(BagError, match=r'the definition of my_msgs/msg/Thing is not'):
            writer.add_topic(BagTopic('/thing', 'my_msgs/msg/Thing'))


def test_only_bags_are_removed(tmp_path: Path) -> None:
    path = write_bag(tmp_path / 'bag', MESSAGES[:3])
    remove_bag(path)
    assert not path.exists()
    write_bag(tmp_path / 'folder', MESSAGES[:3])
    precious = tmp_path / 'folder' / 'precious.txt'
    precious.write_text('thesis')
    for taken in (tmp_path / 'folder', precious):
        with pytest.raises(BagError, match='than a bag; it is not overwritten'):
            remove_bag(taken)
    assert precious.read_text() == 'thesis'

# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Damaged bags: what can be read is read and the damage is told, or there is one clear error."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from synthetic import run_messages, write_bag

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.contents import BagContents
from manifold_mpc_ros.lab.recording.bags.reader import read_bag
from manifold_mpc_ros.lab.recording.bags.run import read_run

FUZZ = settings(max_examples=30, deadline=None,
                suppress_health_check=[HealthCheck.function_scoped_fixture])


def damaged(whole: Path, folder: Path, name: str, data: bytes) -> Path:
    """Return a copy of a bag with other bytes in one of its files."""
    copy = folder / 'copy'
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(whole, copy)
    (copy / name).write_bytes(data)
    return copy


def storage_file(whole: Path) -> Path:
    return next(file for file in whole.iterdir() if file.suffix in ('.mcap', '.db3'))


def read_or_error(path: Path) -> BagContents | str:
    """Return what is in a bag, or the words of the one error that reading may raise."""
    try:
        return read_bag(path)
    except BagError as error:
        return str(error)


def told_or_equal(path: Path, whole: Path) -> None:
    """What was read is what was recorded, unless a warning or the one error says otherwise."""
    contents = read_or_error(path)
    if isinstance(contents, str):
        assert contents.startswith(str(path))
        assert '\n' not in contents
        return
    if contents.messages != read_bag(whole).messages:
        assert contents.warnings
    assert all('\n' not in warning for warning in contents.warnings)
    try:
        run = read_run(path)
    except BagError:
        assert contents.warnings
    else:
        assert set(contents.warnings) <= set(run.warnings)


@given(position=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
@FUZZ
def test_a_flipped_bit(
    whole: Path, tmp_path: Path, position: float, bit: int,
) -> None:
    file = storage_file(whole)
    data = bytearray(file.read_bytes())
    data[int(position * len(data))] ^= 1 << bit
    told_or_equal(damaged(whole, tmp_path, file.name, bytes(data)), whole)


def test_a_type_that_is_damaged_is_told(whole: Path, tmp_path: Path) -> None:
    file = storage_file(whole)
    if file.suffix != '.db3':
        pytest.skip('a chunk has a checksum')
    data = file.read_bytes().replace(b'nav_msgs/msg/Odometry', b'nav_msfs/msg/Odometry')
    path = damaged(whole, tmp_path, file.name, data)
    assert read_bag(path).warnings == (
        '/odometry: has the type nav_msfs/msg/Odometry, nav_msgs/msg/Odometry was recorded',)
    told_or_equal(path, whole)


@given(position=st.floats(0.0, 1.0, exclude_max=True))
@example(position=0.0)
@FUZZ
def test_a_truncated_file(whole: Path, tmp_path: Path, position: float) -> None:
    file = storage_file(whole)
    data = file.read_bytes()
    told_or_equal(damaged(whole, tmp_path, file.name, data[:int(position * len(data))]), whole)


@given(position=st.floats(0.0, 1.0, exclude_max=True), byte=st.integers(0, 255))
@FUZZ
def test_damaged_metadata(whole: Path, tmp_path: Path, position: float, byte: int) -> None:
    data = bytearray((whole / 'metadata.yaml').read_bytes())
    data[int(position * len(data))] = byte
    told_or_equal(damaged(whole, tmp_path, 'metadata.yaml', bytes(data)), whole)


@given(data=st.binary(max_size=200))
@FUZZ
def test_noise_behind_the_right_beginning(whole: Path, tmp_path: Path, data: bytes) -> None:
    file = storage_file(whole)
    start = file.read_bytes()[:100]
    told_or_equal(damaged(whole, tmp_path, file.name, start + data), whole)


def test_without_metadata_everything_is_there(whole: Path, tmp_path: Path) -> None:
    copy = tmp_path / 'copy'
    shutil.copytree(whole, copy)
    (copy / 'metadata.yaml').unlink()
    contents = read_bag(copy)
    assert contents.messages == read_bag(whole).messages
    assert dict(contents.custom) == dict(read_bag(whole).custom)
    assert contents.warnings == ()  # the file has a copy of it, and an end
    assert contents.notes == ('metadata.yaml is missing (the recorder was killed?); its copy in '
                              'the storage file was read',)
    assert read_bag(storage_file(copy)).warnings == ()


def test_a_truncated_mcap_gives_its_whole_chunks(tmp_path: Path) -> None:
    messages = run_messages(200)
    whole = write_bag(tmp_path / 'whole', messages)
    data = storage_file(whole).read_bytes()
    (whole / 'whole_0.mcap').write_bytes(data[:len(data) // 2])
    run = read_run(whole)
    read = run.contents.messages[1:]
    assert 0.3 * len(messages) < len(read) < len(messages)
    assert list(read) == messages[:len(read)]
    assert any('cannot be read from byte' in warning for warning in run.warnings)
    assert any(f'messages were read, {200} were recorded' in warning for warning in run.warnings)


def test_a_flipped_bit_in_a_message_is_found_in_either_storage(
    whole: Path, tmp_path: Path,
) -> None:
    file = storage_file(whole)
    data = file.read_bytes()
    message = read_bag(whole).of('/odometry')[2].data
    at = data.index(message) + len(message) // 2
    flipped = data[:at] + bytes([data[at] ^ 1]) + data[at + 1:]
    warnings = read_bag(damaged(whole, tmp_path, file.name, flipped)).warnings \
        if file.suffix == '.db3' else ()
    if file.suffix == '.db3':
        assert warnings == ('/odometry: messages differ from what was recorded (checksum)',)
    else:  # all of this small bag is one chunk
        with pytest.raises(BagError, match='Chunk checksum mismatch'):
            read_bag(damaged(whole, tmp_path, file.name, flipped))


def test_what_is_no_bag(tmp_path: Path) -> None:
    with pytest.raises(BagError, match='no such bag'):
        read_bag(tmp_path / 'nothing')
    (tmp_path / 'text.txt').write_text('text')
    with pytest.raises(BagError, match=r'a folder with metadata.yaml, or a file that ends'):
        read_bag(tmp_path / 'text.txt')
    with pytest.raises(BagError, match=r'no file in it ends in .mcap or .db3'):
        read_bag(tmp_path)
    for suffix, words in (('.mcap', 'begin like an MCAP'), ('.db3', 'begin like a sqlite3')):
        file = tmp_path / f'noise{suffix}'
        file.write_bytes(b'noise' * 100)
        with pytest.raises(BagError, match=words):
            read_bag(file)

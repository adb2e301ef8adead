# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compare own code with the libraries that could replace it; writes docs/results/libraries.json.

    pip install joblib mcap && python benchmarks/libraries.py

`mcap` beside the MCAP storage of lab/recording/bags: what a killed recorder leaves, what can be
read of damaged files, speed. `joblib` beside lab/workers: a worker that dies, a parent that is
killed, time for small jobs. docs/libraries.md has the decisions.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, Writer

from manifold_mpc_ros.lab.recording.bags.contents import BagTopic, RawMessage
from manifold_mpc_ros.lab.recording.bags.scan_mcap import scan_mcap
from manifold_mpc_ros.lab.recording.bags.storage import CHUNK_BYTES
from manifold_mpc_ros.lab.recording.bags.writer import BagWriter
from manifold_mpc_ros.lab.workers import Workers

TOP = Path(__file__).resolve().parents[1]
RESULT = TOP / 'docs' / 'results' / 'libraries.json'
TOPIC, KIND = '/imu', 'sensor_msgs/msg/Imu'
MESSAGES, JOBS = 20_000, 2_000
DATA = bytes(range(256)) + bytes(68)  # as long as an Imu
START_NS = 1_800_000_000_000_000_000


def write_own(path: Path, count: int) -> float:
    """Write messages by our storage, leave a part of them open; return the time it took [s]."""
    writer = BagWriter(path)
    writer.add_topic(BagTopic(TOPIC, KIND))
    begin = time.perf_counter()
    for index in range(count):
        writer.write(RawMessage(TOPIC, START_NS + index, START_NS + index, DATA))
    took = time.perf_counter() - begin
    if count == MESSAGES:
        writer.close()
    return took


def write_mcap(path: Path, count: int) -> float:
    """Write messages by the library, with chunks as large as ours; the same otherwise."""
    path.mkdir()
    with (path / 'bag.mcap').open('wb') as file:
        writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.NONE)
        writer.start('ros2')
        schema = writer.register_schema(KIND, 'ros2msg', b'')
        channel = writer.register_channel(TOPIC, 'cdr', schema)
        begin = time.perf_counter()
        for index in range(count):
            writer.add_message(channel, START_NS + index, DATA, START_NS + index)
        took = time.perf_counter() - begin
        if count != MESSAGES:
            os._exit(0)  # as killed: no buffer is flushed
        writer.finish()
        return took


def own_messages(path: Path) -> Iterator[bytes]:
    """Yield what our scan reads."""
    yield from (message.data for message in scan_mcap(path).messages)


def indexed_messages(path: Path) -> Iterator[bytes]:
    """Yield what the library reads by the index."""
    with path.open('rb') as file:
        yield from (found.data for _, _, found in make_reader(
            file, validate_crcs=True).iter_messages(log_time_order=False))


def sequential_messages(path: Path) -> Iterator[bytes]:
    """Yield what the library reads from front to back."""
    with path.open('rb') as file:
        yield from (found.data for _, _, found in NonSeekingReader(
            file, validate_crcs=True).iter_messages(log_time_order=False))


READERS: dict[str, Callable[[Path], Iterator[bytes]]] = {
    'own scan': own_messages, 'mcap, by the index': indexed_messages,
    'mcap, front to back': sequential_messages}
WRITERS = {'own writer': write_own, 'mcap': write_mcap}


def read(path: Path, reader: Callable[[Path], Iterator[bytes]]) -> dict[str, Any]:
    """Return how many messages came, how many of them were wrong, and what ended it."""
    begin, good, wrong, ended = time.perf_counter(), 0, 0, ''
    try:
        for data in reader(path):
            good, wrong = good + (data == DATA), wrong + (data != DATA)
    except Exception as error:  # noqa: BLE001 (whatever a library raises is what is asked for)
        ended = type(error).__name__
    return {'read': good, 'wrong': wrong, 'ended_by': ended,
            'seconds': round(time.perf_counter() - begin, 3)}


def recordings(folder: Path) -> dict[str, Any]:
    """Return what became of whole, truncated, damaged and unfinished files."""
    found: dict[str, Any] = {'messages': MESSAGES, 'write_us_per_message': {}, 'after_kill': {}}
    for name, write in WRITERS.items():
        found['write_us_per_message'][name] = round(
            1e6 * write(folder / name, MESSAGES) / MESSAGES, 1)
        unfinished = folder / f'{name} killed'
        subprocess.run([sys.executable, __file__, name, str(unfinished)], check=False)
        found['after_kill'][name] = read(
            next(unfinished.glob('*.mcap')), own_messages)['read']
    whole = next((folder / 'own writer').glob('*.mcap'))
    content = whole.read_bytes()
    flipped = bytearray(content)
    flipped[len(content) // 5] ^= 4
    for what, changed in (('whole', content), ('cut in the middle', content[:len(content) // 2]),
                          ('a bit flipped at a fifth', bytes(flipped))):
        path = folder / 'changed.mcap'
        path.write_bytes(changed)
        found[what] = {name: read(path, reader) for name, reader in READERS.items()}
    return found


def job(index: int) -> int:
    """Do nothing; the one below 0 ends its process."""
    if index < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    if 'WAIT' in os.environ:
        time.sleep(60)
    return index


def job_of(_state: int, index: int) -> int:
    """Do the same with a state."""
    return job(index)


def run_own(jobs: Sequence[int]) -> Iterator[int]:
    """Yield results of our workers."""
    with Workers(int, 2) as workers:
        yield from (result for _, result in workers.run(job_of, jobs))


def run_joblib(jobs: Sequence[int]) -> Iterator[int]:
    """Yield results of the library."""
    yield from Parallel(n_jobs=2, return_as='generator_unordered', batch_size=1)(
        delayed(job)(index) for index in jobs)


POOLS = {'own workers': run_own, 'joblib': run_joblib}


def pools() -> dict[str, Any]:
    """Return times, results before a worker's death, and processes that outlive the parent."""
    found: dict[str, Any] = {'jobs': JOBS}
    for name, run in POOLS.items():
        begin = time.perf_counter()
        assert sorted(run(range(JOBS))) == list(range(JOBS))
        took, done, error = time.perf_counter() - begin, 0, ''
        try:
            for _ in run([*range(10), -1, *range(11, JOBS)]):
                done += 1
        except Exception as raised:  # noqa: BLE001 (as above)
            error = type(raised).__name__
        found[name] = {'seconds': round(took, 2), 'results_before_a_death': done,
                       'raised': error, 'alive_after_the_parent': orphans(name)}
    return found


def orphans(name: str) -> int:
    """Return how many workers live two seconds after their parent was killed in mid-job."""
    parent = subprocess.Popen([sys.executable, __file__, name], start_new_session=True,
                              env={**os.environ, 'WAIT': '1'}, stdout=subprocess.DEVNULL)
    end = time.monotonic() + 30.0
    while len(group(parent.pid)) < 3 and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(2.0)
    parent.kill()
    parent.wait()
    time.sleep(2.0)
    left = [pid for pid in group(parent.pid) if b'resource_tracker' not in
            Path(f'/proc/{pid}/cmdline').read_bytes()]
    for pid in group(parent.pid):
        os.kill(pid, signal.SIGKILL)
    return len(left)


def group(leader: int) -> list[int]:
    """Return the processes of a session."""
    found = []
    for path in Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = path.read_text().rpartition(')')[2].split()
        except OSError:
            continue
        if int(fields[3]) == leader and fields[0] != 'Z':
            found.append(int(path.parent.name))
    return found


def lines(*paths: str) -> int:
    """Return the lines of some files of the package."""
    return sum(len((TOP / 'manifold_mpc_ros/lab' / path).read_text(encoding='utf-8').splitlines())
               for path in paths)


def megabytes(*names: str) -> float:
    """Return the installed size of some distributions."""
    return round(sum(Path(str(file.locate())).stat().st_size for name in names
                     for file in metadata.files(name) or [] if file.locate().is_file()) / 1e6, 1)


def main() -> None:
    """Measure and write; with arguments: run one part, as a process that ends badly."""
    if len(sys.argv) > 2:
        WRITERS[sys.argv[1]](Path(sys.argv[2]), MESSAGES // 2)
        os._exit(0)
    if len(sys.argv) > 1:
        list(POOLS[sys.argv[1]](range(20)))
        return
    with tempfile.TemporaryDirectory() as folder:
        data = {
            'mcap': {'version': metadata.version('mcap'),
                     'megabytes_more': megabytes('mcap', 'zstandard'),
                     'own_lines': {'scan': lines('recording/bags/scan_mcap.py'),
                                   'storage': lines('recording/bags/storage.py')},
                     **recordings(Path(folder))},
            'joblib': {'version': metadata.version('joblib'),
                       'megabytes_more': megabytes('joblib'),
                       'own_lines': {'workers': lines('workers.py')}, **pools()}}
    RESULT.write_text(json.dumps(data, indent=1) + '\n', encoding='utf-8')
    print(json.dumps(data, indent=1))


if __name__ == '__main__':
    main()

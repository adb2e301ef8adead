# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of faults, first part: what can happen to messages between the nodes."""

from __future__ import annotations

import math

from manifold_mpc_ros.lab.fault_injection import disturbances as d
from manifold_mpc_ros.lab.fault_injection.cdr import CLOCK, ODOMETRY, WRENCH, Part
from manifold_mpc_ros.lab.fault_injection.disturbances import Edit, MakeDisturbance
from manifold_mpc_ros.lab.fault_injection.fault import (
    SIMULATED_TIME,
    STATE,
    TORQUE,
    Expectation,
    Fault,
    OnTopic,
    PublisherGone,
    SecondPublisher,
)

Q, RATE, TORQUE_VECTOR = ODOMETRY.quaternion, ODOMETRY.vector, WRENCH.vector
NO_STATE = frozenset({'HOLD', 'FALLBACK', 'COAST'})
#: Now and then the stored plan, where the machine is late as well.
MOSTLY_NOMINAL = frozenset({'NOMINAL', 'HOLD'})

NOT_FINITE = 'NaN or Inf in state, setpoint, time'
NORM = 'zero or non-unit quaternion'
SIGNS = 'q and -q alternating'
NOISE = 'exact 180 degrees, with noise'
FRAMES = 'wrong or empty frame_id'
STAMPS = 'stale, duplicate, out of order, future, zero, negative stamps'
JUMP = 'time jumps back'
NO_CLOCK = '/clock never comes'
LINK = 'message loss, latency, jitter'
PUBLISHERS = 'publisher dies, two publishers of the state or of the torque'
RATES = 'rate beyond the existence guard'
DEAD_AXIS = 'saturation, a dead axis'
BYTES = 'malformed bytes'
COMMAND_LIFE = 'controller killed or hung'


def _refused(name: str, does: str, row: str, edit: Edit, reason: str) -> Fault:
    """Return a fault in which every state has to be refused for a reason."""
    return Fault(name, does, row, OnTopic(STATE, d.edited(ODOMETRY, edit)), Expectation(
        modes=NO_STATE, counters=(f'controller.refused.odometry.{reason}',)))


def _garbled(topic: str, name: str, does: str, disturbance: MakeDisturbance) -> Fault:
    """Return a fault in which no reader may trust the bytes; a few may still be readable."""
    return Fault(f'{"state" if topic == STATE else "torque"}-{name}', f'{does} on {topic}',
                 BYTES, OnTopic(topic, disturbance))


STATE_FAULTS = (
    _refused('state-nan-attitude', 'a component of the attitude is NaN', NOT_FINITE,
             d.some_part(Q, math.nan), 'non_finite'),
    _refused('state-inf-rate', 'a component of the rate is infinite', NOT_FINITE,
             d.some_part(RATE, math.inf), 'non_finite'),
    Fault('state-nan-third', 'NaN in every third state, drawn', NOT_FINITE,
          OnTopic(STATE, d.edited(ODOMETRY, d.some_part(RATE, math.nan), 0.3)),
          Expectation(counters=('controller.refused.odometry.non_finite',))),
    _refused('state-zero-quaternion', 'the quaternion is zero', NORM, d.filled(Q, 0.0),
             'quaternion_norm'),
    _refused('state-long-quaternion', 'the quaternion is 5 % too long', NORM,
             d.scaled(Q, 1.05), 'quaternion_norm'),
    _refused('state-huge-quaternion', 'the quaternion is 1e200 times too long', NORM,
             d.scaled(Q, 1e200), 'quaternion_norm'),
    _refused('state-wrong-frame', 'frame_id names another frame', FRAMES, d.text(0, 'odom'),
             'wrong_frame'),
    _refused('state-empty-frame', 'frame_id is empty', FRAMES, d.text(0, ''), 'wrong_frame'),
    _refused('state-wrong-body', 'child_frame_id names another frame', FRAMES,
             d.text(1, 'camera'), 'wrong_frame'),
    _refused('state-long-frame', 'frame_id is 64 kB long', FRAMES, d.text(0, 'x' * 65536),
             'wrong_frame'),
    _refused('state-stale', 'stamps are 10 s old', STAMPS, d.shifted(-10.0), '*'),
    _refused('state-future', 'stamps are 10 s ahead', STAMPS, d.shifted(10.0), 'future'),
    _refused('state-zero-stamp', 'stamps are zero', STAMPS, d.stamped(0, 0), 'invalid_stamp'),
    _refused('state-negative-stamp', 'stamps are negative', STAMPS, d.stamped(-5, 0),
             'invalid_stamp'),
    _refused('state-odd-stamp', 'nanoseconds of the stamp are 4 294 967 295', STAMPS,
             d.stamped(-2**31, 2**32 - 1), 'invalid_stamp'),
    Fault('state-frozen', 'the same state again and again', STAMPS, OnTopic(STATE, d.frozen),
          Expectation(modes=NO_STATE, counters=('controller.refused.odometry.duplicate',))),
    Fault('state-repeated', 'every state three times', STAMPS,
          OnTopic(STATE, d.repeated(3)), Expectation(
              counters=('controller.refused.odometry.duplicate',), stays=MOSTLY_NOMINAL)),
    Fault('state-swapped', 'every two states in the other order', STAMPS,
          OnTopic(STATE, d.swapped), Expectation(
              counters=('controller.refused.odometry.*',), stays=MOSTLY_NOMINAL)),
    Fault('state-signs', 'q or -q, drawn', SIGNS,
          OnTopic(STATE, d.edited(ODOMETRY, d.random_sign(Q))),
          Expectation(stays=MOSTLY_NOMINAL)),
    Fault('state-noise', 'attitude noise of 1e-3 on the slew from 180 degrees', NOISE,
          OnTopic(STATE, d.edited(ODOMETRY, d.noisy(Q, 1e-3, unit=True))),
          Expectation(stays=MOSTLY_NOMINAL)),
    Fault('state-any-attitude', 'an attitude that jumps at random', RATES,
          OnTopic(STATE, d.edited(ODOMETRY, d.noisy(Q, 1.0, unit=True)))),
    Fault('state-fast', 'a rate of 70 rad/s, where the implicit step does not exist', RATES,
          OnTopic(STATE, d.edited(ODOMETRY, d.filled(RATE, 40.0))),
          Expectation(modes=frozenset({'FALLBACK'}))),
    Fault('state-huge-rate', 'a finite rate of 1e300 rad/s', RATES,
          OnTopic(STATE, d.edited(ODOMETRY, d.filled(RATE, 1e300)))),
    Fault('state-lost-10', '10 % of the states are lost', LINK, OnTopic(STATE, d.lost(0.1)),
          Expectation(stays=MOSTLY_NOMINAL)),
    # Ten in a row are as old as a state may be, and rightly end in COAST; four are half of that.
    Fault('state-lost-50', '50 % of the states are lost, at most 4 in a row', LINK,
          OnTopic(STATE, d.lost(0.5, most_in_a_row=4)), Expectation(stays=MOSTLY_NOMINAL)),
    Fault('state-lost', 'no state arrives', LINK, OnTopic(STATE, d.lost()),
          Expectation(modes=NO_STATE)),
    Fault('state-late', 'states are 30 ms late', LINK, OnTopic(STATE, d.late(0.03, 0.03))),
    Fault('state-jitter', 'states are 0 to 60 ms late, some overtake others', LINK,
          OnTopic(STATE, d.late(0.0, 0.06)),
          Expectation(counters=('controller.refused.odometry.*',)), duration_s=2.0),
    Fault('state-publisher-dies', 'the publisher of the state goes away', PUBLISHERS,
          PublisherGone(STATE), Expectation(modes=NO_STATE, recovery_s=4.0)),
    Fault('state-second-publisher', 'another participant publishes attitudes at random',
          PUBLISHERS, SecondPublisher(STATE, d.edited(ODOMETRY, d.noisy(Q, 1.0, unit=True))),
          Expectation(modes=frozenset({'FAULT', 'HOLD', 'COAST'}), reset=True,
                      recovery_s=4.0), duration_s=1.0),
    *(_garbled(STATE, name, does, d.garbled(garble)) for name, does, garble in (
        ('random-bytes', 'random bytes', d.random_bytes),
        ('truncated', 'truncated messages', d.truncated),
        ('huge-length', 'a text whose length goes beyond the message', d.huge_length),
        ('flipped-bits', 'flipped bits', d.flipped),
        ('encapsulation', 'random encapsulation headers', d.header_flipped))),
)

TORQUE_FAULTS = (
    *(Fault(f'torque-{name}', does, row, OnTopic(TORQUE, d.edited(WRENCH, edit)),
            Expectation(counters=(f'simulator.refused.torque_command.{reason}',)))
      for name, does, row, edit, reason in (
        ('nan', 'a component of the command is NaN', NOT_FINITE,
         d.some_part(TORQUE_VECTOR, math.nan), 'non_finite'),
        ('inf', 'a component of the command is infinite', NOT_FINITE,
         d.some_part(TORQUE_VECTOR, -math.inf), 'non_finite'),
        ('wrong-frame', 'the command is in another frame', FRAMES, d.text(0, 'inertial'),
         'wrong_frame'))),
    Fault('torque-huge', 'commands of 1e9 N m reach the plant', DEAD_AXIS,
          OnTopic(TORQUE, d.edited(WRENCH, d.filled(TORQUE_VECTOR, 1e9))),
          Expectation(recovery_s=2.0), duration_s=0.3),
    Fault('torque-dead-axis', 'the torque about x never acts', DEAD_AXIS,
          OnTopic(TORQUE, d.edited(WRENCH, d.filled(Part(3, 4), 0.0)))),
    Fault('torque-lost', 'no command arrives', COMMAND_LIFE, OnTopic(TORQUE, d.lost()),
          Expectation(counters=('simulator.expired_commands',))),
    Fault('torque-lost-50', '50 % of the commands are lost', LINK, OnTopic(TORQUE, d.lost(0.5))),
    Fault('torque-late', 'commands are 40 ms late', LINK, OnTopic(TORQUE, d.late(0.04, 0.04))),
    Fault('torque-jitter', 'commands are 0 to 60 ms late', LINK,
          OnTopic(TORQUE, d.late(0.0, 0.06))),
    Fault('torque-repeated', 'every command five times', STAMPS, OnTopic(TORQUE, d.repeated(5))),
    Fault('torque-frozen', 'the same command again and again', STAMPS,
          OnTopic(TORQUE, d.frozen)),
    Fault('torque-publisher-dies', 'the publisher of the command goes away', PUBLISHERS,
          PublisherGone(TORQUE), Expectation(
              counters=('simulator.expired_commands',), recovery_s=4.0)),
    Fault('torque-second-publisher', 'another participant commands torque too', PUBLISHERS,
          SecondPublisher(TORQUE, d.edited(WRENCH, d.scaled(TORQUE_VECTOR, -1.0))),
          Expectation(counters=('simulator.torque_latched',), reset=True, recovery_s=4.0),
          duration_s=1.0),
    *(_garbled(TORQUE, name, does, d.garbled(garble)) for name, does, garble in (
        ('random-bytes', 'random bytes', d.random_bytes),
        ('truncated', 'truncated messages', d.truncated),
        ('flipped-bits', 'flipped bits', d.flipped))),
)

CLOCK_FAULTS = tuple(
    Fault(f'clock-{name}', does, row, OnTopic(SIMULATED_TIME, disturbance), expected,
          simulated_time=True)
    for name, does, row, disturbance, expected in (
        ('stops', '/clock ceases', NO_CLOCK, d.lost(), Expectation(silent=True)),
        ('back', '/clock is 1.5 s behind', JUMP, d.edited(CLOCK, d.shifted(-1.5)),
         Expectation(silent=True, recovery_s=2.0)),
        ('ahead', '/clock is 100 s ahead', JUMP, d.edited(CLOCK, d.shifted(100.0)),
         Expectation(silent=True, recovery_s=2.0)),
        ('zero', '/clock shows zero', NO_CLOCK, d.edited(CLOCK, d.stamped(0, 0)),
         Expectation(silent=True, recovery_s=2.0)),
        ('negative', '/clock shows a negative time', NOT_FINITE,
         d.edited(CLOCK, d.stamped(-5, 0)), Expectation(silent=True, recovery_s=2.0)),
        ('random-bytes', 'random bytes on /clock', BYTES, d.garbled(d.random_bytes),
         Expectation(silent=True, recovery_s=2.0)),
    ))

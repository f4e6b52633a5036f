"""Robots' bags (rosbag2, MCAP): the joint states in them as columns, by the reader `rosbags`."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .delimited import Table
from .printable import listed

# The message that holds positions, velocities and efforts of joints by name.
STATE = "sensor_msgs/msg/JointState"
FIELDS = ("position", "velocity", "effort")
SUFFIXES = ("mcap", "db3", "bag")


def is_bag(path: Path) -> bool:
    """Whether a folder is a bag."""
    return (path / "metadata.yaml").is_file()


def library(path: Path) -> Any:
    """The reader, or a message that says what to install."""
    try:
        import rosbags.highlevel
        import rosbags.typesys
    except ImportError as error:
        raise ValueError(
            f"{path}: bags need rosbags, which is not installed. Install it: "
            'pip install "jaxfric[ros]".'
        ) from error
    return rosbags


class States(NamedTuple):
    """What a bag holds: its topics, those of joint states, and their messages with receipt, ns."""

    topics: list[str]
    own: list[str]
    messages: list[tuple[int, Any]]


def states(path: Path) -> States:
    """The joint states of a bag; errors are those of the reader."""
    rosbags = library(path)
    store = rosbags.typesys.get_typestore(rosbags.typesys.Stores.LATEST)
    with rosbags.highlevel.AnyReader([path], default_typestore=store) as reader:
        own = [each for each in reader.connections if each.msgtype == STATE]
        rows = [
            (stamp, reader.deserialize(raw, each.msgtype))
            for each, stamp, raw in (reader.messages(connections=own) if own else ())
        ]
        topics = sorted({each.topic for each in reader.connections})
    return States(topics, sorted({each.topic for each in own}), rows)


def table(path: Path, found: States) -> Table:
    """Time, s, and `JOINT/position`, `JOINT/velocity`, `JOINT/effort` of every joint.

    The time is that of the message's header, or of its receipt where that is empty.

    **Raises:** `ValueError` for no or several topics of joint states, naming those there are.
    """
    rows = found.messages
    if len(found.own) != 1 or not rows:
        raise ValueError(
            f"{path}: has {len(found.own)} topics of {STATE} with {len(rows)} messages; one topic "
            f"is needed. The topics are: {listed(found.own or found.topics)}. Write one that holds "
            "joint states into a bag of its own."
        )
    stamps = np.array([m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for _, m in rows])
    late = not np.all(stamps > 0)
    if late:
        stamps = np.array([received for received, _ in rows])
    columns = {"time": (stamps - stamps[0]) * 1e-9}
    for i, (_, state) in enumerate(rows):
        for field in FIELDS:
            # A joint that is not moved by a motor may have no effort: the array is empty.
            for name, value in zip(state.name, getattr(state, field), strict=False):
                column = columns.setdefault(f"{name}/{field}", np.full(len(rows), np.nan))
                column[i] = value
    notes = [f"Read from the topic {found.own[0]}."]
    if late:
        notes.append("Its messages carry no time; that of their receipt is taken.")
    return Table(columns, 1, notes)

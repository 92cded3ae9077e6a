"""A topic whose messages name ever other joints takes no memory for each of the names."""

from __future__ import annotations

import pytest

from sccal.errors import DataError
from tests.message_logs import cdr, json_bytes, read_bytes, ros2_bytes, stamp


def joints(i: int) -> dict[str, object]:
    names = [f"left{i:05}", f"right{i:05}"]
    return {"header": stamp(1000.0 + i), "name": names, "position": [0.1 * i, 0.1 * i], "velocity": [], "effort": []}


@pytest.mark.parametrize("encoding", ["cdr", "json"])
def test_joints_that_change_their_names_are_refused(tmp_path, encoding):
    kind = "sensor_msgs/msg/JointState"
    if encoding == "cdr":
        data = ros2_bytes(("/joints", kind, i + 1, cdr(kind.replace("/msg", ""), joints(i))) for i in range(400))
    else:
        data = json_bytes(("/joints", kind, i + 1, joints(i)) for i in range(400))
    with pytest.raises(DataError, match="more than 256 different fields"):
        read_bytes(tmp_path, data)

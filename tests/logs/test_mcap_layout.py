"""Columns gathered by numpy against the stock decoders, message by message."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.logs.messages.definitions import known_definitions, parse_definitions
from sccal.logs.messages.json_values import JsonGatherer
from sccal.logs.messages.layout import Gatherer, MalformedError, Part, Picked
from sccal.logs.messages.protobuf import ProtobufWalker, parse_descriptors
from sccal.logs.messages.ros import RosWalker
from tests.message_logs import as_dict, cdr, decoded, fill, proto_classes

JOINTS = "sensor_msgs/msg/JointState"
finite = st.floats(allow_nan=False, allow_infinity=False)
few = st.lists(finite, max_size=4)


def everything(paths: Iterable[str], texts: Mapping[str, str]) -> Picked:
    """All numbers, by their paths; strings decide nothing."""
    return Picked({path: path for path in paths})


def take(gatherer: Gatherer | JsonGatherer, messages: list[bytes], at_once: int = 7) -> list[dict[str, float]]:
    """The numbers of each message by path, taken some at a time; NaN-free because of the paths of each part."""
    for first in range(0, len(messages), at_once):
        some = messages[first : first + at_once]
        end = np.cumsum([len(one) for one in some])
        begin = end - [len(one) for one in some]
        gatherer.take(np.frombuffer(b"".join(some) or b"\0", dtype=np.uint8), begin, end, first)
    rows: list[dict[str, float]] = [{} for _ in messages]
    for part in gatherer.parts:
        for name, column in part.columns.items():
            for index, value in zip(part.index.tolist(), column.tolist(), strict=True):
                rows[index][name] = value
    return rows


def flat(value: Any, path: str = "") -> dict[str, float]:
    """All numbers of a nested message by path."""
    if isinstance(value, dict):
        parts = [flat(below, f"{path}.{name}" if path else name) for name, below in value.items()]
    elif isinstance(value, list):
        parts = [flat(below, f"{path}[{i}]") for i, below in enumerate(value)]
    else:
        return {} if isinstance(value, str) else {path: float(value)}
    return {name: number for part in parts for name, number in part.items()}


joint_states = st.fixed_dictionaries(
    {
        "header": st.fixed_dictionaries(
            {
                "stamp": st.fixed_dictionaries(
                    {"sec": st.integers(-(2**31), 2**31 - 1), "nanosec": st.integers(0, 10**9 - 1)}
                ),
                "frame_id": st.text("abcé", max_size=5),
            }
        ),
        "name": st.lists(st.text("lr_", max_size=9), max_size=3),
        "position": few,
        "velocity": few,
        "effort": few,
    }
)


@settings(max_examples=60)
@given(st.lists(joint_states, min_size=1, max_size=20))
def test_cdr_is_read_as_the_stock_decoder_reads_it(values: list[dict[str, Any]]) -> None:
    messages = [cdr(JOINTS, one) for one in values]
    found = take(Gatherer(RosWalker(known_definitions(), "sensor_msgs/JointState"), everything), messages)
    assert found == [flat(as_dict(decoded(JOINTS, raw))) for raw in messages]


@settings(max_examples=40)
@given(st.lists(joint_states, min_size=1, max_size=8))
def test_either_byte_order_reads_the_same(values: list[dict[str, Any]]) -> None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    little = [cdr(JOINTS, one) for one in values]
    big = [
        bytes(store.serialize_cdr(store.deserialize_cdr(raw, JOINTS), JOINTS, little_endian=False)) for raw in little
    ]
    assert big[0][:2] == b"\0\0"
    walker = RosWalker(known_definitions(), "sensor_msgs/JointState")
    assert take(Gatherer(walker, everything), big) == take(Gatherer(walker, everything), little)


def test_in_xcdr2_numbers_are_aligned_to_four_bytes() -> None:
    definitions = parse_definitions("a/B", "uint8 first\nfloat64 second")
    raw = b"\0\x07\0\0" + b"\x05\0\0\0" + np.array([2.5]).tobytes()
    assert take(Gatherer(RosWalker(definitions, "a/B"), everything), [raw]) == [{"first": 5.0, "second": 2.5}]


def test_parameter_lists_are_refused_and_counted() -> None:
    gatherer = Gatherer(RosWalker(known_definitions(), "std_msgs/Float64"), everything)
    assert take(gatherer, [b"\0\x03\0\0" + bytes(8)]) == [{}]
    assert gatherer.malformed == [0]
    assert "0003" in gatherer.why


@settings(max_examples=100)
@given(joint_states, st.data())
def test_no_bytes_make_the_walk_leave_the_message(value: dict[str, Any], data: st.DataObject) -> None:
    raw = bytearray(cdr(JOINTS, value))
    del raw[data.draw(st.integers(4, len(raw))) :]
    for _ in range(data.draw(st.integers(0, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.sampled_from([0, 1, 0x7F, 0xFF]))
    try:
        shape = RosWalker(known_definitions(), "sensor_msgs/JointState").shape(bytes(raw))
    except MalformedError:
        return
    for place in (*shape.numbers.values(), *shape.texts.values()):
        assert 0 <= place.offset <= place.offset + place.width <= len(raw)


def test_definitions_as_ros_writes_them() -> None:
    text = """# a comment
uint8 MODE_A=1
string<=20 NAME="x # y"
Header header   # after it
Part[2] two
other_msgs/msg/Thing[] many
float32[<=3] bounded
int16 count 7
================================================================================
MSG: my_msgs/Part
time when
float64 x
===
MSG: other_msgs/Thing
char c
wstring w
"""
    found = parse_definitions("my_msgs/Root", text)
    assert [(f.name, f.type, f.count) for f in found["my_msgs/Root"]] == [
        ("header", "std_msgs/Header", None),
        ("two", "my_msgs/Part", 2),
        ("many", "other_msgs/Thing", -1),
        ("bounded", "float32", -1),
        ("count", "int16", None),
    ]
    assert found["my_msgs/Part"][0].type == "builtin_interfaces/Time"


KINDS = {
    "Inner": {"x": "double", "f": "float", "deep": "Leaf"},
    "Leaf": {"s": "sint32", "u": "fixed64"},
    "Outer": {
        "a": "int64",
        "b": "uint32",
        "on": "bool",
        "text": "string",
        "inner": "Inner",
        "list": "double*",
        "ints": "int32*",
        "many": "Inner*",
    },
}
inner = st.fixed_dictionaries(
    {
        "x": st.sampled_from([0.0, 1.5]) | finite,
        "f": st.sampled_from([0.0, 0.5, -2.25]),
        "deep": st.fixed_dictionaries({"s": st.integers(-(2**31), 2**31 - 1), "u": st.integers(0, 2**62)}),
    }
)
outer = st.fixed_dictionaries(
    {
        "a": st.integers(-(2**53), 2**53),
        "b": st.integers(0, 2**32 - 1),
        "on": st.booleans(),
        "text": st.text("ab", max_size=3),
        "inner": inner,
        "list": few,
        "ints": st.lists(st.integers(-5, 300), max_size=3),
        "many": st.lists(inner, max_size=2),
    }
)


@settings(max_examples=60)
@given(st.lists(outer, min_size=1, max_size=12))
def test_protobuf_is_read_as_the_stock_decoder_reads_it(values: list[dict[str, Any]]) -> None:
    classes, descriptors = proto_classes("some.pack", KINDS)

    def make(value: dict[str, Any]) -> bytes:
        message = classes["Outer"]()
        many = value["many"]
        fill(message, {name: part for name, part in value.items() if name != "many"})
        for one in many:
            fill(message.many.add(), one)
        return bytes(message.SerializeToString())

    walker = ProtobufWalker(parse_descriptors(descriptors), "some.pack.Outer")
    assert take(Gatherer(walker, everything), [make(value) for value in values]) == [flat(value) for value in values]


@settings(max_examples=60)
@given(st.lists(joint_states, min_size=1, max_size=12))
def test_json_is_read_as_written(values: list[dict[str, Any]]) -> None:
    found = take(JsonGatherer(everything), [json.dumps(value).encode() for value in values])
    wanted = [flat(value) for value in values]
    for one, other in zip(found, wanted, strict=True):
        # A message is read by the first plan that fits, which may leave out what earlier messages did not have.
        assert one.items() <= other.items()
    assert found[0] == wanted[0]


def test_pinned_strings_keep_apart_what_they_name() -> None:
    def positions(paths: Iterable[str], texts: Mapping[str, str]) -> Picked:
        names = {path: text for path, text in texts.items() if path.startswith("name")}
        columns = {text: f"position{path[4:]}" for path, text in names.items()}
        return Picked({name: path for name, path in columns.items() if path in set(paths)}, pinned=list(names))

    orders = [["left", "rite"], ["rite", "left"]]
    values = [{"name": orders[i % 2], "position": [float(i), float(-i)]} for i in range(20)]
    wanted = [dict(zip(v["name"], v["position"], strict=True)) for v in values]
    walker = RosWalker(known_definitions(), "sensor_msgs/JointState")
    assert take(Gatherer(walker, positions), [cdr(JOINTS, value) for value in values]) == wanted
    assert take(JsonGatherer(positions), [json.dumps(value).encode() for value in values]) == wanted


def test_layouts_are_found_again_over_many_messages() -> None:
    values = [{"position": [0.5] * (1 + i % 3), "header": {"frame_id": "x" * (i % 5)}} for i in range(500)]
    gatherer = Gatherer(RosWalker(known_definitions(), "sensor_msgs/JointState"), everything)
    take(gatherer, [cdr(JOINTS, value) for value in values], at_once=500)
    assert len(gatherer.parts) <= 15
    assert sum(part.index.size for part in gatherer.parts) == 500
    assert all(isinstance(part, Part) for part in gatherer.parts)


@pytest.mark.parametrize("schema", [b"\xff\xff", b"\x0a\x05ab", b"\x0b"])
def test_a_schema_that_is_no_descriptor_set(schema: bytes) -> None:
    with pytest.raises(MalformedError):
        parse_descriptors(schema)

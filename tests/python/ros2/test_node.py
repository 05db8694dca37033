"""The node of ROS 2 against messages that have the fields and types of their definitions, and no others.

The definitions are those of ROS 2 (common_interfaces); mcap_ros2 serialises what the node publishes by them.
That of WrenchStamped equals that of Palpate's recordings. ROS 2 itself is not there.
"""

from __future__ import annotations

import importlib.util
import sys
import time
import types
from pathlib import Path

import numpy as np
import pytest
from mcap_ros2._dynamic import generate_dynamic, serialize_dynamic

import palpate
from palpate.scene import BuiltScene, Scene

NODE = Path(__file__).parents[3] / "examples" / "ros2" / "palpate_node.py"
LINE = "\n" + "=" * 80 + "\nMSG: "
HEADER = (
    "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
    + LINE
    + "builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
)
VECTOR = "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
WRENCH = (
    f"std_msgs/Header header\ngeometry_msgs/Wrench wrench{LINE}{HEADER}{LINE}"
    f"geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque{LINE}{VECTOR}"
)
CLOUD = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
    f"uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense{LINE}{HEADER}{LINE}sensor_msgs/PointField\n"
    "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n"
    "uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count"
)


def message(name: str, /, **fields):
    """Class of a message that takes its own fields alone, each of its own type: as rclpy's messages assert."""

    def __init__(self, **given):
        for field, kind in fields.items():
            object.__setattr__(self, field, given.pop(field) if field in given else kind())
        assert not given, f"{name} has no {', '.join(given)}"

    def __setattr__(self, field, value):
        assert field in fields, f"{name} has no field {field}"
        kind = fields[field]
        wanted = (bytes, bytearray) if kind is bytes else kind
        assert isinstance(value, wanted) and not (kind is int and isinstance(value, bool)), f"{name}.{field}: {value!r}"
        object.__setattr__(self, field, value)

    return type(name, (), {"__init__": __init__, "__setattr__": __setattr__})


TIME = message("Time", sec=int, nanosec=int)
HEADER_MESSAGE = message("Header", stamp=TIME, frame_id=str)
POINT = message("Point", x=float, y=float, z=float)
QUATERNION = message("Quaternion", x=float, y=float, z=float, w=float)
POSE = message("Pose", position=POINT, orientation=QUATERNION)
WRENCH_MESSAGE = message("Wrench", force=POINT, torque=POINT)
POSE_STAMPED = message("PoseStamped", header=HEADER_MESSAGE, pose=POSE)
WRENCH_STAMPED = message("WrenchStamped", header=HEADER_MESSAGE, wrench=WRENCH_MESSAGE)
POINT_FIELD = message("PointField", name=str, offset=int, datatype=int, count=int)
POINT_FIELD.FLOAT32 = 7
POINT_CLOUD = message(
    "PointCloud2",
    **{"header": HEADER_MESSAGE, "height": int, "width": int, "fields": list, "is_bigendian": bool},
    **{"point_step": int, "row_step": int, "data": bytes, "is_dense": bool},
)


class Publisher:
    def __init__(self, kind, topic, depth):
        self.kind, self.topic, self.sent = kind, topic, []

    def publish(self, sent):
        assert isinstance(sent, self.kind)
        self.sent.append(sent)


class Node:
    """What the node uses of rclpy's: a name, parameters, publishers, subscriptions, timers and a clock."""

    def __init__(self, name):
        self.name, self.publishers, self.subscriptions, self.timers = name, {}, {}, []

    def declare_parameter(self, name, default):
        return types.SimpleNamespace(value=default)

    def create_publisher(self, kind, topic, depth):
        self.publishers[topic] = Publisher(kind, topic, depth)
        return self.publishers[topic]

    def create_subscription(self, kind, topic, callback, depth):
        self.subscriptions[topic] = (kind, callback)

    def create_timer(self, period, callback):
        self.timers.append((period, callback))

    def get_clock(self):
        now = types.SimpleNamespace(to_msg=lambda: TIME(sec=12, nanosec=345))
        return types.SimpleNamespace(now=lambda: now)

    def destroy_node(self):
        return


def node_of(patch: pytest.MonkeyPatch, built: BuiltScene):
    """The example's node with a scene, on stand-ins for the modules of ROS 2."""
    modules = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "geometry_msgs": {},
        "geometry_msgs.msg": {"PoseStamped": POSE_STAMPED, "WrenchStamped": WRENCH_STAMPED},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"PointCloud2": POINT_CLOUD, "PointField": POINT_FIELD},
    }
    for name, contents in modules.items():
        module = types.ModuleType(name)
        vars(module).update(contents)
        patch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("palpate_node", NODE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    patch.setattr(palpate.Scene, "read", lambda path: built)
    return module.PalpateNode()


@pytest.fixture
def node(monkeypatch, block, block_green):
    scene = Scene(body={"model": "beam"}, tool={"radius": 0.006}, device={"ramp": 0.0}, view={"strain_limit": 0})
    running = node_of(monkeypatch, BuiltScene.of(scene, block, block_green))
    yield running
    running.close()


def pose(z: float):
    return POSE_STAMPED(
        pose=POSE(position=POINT(x=0.04, y=0.025, z=z), orientation=QUATERNION(x=0.0, y=0.0, z=0.0, w=1.0))
    )


def test_topics_and_messages_are_those_of_crtk_and_ros(node):
    kind, measured = node.subscriptions["measured_cp"]
    assert kind is POSE_STAMPED and set(node.publishers) == {"servo_cf", "surface"}
    begun = time.monotonic()
    while (passed := time.monotonic() - begun) < 1.5:
        measured(pose(0.058 - 0.004 * min(1.0, passed)))
        time.sleep(0.002)
    answers = node.publishers["servo_cf"].sent
    assert answers[0].wrench.force.z == 0.0 and answers[-1].wrench.force.z > 0.02
    assert answers[-1].header.frame_id == "world" and answers[-1].header.stamp.sec == 12
    read = round_trip("geometry_msgs/WrenchStamped", WRENCH, answers[-1])
    assert read.wrench.force.z == answers[-1].wrench.force.z
    [(period, surface)] = node.timers
    surface()
    cloud = round_trip("sensor_msgs/PointCloud2", CLOUD, node.publishers["surface"].sent[-1])
    assert period == pytest.approx(0.1) and [f.name for f in cloud.fields] == ["x", "y", "z", "displacement"]
    rows = np.frombuffer(bytes(cloud.data), "<f4").reshape(cloud.height * cloud.width, cloud.point_step // 4)
    assert cloud.row_step == len(bytes(cloud.data)) and np.isfinite(rows).all() and rows[:, 3].max() > 1e-4
    assert rows[:, 2].max() == pytest.approx(0.05, abs=2e-3)


def test_silence_ends_the_force(node):
    measured = node.subscriptions["measured_cp"][1]
    begun = time.monotonic()
    while (passed := time.monotonic() - begun) < 1.0:
        measured(pose(0.058 - 0.004 * min(1.0, 2 * passed)))
        time.sleep(0.002)
    assert node.device.latest()[2] > 0.02
    time.sleep(0.5)
    assert not node.device.latest().any()
    assert "no measured_cp" in node.simulation.frame().statistics["fault"]


def test_a_pose_that_is_none_is_left_out(node):
    measured = node.subscriptions["measured_cp"][1]
    measured(pose(float("nan")))
    wrong = pose(0.06)
    wrong.pose.orientation = QUATERNION(x=0.0, y=0.0, z=0.0, w=0.0)
    measured(wrong)
    assert node.device.reading is None and len(node.publishers["servo_cf"].sent) == 2


def test_recordings_have_the_same_wrench(tmp_path, block, block_green):
    from mcap.reader import make_reader

    path = tmp_path / "press.mcap"
    scene = Scene(body={"model": "beam"}, tool={"radius": 0.006})
    simulation = palpate.Simulation(BuiltScene.of(scene, block, block_green))
    simulation.record(path)
    with simulation:
        time.sleep(0.2)
    simulation.stop_recording()
    with path.open("rb") as stream:
        schemas = {s.name: s.data.decode() for s in make_reader(stream).get_summary().schemas.values()}
    recorded = schemas["geometry_msgs/msg/WrenchStamped"]
    sent = serialize_dynamic("geometry_msgs/WrenchStamped", WRENCH)["geometry_msgs/WrenchStamped"](WRENCH_STAMPED())
    again = serialize_dynamic("geometry_msgs/WrenchStamped", recorded)["geometry_msgs/WrenchStamped"](WRENCH_STAMPED())
    assert sent == again


def round_trip(name: str, definition: str, sent):
    raw = serialize_dynamic(name, definition)[name](sent)
    return generate_dynamic(name, definition)[name](raw)

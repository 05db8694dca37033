"""A node of ROS 2 that feels soft tissue for a robot or a haptic device, in the words of CRTK.

`measured_cp` (geometry_msgs/PoseStamped) moves the first tool of a scene. The node answers each with `servo_cf`
(geometry_msgs/WrenchStamped, N and N m about the tip, on the tool), and publishes `surface` (sensor_msgs/PointCloud2:
x, y, z and displacement, m) ten times a second. Both stand in the frame of the scene.

Run it where ROS 2 and Palpate are installed: python3 palpate_node.py --ros-args -p scene:=block.toml -r __ns:=/MTML
Not verified with a running ROS 2: its messages were compared with their definitions.
"""

import sys
import threading
import time
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2, PointField

import palpate

SURFACE_RATE = 10.0  # Hz
LONGEST_SILENCE = 0.1  # s
COLUMNS = ("x", "y", "z", "displacement")


class CrtkDevice(palpate.Device):
    """Tool that is where `measured_cp` says, and whose force is kept for `servo_cf`."""

    name = "CRTK"
    limits = palpate.DeviceLimits(max_damping=2.0)

    def __init__(self):
        self.lock = threading.Lock()
        self.reading, self.heard = None, 0.0
        self.wrench = np.zeros(6)

    def measured(self, position, orientation):
        """Take a pose: m, and a quaternion w x y z of any length but zero."""
        turned = np.asarray(orientation, float)
        length = np.linalg.norm(turned)
        if not (np.isfinite(position).all() and np.isfinite(length) and length > 0.5):
            return
        with self.lock:
            self.reading, self.heard = palpate.Reading(tuple(position), tuple(turned / length)), time.monotonic()

    def read(self):
        """Give the latest pose; silence is a fault, and then the force is zero."""
        with self.lock:
            if self.reading is not None and time.monotonic() - self.heard > LONGEST_SILENCE:
                self.reading = None
                raise TimeoutError("no measured_cp for a tenth of a second: does the robot still publish?")
            return self.reading

    def write(self, force, torque):
        """Keep the force until the next pose is answered."""
        with self.lock:
            self.wrench = np.concatenate([force, torque])

    def latest(self):
        """Force and torque (6,) of the latest tick."""
        with self.lock:
            return self.wrench.copy()


class PalpateNode(Node):
    """Scene, force loop and topics."""

    def __init__(self):
        super().__init__("palpate")
        scene = self.declare_parameter("scene", "block.toml").value
        self.frame_id = self.declare_parameter("frame_id", "world").value
        self.device = CrtkDevice()
        self.simulation = palpate.Simulation(palpate.Scene.read(Path(scene)), devices={0: self.device})
        self.forces = self.create_publisher(WrenchStamped, "servo_cf", 1)
        self.surface = self.create_publisher(PointCloud2, "surface", 1)
        self.create_subscription(PoseStamped, "measured_cp", self.measured, 1)
        self.create_timer(1.0 / SURFACE_RATE, self.publish_surface)
        self.simulation.start()

    def measured(self, message):
        """Take a pose, and answer with the latest force."""
        place, turned = message.pose.position, message.pose.orientation
        self.device.measured((place.x, place.y, place.z), (turned.w, turned.x, turned.y, turned.z))
        answer = WrenchStamped()
        self.stamp(answer.header)
        wrench = self.device.latest().tolist()
        answer.wrench.force.x, answer.wrench.force.y, answer.wrench.force.z = wrench[:3]
        answer.wrench.torque.x, answer.wrench.torque.y, answer.wrench.torque.z = wrench[3:]
        self.forces.publish(answer)

    def publish_surface(self):
        """Publish the deformed surface of the first body as rows of four floats."""
        drawn = self.simulation.frame().bodies[0].surface_in_scene()
        largest = np.linalg.norm(drawn.displacements, axis=1)
        rows = np.column_stack([drawn.positions + drawn.displacements, largest]).astype("<f4")
        cloud = PointCloud2()
        self.stamp(cloud.header)
        cloud.height, cloud.width = 1, len(rows)
        cloud.fields = [
            PointField(name=name, offset=4 * rank, datatype=PointField.FLOAT32, count=1)
            for rank, name in enumerate(COLUMNS)
        ]
        cloud.is_bigendian, cloud.is_dense = False, True
        cloud.point_step = 4 * len(COLUMNS)
        cloud.row_step = cloud.point_step * len(rows)
        cloud.data = rows.tobytes()
        self.surface.publish(cloud)

    def stamp(self, header):
        """Put time and frame into a header."""
        header.stamp = self.get_clock().now().to_msg()
        header.frame_id = self.frame_id

    def close(self):
        """Stop the loop: the force ends."""
        self.simulation.stop()


def main(arguments=None):
    """Spin until Ctrl-C."""
    rclpy.init(args=arguments)
    node = PalpateNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.close()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main(sys.argv)

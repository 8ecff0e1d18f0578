#!/usr/bin/env python3
"""Every topic publishes with the right frame and fields; stimuli move the muscle; bad input does not harm it. For the
default tissue, the solid (topics.test), and the other (topics_fluid.test)."""
import math
import struct
import sys
import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Float64
from visualization_msgs.msg import Marker, MarkerArray

from helper import Latest, Log, publisher
from sph_muscle.msg import ExternalForce, MuscleState, StimulusCommand

FIELDS = ["x", "y", "z", "displacement", "pressure", "membrane_potential", "activation", "fibre_stretch"]


class TopicsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("topics_test")
        cls.solid = rospy.get_param("/muscle/sph_muscle/tissue", "solid") == "solid"
        cls.log = Log()
        cls.state = Latest("/muscle/state", MuscleState)
        cls.stimulus = publisher("/muscle/stimulus", Float64)
        cls.command = publisher("/muscle/stimulus_command", StimulusCommand)
        cls.activation = publisher("/muscle/activation_command", Float64)
        cls.force = publisher("/muscle/external_force", ExternalForce)

    def check_header(self, header):
        self.assertEqual(header.frame_id, "test_frame")
        self.assertGreater(header.stamp.to_sec(), 1e9)

    def test_particles(self):
        cloud = Latest("/muscle/particles", PointCloud2).wait()
        self.check_header(cloud.header)
        self.assertEqual([field.name for field in cloud.fields], FIELDS)
        self.assertTrue(all(field.datatype == PointField.FLOAT32 for field in cloud.fields))
        self.assertEqual(cloud.point_step, 32)
        self.assertEqual(len(cloud.data), 32 * cloud.width * cloud.height)
        self.assertLess(abs(cloud.width - 600), 7)
        values = struct.unpack("<%df" % (8 * cloud.width), cloud.data)
        self.assertTrue(all(math.isfinite(value) for value in values))
        length = max(values[0::8]) - min(values[0::8])
        self.assertTrue(0.1 < length < 0.3, "the muscle is %g m long" % length)
        self.assertTrue(all(0 <= value <= 1 for value in values[6::8]))

    def test_surface(self):
        surface = Latest("/muscle/surface", Marker).wait()
        self.check_header(surface.header)
        self.assertEqual(surface.type, Marker.TRIANGLE_LIST)
        self.assertGreater(len(surface.points), 300)
        self.assertEqual(len(surface.points) % 3, 0)
        self.assertEqual(len(surface.colors), len(surface.points))
        self.assertTrue(0 < surface.colors[0].a < 1)

    def test_markers(self):
        markers = Latest("/muscle/markers", MarkerArray).wait().markers
        for marker in markers:
            self.check_header(marker.header)
        self.assertEqual({marker.ns for marker in markers}, {"displacement", "attachments", "electrodes", "text"})
        attached = [marker for marker in markers if marker.ns == "attachments"]
        self.assertEqual(len(attached), 2)
        self.assertTrue(all(len(marker.points) > 10 for marker in attached))
        self.assertEqual(len({(marker.ns, marker.id) for marker in markers}), len(markers))

    def test_state(self):
        first = self.state.wait()
        self.check_header(first.header)
        self.assertFalse(first.failed)
        self.assertEqual(first.nonfinite, 0)
        self.assertTrue(0.1 < first.length < 0.3)
        later = self.state.wait(lambda state: state.simulated_time > first.simulated_time + 0.2)
        self.assertGreater(later.steps, first.steps)
        self.state.wait(lambda state: 0.01 < state.real_time_factor < 1.2, "a real-time factor")

    def test_diagnostics(self):
        diagnostics = Latest("/diagnostics", DiagnosticArray)
        statuses = diagnostics.wait(lambda message: len(message.status) == 3, "three statuses").status
        self.assertEqual({status.name.split(": ")[1] for status in statuses}, {"Timing", "State", "Device"})
        values = {item.key: item.value for status in statuses for item in status.values}
        for key in ("real-time factor", "tick p99 (ms)", "step p99 (ms)", "overruns", "non-finite particles",
                    "volume drift", "device", "version"):
            self.assertIn(key, values)
        self.assertEqual(values["non-finite particles"], "0")

    def test_stimulus_contracts_and_zero_relaxes(self):
        rest = self.state.wait(lambda state: state.displacement_max < 1e-3, "rest")  # the test before may have stimulated
        self.stimulus.publish(8000.0)
        on = self.state.wait(lambda state: state.displacement_mean > rest.displacement_mean + 1e-3
                             and state.bulge > 0.02, "a contraction")
        self.assertEqual(on.stimulus_ua_per_mm2, 8000.0)
        self.assertGreater(on.membrane_potential_mv, -75)
        self.assertEqual(on.force > 1, self.solid)
        self.stimulus.publish(0.0)
        off = self.state.wait(lambda state: state.displacement_mean < 0.5 * on.displacement_mean
                              and state.stimulus_ua_per_mm2 == 0, "relaxation")
        self.assertFalse(off.failed)

    def test_stimulus_command_ends_by_itself(self):
        self.command.publish(electrode="origin", current_ua_per_mm2=8000.0, duration=0.1)
        self.state.wait(lambda state: state.membrane_potential_region_mv[0] > state.membrane_potential_region_mv[2],
                        "excitation at the origin")
        self.state.wait(lambda state: max(state.membrane_potential_region_mv) < -75, "rest")

    def test_external_force_moves_the_muscle(self):
        rest = self.state.wait(lambda state: state.displacement_max < 1e-3, "rest")
        force = ExternalForce(radius=0.05, duration=0.3)
        force.force.z = 1.0
        self.force.publish(force)
        self.state.wait(lambda state: state.displacement_max > rest.displacement_max + 2e-4, "a pull")
        self.state.wait(lambda state: state.displacement_max < 1e-3, "rest")

    def test_bad_input_is_dropped_with_a_warning(self):
        cases = [
            (self.stimulus, Float64(math.nan), ["/muscle/stimulus:", "nan"]),
            (self.command, StimulusCommand("nowhere", 1.0, 0.0), ["/muscle/stimulus_command:", "nowhere", "belly"]),
            (self.force, ExternalForce(radius=-0.5), ["/muscle/external_force:", "-0.5"]),
            (self.activation, Float64(math.nan), ["/muscle/activation_command:", "nan"]) if self.solid else
            (self.activation, Float64(0.3), ["/muscle/activation_command:", "tissue: solid"]),
        ]
        for topic, message, parts in cases:
            topic.publish(message)
            self.log.wait_for_text(*parts)
        # The same topics again, past the throttling, with the other bad values.
        rospy.sleep(2.5)
        self.stimulus.publish(math.inf)
        self.log.wait_for_text("/muscle/stimulus:", "inf")
        self.command.publish("belly", 1.0, -3.0)
        self.log.wait_for_text("/muscle/stimulus_command:", "-3")
        before = self.state.wait()
        after = self.state.wait(lambda state: state.simulated_time > before.simulated_time + 0.1, "time to go on")
        self.assertFalse(after.failed)
        self.assertEqual(after.stimulus_ua_per_mm2, 0)

    def test_warnings_are_throttled(self):
        for _ in range(50):
            self.force.publish(ExternalForce(radius=-7.25))
        self.log.wait_for_text("/muscle/external_force:", "-7.25")
        before = self.state.wait()
        self.state.wait(lambda state: state.simulated_time > before.simulated_time + 0.3)
        self.assertLessEqual(len([text for text in self.log.texts if "-7.25" in text]), 2)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "topics_test", TopicsTest, sys.argv)

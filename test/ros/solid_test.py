#!/usr/bin/env python3
"""A solid muscle pulls on the bones at its ends, equally, and takes its activation from a topic."""
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float64

from helper import Latest, Log, publisher
from sph_muscle.msg import MuscleState


class SolidTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("solid_test")
        cls.log = Log()
        cls.activation = publisher("/muscle/activation_command", Float64)
        cls.state = Latest("/muscle/state", MuscleState)

    def test_activated_muscle_pulls_on_both_ends(self):
        origin = Latest("/muscle/origin_wrench", WrenchStamped)
        insertion = Latest("/muscle/insertion_wrench", WrenchStamped)
        insertion.wait()
        self.activation.publish(0.3)
        self.state.wait(lambda state: abs(state.activation - 0.3) < 1e-3, "an activation of 0.3")
        began = self.state.wait().simulated_time
        self.state.wait(lambda state: state.simulated_time > began + 0.5, "the swing to end")
        pull = insertion.wait()
        stamp = pull.header.stamp
        counter = origin.wait(lambda message: message.header.stamp > stamp)
        self.assertEqual(pull.header.frame_id, "test_frame")
        # The insertion is drawn towards the origin, which lies at smaller x, and the other way round.
        self.assertLess(pull.wrench.force.x, -0.1)
        self.assertGreater(counter.wrench.force.x, 0.1)
        self.assertLess(abs(pull.wrench.force.x + counter.wrench.force.x), 0.05 * counter.wrench.force.x)

    def test_activation_out_of_range_is_dropped_with_a_warning(self):
        self.activation.publish(1.5)
        self.log.wait_for_text("/muscle/activation_command:", "1.5")


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "solid_test", SolidTest, sys.argv)

#!/usr/bin/env python3
"""A muscle whose frame is not where its insertion rests settles there before `state` says ready, at time 0."""
import sys
import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from helper import Latest, service
from sph_muscle.msg import MuscleState
from sph_muscle.srv import Step


def bones():
    """humerus -> forearm: 12 mm beyond the insertion's rest place, and 2 mm beside it."""
    transform = TransformStamped()
    transform.header.frame_id = "humerus"
    transform.child_frame_id = "forearm"
    transform.transform.translation.x = 0.112
    transform.transform.translation.y = 0.002
    transform.transform.rotation.w = 1
    return TFMessage([transform])


def ready_said(array):
    return [value.value for status in array.status if "State" in status.name
            for value in status.values if value.key == "ready"]


class StartUpTest(unittest.TestCase):
    def test_pre_stretch_settles_before_ready(self):
        rospy.init_node("start_up_test")
        rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True).publish(bones())
        state = Latest("/muscle/state", MuscleState)
        diagnostics = Latest("/diagnostics", DiagnosticArray)
        self.assertTrue(service("/muscle/pause", SetBool)(True).success)
        state.wait(lambda message: message.ready and message.insertion_following, "a muscle that is ready")

        # Again, from rest to where its frame is; paused, time then stands at 0. The phase may be over between two
        # messages; what is said of it must be true.
        self.assertTrue(service("/muscle/step", Step)(ticks=3).success)
        state.wait(lambda message: message.simulated_time > 0, "a little time")
        said = []
        rospy.Subscriber("/muscle/state", MuscleState, said.append, queue_size=100)
        self.assertTrue(service("/muscle/reset", Trigger)().success)
        start = state.wait(lambda message: message.ready and message.steps == 0, "the end of the start-up phase")
        for message in said:
            if not message.ready:
                self.assertEqual((message.simulated_time, message.steps), (0, 0))
        self.assertEqual((start.simulated_time, start.steps), (0, 0))
        self.assertAlmostEqual(start.attachment_distance, 0.212, delta=1e-4)
        self.assertEqual(start.kinetic_energy, 0)
        self.assertGreater(start.force, 0.5)
        diagnostics.wait(lambda array: any(text in ("1", "True", "true") for text in ready_said(array)),
                         "diagnostics that say ready")

        # Time goes, and nothing changes.
        answer = service("/muscle/step", Step)(ticks=30)
        self.assertTrue(answer.success, answer.message)
        later = state.wait(lambda message: message.simulated_time > 0.49, "half a second")
        self.assertAlmostEqual(later.force, start.force, delta=0.02 * start.force)
        self.assertTrue(later.insertion_following)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "start_up_test", StartUpTest, sys.argv)

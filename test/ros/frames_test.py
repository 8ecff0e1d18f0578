#!/usr/bin/env python3
"""An end follows its tf frame: stretching raises the passive force; what is missing, late or a jump is held and said."""
import math
import sys
import threading
import unittest

import rospy
import rostest
from geometry_msgs.msg import TransformStamped, WrenchStamped
from tf2_msgs.msg import TFMessage

from helper import Latest, Log, publisher
from sph_muscle.msg import MuscleState

REST = 0.1  # m, of the forearm along x in the humerus, whose x axis is the line of action
ASIDE = 0.02  # m, of the forearm's origin beside it
SPEED = 0.05  # m/s


class Forearm:
    """Publishes humerus -> forearm, turned by a quarter about z, 50 times a second."""

    def __init__(self):
        self.publisher = publisher("/tf", TFMessage)
        self.x = self.goal = REST
        self.on = True
        threading.Thread(target=self.run, daemon=True).start()

    def run(self):
        while not rospy.is_shutdown():
            step = max(-0.02 * SPEED, min(0.02 * SPEED, self.goal - self.x))
            self.x += step
            if self.on:
                self.send()
            rospy.sleep(0.02)

    def send(self):
        transform = TransformStamped()
        transform.header.stamp = rospy.Time.now()
        transform.header.frame_id = "humerus"
        transform.child_frame_id = "forearm"
        transform.transform.translation.x = self.x
        transform.transform.translation.y = ASIDE
        transform.transform.rotation.z = transform.transform.rotation.w = math.sqrt(0.5)
        self.publisher.publish(TFMessage([transform]))


class FramesTest(unittest.TestCase):
    def setUp(self):
        rospy.init_node("frames_test")
        self.log = Log()
        self.state = Latest("/muscle/state", MuscleState)

    def settled(self, seconds=0.3):
        began = self.state.wait().simulated_time
        return self.state.wait(lambda state: state.simulated_time > began + seconds, "time to pass")

    def test_an_end_follows_its_frame(self):
        # Nobody publishes the frame yet.
        self.log.wait_for_text("insertion", "forearm", "holds its pose")
        rest = self.state.wait()
        self.assertFalse(rest.insertion_following)
        self.assertFalse(rest.origin_following)

        # It appears: the end's place in it is taken over, and nothing moves.
        forearm = Forearm()
        self.state.wait(lambda state: state.insertion_following, "the insertion to follow")
        self.assertAlmostEqual(self.settled().length, rest.length, delta=2e-5)

        # It moves off: the muscle is stretched and pulls, in the forearm's axes, about the forearm's origin.
        insertion = Latest("/muscle/insertion_wrench", WrenchStamped)
        origin = Latest("/muscle/origin_wrench", WrenchStamped)
        slack = insertion.wait().wrench.force.y
        forearm.goal = REST + 0.02
        self.state.wait(lambda state: state.length > rest.length + 0.0198, "a stretched muscle")
        self.settled(0.6)
        pull = insertion.wait()
        self.assertEqual(pull.header.frame_id, "forearm")
        force, torque = pull.wrench.force, pull.wrench.torque
        self.assertGreater(force.y, slack + 1)
        self.assertLess(math.hypot(force.x, force.z), 0.02 * force.y)
        self.assertAlmostEqual(torque.z, -ASIDE * force.y, delta=0.02 * ASIDE * force.y)
        stamp = pull.header.stamp
        counter = origin.wait(lambda message: message.header.stamp > stamp)
        self.assertEqual(counter.header.frame_id, "humerus")
        self.assertAlmostEqual(counter.wrench.force.x, force.y, delta=0.02 * force.y)

        # A leap is refused, with a warning, and following goes on when the frame is back.
        stretched = self.state.wait().length
        forearm.x = forearm.goal = REST + 0.12
        self.log.wait_for_text("forearm", "jump")
        leapt = self.settled()
        self.assertFalse(leapt.insertion_following)
        self.assertAlmostEqual(leapt.length, stretched, delta=2e-4)
        forearm.x = forearm.goal = REST + 0.02
        self.state.wait(lambda state: state.insertion_following, "the insertion to follow again")

        # tf is lost while the frame moves on: held, and said. Then it is back.
        forearm.on = False
        forearm.goal = REST
        self.log.wait_for_text("forearm", "s old")
        lost = self.settled()
        self.assertFalse(lost.insertion_following)
        self.assertAlmostEqual(lost.length, stretched, delta=2e-4)
        self.assertFalse(lost.failed)
        forearm.on = True
        back = self.state.wait(lambda state: state.insertion_following and state.length < rest.length + 1e-4,
                               "the insertion back in its place")
        self.assertEqual(back.nonfinite, 0)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "frames_test", FramesTest, sys.argv)

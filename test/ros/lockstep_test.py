#!/usr/bin/env python3
"""A simulator in lock-step: it moves the bone, the muscle answers with its time and wrenches, /clock follows."""
import subprocess
import sys
import unittest

import roslib.packages
import rospy
import rostest
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from helper import Latest, publisher, service
from sph_muscle.msg import MuscleState
from sph_muscle.srv import Step

TICK = 0.01
REST = 0.1  # m, of the forearm along the line of action


class LockstepTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("lockstep_test")
        cls.clock = Latest("/clock", Clock)
        cls.state = Latest("/muscle/state", MuscleState)
        cls.tf = publisher("/tf", TFMessage)
        cls.step = service("/muscle/step", Step)
        cls.reset = service("/muscle/reset", Trigger)
        cls.pause = service("/muscle/pause", SetBool)

    def setUp(self):
        self.assertTrue(self.pause(True).success)
        self.assertTrue(self.reset().success)
        self.now = self.state.wait(lambda state: state.paused and state.simulated_time == 0).header.stamp

    def send(self, x, stamp):
        transform = TransformStamped()
        transform.header.stamp = stamp
        transform.header.frame_id = "humerus"
        transform.child_frame_id = "forearm"
        transform.transform.translation.x = x
        transform.transform.rotation.w = 1
        self.tf.publish(TFMessage([transform]))

    def advance(self, x):
        self.now += rospy.Duration(TICK)
        self.send(x, self.now)
        answer = self.step(ticks=1, frames_at=self.now)
        self.assertTrue(answer.success, answer.message)
        return answer

    def test_the_muscle_answers_every_step(self):
        rest = self.state.wait().length
        for k in range(3):  # seen, and taken over where it is
            answer = self.advance(REST)
            self.assertAlmostEqual(answer.simulated_time, (k + 1) * TICK, places=9)
        slack = answer.insertion_wrenches[0].wrench.force.x
        for k in range(50):
            answer = self.advance(REST + 0.015 * (k + 1) / 50)
        self.assertAlmostEqual(answer.simulated_time, 53 * TICK, places=9)
        self.assertEqual(answer.insertion_wrenches[0].header.frame_id, "forearm")
        self.assertEqual(answer.origin_wrenches[0].header.frame_id, "humerus")
        self.assertEqual(answer.insertion_wrenches[0].header.stamp, self.now)
        self.assertLess(answer.insertion_wrenches[0].wrench.force.x, slack - 0.5)
        # It is there at the end of the step, not one transform behind.
        state = self.state.wait(lambda state: state.header.stamp == self.now, "the state of the last step")
        self.assertAlmostEqual(state.length, rest + 0.015, delta=1e-5)
        self.assertEqual(self.clock.message.clock, self.now)

    def test_a_step_without_its_frames_is_refused(self):
        self.advance(REST)
        before = self.advance(REST).simulated_time
        answer = self.step(ticks=1, frames_at=self.now + rospy.Duration(5))
        self.assertFalse(answer.success)
        self.assertIn("frames_at", answer.message)
        self.assertEqual(answer.simulated_time, before)

    def test_a_duration_is_whole_ticks(self):
        self.assertAlmostEqual(self.step(duration=0.05).simulated_time, 0.05, places=9)
        for wrong in (dict(duration=0.015), dict(duration=-0.01), dict(duration=0.05, ticks=5), dict(duration=1e-5)):
            answer = self.step(**wrong)
            self.assertFalse(answer.success)
            self.assertIn("whole number of ticks", answer.message)

    def test_the_clock_never_goes_back(self):
        self.step(ticks=10)
        before = self.clock.wait().clock
        self.assertTrue(self.reset().success)
        self.state.wait(lambda state: state.simulated_time == 0)
        self.assertGreaterEqual(self.clock.wait().clock, before)
        self.step(ticks=1)
        self.assertGreater(self.clock.wait(lambda clock: clock.clock > before).clock, before)

    def test_there_is_one_clock(self):
        node = roslib.packages.find_node("sph_muscle", "sph_muscle_node")[0]
        second = subprocess.run([node, "_publish_clock:=true", "_particles:=100", "__name:=second"], timeout=60,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.assertEqual(second.returncode, 2, second.stdout)
        self.assertIn("/muscle/sph_muscle publishes /clock already", second.stdout)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "lockstep_test", LockstepTest, sys.argv)

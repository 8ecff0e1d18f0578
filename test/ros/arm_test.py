#!/usr/bin/env python3
"""Biceps and triceps move an elbow both ways, the muscles follow, and what they do to the bone is what moves it."""
import sys
import unittest

import rospy
import rostest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from helper import Latest, publisher, service
from sph_muscle.msg import MuscleState
from sph_muscle.srv import Step

START = 1.0471976  # rad, of the elbow
FLEXED, EXTENDED = START + 0.25, START - 0.25


class ArmTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("arm_test")
        cls.joint = Latest("/arm/joint_states", JointState)
        cls.biceps = Latest("/arm/biceps/state", MuscleState)
        cls.triceps = Latest("/arm/triceps/state", MuscleState)
        cls.flex = publisher("/arm/biceps/activation_command", Float64)
        cls.extend = publisher("/arm/triceps/activation_command", Float64)
        cls.pause = service("/arm/pause", SetBool)
        cls.reset = service("/arm/reset", Trigger)
        cls.step = service("/arm/step", Step)

    def setUp(self):
        self.assertTrue(self.pause(False).success)
        self.assertTrue(self.reset().success)

    def test_the_elbow_crosses_its_targets_both_ways(self):
        rest = self.biceps.wait(lambda state: state.insertion_following, "following").length
        self.flex.publish(0.3)
        self.joint.wait(lambda state: state.position[0] > FLEXED, "flexion")
        # The muscle follows the bone: 42 mm of moment arm and 0.25 rad are 10 mm.
        self.assertLess(self.biceps.wait().length, rest - 0.008)
        self.flex.publish(0.0)
        self.extend.publish(0.3)
        self.joint.wait(lambda state: state.position[0] < EXTENDED, "extension")
        for muscle in (self.biceps, self.triceps):
            state = muscle.wait()
            self.assertFalse(state.failed)
            self.assertTrue(state.insertion_following and state.origin_following)
            self.assertEqual(state.nonfinite, 0)
        self.extend.publish(0.0)
        self.flex.publish(0.3)
        self.joint.wait(lambda state: state.position[0] > FLEXED, "flexion again")

    def test_both_muscles_have_one_clock_and_wrenches_give_the_torque(self):
        self.assertTrue(self.pause(True).success)
        self.assertTrue(self.reset().success)
        self.flex.publish(0.2)
        self.biceps.wait(lambda state: state.paused and state.simulated_time == 0, "a pause at 0 s")
        answer = self.step(duration=0.2)  # 50 ticks of 4 ms
        self.assertTrue(answer.success, answer.message)
        self.assertAlmostEqual(answer.simulated_time, 0.2, places=6)
        for muscle in (self.biceps, self.triceps):
            muscle.wait(lambda state: abs(state.simulated_time - 0.2) < 1e-6, "0.2 s")
        self.assertEqual([wrench.header.frame_id for wrench in answer.insertion_wrenches],
                         ["biceps_insertion", "triceps_insertion"])
        # The torque of the tick that ends next is that of the wrenches now, about the hinge along z.
        torque = 0
        for wrench, (x, y) in zip(answer.insertion_wrenches, ((0.045, 0.008), (-0.028, -0.012))):
            force = wrench.wrench.force
            torque += wrench.wrench.torque.z + x * force.y - y * force.x
        before = self.joint.wait().position[0]
        self.assertTrue(self.step(ticks=1).success)
        after = self.joint.wait(lambda state: state.position[0] != before, "the next tick")
        self.assertAlmostEqual(after.effort[0], torque, places=6)
        self.assertGreater(torque, 0.1)
        self.assertFalse(self.step(duration=0.0041).success)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "arm_test", ArmTest, sys.argv)

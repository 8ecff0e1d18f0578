#!/usr/bin/env python3
"""An end that carries a load: the muscle's force balances it; it shortens against it, less than without; attach holds."""
import sys
import unittest

import rospy
import rostest
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from helper import Latest, Log, publisher, service
from sph_muscle.msg import EndLoad, MuscleState
from sph_muscle.srv import End


class LoadTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("load_test")
        cls.log = Log()
        cls.state = Latest("/muscle/state", MuscleState)
        cls.load = publisher("/muscle/load", EndLoad)
        cls.activation = publisher("/muscle/activation_command", Float64)
        cls.attach = service("/muscle/attach", End)
        cls.release = service("/muscle/release", End)
        cls.reset = service("/muscle/reset", Trigger)

    def setUp(self):
        self.assertTrue(self.reset().success)
        state = self.state.wait(lambda state: state.simulated_time < 0.5)
        self.rest, self.rest_distance = state.length, state.attachment_distance

    def settled(self, seconds=0.8):
        began = self.state.wait().simulated_time
        return self.state.wait(lambda state: state.simulated_time > began + seconds, "time to pass")

    def shortening_against(self, pull):
        self.assertTrue(self.reset().success)
        self.load.publish(end="insertion", slide=True, pull=pull)
        self.activation.publish(0.3)
        state = self.settled(1.5)
        self.assertEqual(state.insertion_condition, MuscleState.SLIDING)
        self.assertEqual(state.origin_condition, MuscleState.HELD)
        return state

    def test_a_load_is_carried_and_reduces_the_shortening(self):
        light, heavy = self.shortening_against(2.0), self.shortening_against(20.0)
        self.assertGreater(light.shortening, heavy.shortening + 0.02)
        self.assertGreater(heavy.shortening, 0)
        self.assertAlmostEqual(heavy.force, 20.0, delta=1.0)
        self.assertAlmostEqual(light.force, 2.0, delta=1.0)
        self.assertAlmostEqual(heavy.force_active + heavy.force_passive + heavy.force_damping, heavy.force,
                               delta=0.01 * heavy.force)
        self.assertLess(light.normalised_fibre_length, heavy.normalised_fibre_length)

    def test_release_lets_go_and_attach_holds_where_it_is(self):
        self.activation.publish(0.3)
        held = self.settled()
        self.assertEqual(held.insertion_condition, MuscleState.HELD)
        self.assertAlmostEqual(held.length, self.rest, delta=1e-5)
        self.assertGreater(held.force, 5)
        self.assertTrue(self.release("insertion").success)
        short = self.state.wait(lambda state: state.length < 0.95 * self.rest, "shortening")
        self.assertEqual(short.insertion_condition, MuscleState.FREE)
        self.assertTrue(self.attach("insertion").success)
        caught = self.settled(0.1)  # the end comes to rest in 0.02 s
        self.assertEqual(caught.insertion_condition, MuscleState.HELD)
        self.assertLess(caught.attachment_distance, self.rest_distance)
        later = self.settled()  # the tissue swings meanwhile; the ends do not
        self.assertAlmostEqual(later.attachment_distance, caught.attachment_distance, delta=1e-9)
        self.assertAlmostEqual(self.settled().length, later.length, delta=1e-5)
        self.assertFalse(later.failed)
        # Reset undoes it all.
        self.assertTrue(self.release("insertion").success)
        self.assertTrue(self.reset().success)
        state = self.state.wait(lambda state: state.simulated_time < 0.5)
        self.assertEqual(state.insertion_condition, MuscleState.HELD)
        self.assertAlmostEqual(state.length, self.rest, delta=1e-5)

    def test_bad_input_is_refused(self):
        self.load.publish(end="elbow", pull=1.0)
        self.log.wait_for_text("/muscle/load:", "elbow", "insertion")
        answer = self.release("elbow")
        self.assertFalse(answer.success)
        self.assertIn("elbow", answer.message)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "load_test", LoadTest, sys.argv)

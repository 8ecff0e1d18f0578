#!/usr/bin/env python3
"""Biceps and triceps move an elbow both ways, the muscles follow, and what they do to the bone is what moves it.

    rostest --text sph_muscle arm.test particles:=900 random_s:=180

drives them at random for that long and prints what was seen."""
import math
import random
import sys
import time
import unittest

import rospy
import rostest
import yaml
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from helper import Latest, publisher, service
from sph_muscle.msg import MuscleState
from sph_muscle.srv import Step

START = 1.0471976  # rad, of the elbow
FLEXED, EXTENDED = START + 0.25, START - 0.25
STOPS = 0.087, 2.27  # rad
FASTEST = 10.0  # rad/s, of the elbow
SMALLEST, LARGEST = 0.95, 1.03  # volume of a muscle over its volume at rest
INSERTION = 1  # id of the marker of the tendon there


def length(points):
    (a, b) = points
    return math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))


def magnitude(wrench):
    force = wrench.wrench.force
    return math.hypot(force.x, force.y, force.z)


class Extremes(Latest):
    """Keeps the smallest and largest of some values of all messages of a topic, too."""

    def __init__(self, topic, kind, values):
        self.values = values
        self.seen = {}
        super().__init__(topic, kind)

    def receive(self, message):
        for name, value in self.values(message).items():
            low, high = self.seen.get(name, (value, value))
            self.seen[name] = min(low, value), max(high, value)
        super().receive(message)

    def text(self):
        return ", ".join("%s %.4g to %.4g" % (name, *ends) for name, ends in self.seen.items())


def joint_values(joint):
    return {"angle": joint.position[0], "rate": joint.velocity[0], "torque": joint.effort[0]}


def muscle_values(state):
    return {"force": state.force, "volume": state.volume_ratio, "fibre length": state.normalised_fibre_length,
            "speed": state.speed_max, "nonfinite": state.nonfinite}


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
        self.pause_at_rest()
        self.flex.publish(0.2)
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

    def test_tendons_carry_the_forces(self):
        markers = {name: Latest("/arm/%s/markers" % name, MarkerArray) for name in ("biceps", "triceps")}
        self.pause_at_rest()
        self.flex.publish(1.0)
        self.extend.publish(1.0)
        time.sleep(0.2)
        answer = self.step(duration=0.5)
        self.assertTrue(answer.success, answer.message)
        wrenches = {"biceps": (answer.origin_wrenches[0], answer.insertion_wrenches[0]),
                    "triceps": (None, answer.insertion_wrenches[1])}
        for name, latest in markers.items():
            with open(rospy.get_param("/arm/sph_muscle_arm/%s/config" % name)) as file:
                config = yaml.safe_load(file)
            # What was published before the step ended may come after its answer.
            ended = answer.insertion_wrenches[0].header.stamp
            shown = latest.wait(lambda message: any(m.ns == "tendons" and m.header.stamp >= ended
                                                    for m in message.markers), "tendons after the step")
            tendons = {marker.id: length(marker.points) for marker in shown.markers if marker.ns == "tendons"}
            self.assertEqual(len(tendons), 2 if config["tendon_ends"] == "both" else 1)
            self.assertIn(INSERTION, tendons)
            for end, long in tendons.items():
                stretch = long - config["tendon_slack_length"]
                force = magnitude(wrenches[name][end])
                self.assertAlmostEqual(force, config["tendon_stiffness"] * stretch, delta=1e-4 * force)
                self.assertGreater(force, 40)  # of some 70 and 100 N
                # A tendon, not a rubber band.
                self.assertLess(stretch / config["tendon_slack_length"], 0.05)
            latest.close()

    def test_random_activations_leave_it_sound(self):
        self.drive_at_random("activation_command", (0, 0.1, 0.5, 1))

    def test_random_stimuli_leave_it_sound(self):
        self.drive_at_random("stimulus", (0, 0, 8000))

    def pause_at_rest(self):
        self.assertTrue(self.pause(True).success)
        self.assertTrue(self.reset().success)
        self.biceps.wait(lambda state: state.ready and state.paused and state.simulated_time == 0, "0 s")

    def drive_at_random(self, topic, values):
        """Both muscles get another of the values every simulated second, in lock-step; then they come to rest."""
        seconds = int(rospy.get_param("~random_s"))
        chosen = random.Random(2)
        drives = [publisher("/arm/%s/%s" % (name, topic), Float64) for name in ("biceps", "triceps")]
        self.pause_at_rest()
        joint = Extremes("/arm/joint_states", JointState, joint_values)
        muscles = [Extremes("/arm/%s/state" % name, MuscleState, muscle_values)
                   for name in ("biceps", "triceps")]
        began = time.monotonic()
        for _ in range(seconds):
            self.one_second(drives, [chosen.choice(values) for _ in drives])
        factor = seconds / (time.monotonic() - began)
        for _ in range(3):
            self.one_second(drives, (0, 0))
        print("%s, %d s, real-time factor %.2f\n  elbow: %s\n  biceps: %s\n  triceps: %s\n"
              "  speeds 3 s later: %.3g, %.3g"
              % (topic, seconds, factor, joint.text(), *(muscle.text() for muscle in muscles),
                 *(muscle.message.speed_max for muscle in muscles)))
        self.assertGreaterEqual(joint.seen["angle"][0], STOPS[0])
        self.assertLessEqual(joint.seen["angle"][1], STOPS[1])
        self.assertGreater(joint.seen["angle"][1] - joint.seen["angle"][0], 1)  # it did move
        self.assertLess(max(map(abs, joint.seen["rate"])), FASTEST)
        for muscle in muscles:
            self.assertEqual(muscle.seen["nonfinite"], (0, 0))
            self.assertGreater(muscle.seen["volume"][0], SMALLEST)
            self.assertLess(muscle.seen["volume"][1], LARGEST)
            self.assertLess(muscle.message.speed_max, 0.02)  # m/s; the elbow still creeps
        for subscriber in (joint, *muscles):
            subscriber.close()

    def one_second(self, drives, values):
        for drive, value in zip(drives, values):
            drive.publish(value)
        time.sleep(0.02)  # that they arrive first
        answer = self.step(duration=1.0)
        self.assertTrue(answer.success, answer.message)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "arm_test", ArmTest, sys.argv)

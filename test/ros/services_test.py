#!/usr/bin/env python3
"""Pause, step, reset, snapshots good and bad, and a muscle that fails."""
import os
import shutil
import sys
import tempfile
import unittest

import rospy
import rostest
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from helper import Latest, Log, publisher, service
from sph_muscle.msg import ExternalForce, MuscleState
from sph_muscle.srv import Snapshot, Step

TICK = 1.0 / 60.0


class ServicesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("services_test")
        cls.log = Log()
        cls.state = Latest("/muscle/state", MuscleState)
        cls.stimulus = publisher("/muscle/stimulus", Float64)
        cls.force = publisher("/muscle/external_force", ExternalForce)
        cls.pause = service("/muscle/pause", SetBool)
        cls.step = service("/muscle/step", Step)
        cls.reset = service("/muscle/reset", Trigger)
        cls.save = service("/muscle/save_snapshot", Snapshot)
        cls.load = service("/muscle/load_snapshot", Snapshot)
        cls.folder = tempfile.mkdtemp()

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def setUp(self):
        self.assertTrue(self.reset().success)
        self.assertTrue(self.pause(True).success)
        self.state.wait(lambda state: state.paused, "a pause")

    def steps(self, ticks):
        answer = self.step(ticks=ticks)
        self.assertTrue(answer.success, answer.message)
        return answer.simulated_time

    def test_pause_stops_time_and_resuming_goes_on(self):
        first = self.state.wait()
        second = self.state.wait()  # sent again while nothing moves
        self.assertEqual(first.simulated_time, second.simulated_time)
        self.assertEqual(second.real_time_factor, 0)
        self.assertTrue(self.pause(False).success)
        self.state.wait(lambda state: not state.paused and state.simulated_time > first.simulated_time + 0.1)

    def test_a_late_listener_sees_a_paused_muscle(self):
        cloud = Latest("/muscle/particles", PointCloud2)
        self.assertGreater(cloud.wait(limit=10).width, 100)
        cloud.close()

    def test_step_counts_ticks(self):
        before = self.steps(0)
        self.assertAlmostEqual(self.steps(1) - before, TICK, places=6)
        self.assertAlmostEqual(self.steps(12) - before, 13 * TICK, places=6)
        self.state.wait(lambda state: state.paused and abs(state.simulated_time - before - 13 * TICK) < 1e-6)

    def test_step_of_a_running_muscle_is_refused(self):
        self.pause(False)
        answer = self.step(ticks=1)
        self.assertFalse(answer.success)
        self.assertIn("pause", answer.message)

    def test_reset_rests_at_time_0(self):
        self.stimulus.publish(8000.0)
        self.state.wait(lambda state: state.stimulus_ua_per_mm2 == 8000.0)
        self.steps(30)
        self.assertGreater(self.state.wait().displacement_mean, 1e-4)
        self.assertTrue(self.reset().success)
        state = self.state.wait(lambda state: state.simulated_time == 0, "time 0")
        self.assertLess(state.displacement_max, 1e-6)
        self.assertEqual(state.stimulus_ua_per_mm2, 0)

    def test_a_snapshot_brings_everything_back(self):
        path = os.path.join(self.folder, "contracting.snapshot")
        self.stimulus.publish(8000.0)
        self.state.wait(lambda state: state.stimulus_ua_per_mm2 == 8000.0)
        self.steps(20)
        saved = self.save(path)
        self.assertTrue(saved.success, saved.message)
        self.assertEqual(saved.message, path)
        self.steps(10)
        once = self.state.wait(lambda state: state.simulated_time > saved.simulated_time + 9.5 * TICK)
        self.reset()
        loaded = self.load(path)
        self.assertTrue(loaded.success, loaded.message)
        self.assertEqual(loaded.simulated_time, saved.simulated_time)
        self.steps(10)
        again = self.state.wait(lambda state: state.simulated_time > saved.simulated_time + 9.5 * TICK)
        self.assertEqual(again.displacement_mean, once.displacement_mean)
        self.assertEqual(again.kinetic_energy, once.kinetic_energy)

    def test_a_corrupt_snapshot_is_refused_while_running(self):
        path = os.path.join(self.folder, "good.snapshot")
        self.assertTrue(self.save(path).success)
        with open(path, "rb") as file:
            good = file.read()
        self.pause(False)
        flipped = bytearray(good)
        flipped[len(good) // 2] ^= 0x10
        for name, content in (("short", good[:-100]), ("flipped", bytes(flipped)), ("foreign", b"not a snapshot"),
                              ("empty", b"")):
            bad = os.path.join(self.folder, name)
            with open(bad, "wb") as file:
                file.write(content)
            answer = self.load(bad)
            self.assertFalse(answer.success, name)
            self.assertIn(bad, answer.message)
        self.assertFalse(self.load(os.path.join(self.folder, "missing")).success)
        self.assertFalse(self.save("/nowhere/at/all").success)
        before = self.state.wait()
        self.state.wait(lambda state: state.simulated_time > before.simulated_time + 0.1, "time to go on")

    def test_a_muscle_that_fails_says_so_and_reset_brings_it_back(self):
        force = ExternalForce(radius=1.0)
        force.force.x = 1e38
        self.force.publish(force)
        self.pause(False)
        self.state.wait(lambda state: state.failed, "a failure")
        self.assertIn("particle", self.log.wait_for_text("the muscle has stopped"))
        stopped = self.step(ticks=1)
        self.assertFalse(stopped.success)
        self.assertTrue(self.reset().success)
        state = self.state.wait(lambda state: not state.failed and state.simulated_time > 0.1, "life")
        self.assertEqual(state.nonfinite, 0)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "services_test", ServicesTest, sys.argv)

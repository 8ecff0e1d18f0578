#!/usr/bin/env python3
"""What rosbag records of the muscle comes back from rosbag play."""
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import rosbag
import rospy
import rostest
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker

from helper import LIMIT, Latest
from sph_muscle.msg import MuscleState

TOPICS = ["/muscle/particles", "/muscle/surface", "/muscle/markers", "/muscle/state"]


class BagTest(unittest.TestCase):
    def setUp(self):
        rospy.init_node("bag_test")
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def record(self):
        path = os.path.join(self.folder, "muscle.bag")
        recorder = subprocess.Popen(["rosbag", "record", "-q", "--duration=3", "-O", path] + TOPICS)
        try:
            self.assertEqual(recorder.wait(LIMIT), 0)
        finally:
            recorder.poll() is None and recorder.kill()
        return path

    def test_round_trip(self):
        path = self.record()
        with rosbag.Bag(path) as bag:
            recorded = {topic: bag.get_message_count(topic) for topic in TOPICS}
            first = next(message for _, message, _ in bag.read_messages("/muscle/state"))
            last = [message for _, message, _ in bag.read_messages("/muscle/state")][-1]
        for topic, count in recorded.items():
            self.assertGreater(count, 3, topic)

        # Played under another name, beside the muscle that runs.
        clouds = Latest("/played/particles", PointCloud2)
        surfaces = Latest("/played/surface", Marker)
        states = Latest("/played/state", MuscleState)
        remaps = ["%s:=%s" % (topic, topic.replace("/muscle/", "/played/")) for topic in TOPICS]
        player = subprocess.Popen(["rosbag", "play", "-q", "--delay=1", path] + remaps)
        try:
            state = states.wait(lambda state: state.simulated_time == last.simulated_time, "the last state")
            self.assertEqual(state.displacement_mean, last.displacement_mean)
            self.assertEqual(player.wait(LIMIT), 0)
        finally:
            player.poll() is None and player.send_signal(signal.SIGTERM)
        self.assertGreater(last.simulated_time, first.simulated_time)
        self.assertEqual(clouds.message.header.frame_id, "test_frame")
        self.assertEqual(surfaces.message.type, Marker.TRIANGLE_LIST)
        self.assertGreaterEqual(clouds.count, 0.8 * recorded["/muscle/particles"])

    def test_nothing_is_sent_to_nobody(self):
        # Without listeners the muscle goes on; with one again, time has passed.
        states = Latest("/muscle/state", MuscleState)
        before = states.wait().simulated_time
        states.close()
        time.sleep(0.5)
        states = Latest("/muscle/state", MuscleState)
        self.assertGreater(states.wait().simulated_time, before + 0.1)


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "bag_test", BagTest, sys.argv)

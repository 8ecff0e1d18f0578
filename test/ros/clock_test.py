#!/usr/bin/env python3
"""ROS time that stands still, runs and jumps back does not disturb the muscle."""
import math
import sys
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64

from helper import Latest, Log, publisher
from sph_muscle.msg import MuscleState


class ClockTest(unittest.TestCase):
    def test_clock_jumps_back(self):
        rospy.init_node("clock_test")
        log = Log()
        clock = publisher("/clock", Clock)
        state = Latest("/muscle/state", MuscleState)
        stimulus = publisher("/muscle/stimulus", Float64)
        for second in (1000, 1001, 5, 6):
            clock.publish(rospy.Time(second))
            before = state.wait(lambda message, now=second: message.header.stamp.to_sec() == now,
                                "the stamp %d" % second)
            state.wait(lambda message: message.simulated_time > before.simulated_time + 0.1, "simulated time to run")
        stimulus.publish(math.nan)
        log.wait_for_text("/muscle/stimulus:", "nan")


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "clock_test", ClockTest, sys.argv)

#!/usr/bin/env python3
"""A node given something it cannot use ends with exit code 2 and a message that names it."""
import os
import subprocess
import sys
import tempfile
import unittest

import roslib.packages
import rospy
import rostest


class RefusalTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def file(self, name, content):
        path = os.path.join(self.folder.name, name)
        with open(path, "w") as file:
            file.write(content)
        return path

    def check_refused(self, parameters, *parts, name=None, **environment):
        node = roslib.packages.find_node("sph_muscle", "sph_muscle_node")[0]
        command = [node] + ["_%s:=%s" % item for item in parameters.items()] + ["__name:=" + (name or self._testMethodName)]
        result = subprocess.run(command, timeout=60, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                env=dict(os.environ, **environment))
        self.assertEqual(result.returncode, 2, result.stdout)
        for part in parts:
            self.assertIn(part, result.stdout)

    def test_unknown_parameter(self):
        self.check_refused({"particels": 500}, "particels", "particles")

    def test_out_of_range(self):
        self.check_refused({"smoothing_ratio": 9.5}, "smoothing_ratio", "9.5", "from 0 to 3")

    def test_zero_particles(self):
        self.check_refused({"particles": 0}, "particles", "0")

    def test_wrong_type(self):
        self.check_refused({"density": "heavy"}, "density", "heavy")

    def test_unknown_choice(self):
        self.check_refused({"preset": "biceps"}, "biceps", "triceps_long_head")

    def test_gpu_that_is_not_there(self):
        self.check_refused({"backend": "cuda"}, "backend is cuda, but", "backend: cpu or auto would run",
                           CUDA_VISIBLE_DEVICES="")

    def test_missing_mesh(self):
        self.check_refused({"mesh": "/nowhere/muscle.stl"}, "/nowhere/muscle.stl")

    def test_missing_config(self):
        self.check_refused({"config": "/nowhere/muscle.yaml"}, "/nowhere/muscle.yaml")

    def test_config_that_is_no_text(self):
        self.check_refused({"config": 7.5}, "/test_config_that_is_no_text/config", "7.5", "not a text", "YAML")
        self.check_refused({"config": "true"}, "/config", "1", "not a text")

    def test_bad_yaml(self):
        self.check_refused({"config": self.file("bad.yaml", "particles: [1, 2\nrate: }")}, "bad.yaml")

    def test_bad_value_in_yaml(self):
        self.check_refused({"config": self.file("range.yaml", "density: -4\n")}, "density", "-4")

    def test_what_ros_itself_throws(self):
        """Not only what the node refuses: here a parameter whose name roscpp finds malformed."""
        rospy.set_param("/test_what_ros_itself_throws/bad-name", 1)
        self.check_refused({"particles": 300}, "FATAL", "the node ends", "bad-name")

    def test_node_name_that_is_none(self):
        self.check_refused({}, "FATAL", "the node ends", "a/b", name="a/b")

    def test_time_step_above_the_limit(self):
        self.check_refused({"particles": 300, "time_step": 0.5, "time_step_policy": "refuse"}, "time_step")


if __name__ == "__main__":
    rostest.rosrun("sph_muscle", "refusal_test", RefusalTest, sys.argv)

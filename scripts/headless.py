#!/usr/bin/env python3
"""Runs demo.launch without a screen, drives the stimulus on and off and prints one line of state a second.

Started by scripts/demo. Exit codes: 0 done, 1 the muscle died or went silent, 2 wrong arguments, 143 terminated.
"""
import argparse
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

import rosgraph
import rospy
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

from sph_muscle.msg import MuscleState

CURRENT = 8000.0  # uA/mm2, the paper's
START_LIMIT = 90.0  # s of wall time for building a large muscle or starting rviz on a slow machine
SILENCE_LIMIT = 20.0  # s without a state


class Failure(Exception):
    pass


def free_port():
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return probe.getsockname()[1]


def namespace(launch_arguments):
    """Where the muscle's topics are: the launch argument `name`, of which roslaunch takes the last."""
    values = dict(argument.split(":=", 1) for argument in launch_arguments if ":=" in argument)
    return "/" + values.get("name", "muscle").strip("/")


class Processes:
    """What was started, ended in reverse order."""

    def __init__(self):
        self.started = []

    def start(self, command, **options):
        process = subprocess.Popen(command, start_new_session=True, **options)
        self.started.append(process)
        return process

    def end(self):
        for process in reversed(self.started):
            for kill in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
                if process.poll() is not None:
                    break
                os.killpg(process.pid, kill)
                try:
                    process.wait(15)
                except subprocess.TimeoutExpired:
                    pass


def start_display(processes):
    """An X server in memory; returns its display name."""
    read_end, write_end = os.pipe()
    processes.start(["Xvfb", "-displayfd", str(write_end), "-screen", "0", "1280x820x24", "-nolisten", "tcp"],
                    pass_fds=[write_end], stderr=subprocess.DEVNULL)
    os.close(write_end)
    number = os.read(read_end, 16).decode().strip()
    if not number:
        raise Failure("Xvfb did not start")
    return ":" + number


class Demo:
    def __init__(self, arguments, processes, log_folder):
        self.arguments = arguments
        self.namespace = namespace(arguments.launch_arguments)
        self.state = None
        self.state_time = 0.0
        self.stimulus = 0.0
        environment = dict(os.environ)
        self.display = None
        if arguments.screenshot:
            self.display = start_display(processes)
            environment.update(DISPLAY=self.display, LIBGL_ALWAYS_SOFTWARE="1", QT_X11_NO_MITSHM="1")
        # A master of our own: one that runs already stays undisturbed.
        port = free_port()
        os.environ["ROS_MASTER_URI"] = environment["ROS_MASTER_URI"] = "http://localhost:%d" % port
        self.log = os.path.join(log_folder, "roslaunch.log")
        with open(self.log, "wb") as log:
            self.launch = processes.start(
                ["roslaunch", "-p", str(port), "sph_muscle", "demo.launch",
                 "rviz:=" + ("true" if self.display else "false")] + arguments.launch_arguments,
                env=environment, stdout=log, stderr=subprocess.STDOUT)

    def on_state(self, state):
        self.state = state
        self.state_time = time.monotonic()

    def check_alive(self):
        if self.launch.poll() is not None:
            raise Failure("the muscle ended early, roslaunch gave %d" % self.launch.returncode)

    def show_log(self):
        """What the muscle and rviz said last, without the colours."""
        with open(self.log, errors="replace") as log:
            lines = [re.sub(r"\x1b(\[[0-9;]*m|\][^\x07]*\x07)", "", line) for line in log]
        sys.stderr.writelines(lines[-30:])

    def wait_for(self, what, condition):
        limit = time.monotonic() + START_LIMIT
        while not condition():
            self.check_alive()
            if time.monotonic() > limit:
                raise Failure("waited %g s in vain for %s" % (START_LIMIT, what))
            time.sleep(0.1)

    def connect(self):
        self.wait_for("the ROS master", rosgraph.is_master_online)
        rospy.init_node("demo", anonymous=True, disable_signals=True)
        self.publisher = rospy.Publisher(self.namespace + "/stimulus", Float64, queue_size=1, latch=True)
        rospy.Subscriber(self.namespace + "/state", MuscleState, self.on_state, queue_size=1)
        self.wait_for(self.namespace + "/state", lambda: self.state is not None)
        self.wait_for("the stimulus to be connected", lambda: self.publisher.get_num_connections() > 0)
        if self.display:
            self.wait_for("rviz", self.rviz_listens)
            self.wait_for("a picture in rviz", self.rviz_shows_something)

    def rviz_listens(self):
        _, subscribers, _ = rosgraph.Master("demo").getSystemState()
        topics = {topic for topic, nodes in subscribers if any("rviz" in node for node in nodes)}
        return {self.namespace + topic for topic in ("/particles", "/surface", "/markers")} <= topics

    def rviz_shows_something(self):
        """A window that is not drawn yet has one colour, the empty scene a few dozen, a lit muscle thousands."""
        grabbed = os.path.join(os.path.dirname(self.log), "grabbed.png")
        self.grab(grabbed).wait()
        colours = subprocess.run(["identify", "-format", "%k", grabbed], stdout=subprocess.PIPE, text=True).stdout
        return int(colours or 0) > 1000

    def grab(self, path):
        return subprocess.Popen(["import", "-display", self.display, "-window", "root", path])

    def stimulate(self, current):
        if current != self.stimulus:
            self.stimulus = current
            self.stimulated_at, self.stimulated_wall = self.state.simulated_time, time.monotonic()
            self.publisher.publish(current)

    def print_line(self):
        s = self.state
        print("t %7.2f s  stimulus %5g uA/mm2  potential %6.1f mV  force %6.1f N  shortening %5.1f %%  "
              "displacement mean %6.2f mm max %6.2f mm  pressure %8.1f Pa  bulge %5.1f %%  volume %.3f  RTF %.2f"
              % (s.simulated_time, s.stimulus_ua_per_mm2, s.membrane_potential_mv, s.force, 100 * s.shortening,
                 1e3 * s.displacement_mean, 1e3 * s.displacement_max, s.pressure_mean, 100 * s.bulge, s.volume_ratio,
                 s.real_time_factor),
              flush=True)

    def drive(self):
        """Rest, then on and off in turn; the picture is taken at the end of the first contraction."""
        seconds = self.arguments.seconds
        rest, half = min(1.0, 0.1 * seconds), min(3.0, 0.45 * seconds)
        began = time.monotonic()
        next_line = began + min(1.0, seconds)
        pictured = not self.display
        while True:
            self.check_alive()
            now = time.monotonic()
            elapsed = now - began
            if now - self.state_time > SILENCE_LIMIT:
                raise Failure("no state for %g s" % SILENCE_LIMIT)
            if self.state.failed:
                raise Failure("the muscle's state became non-finite")
            if not pictured and self.stimulus and self.contracted(now):
                self.take_picture()
                pictured = True
                began += time.monotonic() - now  # the pause does not count
                next_line += time.monotonic() - now
                continue
            phase = (elapsed - rest) / half
            on = phase >= 0 and int(phase) % 2 == 0
            self.stimulate(CURRENT if on or (self.stimulus and not pictured) else 0.0)
            if now >= next_line:
                self.print_line()
                next_line += 1.0
            if elapsed >= seconds and next_line > began + seconds:
                if pictured:
                    return
            time.sleep(0.02)

    def contracted(self, now):
        """Long enough in simulated time, for on a busy machine that may be slow; but no longer than the limit."""
        driven = self.state.simulated_time - self.stimulated_at
        return driven >= 0.6 or now - self.stimulated_wall > START_LIMIT

    def take_picture(self):
        """Of a paused muscle, so that particles, surface and text belong together however slow rviz is."""
        pause = rospy.ServiceProxy(self.namespace + "/pause", SetBool)
        pause(True)
        time.sleep(5)
        if self.grab(self.arguments.screenshot).wait(60) != 0:
            raise Failure("no screenshot in " + self.arguments.screenshot)
        print("screenshot: " + self.arguments.screenshot, flush=True)
        pause(False)


def parse(argv):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--screenshot", metavar="FILE.png")
    parser.add_argument("launch_arguments", nargs="*", metavar="name:=value")
    arguments = parser.parse_args(argv)
    if not 0 < arguments.seconds < 1e6:
        parser.error("--seconds %g: above 0 and below 1e6 is wanted" % arguments.seconds)
    return arguments


def main():
    arguments = parse(sys.argv[1:])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # by way of `finally`: roslaunch must not stay behind
    processes = Processes()
    log_folder = tempfile.mkdtemp(prefix="sph_muscle_demo_")
    os.environ.setdefault("ROS_LOG_DIR", log_folder)
    demo = None
    try:
        demo = Demo(arguments, processes, log_folder)
        demo.connect()
        demo.drive()
        demo.check_alive()
    except (Failure, OSError, subprocess.SubprocessError) as failure:
        if demo is not None:
            demo.show_log()
        print("demo: %s" % failure, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    finally:
        processes.end()
        shutil.rmtree(log_folder, ignore_errors=True)
    print("done")
    return 0


if __name__ == "__main__":
    sys.exit(main())

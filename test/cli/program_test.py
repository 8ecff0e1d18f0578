#!/usr/bin/env python3
"""The command-line programs as a user meets them: exit codes, messages, files.

    program_test.py RUN BENCH [unittest arguments]
"""
import csv
import json
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree

RUN, BENCH = sys.argv[1:3]
# One thread: on a busy machine two that wait for each other cost more than they save here.
SMALL = ["--set", "particles=300", "--set", "threads=1"]
FLUID = [*SMALL, "--set", "tissue=fluid"]


def run(*arguments, program=RUN, **keywords):
    return subprocess.run([program, *arguments], capture_output=True, text=True, timeout=120, **keywords)


VERSION = run("--version").stdout
HAS_YAML = "YAML yes" in VERSION
HAS_CUDA = bool(re.search(r"back ends: .*cuda", VERSION))
HAS_MESH = "meshes yes" in VERSION


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, *parts):
        return os.path.join(self.folder.name, *parts)

    def write(self, name, text):
        with open(self.path(name), "w") as file:
            file.write(text)
        return self.path(name)

    def samples(self, folder="out"):
        with open(self.path(folder, "timeseries.csv")) as file:
            return list(csv.DictReader(file))

    def go(self, *arguments, code=0, program=RUN):
        done = run(*arguments, program=program)
        self.assertEqual(done.returncode, code, done.stderr)
        return done

    def refused(self, *arguments, says, program=RUN):
        """Exit code 2, a short message with every part of `says`, and no results."""
        if program == RUN:
            arguments = ["--duration", "0.01", "--out", self.path("out"), *arguments]
        done = self.go(*arguments, code=2, program=program)
        for part in says:
            self.assertIn(part, done.stderr)
        self.assertLessEqual(done.stderr.count("\n"), 2, done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertFalse(os.path.exists(self.path("out")), "results in spite of bad input")


class Help(Case):
    def test_help_version_and_table(self):
        for program in RUN, BENCH:
            page = self.go("--help", program=program).stdout
            self.assertLessEqual(max(map(len, page.splitlines())), 100)
            self.assertIn("Exit status", page)
            version = self.go("--version", program=program).stdout
            self.assertRegex(version, r"\d+\.\d+\.\d+\n.*precision.*\n.*YAML")
        for option in re.findall(r"--[a-z]+", self.go("--help").stdout):
            self.assertNotIn("unrecognized", run(option).stderr)
        table = self.go("--parameters").stdout
        self.assertIn("| `particles` |  | `2231` | 8 ... 100000000 |", table)
        self.assertRegex(table, r"\| `gravity` \| m/s2 \| `\[0, 0, 0\]` \| -1000 \.\.\. 1000 each \|")
        rows = [line for line in table.splitlines() if line.startswith("| `")]
        self.assertGreater(len(rows), 50)
        for row in rows:
            self.assertEqual(len(re.findall(r"(?<!\\)\|", row)), 6, row)


class Ends(Case):
    SOLID = SMALL + ["--set", "mass_scaling=9", "--quiet"]

    def test_motion_and_activation(self):
        motion = self.write("motion.csv", "time_s,end,dx_m,dy_m,dz_m\n0.02,insertion,0.004,0,0\n0.04,insertion,0,0,0\n")
        self.go(*self.SOLID, "--duration", "0.06", "--every", "0.02", "--out", self.path("out"), "--end-motion", motion,
                "--activate", "0.03:0.06:0.5")
        rows = self.samples()
        distance = [float(row["attachment_distance_m"]) for row in rows]
        self.assertAlmostEqual(distance[1] - distance[0], 0.004, 9)
        self.assertAlmostEqual(distance[2], distance[0], 9)
        self.assertEqual(float(rows[1]["activation"]), 0)
        self.assertGreater(float(rows[3]["force_active_N"]), 10)

    def test_load_and_hold(self):
        self.go(*self.SOLID, "--duration", "0.06", "--every", "0.02", "--out", self.path("out"),
                "--load", "insertion:5,0,0@0:0.04", "--move", "origin:-0.001,0,0@0.02:0.04")
        distance = [float(row["attachment_distance_m"]) for row in self.samples()]
        self.assertGreater(distance[1], distance[0] + 1e-4)
        self.assertGreater(distance[2], distance[1] + 5e-4)
        self.assertLess(abs(distance[3] - distance[2]), 1e-3)


class BadInput(Case):
    def test_command_line(self):
        for arguments, part in ([], "--duration S is missing"), (["--duration", "1"], "--out DIR is missing"):
            self.assertIn(part, self.go(*arguments, code=2).stderr)
        self.refused("--nonsense", says=["nonsense", "--help"])
        self.refused("extra", says=["'extra'", "--help"])
        self.refused("--duration", "-1", says=["--duration", "'-1'", "above 0"])
        self.refused("--duration", "nan", says=["--duration", "'nan'"])
        self.refused("--every", "0", says=["--every", "'0'", "above 0"])
        self.refused("--every", "1e-300", says=["--every", "1e-300", "at most 1e+09"])
        self.refused("--duration", "1e300", says=["--duration", "1e+300", "at most 1e9 s"])
        self.refused("--set", "particles", says=["'particles'", "name=value"])

    def test_parameters(self):
        self.refused("--set", "partciles=100", says=["'partciles'", "did you mean 'particles'"])
        self.refused("--set", "particles=0", says=["'particles'", "'0'", "from 8 to 100000000"])
        self.refused("--set", "density=nan", says=["'density'", "nan"])
        self.refused("--set", "preset=biceps", says=["'preset'", "'biceps'", "vastus_lateralis"])
        self.refused("--set", "threshold_potential=-100", says=["threshold_potential", "rise"])
        self.refused("--set", "time_step=0.5", "--set", "time_step_policy=refuse", *SMALL, says=["time_step", "0.5"])

    def test_backend(self):
        """Asked for by name, the GPU computes or one line says why not; auto runs anyway and says on what."""
        nowhere = dict(os.environ, CUDA_VISIBLE_DEVICES="")
        for program, arguments in (RUN, ["--duration", "0.01", "--out", self.path("gpu")]), (BENCH, ["--steps", "5"]):
            done = run(*arguments, *SMALL, "--set", "backend=cuda", program=program, env=nowhere)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertIn("backend is cuda, but", done.stderr)
            self.assertRegex(done.stderr, r"no CUDA dr|no CUDA dev" if HAS_CUDA else "built without CUDA")
            if program == RUN:
                self.assertFalse(os.path.exists(self.path("gpu")))
            done = run(*arguments, *SMALL, "--set", "backend=auto", program=program, env=nowhere)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stdout, r"cpu, 1 thread \(no CUDA d.*\)" if HAS_CUDA else "cpu, 1 thread[^ ]")

    def test_stimulus(self):
        for entry in "0:1:nan", "0:1:inf", "1:0:8000", "0:1", "0:1:8000:nose", "a:b:c", "0:1:8000:belly:20":
            with self.subTest(entry):
                self.refused(*SMALL, "--stimulate", entry, says=[entry.split(":")[-1]])
        self.refused(*SMALL, "--stimulate", "", says=["--stimulate", "START:END:CURRENT"])
        self.refused(*SMALL, "--stimulate", "0:1:1;" * 300, says=["--stimulate", "1023"])

    def test_schedules_of_ends(self):
        for option, text, part in (("--activate", "0:1:2", "0 ... 1"), ("--activate", "1:0:1", "START < END"),
                                   ("--load", "insertion:1,2", "FX,FY,FZ"), ("--load", "nose:1,2,3", "origin"),
                                   ("--load", "insertion:1,2,nan", "FX,FY,FZ"), ("--slide", "origin:a", "FORCE"),
                                   ("--move", "insertion:0,0,0", "@START:END"), ("--release", "insertion@2:1", "START"),
                                   ("--end-motion", self.path("no.csv"), "no.csv"),
                                   ("--end-motion", self.write("bad.csv", "1,insertion,0,0\n"), "line 1"),
                                   ("--end-motion", self.write("back.csv", "1,origin,0,0,0\n1,origin,0,0,0\n"), "line 2")):
            with self.subTest(text):
                self.refused(*SMALL, option, text, says=[option, part])
        self.refused(*FLUID, "--activate", "0:1:0.5", says=["tissue: solid"])

    def test_files(self):
        self.refused("--restore", self.path("no.snapshot"), *SMALL, says=["no.snapshot"])
        junk = self.write("junk.snapshot", "not a snapshot " * 100)
        self.refused("--restore", junk, *SMALL, says=["junk.snapshot"])
        self.refused("--set", "mesh=" + self.path("no.stl"), says=["no.stl"] if HAS_MESH else ["assimp"])
        if HAS_MESH:
            empty = self.write("empty.stl", "solid empty\nendsolid empty\n")
            self.refused("--set", "mesh=" + empty, says=["empty.stl"])

    def test_output_that_cannot_be(self):
        file = self.write("file", "")
        for out in file, os.path.join(file, "below"):
            done = self.go(*SMALL, "--duration", "0.01", "--out", out, code=2)
            self.assertIn(file, done.stderr)

    @unittest.skipUnless(HAS_YAML, "built without libyaml")
    def test_configuration(self):
        self.refused("--config", self.path("no.yaml"), says=["no.yaml", "No such file"])
        self.refused("--config", self.write("a.yaml", "density: [1\n"), says=["a.yaml:2:1", "not YAML"])
        self.refused("--config", self.write("a.yaml", "\nvoltage: 3\n"), says=["a.yaml:2:1", "'voltage'"])
        self.refused("--config", self.write("a.yaml", "density: 5\n"), says=["a.yaml:1:10", "from 100 to 20000"])

    @unittest.skipIf(HAS_YAML, "built with libyaml")
    def test_configuration_without_yaml(self):
        self.refused("--config", self.write("a.yaml", "density: 1000\n"), says=["a.yaml", "no YAML library"])


class Run(Case):
    def test_samples_are_where_they_were_asked_for(self):
        done = self.go(*SMALL, "--duration", "0.05", "--every", "0.02", "--out", self.path("a", "out"),
                       "--stimulate", "0.02:0.04:8000", "--stimulate", "0.04:1:4000")
        samples = self.samples("a/out")
        self.assertEqual([float(s["time_s"]) for s in samples], [0, 0.02, 0.04, 0.05])
        self.assertEqual(float(samples[-1]["stimulus_uA_per_mm2"]), 4000)
        self.assertGreater(float(samples[-1]["membrane_potential_mV"]), float(samples[0]["membrane_potential_mV"]) + 50)
        self.assertEqual({s["nonfinite_particles"] for s in samples}, {"0"})
        self.assertIn("0.05 s simulated", done.stdout)
        self.assertEqual(done.stderr.count("\r"), 0, "a progress bar where there is no terminal")
        self.assertEqual(sorted(os.listdir(self.path("a/out"))), ["parameters.yaml", "timeseries.csv"])

    def test_quiet(self):
        done = self.go(*SMALL, "--duration", "0.01", "--out", self.path("out"), "--quiet")
        self.assertEqual((done.stdout, done.stderr), ("", ""))

    @unittest.skipUnless(HAS_YAML, "built without libyaml")
    def test_parameters_run_again_to_the_same_result(self):
        config = self.write("a.yaml", "particles: 300\nstimulus: ['0:0.01:8000']\n")
        common = ["--duration", "0.03", "--every", "0.01"]
        self.go("--config", config, *common, "--set", "gravity=[0, 0, -1e-5]", "--stimulate", "0.02:0.03:500",
                "--out", self.path("a"))
        self.go("--config", self.path("a/parameters.yaml"), *common, "--out", self.path("b"))
        for x, y in zip(self.samples("a"), self.samples("b")):
            x.pop("real_time_factor"), y.pop("real_time_factor")
            self.assertEqual(x, y)
        with open(self.path("a/parameters.yaml")) as a, open(self.path("b/parameters.yaml")) as b:
            self.assertEqual(a.read(), b.read())

    def test_a_restored_snapshot_goes_on_where_it_was(self):
        common = [*SMALL, "--every", "0.01", "--stimulate", "0:0.015:8000", "--quiet"]
        self.go(*common, "--duration", "0.02", "--out", self.path("whole"))
        self.go(*common, "--duration", "0.01", "--out", self.path("a"), "--snapshot", self.path("s"))
        self.go(*common, "--duration", "0.01", "--out", self.path("b"), "--restore", self.path("s"))
        whole, rest = self.samples("whole"), self.samples("b")
        self.assertEqual([float(s["time_s"]) for s in rest], [0.01, 0.02])
        whole[-1].pop("real_time_factor"), rest[-1].pop("real_time_factor")
        self.assertEqual(whole[-1], rest[-1])
        done = run("--set", "particles=400", "--duration", "1", "--out", self.path("c"), "--restore", self.path("s"))
        self.assertEqual(done.returncode, 2, done.stderr)

    def test_vtk_files_and_their_times(self):
        self.go(*SMALL, "--duration", "0.02", "--every", "0.01", "--vtk", "--out", self.path("out"))
        for kind in "particles", "surface":
            entries = xml.etree.ElementTree.parse(self.path("out", kind + ".pvd")).findall(".//DataSet")
            self.assertEqual([float(e.get("timestep")) for e in entries], [0, 0.01, 0.02])
            for entry in entries:
                with open(self.path("out", entry.get("file")), "rb") as file:
                    head, mark, data = file.read().partition(b'<AppendedData encoding="raw">')
                self.assertTrue(mark and data.endswith(b"</VTKFile>\n"))
                self.assertIn(b'Name="pressure_Pa"', head)

    def test_a_nonfinite_state_ends_with_3_and_keeps_the_files(self):
        """Finite but absurd potentials in a snapshot, its checksum made right: the membrane overflows."""
        for name, tissue, stage in (("solid", SMALL, "(membrane, step"), ("fluid", FLUID, "in stage 'membrane'")):
            with self.subTest(name):
                common = [*tissue, "--every", "0.01", "--duration", "0.02"]
                self.go(*common, "--out", self.path("a"), "--snapshot", self.path("s"))
                with open(self.path("s"), "rb") as file:
                    snapshot = bytearray(file.read()[:-8])
                end = snapshot.rindex(b"recovery", 0, snapshot.rindex(b"activation"))  # the array after the potentials
                for word in range(10, 100):
                    snapshot[end - 4 * word:end - 4 * word + 4] = struct.pack("<f", 3e38)
                checksum = 0xcbf29ce484222325  # FNV-1a
                for byte in snapshot:
                    checksum = (checksum ^ byte) * 0x100000001b3 % 2**64
                with open(self.path("s"), "wb") as file:
                    file.write(snapshot + struct.pack("<Q", checksum))
                done = self.go(*common, "--restore", self.path("s"), "--out", self.path(name), code=3)
                self.assertIn("particle", done.stderr)
                self.assertIn(stage, done.stderr)
                self.assertEqual([float(s["time_s"]) for s in self.samples(name)], [0.02])

    @unittest.skipUnless(os.path.exists("/dev/full"), "no /dev/full")
    def test_a_full_disk_is_said(self):
        os.mkdir(self.path("out"))
        os.symlink("/dev/full", self.path("out", "timeseries.csv"))
        done = run(*SMALL, "--duration", "0.01", "--out", self.path("out"))
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("No space", done.stderr)

    def test_interruption_leaves_whole_files(self):
        process = subprocess.Popen([RUN, *SMALL, "--duration", "1e6", "--every", "0.01", "--vtk", "--out",
                                    self.path("out"), "--snapshot", self.path("s")],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            for _ in range(600):
                time.sleep(0.05)
                if os.path.exists(self.path("out/vtk/surface_000002.vtp")):
                    break
            process.send_signal(signal.SIGINT)
            out, error = process.communicate(timeout=60)
        finally:
            process.kill()
        self.assertEqual(process.returncode, 128 + signal.SIGINT, error)
        self.assertIn("interrupted", out)
        count = len(self.samples())
        self.assertGreaterEqual(count, 2)
        entries = xml.etree.ElementTree.parse(self.path("out/surface.pvd")).findall(".//DataSet")
        self.assertEqual(len(entries), count)
        self.assertTrue(os.path.exists(self.path("s")), "the snapshot asked for")

    def test_progress_on_a_terminal(self):
        try:
            master, slave = pty.openpty()
        except OSError as error:  # a root without /dev/pts
            self.skipTest(str(error))
        done = subprocess.run([RUN, *SMALL, "--duration", "0.03", "--every", "0.01", "--out", self.path("out")],
                              stderr=slave, stdout=subprocess.PIPE, timeout=120)
        os.close(slave)
        shown = ""
        while True:
            try:
                piece = os.read(master, 65536).decode()
            except OSError:  # Linux: the other side is closed
                break
            if not piece:
                break
            shown += piece
        os.close(master)
        self.assertEqual(done.returncode, 0)
        self.assertRegex(shown, r"\[#+\.*\] \d\.\d+ of 0\.03 s, real-time factor .* left")
        self.assertTrue(shown.endswith("\r\x1b[K"), "the bar is taken away")


class Bench(Case):
    KEYS = {"tissue", "backend", "batch", "device", "threads", "particles", "neighbours_per_particle", "steps_per_s",
            "particle_steps_per_s", "rtf", "stage_us", "step_us_median", "step_us_p99", "peak_memory_bytes",
            "memory_bytes_per_particle", "cpu_us_per_step", "cpu_us_per_step_least", "cpu_us_min", "step_us_min"}
    STAGES = {"neighbours", "intermediate_velocity", "density_pressure", "forces", "diffusion", "cell_model",
              "integration", "other"}

    def test_one_json_object_on_one_line(self):
        done = self.go("--tissue", "fluid", "--backend", "cpu", "--particles", "300", "--steps", "20", "--repeat",
                       "3", "--threads", "1", "--set", "smoothing_ratio=2.5", program=BENCH)
        self.assertEqual(done.stdout.count("\n"), 1)
        result = json.loads(done.stdout)
        self.assertLessEqual(self.KEYS, set(result))
        self.assertEqual(set(result["stage_us"]), self.STAGES)
        self.assertEqual((result["tissue"], result["backend"], result["threads"]), ("fluid", "cpu", 1))
        self.assertAlmostEqual(result["particles"], 300, delta=3)
        # The figures of one line have to agree with each other.
        self.assertAlmostEqual(result["particle_steps_per_s"] / result["steps_per_s"] / result["particles"], 1, 4)
        self.assertAlmostEqual(result["rtf"] / result["steps_per_s"] / result["time_step_s"], 1, 4)
        self.assertAlmostEqual(sum(result["stage_us"].values()) * result["steps_per_s"] / 1e6, 1, 3)
        self.assertLessEqual(result["step_us_min"], result["step_us_median"])
        self.assertLessEqual(result["step_us_median"], result["step_us_p99"])
        self.assertLessEqual(0, result["cpu_us_min"])
        self.assertLessEqual(result["cpu_us_min"], result["cpu_us_per_step_least"])
        self.assertLessEqual(result["cpu_us_per_step_least"], result["cpu_us_per_step"])
        self.assertGreater(result["neighbours_per_particle"], 5)
        self.assertGreater(result["peak_memory_bytes"], 1e6)
        self.assertGreater(result["memory_bytes_per_particle"], 100)

    def test_refusals(self):
        self.refused("--tissue", "jelly", says=["'tissue'", "'jelly'", "fluid"], program=BENCH)
        self.refused("--backend", "abacus", says=["'backend'", "'abacus'", "cpu"], program=BENCH)
        self.refused("--particles", "0", says=["'particles'", "'0'"], program=BENCH)
        self.refused("--steps", "0", says=["--steps", "'0'", "from 1"], program=BENCH)
        self.refused("--steps", "2.5", says=["--steps", "2.5"], program=BENCH)
        self.refused("--repeat", "x", says=["--repeat", "'x'"], program=BENCH)
        self.refused("--set", "nothing=1", says=["'nothing'"], program=BENCH)
        self.refused("--frobnicate", says=["--help"], program=BENCH)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])

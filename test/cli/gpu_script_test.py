#!/usr/bin/env python3
"""bench/gpu.sh with programs that pretend: what it writes, what it reckons, and how it ends. No GPU is needed.

usage: gpu_script_test.py bench/gpu.sh
"""
import csv
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(sys.argv.pop(1)).resolve()

# 60 neighbours; a stage takes 10 us on the GPU for a thousand particles, on one thread of the CPU 4000 us.
BENCH = r"""#!/bin/bash
while (($#)); do
    case $1 in --tissue) t=$2 ;; --backend) b=$2 ;; --particles) n=$2 ;; --threads) threads=$2 ;; esac
    [[ $1 == --* ]] && shift; shift
done
if [[ $t$b == "$FAKE_REFUSED" ]]; then echo "sph_muscle_bench: Fake has 3 MiB of 4 MiB free, and 5 MiB are needed" >&2; exit 2; fi
if [[ $t$b$n == "$FAKE_BROKEN" ]]; then echo "sph_muscle_bench: particle 3 is not finite" >&2; exit 1; fi
rtf=0.5; ((n == 10000000)) && rtf=1.23457e-05
us=$((n / 100)); [[ $b == cpu ]] && us=$((400 * us))
device="cuda: Fake (sm_90)"; [[ $b == cpu ]] && device="cpu, 2 threads"
stages="\"neighbours\": $us, \"intermediate_velocity\": $us, \"density_pressure\": $us, \"forces\": $us, \"diffusion\": 0, \"cell_model\": $us, \"integration\": $us, \"other\": 0}, "
stages+="${SPH_MUSCLE_TIME_LAUNCHES:+\"launch_us\": {\"move\": $us, \"strain\": $us, \"sum\": 3, \"rigid\": 7.5, \"smooth\": $us, \"force\": $us\}, }"
echo "{\"tissue\": \"$t\", \"backend\": \"$b\", \"device\": \"$device\", \"threads\": ${threads:-2}, \"particles\": $n, \"neighbours_per_particle\": 60, \"steps_per_s\": 1000, \"particle_steps_per_s\": ${n}000, \"ns_per_neighbour_pair\": 1, \"rtf\": $rtf, \"stage_us\": {$stages\"step_us_median\": 900, \"step_us_p99\": 1100, \"peak_memory_bytes\": 1, \"memory_bytes_per_particle\": 2000, \"steps\": 100, \"batch\": 1, \"repeat\": 3, \"time_step_s\": 2e-05, \"step_us_min\": 800, \"precision\": \"single\", \"version\": \"0\"}"
"""
PARITY = r"""#!/bin/bash
case $FAKE_PARITY in
77) echo "skipped: no CUDA device answers" ;;
1) echo "solid: DIFFERS" ;;
*) echo "solid: agrees" ;;
esac
exit $FAKE_PARITY
"""
CEILINGS = r"""#!/bin/bash
echo '{"device": "Fake", "multiprocessors": 132, "l2_bytes": 52428800, "memory_bytes": 150000000000, "memory_GB_per_s": 4000, "l2_GB_per_s": 8000, "single_GFLOP_per_s": 60000, "double_GFLOP_per_s": 30000, "graph_node_us": 1.1, "full_graph_node_us": 1.7, "launch_alone_us": 2.5, "grid_barrier_us": 1.5}'
"""
SANITIZER = r"""#!/bin/bash
[[ $2 == "$FAKE_SANITIZER" ]] && { echo "1 error"; exit 9; }
[[ $2 == "$FAKE_SILENT" ]] && exit 0
[[ $2 == "$FAKE_UNSUPPORTED" ]] && { echo "========= Error: Device not supported. Please refer to the documentation"; exit 1; }
echo "========= ERROR SUMMARY: 0 errors"
"""
# Says that whatever FAKE_TOO_LONG names took longer than it may.
TIMEOUT = r"""#!/bin/bash
[[ -n $FAKE_TOO_LONG && $* == *"$FAKE_TOO_LONG"* ]] && { echo "so far"; exit 124; }
shift 3
exec "$@"
"""
SMI = r"""#!/bin/bash
if [[ $* == *" -l "* ]]; then printf '345\n1980\n1755\n'; exec sleep 100; fi
echo "Fake GPU, 1.0, 1 MiB, 1 MHz"
"""


class GpuScript(unittest.TestCase):
    def run_script(self, *options, parity="0", **fake):
        with tempfile.TemporaryDirectory() as folder:
            place = pathlib.Path(folder)
            for name, text in [("sph_muscle_bench", BENCH), ("sph_muscle_parity", PARITY),
                               ("sph_muscle_ceilings", CEILINGS), ("compute-sanitizer", SANITIZER),
                               ("nvidia-smi", SMI),
                               ("timeout", TIMEOUT)]:
                (place / name).write_text(text)
                (place / name).chmod(0o755)
            environment = dict(os.environ, PATH=f"{folder}:{os.environ['PATH']}", FAKE_PARITY=parity)
            environment.update({f"FAKE_{name.upper()}": value for name, value in fake.items()})
            done = subprocess.run([SCRIPT, "--out", place / "out", "--build", place / "build", "--programs", place,
                                   *options], env=environment, capture_output=True, text=True, timeout=120)
            files = sorted(path.name for path in (place / "out").iterdir())
            self.assertEqual(files, ["gpu-Fake-GPU.csv", "gpu-Fake-GPU.txt"])
            with open(place / "out" / files[0], newline="") as rows:
                table = list(csv.reader(rows))
            summary = (place / "out" / files[1]).read_text()
        self.assertEqual(done.stdout, summary)
        self.assertEqual(done.stderr, "")
        for row in table:
            self.assertEqual(len(row), len(table[0]), row)
        return done.returncode, [dict(zip(table[0], row)) for row in table[1:]], summary

    def test_writes_all_sizes_of_both_tissues(self):
        code, rows, summary = self.run_script()
        self.assertEqual(code, 0, summary)
        sizes = [2231, 4944, 9888, 18475, 100000, 1000000, 10000000]
        for tissue in ["solid", "fluid"]:
            found = [int(row["particles"]) for row in rows
                     if row["variant"] == "graph" and row["tissue"] == tissue and row["backend"] == "cuda"]
            self.assertEqual(found, sizes)
        self.assertIn("MHz, least and most seen: 345 1980", summary)
        self.assertEqual({row["variant"] for row in rows}, {"graph", "persistent", "launches", "cpu"})
        self.assertIn("paper_h=0.04", next(r["command"] for r in rows if r["tissue"] == "fluid" and
                                           r["particles"] == "18475"))
        self.assertEqual(rows[0]["stage_us_forces"], "22")
        self.assertEqual(rows[0]["gpu"], "Fake GPU, 1.0, 1 MiB, 1 MHz")
        self.assertIn("SPH_MUSCLE_PERSISTENT=1", next(r["command"] for r in rows if r["variant"] == "persistent"))
        for part in ["passed   parity", "passed   the same with one kernel", "passed   memcheck", "passed   racecheck", "passed   synccheck", "passed   ceilings", "0 failed"]:
            self.assertIn(part, summary)
        # Numbers are rounded, not cut: 1.23457e-05 is not 1.23.
        words = next(line for line in summary.splitlines() if line.startswith("solid   cuda        10000000")).split()
        self.assertEqual(words[3:], ["60.0", "1000", "1e+10", "1.235e-05", "1100"])
        for what, asked, best, said in [("fluid, 18475 particles, h = 0.04: steps/s", "20000", "1000", "MISSED"),
                                        ("solid, 18475 particles, true density: RTF", "1", "0.5", "MISSED"),
                                        ("fluid, 10 million particles: particle-steps/s", "1e9", "10000000000", "reached")]:
            line = next(line for line in summary.splitlines() if what in line)
            self.assertEqual(line.split(what)[1].split(), [asked, "asked,", best, said])

    def test_takes_the_support_that_each_figure_is_asked_for_at(self):
        _, rows, _ = self.run_script()
        for row in rows:
            of = row["command"].split(" --set ")[1:]
            if row["tissue"] == "solid":  # the library's default
                self.assertEqual(of, [], row["command"])
            elif row["particles"] == "18475":
                self.assertEqual([one.split(" --")[0] for one in of], ["paper_units=true", "paper_h=0.04"])
            else:
                self.assertEqual(of, ["smoothing_ratio=2.4"])

    def test_reckons_stages_and_figure_13(self):
        _, _, summary = self.run_script("--most", "20000")
        # 18475 particles, 184 us: 72 * 60 + 160 bytes a particle asked for in move.
        asked = 18475 * (72 * 60 + 160) / 184 / 1e3
        line = next(line for line in summary.splitlines() if line.startswith("  move"))
        self.assertIn(f"{asked:.0f} GB/s asked for ({100 * asked / 8000:3.0f} % of the cache)", line)
        flop = 18475 * (42 * 60 + 100) / 184 / 1e3
        self.assertIn(f"{flop:.0f} GFLOP/s", line)
        self.assertIn("a launch in a graph 1.1 us, of blocks that fill the device 1.7 us; one that is waited for, as all below, 2.5 us", summary)
        # The fluid's rows are longer than its neighbours are many: by the skin (SPHM_FLUID_SKIN).
        entries = 60 * (1 + 0.03)**3
        line = next(line for line in summary.splitlines() if line.startswith("  force "))
        self.assertIn(f"{18475 * (60 * entries + 250) / 184 / 1e3:.0f} GB/s asked for", line)
        self.assertIn("  rigid                         7.50 us a step", summary)
        self.assertNotIn("  weigh ", summary)
        for name, paper, stages in [("density_and_pressure", "283", 2), ("forces", "152", 1),
                                    ("intermediate_velocity", "103", 2), ("corrected_velocity", "8", 1)]:
            words = next(line for line in summary.splitlines() if line.startswith(f"  {name} ")).split()
            self.assertEqual(words[1:], [paper, "400", str(73600 * stages), str(184 * stages)])
        words = next(line for line in summary.splitlines() if line.startswith("  update_of_properties")).split()
        self.assertEqual(words[1:3], ["14.9", "none"])

    def test_says_what_is_missing(self):
        code, rows, summary = self.run_script("--most", "20000", refused="fluidcuda")
        self.assertEqual(code, 0)
        self.assertFalse([row for row in rows if row["tissue"] == "fluid" and row["backend"] == "cuda"])
        self.assertIn("none     fluid cuda 2231: sph_muscle_bench: Fake has 3 MiB of 4 MiB free", summary)

    def test_ends_without_a_device(self):
        code, rows, summary = self.run_script(parity="77")
        self.assertEqual(code, 77)
        self.assertEqual({row["backend"] for row in rows}, {"cpu"})
        self.assertIn("skipped  parity", summary)
        self.assertIn("no CUDA device answered", summary)

    def test_tells_failures(self):
        for fake, line in [({"parity": "1"}, "FAILED   parity"), ({"sanitizer": "racecheck"}, "FAILED   racecheck"),
                           ({"silent": "memcheck"}, "FAILED   memcheck (status 99)"),
                           ({"too_long": "sph_muscle_parity"}, "FAILED   parity with the CPU over 500 steps, determinism, two muscles at once: took too long"),
                           ({"too_long": "--tissue solid --backend cuda --particles 4944"}, "FAILED   solid cuda 4944: took too long"),
                           ({"broken": "solidcuda4944"}, "none     solid cuda 4944: sph_muscle_bench: particle 3")]:
            code, _, summary = self.run_script("--most", "5000", **fake)
            self.assertEqual(code, 1, summary)
            self.assertIn(line, summary)

    def test_skips_a_sanitizer_that_does_not_support_the_machine(self):
        code, _, summary = self.run_script("--most", "2231", unsupported="memcheck")
        self.assertEqual(code, 0, summary)
        self.assertIn("skipped  memcheck: the sanitizer does not support", summary)
        self.assertIn("passed   racecheck", summary)

    def test_takes_the_commit_of_sources_without_git(self):
        _, rows, summary = self.run_script("--most", "2231", "--commit", "abc123")
        self.assertEqual({row["commit"] for row in rows}, {"abc123"})
        self.assertIn("sph_muscle abc123, ", summary)

    def test_leaves_out_what_is_late(self):
        code, rows, summary = self.run_script("--seconds", "3")
        self.assertEqual(code, 0, summary)
        self.assertEqual(rows, [])
        self.assertIn("left out parity", summary)
        self.assertIn("left out solid cuda 10000000: out of time", summary)


if __name__ == "__main__":
    unittest.main()

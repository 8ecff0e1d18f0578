#!/bin/bash
# Runs the CPU benchmark at the paper's four particle counts and at 100,000 and 200,000, and writes a CSV with
# the command, the commit and the processor into bench/results/.
#
#   bench/cpu.sh [--threads N] [--steps N] [--repeat R] [--out FILE] [BENCH]
#
# The counts take turns, R rounds of them, and the median run of each is kept: the clock of a shared machine
# drifts, and so do all counts alike. BENCH is the program (default build/sph_muscle_bench). At 18,475
# particles the support radius is the paper's h = 0.04; elsewhere it scales with the spacing (smoothing_ratio
# 2.68), so that every count has about 70 neighbours and the cost of a neighbour pair can be compared.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
threads=0 steps=100 repeat=5 out="" bench="$root/build/sph_muscle_bench"
while (($#)); do
    case $1 in
    --threads) threads=$2; shift 2 ;;
    --steps) steps=$2; shift 2 ;;
    --repeat) repeat=$2; shift 2 ;;
    --out) out=$2; shift 2 ;;
    -h | --help) sed -n '2,10s/^# \{0,1\}//p' "$0"; exit 0 ;;
    -*) echo "cpu.sh: unknown option $1" >&2; exit 2 ;;
    *) bench=$1; shift ;;
    esac
done
[[ -x $bench ]] || { echo "cpu.sh: no program $bench; build it or name it" >&2; exit 2; }

processor=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)
commit=$(git -C "$root" describe --always --dirty 2>/dev/null || echo unknown)
[[ $out ]] || out="$root/bench/results/cpu-$(tr -cs 'A-Za-z0-9\n' '-' <<<"${processor:-unknown}" | sed 's/-*$//').csv"
mkdir -p "$(dirname "$out")"

rows=()
for ((round = 1; round <= repeat; ++round)); do
    for particles in 2231 4944 9888 18475 100000 200000; do
        radius=(--set smoothing_ratio=2.68)
        ((particles == 18475)) && radius=(--set paper_units=true --set paper_h=0.04)
        command=(sph_muscle_bench --tissue fluid --backend cpu --particles "$particles" --steps "$steps"
            --repeat 1 --threads "$threads" "${radius[@]}")
        echo "round $round of $repeat: ${command[*]}" >&2
        rows+=("${command[*]}" "$("$bench" "${command[@]:1}")")
    done
done

python3 - "$out" "$commit" "$processor" "${rows[@]}" <<'PYTHON'
import csv, json, os, sys

out, commit, processor, *rows = sys.argv[1:]
runs = {}
for command, line in zip(rows[::2], rows[1::2]):
    runs.setdefault(command, []).append(json.loads(line))
with open(out + ".new", "w", newline="") as file:
    writer = None
    for command, rounds in runs.items():
        row = sorted(rounds, key=lambda run: run["steps_per_s"])[len(rounds) // 2]
        row.update(rounds=len(rounds), steps_per_s_least=min(run["steps_per_s"] for run in rounds),
                   steps_per_s_most=max(run["steps_per_s"] for run in rounds))
        for stage, us in row.pop("stage_us").items():
            row["stage_us_" + stage] = us
        row.update(commit=commit, processor=processor, command=command)
        if writer is None:
            writer = csv.DictWriter(file, row, lineterminator="\n")
            writer.writeheader()
        writer.writerow(row)
os.replace(out + ".new", out)
PYTHON
echo "wrote $out" >&2

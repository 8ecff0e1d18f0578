#!/bin/bash
# One command for a machine with an NVIDIA GPU, nvcc and CMake: builds without ROS and without network, compares the
# GPU with the CPU, runs compute-sanitizer on small cases, times both tissues, and writes a CSV and a summary.
#
#   bench/gpu.sh [--out FOLDER] [--build FOLDER] [--seconds S] [--most PARTICLES]
#
# FOLDER for results: default bench/results; for the build: build/gpu. It ends within S seconds (default 470; what does
# not fit any more is left out, and the summary says so). PARTICLES: largest muscle (default 10 million). Needs
# neither Python nor gtest, assimp or YAML. Exit status: 0 everything that ran passed, 1 something failed, 2 it could
# not begin, 77 no device answered.
set -uo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
out=$root/bench/results build=$root/build/gpu seconds=470 most=10000000
while (($#)); do
    case $1 in
    --out) out=$2; shift 2 ;;
    --build) build=$2; shift 2 ;;
    --seconds) seconds=$2; shift 2 ;;
    --most) most=$2; shift 2 ;;
    -h | --help) sed -n '2,11s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) echo "gpu.sh: unknown option $1" >&2; exit 2 ;;
    esac
done

began=$SECONDS
left() { echo $((seconds - (SECONDS - began))); }
# limited MOST COMMAND...: no longer than MOST seconds, nor than what is left; 124 when it took longer.
limited() {
    local most_s=$1 left_s
    shift
    left_s=$(left)
    ((left_s > 5)) || return 124
    timeout $((left_s < most_s ? left_s : most_s)) "$@"
}
die() { echo "gpu.sh: $*" >&2; exit 2; }

PATH=$PATH:/usr/local/cuda/bin
for tool in cmake nvcc; do command -v $tool >/dev/null || die "no $tool"; done
commit=$(git -C "$root" describe --always --dirty 2>/dev/null || echo unknown)
device=$(nvidia-smi --query-gpu=name,driver_version,memory.total,clocks.max.sm --format=csv,noheader 2>/dev/null | head -n 1)
processor=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)
slug=$(tr -cs 'A-Za-z0-9\n' '-' <<<"${device%%,*}" | sed 's/-*$//')
mkdir -p "$out" "$build" || die "cannot make $out and $build"
csv=$out/gpu-${slug:-none}.csv summary=$out/gpu-${slug:-none}.txt
: >"$csv" && : >"$summary" || die "cannot write $csv and $summary"
failures=0
tell() { printf '%s\n' "$*" | tee -a "$summary"; }
verdict() { # STATUS WHAT [LOG]
    case $1 in
    0) tell "passed   $2" ;;
    77) tell "skipped  $2: $(tail -n 1 "$3")" ;;
    124) tell "left out $2: out of time" ;;
    *) tell "FAILED   $2 (status $1): see $3"; tail -n 5 "$3" | sed 's/^/           /' | tee -a "$summary"; failures=$((failures + 1)) ;;
    esac
}

tell "sph_muscle $commit, $(date -u +%FT%TZ), command: bench/gpu.sh"
tell "device: ${device:-none found by nvidia-smi}; $(nvcc --version | sed -n 's/.*release \([0-9.]*\).*/nvcc \1/p'); processor: ${processor:-unknown}, $(nproc) cores"

# Build: for the device that is here where it can be asked, else for all.
capability=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2>/dev/null | head -n 1 | tr -d '.')
architectures=()
[[ $capability =~ ^[0-9]+$ ]] && architectures=("-DCMAKE_CUDA_ARCHITECTURES=$capability-real")
log=$build/build.log
{
    cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release -DSPH_MUSCLE_ROS=OFF -DSPH_MUSCLE_CUDA=ON \
        -DSPH_MUSCLE_TESTS=OFF "${architectures[@]}" &&
        limited 240 cmake --build "$build" -j "$(nproc)"
} >"$log" 2>&1
status=$?
verdict $status "build in $((SECONDS - began)) s" "$log"
((status == 0)) || exit 2
bench=$build/sph_muscle_bench parity=$build/sph_muscle_parity

# The same numbers as the CPU's, and the same bits twice.
log=$build/parity.log
limited 120 "$parity" >"$log" 2>&1
status=$?
verdict $status "parity with the CPU over 500 steps, determinism, two muscles at once" "$log"
grep -hE '^skipped|agrees$|DIFFERS$|MORE THAN|NOT FINITE' "$log" | sed 's/^/           /' | tee -a "$summary"
there=$((status != 77))

# Small cases under the sanitizer.
sanitizer=$(command -v compute-sanitizer || ls /usr/local/cuda/compute-sanitizer/compute-sanitizer 2>/dev/null)
for tool in memcheck racecheck; do
    log=$build/$tool.log
    if [[ -z $sanitizer ]]; then
        tell "skipped  $tool: no compute-sanitizer"
    elif ((!there)); then
        tell "skipped  $tool: no device"
    else
        limited 60 "$sanitizer" --tool $tool --error-exitcode 9 "$parity" --particles 200 --steps 70 >"$log" 2>&1
        verdict $? "$tool" "$log"
    fi
done

# Speed. JSON to CSV without a JSON reader: the benchmark's lines are flat but for stage_us.
columns=(tissue backend device particles neighbours_per_particle steps_per_s particle_steps_per_s rtf step_us_median
    step_us_p99 step_us_min time_step_s steps batch repeat memory_bytes_per_particle precision)
value() { sed -n "s/.*\"$1\": \"\{0,1\}\([^\",}]*\).*/\1/p" <<<"$2"; }
printf '%s,' "${columns[@]}" >"$csv"
echo "commit,gpu,command" >>"$csv"
tell "$(printf '%-7s %-5s %10s %6s %12s %14s %10s %12s' tissue where particles neigh. steps/s particle-steps/s RTF step-p99-us)"
measure() { # TISSUE BACKEND PARTICLES STEPS OPTION...
    local tissue=$1 backend=$2 particles=$3 steps=$4 line status log row=() column
    shift 4
    ((particles <= most)) || return 0
    local command=(sph_muscle_bench --tissue "$tissue" --backend "$backend" --particles "$particles" --steps "$steps" "$@")
    log=$build/bench-$tissue-$backend-$particles.log
    line=$(limited 90 "$bench" "${command[@]:1}" 2>"$log")
    status=$?
    if ((status != 0)); then
        if ((status == 124)); then tell "left out $tissue $backend $particles: out of time"; else
            tell "none     $tissue $backend $particles: $(tail -n 1 "$log")"
            # What is not built yet, or does not fit, is no failure of what is.
            ((status == 2 || status == 1)) && grep -qE 'not computed by CUDA yet|MiB are needed|no CUDA d|no memory' "$log" || failures=$((failures + 1))
        fi
        return 0
    fi
    for column in "${columns[@]}"; do row+=("$(value "$column" "$line")"); done
    local text="${command[*]}"
    (IFS=,; echo "${row[*]},$commit,\"$device\",\"$text\"") >>"$csv"
    tell "$(printf '%-7s %-5s %10s %6.4s %12.6s %14.4g %10.4s %12.6s' "$tissue" "$backend" "${row[3]}" "${row[4]}" "${row[5]}" "${row[6]}" "${row[7]}" "${row[9]}")"
}
measure_both() { # PARTICLES STEPS
    local radius=(--set smoothing_ratio=2.4)
    (($1 == 18475)) && radius=(--set paper_units=true --set paper_h=0.04)
    measure solid cuda "$1" "$2" --batch 320 --repeat 3 --set smoothing_ratio=2.4
    measure fluid cuda "$1" "$2" --batch 100 --repeat 3 "${radius[@]}"
}
for particles in 2231 4944 9888 18475; do measure_both $particles 6400; done
# The CPU beside it, all cores, fewer steps.
measure solid cpu 18475 200 --repeat 3 --set smoothing_ratio=2.4
measure fluid cpu 18475 200 --repeat 3 --set paper_units=true --set paper_h=0.04
measure_both 100000 3200
measure_both 1000000 320
measure_both 10000000 96

# Where a step's time goes: its launches one by one, each waited for, which a graph does not do.
if ((there)) && line=$(SPH_MUSCLE_TIME_LAUNCHES=1 limited 60 "$bench" --tissue solid --backend cuda --particles 18475 \
    --steps 640 --batch 320 --repeat 1 --set smoothing_ratio=2.4 2>"$build/stages.log"); then
    tell "solid, 18475 particles, us a step of launches timed one by one: move (force, integration, cell model) $(value forces "$line"), strain (diffusion, stress) $(value density_pressure "$line"), spread $(value diffusion "$line")"
fi

tell "ceilings of bandwidth and arithmetic, and the paper's Figure 13: not measured by this script yet"
tell "$((SECONDS - began)) s in all; $failures failed; rows in $csv"
((failures == 0)) || exit 1
((there)) || exit 77

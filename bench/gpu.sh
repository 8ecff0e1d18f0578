#!/bin/bash
# One command for a machine with an NVIDIA GPU, nvcc and CMake: builds without ROS and without network, compares the
# GPU with the CPU, runs compute-sanitizer on small cases, times both tissues, and writes a CSV and a summary.
#
#   bench/gpu.sh [--out FOLDER] [--build FOLDER] [--programs FOLDER] [--seconds S] [--most PARTICLES]
#
# FOLDER for results: default bench/results; for the build: build/gpu; with --programs those in that folder are taken
# and nothing is built. It ends within S seconds (default 470): every part has its own share, and what does not fit any
# more is left out, with a line that says so. PARTICLES: largest muscle (default 10 million). Needs neither Python nor
# gtest, assimp or YAML. Exit status: 0 everything that ran passed, 1 something failed, 2 it could not begin, 77 no
# device answered.
#
# The counts of bytes and operations are those of doc/cuda.md, by hand from cuda/*_threads.h; n is the number of
# neighbours.
set -uo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
out=$root/bench/results build=$root/build/gpu programs= seconds=470 most=10000000
while (($#)); do
    case $1 in
    --out) out=$2; shift 2 ;;
    --build) build=$2; shift 2 ;;
    --programs) programs=$2; shift 2 ;;
    --seconds) seconds=$2; shift 2 ;;
    --most) most=$2; shift 2 ;;
    -h | --help) sed -n '2,15s/^# \{0,1\}//p' "$0"; exit 0 ;;
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
[[ -n $programs ]] || for tool in cmake nvcc; do command -v $tool >/dev/null || die "no $tool"; done
commit=$(git -C "$root" describe --always --dirty 2>/dev/null || echo unknown)
device=$(nvidia-smi --query-gpu=name,driver_version,memory.total,clocks.max.sm --format=csv,noheader 2>/dev/null | head -n 1)
processor=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)
slug=$(tr -cs 'A-Za-z0-9\n' '-' <<<"${device%%,*}" | sed 's/-*$//')
mkdir -p "$out" "$build" || die "cannot make $out and $build"
csv=$out/gpu-${slug:-none}.csv summary=$out/gpu-${slug:-none}.txt
: >"$csv" && : >"$summary" || die "cannot write $csv and $summary"
failures=0
logs=$build
tell() { printf '%s\n' "$@" | tee -a "$summary"; }
verdict() { # STATUS WHAT [LOG]
    case $1 in
    0) tell "passed   $2" ;;
    77) tell "skipped  $2: $(tail -n 1 "$3")" ;;
    124) tell "left out $2: out of time" ;;
    *) tell "FAILED   $2 (status $1): see $3"; tail -n 5 "$3" | sed 's/^/           /' | tee -a "$summary"; failures=$((failures + 1)) ;;
    esac
}

tell "sph_muscle $commit, $(date -u +%FT%TZ), command: bench/gpu.sh"
tell "device: ${device:-none found by nvidia-smi}; $(nvcc --version 2>/dev/null | sed -n 's/.*release \([0-9.]*\).*/nvcc \1/p'); processor: ${processor:-unknown}, $(nproc) cores"

# Build: for the device that is here where it can be asked, else for all.
build_all() {
    local capability architectures=()
    capability=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2>/dev/null | head -n 1 | tr -d '.')
    [[ $capability =~ ^[0-9]+$ ]] && architectures=("-DCMAKE_CUDA_ARCHITECTURES=$capability-real")
    cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release -DSPH_MUSCLE_ROS=OFF -DSPH_MUSCLE_CUDA=ON \
        -DSPH_MUSCLE_TESTS=OFF "${architectures[@]}" &&
        limited 180 cmake --build "$build" -j "$(nproc)"
}
if [[ -z $programs ]]; then
    programs=$build
    log=$build/build.log
    build_all >"$log" 2>&1
    status=$?
    verdict $status "build in $((SECONDS - began)) s" "$log"
    ((status == 0)) || exit 2
fi
bench=$programs/sph_muscle_bench parity=$programs/sph_muscle_parity ceilings=$programs/sph_muscle_ceilings
for program in "$bench" "$parity" "$ceilings"; do [[ -x $program ]] || die "no $program"; done

# The same numbers as the CPU's, and the same bits twice.
log=$logs/parity.log
limited 120 "$parity" >"$log" 2>&1
status=$?
verdict $status "parity with the CPU over 500 steps, determinism, two muscles at once" "$log"
grep -hE '^skipped|agrees$|DIFFERS$|MORE THAN|NOT FINITE' "$log" | sed 's/^/           /' | tee -a "$summary"
there=$((status != 77))
if ((there)); then
    log=$logs/parity-persistent.log
    SPH_MUSCLE_PERSISTENT=1 limited 40 "$parity" --steps 100 >"$log" 2>&1
    verdict $? "the same with one kernel for many steps of the solid" "$log"
fi

# Small cases under the sanitizer.
sanitizer=$(command -v compute-sanitizer || ls /usr/local/cuda/compute-sanitizer/compute-sanitizer 2>/dev/null)
for tool in memcheck racecheck; do
    log=$logs/$tool.log
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
columns=(tissue backend device threads particles neighbours_per_particle steps_per_s particle_steps_per_s rtf
    step_us_median step_us_p99 step_us_min time_step_s steps batch repeat memory_bytes_per_particle precision
    neighbours intermediate_velocity density_pressure forces diffusion cell_model integration other)
value() { sed -n "s/.*\"$1\": \"\{0,1\}\([^\",}]*\).*/\1/p" <<<"$2"; }
printf '%s,' "${columns[@]}" | sed -E 's/(neighbours|intermediate_velocity|density_pressure|forces|diffusion|cell_model|integration|other),/stage_us_\1,/g' >"$csv"
echo "variant,commit,gpu,command" >>"$csv"
heading=$(printf '%-7s %-9s %10s %6s %12s %14s %10s %12s' tissue where particles neigh. steps/s particle-steps/s RTF step-p99-us)
line=
# measure VARIANT TISSUE BACKEND PARTICLES STEPS OPTION...: a row of the CSV and a line of the summary; leaves what the
# benchmark printed in `line`, or nothing. VARIANT: graph, persistent (one kernel for many
# steps), launches (timed one by one), cpu.
measure() {
    local variant=$1 tissue=$2 backend=$3 particles=$4 steps=$5 status log row=() column where setting=
    shift 5
    line=
    ((particles <= most)) || return 0
    local command=(sph_muscle_bench --tissue "$tissue" --backend "$backend" --particles "$particles" --steps "$steps" "$@")
    case $variant in
    persistent) setting=SPH_MUSCLE_PERSISTENT=1 where=persist. ;;
    launches) setting=SPH_MUSCLE_TIME_LAUNCHES=1 where=launches ;;
    *) where=$backend ;;
    esac
    log=$logs/bench-$variant-$tissue-$backend-$particles.log
    line=$(limited 75 env $setting "$bench" "${command[@]:1}" 2>"$log")
    status=$?
    if ((status != 0)); then
        line=
        if ((status == 124)); then tell "left out $tissue $where $particles: out of time"; else
            tell "none     $tissue $where $particles: $(tail -n 1 "$log")"
            # What is not built yet, or does not fit, is no failure of what is.
            ((status == 2 || status == 1)) && grep -qE 'MiB are needed|no CUDA d|no memory' "$log" || failures=$((failures + 1))
        fi
        return 0
    fi
    for column in "${columns[@]}"; do row+=("$(value "$column" "$line")"); done
    local text="${setting:+$setting }${command[*]}"
    (IFS=,; echo "${row[*]},$variant,$commit,\"$device\",\"$text\"") >>"$csv"
    tell "$(printf '%-7s %-9s %10s %6.4s %12.6s %14.4g %10.4s %12.6s' "$tissue" "$where" "${row[4]}" "${row[5]}" "${row[6]}" "${row[7]}" "${row[8]}" "${row[10]}")"
}
support=(--set smoothing_ratio=2.4) paper=(--set paper_units=true --set paper_h=0.04)
measure_both() { # PARTICLES STEPS
    local of_fluid=("${support[@]}") of_solid=("${support[@]}")
    (($1 == 18475)) && of_fluid=("${paper[@]}")
    # 60 neighbours at 24 bytes each, twice while they are made on the host: at 10 million particles half as many do.
    (($1 >= 10000000)) && of_solid=(--set smoothing_ratio=2)
    measure graph solid cuda "$1" "$2" --batch 320 --repeat 3 "${of_solid[@]}"
    measure graph fluid cuda "$1" "$2" --batch 100 --repeat 3 "${of_fluid[@]}"
}

tell "" "$heading"
if ((there)); then
    for particles in 2231 4944 9888 18475; do measure_both $particles 6400; done
    measure persistent solid cuda 18475 6400 --batch 320 --repeat 3 "${support[@]}"
fi
# The CPU beside it, all cores, fewer steps.
measure cpu solid cpu 18475 200 --repeat 3 "${support[@]}"
measure cpu fluid cpu 18475 200 --repeat 3 "${paper[@]}"

# Ceilings, and where a step's time goes: its launches one by one, each waited for, which a graph does not do.
number() { [[ $1 =~ ^[-+0-9.e]+$ ]]; }
# stage NAME US BYTES UNIQUE FLOP of a particle: bytes that its threads ask for, and of them those that have to come
# from memory at least once when nothing stays in a cache.
stage() {
    number "$2" && number "$particles_now" || return 0
    tell "$(awk -v name="$1" -v us="$2" -v bytes="$3" -v unique="$4" -v flop="$5" -v n="$particles_now" -v mem="$memory_GB" -v l2="$l2_GB" -v gflop="$single_GFLOP" 'BEGIN {
        if (us <= 0) exit
        asked = n * bytes / us / 1e3; once = n * unique / us / 1e3; rate = n * flop / us / 1e3
        printf "  %-24s %9.2f us  %8.0f GB/s asked for (%3.0f %% of the cache), %7.0f GB/s unique (%3.0f %% of memory), %7.0f GFLOP/s (%4.1f %%)", name, us, asked, 100 * asked / l2, once, 100 * once / mem, rate, 100 * rate / gflop }')"
}
stages_of_solid() { # of `line`
    local n
    n=$(value neighbours_per_particle "$line") particles_now=$(value particles "$line")
    number "$n" || return 0
    of() { awk -v n="$n" "BEGIN { print $1 }"; }
    stage "move" "$(value forces "$line")" "$(of '84*n+160')" "$(of '20*n+160')" "$(of '36*n+100')"
    stage "strain" "$(value density_pressure "$line")" "$(of '60*n+190')" "$(of '24*n+190')" "$(of '45*n+1100')"
}
if ((there)); then
    tell ""
    log=$logs/ceilings.log
    found=$(limited 40 "$ceilings" 2>"$log")
    status=$?
    verdict $status "ceilings" "$log"
    if ((status == 0)); then
        memory_GB=$(value memory_GB_per_s "$found") l2_GB=$(value l2_GB_per_s "$found")
        single_GFLOP=$(value single_GFLOP_per_s "$found")
        tell "  memory $memory_GB GB/s, level-2 cache $l2_GB GB/s ($(value l2_bytes "$found") bytes); single precision $single_GFLOP, double $(value double_GFLOP_per_s "$found") GFLOP/s"
        tell "  a launch in a graph $(value graph_node_us "$found") us, a barrier of the whole grid $(value grid_barrier_us "$found") us"
        for particles in 18475 1000000; do
            measure launches solid cuda $particles 320 --batch 320 --repeat 1 --warm-up 32 "${support[@]}"
            [[ -z $line ]] || stages_of_solid
        done
    fi
fi

# The paper's Figure 13: its GPU (Titan X) over one thread of its CPU, and ours over one thread of ours.
ratio() { awk -v a="$1" -v b="$2" 'BEGIN { if (a + 0 > 0 && b + 0 > 0) printf "%.4g", a / b; else printf "none" }'; }
stage_sum() { # LINE STAGE...
    local sum=0 one text=$1
    shift
    for one in "$@"; do sum=$(awk -v a="$sum" -v b="$(value "$one" "$text")" 'BEGIN { print a + b }'); done
    echo "$sum"
}
if ((there)); then
    tell "" "Figure 13 of the paper, fluid, 18475 particles, h = 0.04: a stage on one CPU thread over the same on the GPU"
    measure cpu fluid cpu 18475 20 --repeat 1 --threads 1 --warm-up 2 "${paper[@]}"
    one_thread=$line
    measure launches fluid cuda 18475 320 --repeat 1 --batch 320 "${paper[@]}"
    on_gpu=$line
    tell "$(printf '  %-24s %8s %8s %14s %14s' stage paper ours 'CPU us' 'GPU us')"
    while read -r name speedup stages; do
        cpu_us=$(stage_sum "$one_thread" $stages) gpu_us=$(stage_sum "$on_gpu" $stages)
        tell "$(printf '  %-24s %8s %8s %14s %14s' "$name" "$speedup" "$(ratio "$cpu_us" "$gpu_us")" "$cpu_us" "$gpu_us")"
    done <<<'density_and_pressure 283 density_pressure
forces 152 forces
intermediate_velocity 103 intermediate_velocity
cell_model 15.5 cell_model diffusion
update_of_properties 14.9 -
neighbours 9.7 neighbours
corrected_velocity 8 integration'
    tell "  ours counts the Laplacian of the potential to the cell model where a back end times it apart, and has no update of properties; 0 us or none: that back end times the stage together with another"
fi

if ((there)); then
    tell "" "$heading"
    measure_both 100000 3200
    measure_both 1000000 320
    measure_both 10000000 96
fi

tell "" "$((SECONDS - began)) s in all; $failures failed; rows in $csv"
((there)) || tell "no CUDA device answered: nothing was measured on a GPU"
((failures == 0)) || exit 1
((there)) || exit 77

#!/bin/bash
# One command for a machine with an NVIDIA GPU, nvcc and CMake: builds without ROS and without network, compares the
# GPU with the CPU, runs compute-sanitizer on small cases, times both tissues, and writes a CSV and a summary.
#
#   bench/gpu.sh [--out FOLDER] [--build FOLDER] [--programs FOLDER] [--seconds S] [--most PARTICLES] [--commit NAME]
#
# FOLDER for results: default bench/results; for the build: build/gpu; with --programs those in that folder are taken
# and nothing is built. It ends within S seconds (default 470): every part has its own share, and what does not fit any
# more is left out, with a line that says so; a part that takes longer than its share has failed. PARTICLES: largest
# muscle (default 10 million). NAME: the commit, where the sources have come without git. Needs neither Python nor
# gtest, assimp or YAML. Exit status: 0 everything that ran passed, 1 something failed, 2 it could not begin, 77 no
# device answered.
#
# The counts of bytes and operations are those of doc/cuda.md, by hand from cuda/*_threads.h; n is the number of
# neighbours.
set -uo pipefail
export LC_ALL=C # numbers with a point

root=$(cd "$(dirname "$0")/.." && pwd)
out=$root/bench/results build=$root/build/gpu programs= seconds=470 most=10000000 commit=
while (($#)); do
    case $1 in
    --out) out=$2; shift 2 ;;
    --build) build=$2; shift 2 ;;
    --programs) programs=$2; shift 2 ;;
    --seconds) seconds=$2; shift 2 ;;
    --most) most=$2; shift 2 ;;
    --commit) commit=$2; shift 2 ;;
    -h | --help) sed -n '2,16s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) echo "gpu.sh: unknown option $1" >&2; exit 2 ;;
    esac
done

began=$SECONDS
left() { echo $((seconds - (SECONDS - began))); }
# limited MOST COMMAND...: no longer than MOST seconds, nor than what is left. 124: it took longer than MOST (137: and
# had to be killed), which a launch that hangs does, too; 75: too little time is left for it.
limited() {
    local most_s=$1 left_s status
    shift
    left_s=$(left)
    ((left_s > 5)) || return 75
    timeout -k 5 $((left_s < most_s ? left_s : most_s)) "$@"
    status=$?
    (((status == 124 || status == 137) && left_s < most_s)) && return 75
    return $status
}
die() { echo "gpu.sh: $*" >&2; exit 2; }

PATH=$PATH:/usr/local/cuda/bin
[[ -n $programs ]] || for tool in cmake nvcc; do command -v $tool >/dev/null || die "no $tool"; done
commit=${commit:-$(git -C "$root" describe --always --dirty 2>/dev/null || echo unknown)}
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
    75) tell "left out $2: out of time" ;;
    124 | 137) tell "FAILED   $2: took too long; it got as far as"; tail -n 3 "$3" | sed 's/^/           /' | tee -a "$summary"; failures=$((failures + 1)) ;;
    *) tell "FAILED   $2 (status $1): see $3"; tail -n 5 "$3" | sed 's/^/           /' | tee -a "$summary"; failures=$((failures + 1)) ;;
    esac
}

tell "sph_muscle $commit, $(date -u +%FT%TZ), command: bench/gpu.sh"
tell "device: ${device:-none found by nvidia-smi}; $(nvcc --version 2>/dev/null | sed -n 's/.*release \([0-9.]*\).*/nvcc \1/p'); processor: ${processor:-unknown}, $(nproc) cores"

# Build: for the device that is here where it can be asked, else for all.
build_all() {
    local capability architectures=() generator=()
    command -v make >/dev/null || ! command -v ninja >/dev/null || generator=(-G Ninja)
    capability=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2>/dev/null | head -n 1 | tr -d '.')
    [[ $capability =~ ^[0-9]+$ ]] && architectures=("-DCMAKE_CUDA_ARCHITECTURES=$capability-real")
    cmake "${generator[@]}" -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release -DSPH_MUSCLE_ROS=OFF -DSPH_MUSCLE_CUDA=ON \
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

# Somebody keeps the device open, or the driver may start it anew for every program below, seconds each; and it
# notes what clock the figures were measured at.
clocks=$logs/clocks.csv
nvidia-smi --query-gpu=clocks.sm --format=csv,noheader,nounits -l 5 >"$clocks" 2>/dev/null &
watcher=$!
trap 'kill $watcher 2>/dev/null' EXIT

# The same numbers as the CPU's, and the same bits twice.
log=$logs/parity.log
limited 120 "$parity" >"$log" 2>&1
status=$?
verdict $status "parity with the CPU over 500 steps, determinism, two muscles at once" "$log"
grep -hE '^skipped|agrees$|DIFFERS$|MORE THAN|NOT FINITE|at once, one looked at' "$log" | sed 's/^/           /' | tee -a "$summary"
there=$((status != 77))
if ((there)); then
    log=$logs/parity-persistent.log
    SPH_MUSCLE_PERSISTENT=1 limited 40 "$parity" --steps 100 >"$log" 2>&1
    verdict $? "the same with one kernel for many steps of the solid" "$log"
fi

# Small cases under the sanitizer, which has to say itself that it found nothing.
sanitizer=$(command -v compute-sanitizer || ls /usr/local/cuda/compute-sanitizer/compute-sanitizer 2>/dev/null)
for tool in memcheck racecheck synccheck; do
    log=$logs/$tool.log
    if [[ -z $sanitizer ]]; then
        tell "skipped  $tool: no compute-sanitizer"
    elif ((!there)); then
        tell "skipped  $tool: no device"
    else
        limited 60 "$sanitizer" --tool $tool --error-exitcode 9 "$parity" --particles 200 --steps 70 >"$log" 2>&1
        status=$?
        if ((status != 75)) && grep -qi 'device not supported' "$log"; then
            tell "skipped  $tool: the sanitizer does not support this device or machine"
            continue
        fi
        ((status != 0)) || grep -q 'SUMMARY: 0 ' "$log" || status=99
        verdict $status "$tool" "$log"
    fi
done

# Speed. JSON to CSV without a JSON reader: the benchmark's lines are flat but for stage_us.
columns=(tissue backend device threads particles neighbours_per_particle steps_per_s particle_steps_per_s rtf
    step_us_median step_us_p99 step_us_min time_step_s steps batch repeat memory_bytes_per_particle precision
    neighbours intermediate_velocity density_pressure forces diffusion cell_model integration other)
number() { [[ $1 =~ ^[-+0-9.e]+$ ]]; }
# shown FORMAT NUMBER: or a dash.
shown() { if number "$2"; then printf "$1" "$2"; else printf '%s' -; fi; }
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
    line=$(limited $((particles < 10000000 ? 75 : 120)) env $setting "$bench" "${command[@]:1}" 2>"$log")
    status=$?
    if ((status != 0)); then
        line=
        if ((status == 75)); then tell "left out $tissue $where $particles: out of time"
        elif ((status == 124 || status == 137)); then
            tell "FAILED   $tissue $where $particles: took too long"
            failures=$((failures + 1))
        else
            tell "none     $tissue $where $particles: $(tail -n 1 "$log")"
            # What is not built yet, or does not fit, is no failure of what is.
            ((status == 2 || status == 1)) && grep -qE 'MiB are needed|no CUDA d|no memory' "$log" || failures=$((failures + 1))
        fi
        return 0
    fi
    for column in "${columns[@]}"; do row+=("$(value "$column" "$line")"); done
    local text="${setting:+$setting }${command[*]}"
    (IFS=,; echo "${row[*]},$variant,$commit,\"$device\",\"$text\"") >>"$csv"
    measured[$variant-$tissue-$particles]=$line
    tell "$(printf '%-7s %-9s %10s %6s %12s %14s %10s %12s' "$tissue" "$where" "${row[4]}" "$(shown %.1f "${row[5]}")" "$(shown %.6g "${row[6]}")" "$(shown %.4g "${row[7]}")" "$(shown %.4g "${row[8]}")" "$(shown %.6g "${row[10]}")")"
}
declare -A measured # what the benchmark printed, by variant, tissue and particles
# The fluid's support is that of its targets: the paper's at the paper's largest muscle, else 2.4 spacings. The solid has
# the library's default: no option.
paper=(--set paper_units=true --set paper_h=0.04)
fluid_support() { # PARTICLES: leaves the options in `support`
    support=(--set smoothing_ratio=2.4)
    (($1 != 18475)) || support=("${paper[@]}")
}
# The muscle is made anew for each repetition, which for the largest ones takes longer than the steps: once.
measure_both() { # PARTICLES STEPS
    local repeat=$(($1 < 1000000 ? 3 : 1)) support
    fluid_support "$1"
    measure graph fluid cuda "$1" "$2" --batch $(($1 < 1000000 ? 160 : 32)) --repeat $repeat "${support[@]}"
    measure graph solid cuda "$1" "$2" --batch $(($1 < 1000000 ? 320 : 32)) --repeat $repeat
}

tell "" "$heading"
if ((there)); then
    for particles in 2231 4944 9888 18475; do
        measure_both $particles 6400
        measure persistent solid cuda $particles 6400 --batch 320 --repeat 3
    done
fi
# The CPU beside it, all cores, fewer steps.
measure cpu solid cpu 18475 200 --repeat 3
measure cpu fluid cpu 18475 200 --repeat 3 "${paper[@]}"

# Ceilings, and where a step's time goes: its launches one by one, each waited for, which a graph does not do.
# stage NAME US BYTES UNIQUE FLOP of a particle: bytes that its threads ask for, and of them those that have to come
# from memory at least once when nothing stays in a cache.
stage() {
    number "$2" && number "$particles_now" || return 0
    tell "$(awk -v name="$1" -v us="$2" -v bytes="$3" -v unique="$4" -v flop="$5" -v n="$particles_now" -v mem="$memory_GB" -v l2="$l2_GB" -v gflop="$single_GFLOP" 'BEGIN {
        if (us <= 0) exit
        asked = n * bytes / us / 1e3; once = n * unique / us / 1e3; rate = n * flop / us / 1e3
        printf "  %-24s %9.2f us  %8.0f GB/s asked for (%3.0f %% of the cache), %7.0f GB/s unique (%3.0f %% of memory), %7.0f GFLOP/s (%4.1f %%)", name, us, asked, 100 * asked / l2, once, 100 * once / mem, rate, 100 * rate / gflop }')"
}
stages() { # TISSUE; of `line`
    local n one
    n=$(value neighbours_per_particle "$line") particles_now=$(value particles "$line")
    number "$n" || return 0
    # Entries of a row of the fluid: within the support and the skin (SPHM_FLUID_SKIN in src/core/fluid_watch.h).
    [[ $1 == fluid ]] && n=$(awk -v n="$n" -v skin=0.03 'BEGIN { print (1 + skin) ^ 3 * n }')
    of() { awk -v n="$n" "BEGIN { print $1 }"; }
    tell "  $1, $particles_now particles, $(shown %.4g "$n") entries a row"
    if [[ $1 == solid ]]; then
        stage move "$(value move "$line")" "$(of '72*n+160')" "$(of '8*n+160')" "$(of '42*n+100')"
        stage strain "$(value strain "$line")" "$(of '64*n+210')" "$(of '12*n+210')" "$(of '51*n+1100')"
    else
        stage sum "$(value sum "$line")" 24 24 33
        stage predict "$(value predict "$line")" 73 73 150
        stage smooth "$(value smooth "$line")" "$(of '36*n+190')" "$(of '4*n+190')" "$(of '28*n+160')"
        stage force "$(value force "$line")" "$(of '60*n+250')" "$(of '8*n+250')" "$(of '70*n+230')"
        for one in rigid report list box lay_out bin sort starts reorder settle count scan fill correct weigh; do
            number "$(value $one "$line")" && tell "$(printf '  %-24s %9.2f us a step' "$one" "$(value $one "$line")")"
        done
    fi
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
        tell "  a launch in a graph $(value graph_node_us "$found") us, of blocks that fill the device $(value full_graph_node_us "$found") us; one that is waited for, as all below, $(value launch_alone_us "$found") us; a barrier of the whole grid $(value grid_barrier_us "$found") us"
        for particles in 18475 1000000; do
            for tissue in solid fluid; do
                support=()
                [[ $tissue == solid ]] || fluid_support $particles
                measure launches $tissue cuda $particles 320 --batch 320 --repeat 1 --warm-up 32 "${support[@]}"
                [[ -z $line ]] || stages $tissue
            done
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
    on_gpu=${measured[launches-fluid-18475]-}
    tell "$(printf '  %-24s %8s %8s %14s %14s' stage paper ours 'CPU us' 'GPU us')"
    while read -r name speedup stages; do
        cpu_us=$(stage_sum "$one_thread" $stages) gpu_us=$(stage_sum "$on_gpu" $stages)
        tell "$(printf '  %-24s %8s %8s %14s %14s' "$name" "$speedup" "$(ratio "$cpu_us" "$gpu_us")" "$cpu_us" "$gpu_us")"
    done <<<'density_and_pressure 283 intermediate_velocity density_pressure
forces 152 forces
intermediate_velocity 103 intermediate_velocity density_pressure
cell_model 15.5 cell_model diffusion
update_of_properties 14.9 -
neighbours 9.7 neighbours
corrected_velocity 8 integration'
    tell "  density, pressure and intermediate velocity are one sweep of ours, on both sides: both rows show it"
    tell "  ours counts the Laplacian of the potential to the cell model where a back end times it apart, and has no update of properties; 0 us or none: that back end times the stage together with another"
fi

if ((there)); then
    tell "" "$heading"
    measure_both 100000 3200
    measure_both 1000000 320
    measure_both 10000000 96
fi

# What is asked for, and what was measured of it.
target() { # WHAT KEY LEAST LINE...: of the lines the largest value
    local what=$1 key=$2 least=$3 best=- said=- one
    shift 3
    for one in "$@"; do
        number "$(value "$key" "$one")" && best=$(awk -v a="$(value "$key" "$one")" -v b="$best" 'BEGIN { print((b == "-" || a + 0 > b + 0) ? a : b) }')
    done
    [[ $best == - ]] || said=$(awk -v a="$best" -v b="$least" 'BEGIN { print((a + 0 >= b + 0) ? "reached" : "MISSED") }')
    [[ $best != - ]] || best="not measured"
    tell "$(printf '  %-52s %10s asked, %14s  %s' "$what" "$least" "$best" "$said")"
}
if ((there)); then
    tell "" "Targets"
    target "fluid, 18475 particles, h = 0.04: steps/s" steps_per_s 20000 "${measured[graph-fluid-18475]-}"
    target "solid, 18475 particles: steps/s" steps_per_s 50000 "${measured[graph-solid-18475]-}" "${measured[persistent-solid-18475]-}"
    target "solid, 18475 particles, true density: RTF" rtf 1 "${measured[graph-solid-18475]-}" "${measured[persistent-solid-18475]-}"
    target "fluid, 10 million particles: particle-steps/s" particle_steps_per_s 1e9 "${measured[graph-fluid-10000000]-}"
fi

((there)) && tell "" "clock of the multiprocessors, MHz, least and most seen: $(sort -n "$clocks" | sed -n '1p;$p' | paste -sd ' ')"
tell "" "$((SECONDS - began)) s in all; $failures failed; rows in $csv"
((there)) || tell "no CUDA device answered: nothing was measured on a GPU"
((failures == 0)) || exit 1
((there)) || exit 77

# Shared by scripts/demo and scripts/test: packages, the ROS environment, builds. Source it with bash.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build
jobs=$(nproc)

say() { printf '== %s\n' "$*"; }
die() {
    printf '%s: %s\n' "$(basename "$0")" "$*" >&2
    exit 1
}

# ROS: Debian's own packages in /usr, or a sourced Noetic under /opt/ros ------------------------------------

using_opt_ros() { [[ -n ${ROS_DISTRO:-} && -f /opt/ros/$ROS_DISTRO/setup.bash ]]; }

# Packages by purpose, as Debian 12 names them.
packages_build="build-essential cmake pkg-config libassimp-dev libyaml-dev catkin ros-message-generation
    libroscpp-dev libstd-msgs-dev libsensor-msgs-dev libgeometry-msgs-dev libvisualization-msgs-dev
    libstd-srvs-dev libdiagnostic-msgs-dev libdiagnostic-updater-dev ros-std-msgs ros-geometry-msgs
    libtf2-dev libtf2-ros-dev libros-rosgraph-msgs-dev liburdf-dev"
packages_run="python3-roslaunch rosout rosbash python3-rostopic python3-rosnode python3-rosservice
    python3-rosparam python3-rosmsg rospack-tools python3-rospy python3-geometry-msgs python3-std-msgs
    python3-std-srvs python3-rosbag ros-robot-state-publisher"
packages_view="rviz"
packages_screenshot="rviz xvfb xauth libgl1-mesa-dri imagemagick"
# validation/run needs no ROS: the library, and what judges it.
packages_core="build-essential cmake pkg-config git"
packages_validation="python3-numpy python3-scipy python3-matplotlib python3-dolfinx gmsh python3-gmsh
    python3-petsc4py libopenblas0-serial"
packages_test="libgtest-dev librostest-dev python3-rostest python3-rosunit python3-sensor-msgs
    python3-visualization-msgs python3-diagnostic-msgs python3-tf2-msgs catkin-lint catkin-tools
    clang-format ccache git"

if using_opt_ros; then
    p=ros-$ROS_DISTRO
    packages_build="build-essential cmake pkg-config libassimp-dev libyaml-dev $p-catkin $p-message-generation
        $p-roscpp $p-std-msgs $p-sensor-msgs $p-geometry-msgs $p-visualization-msgs $p-std-srvs
        $p-diagnostic-msgs $p-diagnostic-updater $p-message-runtime $p-tf2 $p-tf2-ros
        $p-rosgraph-msgs $p-urdf"
    packages_run="$p-roslaunch $p-rosout $p-rosbash $p-rostopic $p-rosnode $p-rosservice $p-rosparam $p-rosmsg
        $p-rospy $p-rosbag $p-robot-state-publisher"
    packages_view="$p-rviz"
    packages_screenshot="$p-rviz xvfb xauth libgl1-mesa-dri imagemagick"
    packages_test="libgtest-dev $p-rostest $p-rosunit $p-tf2-msgs ccache git"
fi

as_root() {
    if (($(id -u) == 0)); then
        "$@"
    else
        command -v sudo >/dev/null || die "neither root nor sudo to run: $*"
        sudo "$@"
    fi
}

installed() { [[ $(dpkg-query -W -f='${db:Status-Abbrev}' "$1" 2>/dev/null) == ii* ]]; }

# Installs what is missing of the given packages; asks apt nothing when nothing is.
install_packages() {
    command -v apt-get >/dev/null || die "no apt-get: install by hand: $*"
    local missing=()
    for package in "$@"; do installed "$package" || missing+=("$package"); done
    if ((${#missing[@]} == 0)); then
        say "packages: all $# are installed"
        return
    fi
    say "packages: installing ${missing[*]}"
    as_root apt-get update -q || die "apt-get update failed"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends \
        "${missing[@]}" || die "apt-get could not install: ${missing[*]}"
}

# A python3 without the ROS modules (pyenv, conda) in front of the system's would be taken by catkin and by
# every script with "env python3", so the system's comes first.
ros_environment() {
    if using_opt_ros; then
        say "ROS: $ROS_DISTRO from /opt/ros"
    else
        export PATH=/usr/bin:$PATH
        say "ROS: the system's packages in /usr"
    fi
    export ROS_HOSTNAME=localhost
    unset ROS_IP
    # roslaunch and rostest look localhost up; a root straight from debootstrap has no /etc/hosts.
    if ! getent hosts localhost >/dev/null; then
        say "localhost has no address: adding it to /etc/hosts"
        echo "127.0.0.1 localhost" | as_root tee -a /etc/hosts >/dev/null
    fi
}

# configure FOLDER OPTION...: configures only when FOLDER is new or the options changed, so that a second run
# is quick.
configure() {
    local folder=$1
    shift
    if [[ ! -f $folder/CMakeCache.txt || $(cat "$folder/.options" 2>/dev/null) != "$*" ]]; then
        mkdir -p "$folder"
        cmake -S "$root" -B "$folder" "$@" && printf '%s' "$*" >"$folder/.options"
    fi
}

# The folder scripts/demo runs from and the rostests are run in.
ros_options=(-DSPH_MUSCLE_ROS=ON -DSPH_MUSCLE_TESTS=OFF -DCMAKE_BUILD_TYPE=RelWithDebInfo)
build_ros() { configure "$build/ros" "${ros_options[@]}" && cmake --build "$build/ros" -j "$jobs"; }

source_devel() {
    # The generated scripts use unset variables.
    set +u
    source "$build/ros/devel/setup.bash"
    set -u
}

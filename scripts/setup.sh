#!/usr/bin/env bash
# Installs what is missing, makes the Python environment, builds the workspace. Safe to call again and again:
# with everything in place it takes a moment. Needs the network only for what is missing.
set -Eeuo pipefail
trap 'echo "setup.sh: stopped at line $LINENO" >&2' ERR

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
workspace="$root/build/catkin_ws"
venv="$root/.venv"
system_python=/usr/bin/python3
name=wheelchair_shared_control

say() { echo "setup.sh: $*"; }
fail() { echo "setup.sh: $*" >&2; exit 1; }

case "${1:-}" in
  "") ;;
  -h | --help)
    echo "usage: scripts/setup.sh"
    echo "Installs system packages (apt, as root or by sudo), makes .venv from /usr/bin/python3 with the"
    echo "requirements, and builds the catkin workspace build/catkin_ws. Does nothing where nothing is missing."
    exit 0 ;;
  *) fail "unknown argument '$1' (see --help)" ;;
esac

# catkin writes programs whose first line is the path of .venv's Python.
case "$root" in *[[:space:]]*) fail "catkin does not work in a path with blanks: move '$root' elsewhere" ;; esac

# ---- system packages ------------------------------------------------------------------------------------

# Compiler and headers: catkin's CMake projects ask for a compiler, PyPI packages without a wheel need both.
# libusb, libgl, libegl, libgomp: open3d loads them. xvfb and Mesa: rviz without a screen.
packages=(build-essential ca-certificates cmake git python3 python3-dev python3-setuptools python3-venv
  libegl1 libgl1 libgl1-mesa-dri libgomp1 libusb-1.0-0 xauth xvfb)
if [ -d /opt/ros/noetic ]; then
  packages+=(ros-noetic-{actionlib,actionlib-msgs,catkin,diagnostic-msgs,geometry-msgs,joy,map-msgs,message-generation}
    ros-noetic-{message-runtime,move-base-msgs,nav-msgs,robot-state-publisher,rosbag,rosbash,rosgraph-msgs}
    ros-noetic-{roslaunch,rosmsg,rosnode,rosparam,rospy,rosservice,rostest,rostopic,rviz,sensor-msgs}
    ros-noetic-{std-msgs,std-srvs,tf2-ros,visualization-msgs})
else
  # Debian's own packages of ROS 1.
  packages+=(catkin librostest-dev rosbash rviz
    ros-{geometry-msgs,map-msgs,message-generation,message-runtime,move-base-msgs,nav-msgs}
    ros-{robot-state-publisher,sensor-msgs,std-msgs}
    python3-{actionlib,actionlib-msgs,diagnostic-msgs,geometry-msgs,map-msgs,move-base-msgs,nav-msgs}
    python3-{sensor-msgs,std-srvs}
    python3-{rosbag,roscpp-msg,rosgraph,rosgraph-msgs,roslaunch,roslib,rosmaster,rosmsg,rosnode,rosparam}
    python3-{rospy,rosservice,rostest,rostopic,tf2-ros,visualization-msgs})
fi

as_root() {
  if [ "$(id -u)" = 0 ]; then
    "$@"
  elif command -v sudo >/dev/null; then
    sudo "$@"
  else
    fail "not root, and no sudo: as root, run: apt-get install ${missing[*]}"
  fi
}

install_system_packages() {
  command -v dpkg-query >/dev/null || fail "needs Debian 12, or Ubuntu 20.04 with ROS Noetic (no dpkg here)"
  local installed package
  installed=" $(dpkg-query -W -f '${db:Status-Abbrev}${Package} ' | grep -o 'ii [^ ]*' | cut -c4- | tr '\n' ' ')"
  missing=()
  for package in "${packages[@]}"; do
    [[ "$installed" == *" $package "* ]] || missing+=("$package")
  done
  if [ ${#missing[@]} -eq 0 ]; then return; fi
  say "installing ${missing[*]}"
  local apt=(env DEBIAN_FRONTEND=noninteractive apt-get -y -q --no-install-recommends)
  # The lists of a fresh machine are empty or old: fetch them where they do not know what is missing, and where
  # what they name is no longer there.
  apt-get -s install "${missing[@]}" >/dev/null 2>&1 || as_root "${apt[@]}" update
  as_root "${apt[@]}" install "${missing[@]}" && return
  as_root "${apt[@]}" update
  as_root "${apt[@]}" install "${missing[@]}" \
    || fail "apt-get could not install: ${missing[*]} (needs Debian 12, or Ubuntu 20.04 with /opt/ros/noetic)"
}

# ---- Python environment -----------------------------------------------------------------------------------

install_python_packages() {
  # What is installed, and where: programs in .venv/bin carry its path, so a moved checkout needs a new one.
  local stamp="$venv/requirements.installed" wanted
  wanted="$(echo "$venv"; cat "$root"/requirements*.txt)"
  if ! "$venv/bin/python" -c '' 2>/dev/null || { [ -f "$stamp" ] && [ "$(head -n 1 "$stamp")" != "$venv" ]; }; then
    say "making .venv from $system_python"
    rm -rf "$venv"
    "$system_python" -m venv --system-site-packages "$venv"
    # A pip older than 20.3 (Ubuntu 20.04) does not know the wheels that open3d comes in.
    "$venv/bin/python" -m pip install -q --disable-pip-version-check --upgrade "pip>=20.3"
  fi
  if [ ! -f "$stamp" ] || [ "$(cat "$stamp")" != "$wanted" ]; then
    say "installing Python packages (some minutes the first time)"
    "$venv/bin/python" -m pip install -q --disable-pip-version-check \
      -r "$root/requirements.txt" -r "$root/requirements-test.txt"
    echo "$wanted" > "$stamp"
  fi
}

# ---- catkin workspace -------------------------------------------------------------------------------------

# What the build depends on: where it is, with which Python, the interfaces, and which programs there are
# (their contents are read through links, not copied).
fingerprint() {
  {
    echo "$root" "$(readlink -f "$system_python")"
    cd "$root"
    cat CMakeLists.txt package.xml setup.py msg/* srv/*
    ls --ignore=build --ignore=output
    { find msg srv nodes scripts test/rostest -maxdepth 1 -type f 2>/dev/null || true; } | sort
  } | cksum
}

build() {
  local stamp="$workspace/built" now
  now="$(fingerprint)"
  [ -f "$stamp" ] && [ -f "$workspace/devel/setup.bash" ] && [ "$(cat "$stamp")" = "$now" ] && return
  say "building the catkin workspace"
  # A moved checkout leaves absolute paths behind.
  if [ -f "$workspace/build/CMakeCache.txt" ] \
    && ! grep -q "^CMAKE_HOME_DIRECTORY:INTERNAL=$workspace/src\$" "$workspace/build/CMakeCache.txt"; then
    rm -rf "$workspace/build" "$workspace/devel"
  fi
  # The package in our workspace is a folder of links to the checkout's entries: were it the checkout itself,
  # rosrun would find every program a second time, in build/. In a user's own workspace, where the package is the
  # checkout, rosrun leaves build/ out by itself.
  local package="$workspace/src/$name" entry
  rm -rf "$package"
  mkdir -p "$package"
  for entry in "$root"/*; do
    case "${entry##*/}" in
      build | output) ;;
      *) ln -s "../../../../${entry##*/}" "$package/" ;;
    esac
  done
  # A foreign workspace that happens to be sourced would be baked into ours.
  local clean=(env -u CMAKE_PREFIX_PATH -u ROS_PACKAGE_PATH -u PYTHONPATH -u PKG_CONFIG_PATH -u LD_LIBRARY_PATH
    PATH="$venv/bin:/usr/local/bin:/usr/bin:/bin")
  local log="$workspace/build.log"
  # shellcheck disable=SC2016
  if ! "${clean[@]}" bash -c '
      if [ -f /opt/ros/noetic/setup.bash ]; then . /opt/ros/noetic/setup.bash; PATH="$2/bin:$PATH"; fi
      catkin_make -C "$1" -DPYTHON_EXECUTABLE="$2/bin/python" -DCMAKE_BUILD_TYPE=Release
    ' build "$workspace" "$venv" >"$log" 2>&1; then
    tail -n 30 "$log" >&2
    fail "catkin_make failed: $log"
  fi
  echo "$now" > "$stamp"
}

# ---- hot loops --------------------------------------------------------------------------------------------

# Numba compiles them at their first call and keeps the result beside the source. One episode calls them all, so
# that the first demonstration does not drive while it compiles. Numba sees when a function's own file has changed, but
# not a file of what it calls: after any change all are compiled anew.
compile_hot_loops() {
  local stamp="$venv/compiled" now
  now="$(find "$root/src" -name '*.py' -type f -print0 | sort -z | xargs -0 cat | cksum)"
  if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$now" ]; then return; fi
  say "compiling the hot loops (a minute or two, after a change of the source)"
  find "$root/src" \( -name '*.nbi' -o -name '*.nbc' \) -delete
  PYTHONPATH="$root/src" "$venv/bin/python" "$root/scripts/evaluate" --seed 1 >/dev/null \
    || fail "the first episode failed: see the line above"
  echo "$now" > "$stamp"
}

install_system_packages
# Two calls at once (a demonstration beside the tests) wait for each other.
mkdir -p "$workspace"
exec 9>"$workspace/lock"
flock 9
install_python_packages
build
compile_hot_loops

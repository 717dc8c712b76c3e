# shellcheck shell=bash
# Source this from bash: it puts the project's Python, ROS 2 and the built workspace into the shell.
#   . setup/environment.sh

_paint_root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)

if [ -z "${ROS_DISTRO:-}" ] && [ -f "$_paint_root/.venv/.ros_source" ]; then
    echo "This was built with ROS $(cat "$_paint_root/.venv/.ros_source"): source its setup.bash first." >&2
    unset _paint_root
    return 1
fi

# VAR FOLDER: puts the folder first in the list, once.
_paint_prepend() {
    case ":${!1:-}:" in
        *":$2:"*) ;;
        *) export "$1=$2${!1:+:${!1}}" ;;
    esac
}

export VIRTUAL_ENV=$_paint_root/.venv
export ROS_AUTOMATIC_DISCOVERY_RANGE=${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}

# Set-up files of ROS read variables that may not be set.
_paint_nounset=$(case $- in *u*) echo yes ;; esac)
set +u

if [ -z "$ROS_DISTRO" ]; then
    # The environment itself is the ROS prefix. Its wheels start every Python twice to find their
    # libraries; with the path and their guard set here, they need not.
    _paint_prepend AMENT_PREFIX_PATH "$VIRTUAL_ENV"
    _paint_prepend CMAKE_PREFIX_PATH "$VIRTUAL_ENV"
    for _paint_folder in "$VIRTUAL_ENV"/lib/python3.*/site-packages/ros_*.libs "$VIRTUAL_ENV/lib"; do
        if [ -d "$_paint_folder" ]; then
            _paint_prepend LD_LIBRARY_PATH "$_paint_folder"
        fi
    done
    export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
fi
_paint_prepend PATH "$VIRTUAL_ENV/bin"

if [ -z "$PAINT_UNDERLAY_ONLY" ] && [ -f "$_paint_root/ros2_ws/install/local_setup.bash" ]; then
    . "$_paint_root/ros2_ws/install/local_setup.bash"
    _paint_prepend PATH "$_paint_root/ros2_ws/install/lib/paint_deposition"
fi

[ -z "$_paint_nounset" ] || set -u
unset -f _paint_prepend
unset _paint_root _paint_folder _paint_nounset

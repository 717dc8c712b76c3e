# shellcheck shell=bash
# Where things are and how the set-up speaks; sourced by the scripts beside it.

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)
venv=$root/.venv
workspace=$root/ros2_ws
log=$root/.setup/setup.log

say() {
    printf '%s\n' "$*"
}

fail() {
    printf '%s\n' "$@" >&2
    exit 1
}

# still_at WORK STARTED: a line every 10 s with the time and how much is compiled, while this shell runs.
still_at() {
    while sleep 10 >/dev/null && kill -0 $$ 2>/dev/null; do
        say "  $1: $((SECONDS - $2)) s" \
            "$(sed -n '/^== /h; /^\[ *[0-9]*%\]/h; ${x; s/^\(\[.*%\]\).*/\1/p}' "$log")"
    done
}

# logged WHAT COMMAND...: runs the command into the log; when it fails, shows the end and names the log.
logged() {
    local what=$1 started=$SECONDS status=0
    shift
    say "$what ..."
    printf '\n== %s: %s\n' "$what" "$*" >>"$log"
    still_at "${what%%[ ,]*}" "$started" &
    "$@" >>"$log" 2>&1 </dev/null || status=$?
    kill %% 2>/dev/null || true
    wait %% 2>/dev/null || true
    if ((status)); then
        tail -n 15 "$log" >&2
        fail "'$what' failed after $((SECONDS - started)) s. The whole log: $log"
    fi
}

# through_shell SCRIPT...: has Python scripts started by the shell. The kernel takes the first line of
# a script apart at spaces, so that it cannot name an interpreter whose path has some. To Python the
# lines for the shell are a text.
through_shell() {
    sed -i "1c\\
#!/bin/sh\\
'''exec' \"$venv/bin/python\" \"\$0\" \"\$@\"\\
' '''" "$@"
}

# Where ROS 2 comes from: the distribution that is sourced, else the one this environment was made
# with, else 'wheels'.
ros_source() {
    local made_with=wheels
    [[ ! -f $venv/.ros_source ]] || made_with=$(<"$venv/.ros_source")
    printf '%s\n' "${ROS_DISTRO:-$made_with}"
}

# What the Python environment is made from.
environment_fingerprint() {
    {
        printf '%s\n' "$root" "$(ros_source)"
        cat "$root"/requirements/*.txt "$root"/setup/{python_environment.sh,repair_cmake_exports.py}
    } | sha256sum
}

# What compiled messages depend on besides their own sources: code generated from a message that is
# gone would stay, so the names of all messages count.
toolchain_fingerprint() {
    {
        printf '%s\n' "$root" "$(ros_source)"
        (cd "$workspace/src/paint_msgs" && find . -type f | sort)
        grep '^version' "$venv/pyvenv.cfg"
        cat "$root/requirements/ros.txt" "$root/setup/workspace.sh"
    } | sha256sum
}

# sources_fingerprint linked|copied: the sources as far as an install does not follow them by
# itself. One made of links follows what is inside Python modules and shared files.
sources_fingerprint() {
    local package=$workspace/src/paint_deposition
    {
        find "$workspace/src/paint_msgs" "$package"/{setup.py,setup.cfg,pyproject.toml,package.xml,resource} \
            -type f -print0 | sort -z | xargs -0 sha256sum
        find "$package" \( -path '*/launch/*' -o -path '*/config/*' -o -path '*/samples/*' \) \
            -type f -not -path '*/__pycache__/*' | sort
        if [[ $1 == copied ]]; then
            find "$package" -type f -not -path '*/__pycache__/*' -print0 \
                | sort -z | xargs -0 sha256sum
        fi
    } | sha256sum
}

install_kind() {
    if [[ -L $workspace/build/paint_deposition/paint_deposition ]]; then
        echo linked
    else
        echo copied
    fi
}

# The fingerprint files are removed before anything is changed and written when all is done:
# what was interrupted has none, and is made from nothing.
environment_is_current() {
    [[ -x $venv/bin/python && -f $venv/.fingerprint ]] \
        && [[ $(<"$venv/.fingerprint") == "$(environment_fingerprint)" ]]
}

workspace_is_current() {
    [[ -f $workspace/install/.fingerprint ]] \
        && [[ $(<"$workspace/install/.fingerprint") == \
            "$(toolchain_fingerprint; sources_fingerprint "$(install_kind)")" ]]
}

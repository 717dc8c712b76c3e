#!/usr/bin/env bash
# Builds the workspace with colcon into ros2_ws/install. Called by build.sh.
# Python modules and shared files are linked, not copied: edits to them need no build.
set -euo pipefail
source "$(dirname -- "${BASH_SOURCE[0]}")/project.sh"
trap 'exit 130' INT TERM

build=$workspace/build
install=$workspace/install

toolchain=$(toolchain_fingerprint)
if [[ ! -f $install/.fingerprint || $(head -n 1 "$install/.fingerprint") != "$toolchain" ]]; then
    rm -rf "$build" "$install"
fi
rm -f "$install/.fingerprint"

# Taken before the build: a file edited meanwhile shows up as a change afterwards.
linked=$(sources_fingerprint linked)
copied=$(sources_fingerprint copied)

PAINT_UNDERLAY_ONLY=1 source "$root/setup/environment.sh"
logged 'Compiling the ROS messages in C and C++, which takes longest, and linking nodes and command line' \
    python -c 'from colcon_core.command import main; raise SystemExit(main())' \
    --log-base "$workspace/log" build \
    --base-paths "$workspace/src" --build-base "$build" --install-base "$install" \
    --merge-install --symlink-install --event-handlers console_direct+ \
    --cmake-args -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=OFF

if [[ $venv == *[[:space:]]* ]]; then
    through_shell "$install"/lib/paint_deposition/*
    # colcon's own scripts call their interpreter without quotes.
    sed -i 's/(\$_colcon_python_executable /("$_colcon_python_executable" /' \
        "$install"/local_setup.{sh,bash}
fi

sources=$linked
[[ $(install_kind) == linked ]] || sources=$copied
printf '%s\n' "$toolchain" "$sources" >"$install/.fingerprint"

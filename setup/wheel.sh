#!/usr/bin/env bash
# Build the wheel with compiled code in it, into dist/: for one Python, by default that of .venv, and
# for both kinds of processor that kernel/compiler.py names, where this machine has AVX-512 (else for
# x86-64-v3). What is missing compiles on first use.
#   setup/wheel.sh [PYTHON]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
uv=${UV:-$PWD/.venv/bin/uv}
executable=$("${1:-.venv/bin/python}" -c 'import sys; print(sys.executable)')
tag=$("$executable" -c 'import sys; print("cp%d%d" % sys.version_info[:2])')
dist=$PWD/dist
unset PYTHONPATH NUMBA_CACHE_DIR NUMBA_CPU_NAME

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp -r ros2_ws/src/paint_deposition "$work/source"
rm -rf "$work"/source/{build,*.egg-info}
"$uv" build --quiet --wheel --out-dir "$work" "$work/source"
for place in build new; do
    "$uv" venv --quiet --python "$executable" "$work/$place"
done
"$uv" pip install --quiet --python "$work/build/bin/python" --constraint requirements/core.txt \
    "$work"/*.whl wheel
cd "$work"

# What the first commands of a new user compile stays beside the modules.
kinds=$(build/bin/python -c 'from paint_deposition.kernel.compiler import kinds_at_hand as k; print(*k())')
for kind in $kinds; do
    NUMBA_CPU_NAME=$kind build/bin/paint doctor
    NUMBA_CPU_NAME=$kind build/bin/paint demo -o "demo-$kind"
done
build/bin/wheel unpack --dest unpacked ./*.whl
unpacked=$(echo "$work"/unpacked/*)
(cd build/lib/python*/site-packages && find paint_deposition -name '*.nb[ic]' -exec cp --parents '{}' "$unpacked" \;)
build/bin/wheel pack --dest-dir . "$unpacked"
wheel=$(build/bin/wheel tags --remove --python-tag "$tag" --abi-tag none \
    --platform-tag manylinux_2_28_x86_64 ./*.whl)

# Elsewhere, with the newest libraries, nothing may be left to compile.
"$uv" pip install --quiet --python new/bin/python "./$wheel"
brought() { find new/lib -path '*/paint_deposition/*.nb[ic]' -exec sha256sum '{}' + | sort; }
brought > brought
samples=new/share/paint_deposition/samples
for kind in $kinds; do
    NUMBA_CPU_NAME=$kind new/bin/paint simulate --mesh $samples/door.stl --trajectory $samples/door_vertical -o "film-$kind"
done
brought | diff brought - || { echo 'compiled again, though the wheel brings it: see above' >&2; exit 1; }

mkdir -p "$dist"
mv "$wheel" "$dist/"
echo "Built: dist/$wheel"

#!/usr/bin/env bash
# Bundle the libraries of the live page, at the versions of page_libraries/package-lock.json, into
# files of the package, with their licences. Needs Node; run it after a change of versions only.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/page_libraries"
static=../../ros2_ws/src/paint_deposition/paint_deposition/report/static

npm ci --ignore-scripts --no-audit --no-fund
npx esbuild libraries.js --bundle --minify --format=esm --outfile="$static/libraries.js"
cp node_modules/uplot/dist/uPlot.min.css "$static/uplot.css"
for library in three three-mesh-bvh uplot; do
    version=$(node -p "require('./node_modules/$library/package.json').version")
    printf '%s %s\n\n' "$library" "$version"
    cat "node_modules/$library/LICENSE"
    echo
done > "$static/LICENCES.txt"
rm -r node_modules

#!/usr/bin/env bash
# Measures again what the papers measured and writes docs/results: pages, charts and data.
#   scripts/results.sh             about 20 minutes on 2 cores, with smaller maps, frames and ray counts
#   scripts/results.sh --quick     under 3 minutes, into out/results-quick
#   scripts/results.sh --full      everything at full size
#   scripts/results.sh --only rmip-table-1,kolb-tables
# KNURL names a program to use instead of building one.
. "$(dirname "$0")/common.sh"
if [ -z "${KNURL:-}" ]; then
    build_tree build -DCMAKE_BUILD_TYPE=Release -DKNURL_TESTS=OFF
    KNURL=$root/build/bin/knurl
fi
PYTHONDONTWRITEBYTECODE=1 exec /usr/bin/python3 scripts/results/main.py --knurl="$KNURL" "$@"

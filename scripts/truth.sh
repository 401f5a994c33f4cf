#!/usr/bin/env bash
# The truth tests at full size: every exact method against the slow oracle on all rays. Takes long.
. "$(dirname "$0")/common.sh"
scripts/setup.sh
build_tree build -DCMAKE_BUILD_TYPE=Release -DKNURL_TESTS=ON
KNURL_TRUTH_SCALE=${KNURL_TRUTH_SCALE:-1} exec ctest --test-dir build --verbose --no-tests=error --timeout 36000 \
    -L truth "$@"

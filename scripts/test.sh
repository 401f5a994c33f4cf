#!/usr/bin/env bash
# Builds knurl in build/ and runs every test. Arguments go to ctest, for example: scripts/test.sh -R cli
# KNURL_TRUTH_SCALE is the part of the full ray counts that the truth tests trace (default 0.02);
# KNURL_CMAKE_OPTIONS are added to the build's options.
. "$(dirname "$0")/common.sh"
scripts/setup.sh
# shellcheck disable=SC2086 # the options are words
build_tree build -DCMAKE_BUILD_TYPE=Release -DKNURL_TESTS=ON ${KNURL_CMAKE_OPTIONS:-}
exec ctest --test-dir build --output-on-failure --no-tests=error -j "$jobs" "$@"

#!/usr/bin/env bash
# fuzz.sh [SECONDS]: builds the fuzz targets with clang, address and undefined-behaviour sanitizers, and
# runs each for SECONDS (default 60). Crashing inputs are left in build-fuzz/crashes.
. "$(dirname "$0")/common.sh"
seconds=${1:-60}
[[ $seconds =~ ^[0-9]+$ ]] || { echo "usage: scripts/fuzz.sh [SECONDS]" >&2; exit 2; }
scripts/setup.sh
build_tree build-fuzz -DCMAKE_BUILD_TYPE=Release -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ \
    -DKNURL_FUZZ=ON -DKNURL_TESTS=ON -DKNURL_SANITIZE=address,undefined

python3 scripts/fuzz_seeds.py build-fuzz/seeds
mkdir -p build-fuzz/crashes
found=0
for source in tests/fuzz/fuzz_*.c; do
    [ -e "$source" ] || { echo "fuzz: no targets in tests/fuzz" >&2; exit 1; }
    name=$(basename "$source" .c)
    # New inputs are kept from run to run in the first folder; the others are only read.
    corpus=build-fuzz/corpus/$name
    mkdir -p "$corpus"
    kind=${name#fuzz_}
    seeds=(build-fuzz/seeds)
    for folder in "tests/fuzz/seeds/$kind" tests/crashers/*/; do [ ! -d "$folder" ] || seeds+=("$folder"); done
    log=build-fuzz/$name.log
    if ! timeout $((seconds * 4 + 120)) "build-fuzz/bin/$name" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 \
        -max_len=65536 -close_fd_mask=1 -print_final_stats=1 -artifact_prefix="build-fuzz/crashes/$name-" \
        "$corpus" "${seeds[@]}" >"$log" 2>&1; then
        tail -n 60 "$log"
        echo "$name: failed" >&2
        found=1
        continue
    fi
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    [ "${runs:-0}" -gt 0 ] || { tail -n 20 "$log"; echo "$name: ran nothing" >&2; found=1; continue; }
    echo "$name: $runs inputs, no failure"
done
exit $found

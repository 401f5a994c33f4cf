# shellcheck shell=bash
# Sourced by the other scripts: strict mode, the repository's root, and one way to build.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
jobs=${KNURL_JOBS:-$(nproc)}

# build_tree FOLDER [cmake option...]: configures and builds; prints the log only when that fails.
build_tree() {
    local folder=$1
    shift
    local log
    log=$(mktemp)
    if cmake -S "$root" -B "$folder" -G Ninja "$@" >"$log" 2>&1 && ninja -C "$folder" -j "$jobs" >"$log" 2>&1; then
        rm -f "$log"
    else
        cat "$log" >&2
        rm -f "$log"
        echo "build of $folder failed" >&2
        return 1
    fi
}

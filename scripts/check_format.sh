#!/usr/bin/env bash
# Fails if a C or C++ file is not as clang-format writes it; --fix rewrites it.
. "$(dirname "$0")/common.sh"
mode=(--dry-run -Werror)
[ "${1:-}" != --fix ] || mode=(-i)
folders=()
for folder in include src apps bench tests; do [ ! -d "$folder" ] || folders+=("$folder"); done
find "${folders[@]}" -type f \( -name '*.c' -o -name '*.h' -o -name '*.cpp' \) -print0 |
    xargs -0 clang-format --style=file "${mode[@]}"
echo "format: good"

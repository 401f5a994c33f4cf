#!/usr/bin/env bash
# Installs the Debian 12 packages that knurl is built from. Quick and offline when they are there.
set -euo pipefail

packages=(
    build-essential cmake ninja-build pkg-config
    libembree-dev libpng-dev libjpeg62-turbo-dev libtiff-dev libopenexr-dev libstb-dev
    libassimp-dev libjansson-dev libcmocka-dev
    clang clang-format libclang-rt-14-dev
    python3 python3-numpy
)

missing=()
for package in "${packages[@]}"; do
    state=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
    [ "$state" = installed ] || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
    exit 0
fi

echo "setup: installing ${missing[*]}"
as_root=()
if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null; then
        echo "setup: these packages are missing, and installing them needs root or sudo: ${missing[*]}" >&2
        exit 1
    fi
    as_root=(sudo)
fi
install=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -y --no-install-recommends install "${missing[@]}")
# The package lists may be missing or old; fetch them only if that is so.
"${install[@]}" || { "${as_root[@]}" apt-get -qq update && "${install[@]}"; }

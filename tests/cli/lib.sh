# Sourced by the command-line tests, which get: program, scratch folder, source folder.
set -euo pipefail
[ $# -eq 3 ] || { echo "usage: $0 PROGRAM SCRATCH SOURCE" >&2; exit 2; }
knurl=$1
scratch=$2
source_folder=$3
python=/usr/bin/python3
rm -rf "$scratch"
mkdir -p "$scratch"
cd "$scratch"
export LC_ALL=C

fail() {
    echo "FAILED (line ${BASH_LINENO[1]:-?}): $*" >&2
    exit 1
}

# expect STATUS COMMAND...: runs it, output in stdout.txt and stderr.txt, checks the exit status.
expect() {
    local wanted=$1 found=0
    shift
    "$@" >stdout.txt 2>stderr.txt || found=$?
    if [ "$found" -ne "$wanted" ]; then
        head -c 4000 stdout.txt stderr.txt >&2
        fail "status $found, expected $wanted: $*"
    fi
}

# expect_text FILE TEXT: the file holds the text, literally.
expect_text() {
    grep -qF -- "$2" "$1" || { head -c 4000 "$1" >&2; fail "'$2' is not in $1"; }
}

# expect_error STATUS TEXT COMMAND...: fails with that status and says the text on standard error.
expect_error() {
    local wanted=$1 text=$2
    shift 2
    expect "$wanted" "$@"
    expect_text stderr.txt "$text"
}

# No file but the named ones (and the two logs) is in the scratch folder.
expect_only() {
    local found
    found=$(find . -maxdepth 1 -type f -printf '%f\n' | sort | grep -vxE 'stdout.txt|stderr.txt' | tr '\n' ' ')
    local wanted
    wanted=$(printf '%s\n' "$@" | sort | tr '\n' ' ')
    [ "$found" = "$wanted" ] || fail "files '$found', expected '$wanted'"
}

# A square of side 2 in y = 0, texture over all of it (v = 1 at z = 1, as OBJ counts it), its normal up.
write_plane() {
    cat >plane.obj <<'OBJ'
v -1 0 -1
v 1 0 -1
v 1 0 1
v -1 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 1 0
f 1/1/1 4/4/1 3/3/1
f 1/1/1 3/3/1 2/2/1
OBJ
}

# A 4 x 2 map: binary PGM, 8 bits.
write_map() {
    printf 'P5\n4 2\n255\n' >map.pgm
    printf '\000\100\200\300\040\140\240\377' >>map.pgm
}

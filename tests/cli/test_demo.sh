#!/usr/bin/env bash
# knurl demo: every scene is written, is sound glTF, is read by knurl, and is the same each time.
# Arguments: the program, a scratch folder, the source folder.
set -u
knurl=$1
scratch=$2
failures=0

fail() {
    echo "FAILED: $*" >&2
    failures=$((failures + 1))
}

# expect CODE WORDS... -- COMMAND...: the exit code, and each word on standard output or error.
expect() {
    local code=$1 words=() got output
    shift
    while [ "$1" != -- ]; do words+=("$1"); shift; done
    shift
    output=$("$@" 2>&1)
    got=$?
    [ "$got" -eq "$code" ] || fail "'$*' ended with $got, expected $code: $output"
    local word
    for word in "${words[@]}"; do
        case $output in *"$word"*) ;; *) fail "'$*' did not say '$word': $output" ;; esac
    done
}

rm -rf "$scratch"
mkdir -p "$scratch"
scenes=$("$knurl" demo list | awk '$2 == "all" {print $1}')
for wanted in gallery torus plane sphere box cobblestones basket spikes chainmail planet glass; do
    grep -qx "$wanted" <<<"$scenes" || fail "'demo list' does not name $wanted"
done

# Wrong usage.
expect 0 "NAME" "GROUP" "--size" "--map-size" "--seed" -- "$knurl" demo --help
expect 2 "no scene named" -- "$knurl" demo
expect 2 "spheer" "did you mean 'sphere'" "cobblestones" -- "$knurl" demo spheer "$scratch/x"
expect 2 "zzzzzzzz" "gallery" "glass" -- "$knurl" demo zzzzzzzz "$scratch/x"
expect 2 "no folder" -- "$knurl" demo torus
expect 2 "third argument" -- "$knurl" demo torus "$scratch/x" more
expect 2 "--size" "15" -- "$knurl" demo torus "$scratch/x" --size 15
expect 2 "--map-size" "15" -- "$knurl" demo rmip "$scratch/x" --map-size 15
expect 2 "did you mean 'rmip'" -- "$knurl" demo rmp "$scratch/x"
expect 2 "no folder" -- "$knurl" demo kolb
expect 2 "--seed" "-1" -- "$knurl" demo torus "$scratch/x" --seed=-1
[ ! -e "$scratch/x" ] || fail "a refused command left files behind"

# Everything, twice: the same bytes. Another seed: other maps.
expect 0 "gallery/gallery.gltf" "triangles" -- "$knurl" demo all "$scratch/a/deep" --size 64
output=$("$knurl" demo all "$scratch/b" --size 64 --quiet 2>&1) || fail "the second run failed"
[ -z "$output" ] || fail "--quiet printed: $output"
diff -r "$scratch/a/deep" "$scratch/b" >/dev/null || fail "two runs differ: $(diff -rq "$scratch/a/deep" "$scratch/b" | head -3)"
"$knurl" demo cobblestones "$scratch/c" --size 64 --seed 7 --quiet || fail "--seed 7 failed"
cmp -s "$scratch/b/cobblestones/cobbles-height.png" "$scratch/c/cobblestones/cobbles-height.png" &&
    fail "--seed did not change the map"

# The groups of bench scenes, with small maps: base triangles that are displaced, as in the papers' tables or
# as near as the mesh comes, and how many of them may fold: none with maps of 512 texels and more, but at 96
# scales and joints run together into larger steps.
bench_scenes="alien-sphere 900 0
wicker-basket 4800 0
creature 52488 3
diving-helmet 2484 0
medieval-helmet 2278 0
elven-armor 800 0
ninja-head 8712 0
terracotta-roof 128 0
desert-tire 8960 0
rough-glass 2220 0
asteroid 480 0
draped-mail 1426 0
leather-sphere 3968 0
orb 3968 0
tree-stump 7701 0
bamboo-dragon 22308 9
terrain-32 2 0
terrain-64 2 0
terrain-128 2 0
terrain-256 2 0
grid-32 2 0
grid-64 2 0
grid-128 2 0
grid-256 2 0
relief-simple 2 0
relief-spikes 2 0"
listed=$("$knurl" demo list | awk '$2 != "all" {print $1}')
[ "$listed" = "$(awk '{print $1}' <<<"$bench_scenes")" ] || fail "the bench scenes listed are: $listed"
for group in rmip pdm baboud kolb; do
    "$knurl" demo list | grep -q " $group " || fail "'demo list' does not name the group $group"
    "$knurl" demo "$group" "$scratch/b" --map-size 96 >>"$scratch/bench.txt" || fail "the group $group failed"
    "$knurl" demo "$group" "$scratch/b2" --map-size 96 --quiet || fail "the group $group failed again"
done
while read -r scene triangles folds; do
    grep -q "/$scene.gltf: .* triangles, $triangles of them displaced" "$scratch/bench.txt" ||
        fail "$scene has not $triangles displaced triangles: $(grep "/$scene.gltf" "$scratch/bench.txt")"
    diff -r "$scratch/b/$scene" "$scratch/b2/$scene" >/dev/null || fail "two runs of $scene differ"
    found=$("$knurl" info "$scratch/b/$scene/$scene.gltf" | sed -n 's/.*triangles folded \([0-9]*\).*/\1/p' |
        awk '{sum += $1} END {print sum + 0}')
    [ "$found" -le "$folds" ] || fail "$scene has $found folded triangles"
done <<<"$bench_scenes"
scenes="$scenes
$listed"
# --map-size reduces and never enlarges.
expect 0 "96 x 96" -- "$knurl" info "$scratch/b/terrain-256/terrain-height.png"
expect 0 "96 x 96" -- "$knurl" info "$scratch/b/creature/scales-height.png"
expect 0 "32 x 32" -- "$knurl" info "$scratch/b/terrain-32/terrain-height.png"

# Each document: accessors inside their views, true bounds, unit normals, outward winding, closed seams.
python=/usr/bin/python3
if "$python" -c 'import numpy' 2>/dev/null; then
    for scene in $scenes; do
        "$python" "$(dirname "$0")/check_gltf.py" "$scratch/b/$scene/$scene.gltf" || fail "$scene.gltf is not sound"
    done
    "$knurl" demo torus "$scratch/glb" --size 64 --glb --quiet || fail "--glb failed"
    "$python" "$(dirname "$0")/check_gltf.py" "$scratch/glb/torus/torus.glb" || fail "torus.glb is not sound"
    expect 0 -- "$knurl" info "$scratch/glb/torus/torus.glb"
else
    echo "note: no numpy for $python, documents are checked by knurl alone"
fi

# What was written, knurl reads.
for scene in $scenes; do
    expect 0 -- "$knurl" info "$scratch/b/$scene/$scene.gltf"
    for image in "$scratch/b/$scene"/*.png "$scratch/b/$scene"/*.exr; do
        expect 0 "x" -- "$knurl" info "$image"
    done
    ls "$scratch/b/$scene"/*.part "$scratch/b/$scene"/*.tmp >/dev/null 2>&1 && fail "$scene left temporary files"
done

# Places that cannot be written: the path and the reason, exit code 3.
touch "$scratch/file"
expect 3 "$scratch/file" "ot a directory" -- "$knurl" demo torus "$scratch/file" --size 16
mkdir -p "$scratch/taken/torus/torus.gltf"
expect 3 "torus.gltf" -- "$knurl" demo torus "$scratch/taken" --size 16
if [ "$(id -u)" -ne 0 ]; then
    mkdir "$scratch/locked"
    chmod 555 "$scratch/locked"
    expect 3 "$scratch/locked" "ermission denied" -- "$knurl" demo torus "$scratch/locked" --size 16
    chmod 755 "$scratch/locked"
fi

[ "$failures" -eq 0 ] || { echo "$failures failures" >&2; exit 1; }

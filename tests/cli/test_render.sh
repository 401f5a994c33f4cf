#!/usr/bin/env bash
# knurl render: formats, AOVs, statistics, crops, seeds, threads, progress, interruption.
. "$(dirname "$0")/lib.sh" "$@"
write_plane
write_map
small="--width 48 --height 32 --spp 2 --disp map.pgm --disp-factor 0.2"

# Every format, told by its first bytes; nothing else is left behind.
mkdir formats
for format in png jpg ppm exr hdr pfm tif; do
    expect 0 "$knurl" render plane.obj -o formats/a.$format $small -q
    [ ! -s stderr.txt ] || fail "--quiet is not quiet: $(cat stderr.txt)"
    [ ! -s stdout.txt ] || fail "render printed on standard output"
    expect 0 "$knurl" info --json formats/a.$format
    "$python" -c 'import json; i = json.load(open("stdout.txt")); assert (i["width"], i["height"]) == (48, 32), i'
done
[ "$(ls formats | wc -l)" -eq 7 ] || fail "files were left: $(ls formats)"

# AOVs: layers of an EXR, files of their own beside the rest.
expect 0 "$knurl" render plane.obj -o layers.exr $small --aov all
for channel in R G B A depth.Z albedo.R steps position.X; do
    grep -qa "${channel%%.*}" layers.exr || fail "no channel $channel in layers.exr"
done
mkdir aovs
expect 0 "$knurl" render plane.obj -o aovs/a.png $small --aov depth,uv
[ "$(ls aovs | tr '\n' ' ')" = "a.depth.exr a.png a.uv.exr " ] || fail "AOV files: $(ls aovs)"

# The same seed gives the same bits with any number of threads, another seed does not.
for threads in 1 2 5; do
    expect 0 "$knurl" render plane.obj -o threads$threads.exr $small --seed 7 --threads $threads -q
done
cmp threads1.exr threads2.exr
cmp threads1.exr threads5.exr
expect 0 "$knurl" render plane.obj -o seed.exr $small --seed 8 -q
! cmp -s threads1.exr seed.exr || fail "the seed changes nothing"

# Displacement from the command line is seen; that of the scene can be taken away.
expect 0 "$knurl" render plane.obj -o raised.exr $small --seed 7 --disp-factor 0.4 -q
! cmp -s threads1.exr raised.exr || fail "--disp-factor changes nothing"
printf 'newmtl m\ndisp -mm 0 0.2 map.pgm\n' >own.mtl
sed 's/^f/usemtl m\n&/; 1i mtllib own.mtl' plane.obj >own.obj
expect 0 "$knurl" info own.obj --json
"$python" -c 'import json; assert json.load(open("stdout.txt"))["objects"][0]["displaced"]'
expect 0 "$knurl" info own.obj --json --no-disp
"$python" -c 'import json; assert not json.load(open("stdout.txt"))["objects"][0]["displaced"]'
expect 0 "$knurl" render plane.obj -o primary.png $small --integrator primary -q
expect 0 "$knurl" render plane.obj -o ao.png $small --integrator ao -q
! cmp -s primary.png ao.png || fail "integrators are the same"
expect 0 "$knurl" render plane.obj -o dark.png $small --exposure -10 -q
expect 0 "$knurl" render plane.obj -o bright.png $small --exposure 4 -q
! cmp -s dark.png bright.png || fail "the exposure changes nothing"
expect 0 "$knurl" render plane.obj -o black.exr $small --background 0,0,0 -q
expect 0 "$knurl" render plane.obj -o lod.png $small --lod 1.5 -q
expect 0 "$knurl" render plane.obj -o auto.png $small --lod auto --clamp 2 --max-depth 3 -q
expect 0 "$knurl" render plane.obj -o env.exr $small --env bright.png --env-rotation 90 --env-intensity 2 -q
expect 0 "$knurl" render plane.obj -o crop.png $small --crop 8,4,16,12 -q

# Statistics
expect 0 "$knurl" render plane.obj -o stats.png $small --stats stats.json
"$python" - <<'PY'
import json
stats = json.load(open("stats.json"))
keys = ["knurl", "scene", "output", "method", "width", "height", "samples", "samples_done", "seed", "threads",
        "interrupted", "load_seconds", "build_seconds", "render_seconds", "rays", "rays_per_second", "steps_mean",
        "bytes"]
assert list(stats) == keys, list(stats)
assert stats["width"] == 48 and stats["height"] == 32 and stats["samples"] == 2 and stats["samples_done"] == 2
assert stats["rays"]["primary"] == 48 * 32 * 2, stats["rays"]
assert stats["interrupted"] is False and stats["method"] == "fast" and stats["bytes"]["maps"] > 0
PY
expect 0 "$knurl" render plane.obj -o stats.png $small --stats - -q
"$python" -m json.tool <stdout.txt >/dev/null

# Progress in a log: tenths with times.
expect 0 "$knurl" render plane.obj -o log.png --width 200 --height 200 --spp 64 --disp map.pgm --disp-factor 0.2
grep -qE '^render: [1-9]0%, elapsed [0-9]+:[0-9]{2}, left [0-9]+:[0-9]{2}$' stderr.txt || fail "no progress: $(cat stderr.txt)"

# Failures leave nothing and keep what was there.
echo old >kept.png
expect_error 3 "nothing.obj" "$knurl" render nothing.obj -o kept.png
expect_error 3 "nothing.png" "$knurl" render plane.obj -o kept.png --disp nothing.png
expect_error 3 "nothing.exr" "$knurl" render plane.obj -o kept.png --env nothing.exr $small
expect_error 3 "nowhere/a.png: cannot write there" "$knurl" render plane.obj -o nowhere/a.png
expect_error 4 "memory" "$knurl" render plane.obj -o kept.png $small --memory-limit 20K
[ "$(cat kept.png)" = old ] || fail "a failed run changed an old picture"
if find . -name '*.tmp' | grep .; then fail "temporary files were left"; fi
echo good

#!/usr/bin/env bash
# knurl info: images, maps and scenes, as text and as JSON with stable keys; files that are broken.
. "$(dirname "$0")/lib.sh" "$@"
write_plane
write_map

expect 0 "$knurl" info map.pgm
expect_text stdout.txt "map.pgm: 4 x 2, 1 channel, u8"
expect 0 "$knurl" info map.pgm --json --timing
"$python" - <<'PY'
import json
info = json.load(open("stdout.txt"))
assert list(info) == ["knurl", "kind", "path", "width", "height", "channels", "format", "bits", "channel_ranges",
                      "map", "timing"], list(info)
assert (info["kind"], info["width"], info["height"], info["bits"]) == ("image", 4, 2, 8)
assert info["channel_ranges"][0]["min"] == 0 and info["channel_ranges"][0]["max"] == 1
assert list(info["map"]) == ["levels", "range", "bytes", "build_ms", "tiled"]
assert list(info["map"]["bytes"]) == ["samples", "levels", "minmax", "rmip", "blocks", "total"]
assert info["map"]["levels"] == 3 and info["map"]["range"] == [0, 1]
assert info["map"]["bytes"]["rmip"] == 0 < info["map"]["bytes"]["blocks"], info["map"]["bytes"]
assert info["timing"]["copied_bytes"] == 8 and info["timing"]["bounds_ms"] >= 0
PY

# The structures are those of the method.
expect 0 "$knurl" info map.pgm
expect_text stdout.txt "tiles of samples"
expect 0 "$knurl" info map.pgm --method rmip
expect_text stdout.txt "RMIP table"
! grep -q "tiles of samples" stdout.txt || fail "rmip has tiles"

# Tiling multiplies the texels and the tessellation, and costs nothing.
"$python" -c '
import random
random.seed(1)
open("noise.pgm", "wb").write(b"P5\n300 200\n255\n" + bytes(random.randrange(256) for _ in range(60000)))'
expect 0 "$knurl" info noise.pgm --json
cp stdout.txt one.json
expect 0 "$knurl" info noise.pgm --json --tile 8x4
"$python" - <<'PY'
import json
one, tiled = json.load(open("one.json"))["map"], json.load(open("stdout.txt"))["map"]
assert tiled["bytes"] == one["bytes"] and tiled["tiled"]["map_bytes"] == one["tiled"]["map_bytes"]
assert abs(one["tiled"]["texels"] - 60000) < 1 and abs(tiled["tiled"]["texels"] - 32 * 60000) < 32
assert tiled["tiled"]["tessellated_bytes"] > 16 * one["tiled"]["tessellated_bytes"]
PY

# A map that is not finite is still an image.
"$python" -c '
import struct
open("nan.pfm", "wb").write(b"Pf\n2 1\n-1\n" + struct.pack("<2f", 1, float("nan")))'
expect 0 "$knurl" info nan.pfm
expect_text stdout.txt "not usable as a height map"
expect_text stdout.txt "1 not finite"

# Scenes
expect 0 "$knurl" info plane.obj --disp noise.pgm --disp-factor 0.1 --disp-offset -0.05
expect_text stdout.txt "2 triangles, displaced"
expect_text stdout.txt "tessellated at one vertex per texel"
expect 0 "$knurl" info plane.obj --disp noise.pgm --disp-factor 0.1 --disp-offset -0.05 --json --timing
"$python" - <<'PY'
import json
info = json.load(open("stdout.txt"))
assert list(info) == ["knurl", "kind", "path", "method", "lower", "upper", "instances", "materials", "objects",
                      "textures", "cameras", "lights", "warnings", "bytes", "tessellated_bytes", "timing"], list(info)
assert info["kind"] == "scene" and info["method"] == "fast" and info["instances"] == 1
box = info["objects"][0]
assert list(box) == ["name", "displaced", "triangles", "texels", "folded", "flat_uv", "degenerate",
                     "replaced_normals", "seam_edges", "height_min", "height_max", "lower", "upper",
                     "displacement", "bytes", "tessellated_bytes"], list(box)
assert box["displaced"] is True and box["triangles"] == 2 and box["folded"] == box["degenerate"] == 0
assert abs(box["texels"] - 60000) < 1 and box["seam_edges"] == 0
assert -0.0500001 <= box["height_min"] < -0.049 and 0.049 < box["height_max"] <= 0.0500001, box
assert info["lower"][0] <= -1 and info["upper"][0] >= 1 and info["upper"][1] >= 0.049
assert box["displacement"]["factor"] == 0.1 and box["displacement"]["offset"] == -0.05
assert info["textures"][0]["width"] == 300 and info["textures"][0]["bits"] == 8
assert info["bytes"]["total"] == sum(info["bytes"][k] for k in ["mesh", "shells", "maps", "bvh"])
assert info["tessellated_bytes"] > 20 * info["bytes"]["maps"]
PY

# A budget for the method's hierarchy.
shells() {
    expect 0 "$knurl" info plane.obj --disp noise.pgm --disp-factor 0.1 --json "$@"
    "$python" -c 'import json; i = json.load(open("stdout.txt")); print(i["method"], i["bytes"]["shells"])'
}
read -r _ usual < <(shells)
read -r method most < <(shells --accel-budget 64M)
[ "$method" = "fast:budget=64" ] || fail "method $method with a budget of 64M"
read -r method none < <(shells --accel-budget 0 --method fast)
[ "$method" = "fast:budget=0" ] || fail "method $method with a budget of 0"
read -r method some < <(shells --method fast --accel-budget 8K)
[ "$method" = "fast:budget=0.0078125" ] || fail "method $method with a budget of 8K"
[ "$none" -le "$some" ] && [ "$some" -lt "$usual" ] && [ "$usual" -le "$most" ] && [ "$none" -lt 4096 ] ||
    fail "bytes of shells: $none, $some, $usual, $most with budgets of 0, 8K, as usual and 64M"

expect 0 "$knurl" info plane.obj --json
"$python" -c 'import json; o = json.load(open("stdout.txt"))["objects"]; assert o == [{"name": o[0]["name"], "displaced": False, "triangles": 2}], o'

# Cameras, lights and textures of a glTF scene.
"$python" "$source_folder/scripts/fuzz_seeds.py" seeds
expect 0 "$knurl" info seeds/scene.glb --json -q
"$python" - <<'PY'
import json
info = json.load(open("stdout.txt"))
assert len(info["cameras"]) == len(info["lights"]) == len(info["textures"]) == 1, info
assert list(info["cameras"][0]) == ["name", "kind", "yfov_degrees", "lens_radius"], info["cameras"]
assert abs(info["cameras"][0]["yfov_degrees"] - 45.8366) < 1e-3 and info["cameras"][0]["kind"] == "perspective"
assert list(info["lights"][0]) == ["name", "kind", "intensity", "color"] and info["lights"][0]["kind"] == "spot"
assert info["textures"][0]["path"] is None and info["textures"][0]["width"] == 4
assert info["objects"][0]["displacement"]["uv_scale"] == [2, 3]
PY
expect 0 "$knurl" info seeds/scene.glb
expect_text stdout.txt "perspective"
expect_text stdout.txt "spot, intensity 5"

# Broken files: status 3 and the file's name, never a crash or a wait.
printf '\211PNG\r\n\032\nnot really' >broken.png
printf '\377\330\377\340 broken' >broken.jpg
printf 'v/1\001\002\000\000\000broken' >broken.exr
printf 'II*\000\377\377\377\377' >broken.tif
printf '#?RADIANCE\n\n-Y 99999999 +X 99999999\n' >broken.hdr
printf 'P5\n100000 100000\n255\n' >broken.pgm
printf '{"asset": {"version": "2.0"}, "meshes": [' >broken.gltf
printf 'glTF\002\000\000\000\377\377\377\177' >broken.glb
printf 'v 0 0 0\nf 1 2 3\n' >broken.obj
printf 'ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n' >broken.ply
: >empty.png
: >empty.gltf
: >empty.obj
for file in broken.* empty.*; do
    found=0
    timeout 60 "$knurl" info "$file" >stdout.txt 2>stderr.txt || found=$?
    case $found in
    3 | 4) expect_text stderr.txt "$file" ;;
    *) cat stdout.txt stderr.txt >&2; fail "status $found for $file, expected 3" ;;
    esac
    [ $found -eq 3 ] || [ "$file" = broken.pgm ] || [ "$file" = broken.hdr ] || fail "status $found for $file, expected 3"
done
for file in broken.png broken.exr empty.png; do
    expect_error 3 "$file" "$knurl" render plane.obj --disp $file -o a.png
    [ ! -e a.png ] || fail "a picture was made with $file"
done
expect_error 3 "nothing.gltf" "$knurl" info nothing.gltf
expect_error 3 "nothing.png" "$knurl" info nothing.png
echo good

#!/usr/bin/env bash
# knurl bake: each format is read back and traced; errors.
. "$(dirname "$0")/lib.sh" "$@"
write_plane
write_map

# Two instances of a displaced square, one mirrored, moved and stretched, and a plain triangle without normals.
"$python" - <<'PY'
import base64, json, struct
def data(values, code): return struct.pack("<%d%s" % (len(values), code), *values)
positions = data([-1, 0, -1, 1, 0, -1, 1, 0, 1, -1, 0, 1], "f")
normals = data([0, 1, 0] * 4, "f")
uv = data([0, 0, 1, 0, 1, 1, 0, 1], "f")
faces = data([0, 3, 2, 0, 2, 1], "I")
blob = positions + normals + uv + faces
views, at = [], 0
for part in (positions, normals, uv, faces):
    views.append({"buffer": 0, "byteOffset": at, "byteLength": len(part)})
    at += len(part)
scene = {
    "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
    "nodes": [{"mesh": 0, "name": "one"},
              {"mesh": 0, "name": "two words", "matrix": [-1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 0, 5, 1, 0, 1]},
              {"mesh": 1, "translation": [0, 0, 8]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0}]},
               {"primitives": [{"attributes": {"POSITION": 0}, "indices": 3, "material": 1}]}],
    "materials": [{"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0},
                   "extensions": {"KHR_materials_displacement": {"displacementGeometryTexture": {"index": 0}, "displacementGeometryFactor": 0.3}}},
                  {"name": "plain"}],
    "textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071, "wrapT": 33071}],
    "images": [{"uri": "map.png"}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, 0, -1], "max": [1, 0, 1]},
                  {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
                  {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
                  {"bufferView": 3, "componentType": 5125, "count": 6, "type": "SCALAR"}],
    "bufferViews": views,
    "buffers": [{"byteLength": len(blob), "uri": "data:application/octet-stream;base64," + base64.b64encode(blob).decode()}],
    "extensionsUsed": ["KHR_materials_displacement"],
}
json.dump(scene, open("scene.gltf", "w"))
# A smooth 16-bit map, as PNG.
import zlib, math
rows = b""
for y in range(32):
    rows += b"\0" + b"".join(struct.pack(">H", int(32767 * (1 + math.sin(0.19 * x) * math.cos(0.19 * y)))) for x in range(32))
def chunk(kind, body): return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
open("map.png", "wb").write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 32, 32, 16, 0, 0, 0, 0)) +
                            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
rays = ["ox,oy,oz,dx,dy,dz"]
for i in range(40):
    for j in range(40):
        x, z = -0.93 + 1.86 * i / 39, -1.05 + 1.9 * j / 39
        rays.append("%g,5,%g,0.01,-1,0.02" % (x, z))
        rays.append("%g,5,%g,0.01,-1,0.02" % (x + 5, z))
        rays.append("%g,5,%g,0.01,-1,0.02" % (x, z + 8))
open("rays.csv", "w").write("\n".join(rays) + "\n")
PY
expect 0 "$knurl" info scene.gltf
expect 0 "$knurl" trace scene.gltf --rays rays.csv --out exact.csv

for format in obj ply glb; do
    expect 0 "$knurl" bake scene.gltf -o baked.$format --rate 2
    expect_text stderr.txt "baked.$format: "
    expect 0 "$knurl" info --json baked.$format
    cp stdout.txt $format.json
    expect 0 "$knurl" trace baked.$format --rays rays.csv --out $format.csv
    expect 0 "$knurl" render baked.$format -o $format.png --width 32 --height 32 --spp 1 --integrator ao
    "$python" - $format <<'PY'
import csv, json, sys
name = sys.argv[1]
info = json.load(open(name + ".json"))
counts = [o["triangles"] for o in info["objects"]]
assert not any(o["displaced"] for o in info["objects"])
first = counts[0] - (2 if name == "ply" else 0)
if name == "ply": assert len(counts) == 1 and first % 2 == 0
if name == "obj": assert len(counts) == 3 and counts[0] == counts[1] and counts[2] == 2, counts
if name == "glb":
    assert len(counts) == 2 and counts[1] == 2 and info["instances"] == 3, info
    assert 2 * 60 * 60 < counts[0] < 2 * 70 * 70, counts
exact, found = ([dict(r) for r in csv.DictReader(open(f))] for f in ("exact.csv", name + ".csv"))
assert len(exact) == len(found) == 4800
worst = {"n": 0, "s": 0}
dt = []
for a, b in zip(exact, found):
    assert a["hit"] == b["hit"] == "1", (a, b)
    dt.append(abs(float(a["t"]) - float(b["t"])))
    # On mirrored instances a hit's normals follow the winding, a file's stay outside.
    worst["n"] = max(worst["n"], 1 - abs(sum(float(a[k]) * float(b[k]) for k in ("nsx", "nsy", "nsz"))))
    assert name == "glb" or (float(b["ngy"]) > 0 and float(b["nsy"]) > 0), b
    # Baked texture coordinates are the mesh's own, which here are the map's.
    if abs(float(a["pz"])) < 2:
        worst["s"] = max(worst["s"], abs(float(a["u"]) - float(b["u"])), abs(float(a["v"]) - float(b["v"])))
# The map's clamped border has creases, which facets cut.
dt.sort()
assert dt[-20] < 1e-3 and dt[-1] < 0.01 and dt[-20] > 0 and worst["n"] < 1e-3 and worst["s"] < 5e-3, (dt[-20:], worst)
PY
done

# Materials and instances in GLB.
"$python" - <<'PY'
import json, struct
b = open("baked.glb", "rb").read()
magic, version, total, size = struct.unpack("<IIII", b[:16])
assert magic == 0x46546c67 and version == 2 and total == len(b)
g = json.loads(b[20:20 + size])
assert [m["name"] for m in g["materials"]] == ["red", "plain"]
assert g["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] == [0.5, 0.25, 0.125, 1]
assert len(g["nodes"]) == 3 and len(g["meshes"]) == 2
a = g["accessors"][0]
assert a["min"][0] == -1 and a["max"][0] == 1 and 0.28 < a["max"][1] <= 0.3001, a
p = open("baked.ply", "rb").read()
head = p[:p.index(b"end_header\n") + 11]
v, f = (int(l.split()[2]) for l in head.decode().splitlines() if l.startswith("element"))
assert len(p) == len(head) + 32 * v + 13 * f
PY

# Rates, limits, displacement from the command line, standard output.
expect 0 "$knurl" bake plane.obj --disp map.pgm --disp-factor 0.1 --tile 8x8 --rate 0.25 -o - --format ply -q
cmp -s stdout.txt /dev/null && fail "nothing on standard output"
cp stdout.txt a.ply
expect 0 "$knurl" bake plane.obj --disp map.pgm --disp-factor 0.1 --tile 8x8 --rate 0.25 -o b.ply --threads 3 -q
cmp a.ply b.ply
expect 0 "$knurl" bake plane.obj --disp map.pgm --tile 100x200 --max-triangles 500 -o c.ply
expect_text stderr.txt "at the lowest"
expect 0 "$knurl" info --json c.ply
"$python" -c 'import json; n = json.load(open("stdout.txt"))["objects"][0]["triangles"]; assert 250 < n <= 500, n'

rm -f ./*.ply ./*.obj.bak
before=$(ls)
expect_error 2 "-o FILE is missing" "$knurl" bake plane.obj
expect_error 2 "the scene file is missing" "$knurl" bake -o x.ply
expect_error 2 "expected a name that ends in .obj, .ply or .glb" "$knurl" bake plane.obj -o x.stl
expect_error 2 "--rate" "$knurl" bake plane.obj -o x.ply --rate 0
expect_error 2 "--format" "$knurl" bake plane.obj -o x.ply --format stl
expect_error 3 "nothing.obj" "$knurl" bake nothing.obj -o x.ply
expect_error 3 "cannot write there" "$knurl" bake plane.obj -o nowhere/x.ply
expect_error 4 "65535" "$knurl" bake plane.obj --disp map.pgm --tile 40000x40000 -o x.ply
expect_error 4 "4 GiB at most" "$knurl" bake plane.obj --disp map.pgm --tile 2500x5000 -o x.glb -q
[ "$(ls)" = "$before" ] || fail "files: $(ls)"
expect_error 3 "No space left" "$knurl" bake plane.obj --disp map.pgm --tile 100x100 -o /dev/full --format obj

# The method itself.
expect 0 "$knurl" trace scene.gltf --rays rays.csv --out facets.csv --method tessellation:rate=2
"$python" - <<'PY'
import csv
for a, b in zip(csv.DictReader(open("exact.csv")), csv.DictReader(open("facets.csv"))):
    assert b["hit"] == "1" and abs(float(a["t"]) - float(b["t"])) < 0.01 and a["object"] == b["object"], (a, b)
PY
expect_error 4 "method tessellation" "$knurl" trace plane.obj --disp map.pgm --tile 2000x2000 --rays rays.csv --out x.csv \
    --method tessellation --memory-limit 100M

# Interrupted: nothing is left.
mkdir stopped
"$python" -c 'import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])' "$knurl" bake plane.obj --disp map.pgm --tile 4000x8000 --rate 1 -o stopped/x.ply \
    >/dev/null 2>log.txt &
process=$!
for _ in $(seq 1 600); do
    [ -n "$(find stopped -type f -size +0)" ] && break
    kill -0 $process 2>/dev/null || { cat log.txt >&2; fail "ended before the signal"; }
    sleep 0.05
done
kill -INT $process
found=0
wait $process || found=$?
[ $found -eq 130 ] || { cat log.txt >&2; fail "status $found, expected 130"; }
[ -z "$(ls stopped)" ] || fail "files: $(ls stopped)"
echo good

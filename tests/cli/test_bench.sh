#!/usr/bin/env bash
# knurl bench: JSON and CSV keys, a row for every method, ray set and thread count, the same rays for every
# method, methods that do not fit in memory, and wrong command lines.
. "$(dirname "$0")/lib.sh" "$@"
write_plane
"$python" -c '
import random
random.seed(1)
open("noise.pgm", "wb").write(b"P5\n40 30\n255\n" + bytes(random.randrange(256) for _ in range(1200)))'
surface="plane.obj --disp noise.pgm --disp-factor 0.2"
# A closed surface: an octahedron whose vertices have one normal and one texture coordinate each.
cat >ball.obj <<'OBJ'
v 1 0 0
v 0 1 0
v 0 0 1
v -1 0 0
v 0 -1 0
v 0 0 -1
vt 1 0.5
vt 0.45 0.4
vt 0.5 1
vt 0 0.5
vt 0.55 0.6
vt 0.5 0
vn 1 0 0
vn 0 1 0
vn 0 0 1
vn -1 0 0
vn 0 -1 0
vn 0 0 -1
f 1/1/1 2/2/2 3/3/3
f 3/3/3 2/2/2 4/4/4
f 4/4/4 2/2/2 6/6/6
f 6/6/6 2/2/2 1/1/1
f 3/3/3 5/5/5 1/1/1
f 4/4/4 5/5/5 3/3/3
f 6/6/6 5/5/5 4/4/4
f 1/1/1 5/5/5 6/6/6
OBJ
ball="ball.obj --disp noise.pgm --disp-factor 0.2"
variant=rmip:marching-scale=1:inversion=off:bounds=minmax
all_rays=primary,grazing,diffuse,diffuse-shuffled,occlusion,inside,inside-shuffled

# Every key of the contract, and rows in order.
expect 0 "$knurl" bench $ball --methods rmip,$variant --rays $all_rays --count 600 --rounds 2 --threads 2 \
    --json out.json --csv out.csv --heat-map steps.png --frame 16x9x2
cp stdout.txt table.txt
"$python" - "$variant" <<'PY'
import csv, json, sys
variant = sys.argv[1]
data = json.load(open("out.json"))
assert list(data) == ["knurl", "threads", "rounds", "count", "seed", "lod", "disp_scale", "tile_scale", "frame",
                      "dt_unit", "interrupted", "heat_maps", "results"], list(data)
assert data["threads"] == 2 and data["rounds"] == 2 and data["frame"] == [16, 9, 2] and not data["interrupted"]
kinds = "primary grazing diffuse diffuse-shuffled occlusion inside inside-shuffled".split()
rows = data["results"]
expected = [(k, t, m) for k in kinds for t in (1, 2) for m in ("rmip", variant)]
expected += [("frame", 2, "rmip"), ("frame", 2, variant)]
assert [(r["rays"], r["threads"], r["method"]) for r in rows] == expected
keys = ["scene", "method", "rays", "threads", "calls", "count", "mrays_min", "mrays_median", "mrays_max",
        "mrays_cpu_median", "frame_ms_median", "steps_mean", "steps_p99", "steps_max", "build_ms", "bytes", "missed", "false",
        "dt_median", "dt_p99", "reference", "error"]
structures = ["mesh", "shells", "bvh", "map_samples", "map_levels", "map_minmax", "map_rmip", "map_blocks", "total"]
for r in rows:
    assert list(r) == keys, list(r)
    assert r["scene"] == "ball.obj" and r["error"] is None, r
    assert 0 < r["mrays_min"] <= r["mrays_median"] <= r["mrays_max"]
    assert list(r["bytes"]) == structures and r["build_ms"] > 0
    assert r["bytes"]["total"] == sum(r["bytes"][s] for s in structures[:-1]) and r["bytes"]["map_samples"] == 1200
    frame = r["rays"] == "frame"
    assert r["calls"] == (None if frame else "single" if r["threads"] == 1 else "batch"), r
    assert (r["mrays_cpu_median"] is None) == frame and (frame or r["mrays_cpu_median"] > 0)
    assert (r["frame_ms_median"] is not None) == frame and (r["reference"] is None) == frame
    if frame:
        assert r["count"] == 16 * 9 * 2 and r["frame_ms_median"] > 0 and r["steps_mean"] > 0
        continue
    assert r["reference"] == variant # of rmip itself
    assert r["missed"] == 0 and r["false"] == 0, r
    if r["rays"] == "occlusion":
        assert r["steps_mean"] is None and r["dt_median"] is None
    else:
        assert 0 < r["steps_mean"] <= r["steps_max"] and r["steps_p99"] <= r["steps_max"]
        assert 0 <= r["dt_median"] <= r["dt_p99"] < 1e-12, r
# A set is the same for all methods and thread counts, and a shuffled one does the same work.
counts = {k: {r["count"] for r in rows if r["rays"] == k} for k in kinds}
assert all(len(c) == 1 for c in counts.values()), counts
assert counts["diffuse"] == {600} and counts["primary"] == {32 * 16}, counts
def of(kind, method="rmip"):
    return next(r for r in rows if r["rays"] == kind and r["method"] == method)
for kind in ("diffuse", "inside"):
    a, b = of(kind), of(kind + "-shuffled")
    assert abs(a["steps_mean"] - b["steps_mean"]) < 1e-9 and a["steps_max"] == b["steps_max"], (a, b)
assert of("grazing")["steps_mean"] != of("diffuse")["steps_mean"]
assert [m["file"] for m in data["heat_maps"]] == ["steps.ball.0.png", "steps.ball.1.png"]
assert len({m["white"] for m in data["heat_maps"]}) == 1 and data["heat_maps"][0]["white"] >= of("primary")["steps_max"]

table = list(csv.DictReader(open("out.csv", newline="")))
assert list(table[0]) == keys[:15] + ["bytes_" + s for s in structures] + keys[16:]
assert len(table) == len(rows)
for a, b in zip(table, rows):
    assert None not in a and None not in a.values(), a
    for key in keys:
        if key == "bytes":
            assert [int(a["bytes_" + s]) for s in structures] == list(b["bytes"].values())
        elif isinstance(b[key], (int, float)):
            assert abs(float(a[key]) - b[key]) <= 1e-8 * abs(b[key]), (key, a[key], b[key])
        else:
            assert a[key] == (b[key] or ""), (key, a[key], b[key])
PY
expect_text table.txt "rmip ($variant)"
expect_text table.txt "inside-shuffled"
[ "$(grep -c '^frame ' table.txt)" -eq 2 ] || fail "frames are not in the table"
expect 0 "$knurl" info steps.ball.0.png
expect_text stdout.txt "32 x 16, 3 channels, u8"

# Rays, hits and steps depend on the seed alone: not on the methods beside them, nor on the threads.
work() {
    "$python" -c '
import json, sys
keys = ["rays", "count", "steps_mean", "steps_p99", "steps_max", "missed", "false", "dt_median", "dt_p99"]
rows = json.load(open(sys.argv[1]))["results"]
print([[r[k] for k in keys] for r in rows if r["method"] == "rmip" and r["threads"] == 1 and r["rays"] != "frame"])' "$1"
}
work out.json >work.txt
expect 0 "$knurl" bench $ball --methods $variant,rmip --rays $all_rays --count 600 --rounds 1 --threads 1 \
    --json again.json -q
work again.json | cmp -s - work.txt || fail "rays depend on the methods or threads"
[ "$("$python" -c 'import json; print(len(json.load(open("again.json"))["results"]))')" -eq 14 ] ||
    fail "with one thread there is one row per method and set"
expect 0 "$knurl" bench $ball --methods rmip --rays $all_rays --count 600 --rounds 1 --threads 1 --seed 7 \
    --json seed.json -q
work seed.json | cmp -s - work.txt && fail "--seed changes nothing"

# Both kinds of calls on one thread and on two: the same hits and steps.
expect 0 "$knurl" bench $ball --methods rmip,tessellation --rays primary,occlusion,inside-shuffled --count 2000 \
    --rounds 2 --threads 2 --calls both --json calls.json -q
"$python" - <<'PY'
import json
rows = json.load(open("calls.json"))["results"]
ways = [(1, "single"), (1, "batch"), (2, "single"), (2, "batch")]
expected = [(k, t, c, m) for k in ("primary", "occlusion", "inside-shuffled") for t, c in ways
            for m in ("rmip", "tessellation")]
assert [(r["rays"], r["threads"], r["calls"], r["method"]) for r in rows] == expected
for r in rows:
    assert 0 < r["mrays_min"] <= r["mrays_median"] and r["mrays_cpu_median"] > 0 and r["error"] is None, r
    if r["method"] == "rmip":
        assert r["missed"] == 0 and r["false"] == 0, r
        assert r["steps_mean"] == rows[expected.index((r["rays"], 1, "single", "rmip"))]["steps_mean"]
PY
expect 0 "$knurl" bench $ball --methods rmip --rays primary --count 600 --rounds 1 --threads 1 --calls batch --csv calls.csv
[ "$(grep -c '^ball.obj,rmip,primary,1,batch,' calls.csv)" -eq 1 ] && [ "$(wc -l <calls.csv)" -eq 2 ] ||
    fail "--calls batch on one thread"

# Rays from inside are for closed scenes.
expect 0 "$knurl" bench $surface --methods rmip --rays primary,inside,inside-shuffled --count 600 --rounds 1 --json open.json
expect_text stdout.txt "rmip: the scene is not closed: "
"$python" -c '
import json
rows = json.load(open("open.json"))["results"]
assert all((r["error"] is None) == (r["rays"] == "primary") for r in rows) and len(rows) >= 3, rows'

# Rays that start a little off the surface do not meet facets at once.
for lift in 0 0.05; do
    expect 0 "$knurl" bench $ball --methods tessellation --rays primary,diffuse --count 2000 --rounds 1 --threads 1 \
        --lift $lift --json lift$lift.json -q
done
"$python" -c '
import json
a, b = (json.load(open(f))["results"] for f in ("lift0.json", "lift0.05.json"))
assert a[0]["false"] == b[0]["false"] and a[1]["false"] > 10 * b[1]["false"] + 10, (a[1]["false"], b[1]["false"])'

# Undisplaced meshes left out.
expect 0 "$knurl" demo sphere . --size 32 -q
for only in "" --displaced-only; do
    expect 0 "$knurl" bench sphere/sphere.gltf --methods rmip --rays primary,inside --count 600 --rounds 1 \
        --threads 1 $only --json "only$only.json" -q
done
"$python" -c '
import json
a, b = (json.load(open(f))["results"] for f in ("only.json", "only--displaced-only.json"))
assert all(r["error"] is None and r["missed"] == 0 for r in a + b)
assert a[0]["bytes"]["bvh"] > b[0]["bytes"]["bvh"] > 0 and a[0]["bytes"]["mesh"] > b[0]["bytes"]["mesh"]
assert a[0]["bytes"]["map_samples"] == b[0]["bytes"]["map_samples"]'

# Scales, a level of detail, and a reference of one's own.
expect 0 "$knurl" bench $surface --methods rmip --rays primary --count 600 --rounds 1 --json - --lod 1.5 \
    --disp-scale 2 --tile-scale 3 --reference rmip
"$python" -c '
import json
data = json.load(open("stdout.txt"))
assert (data["lod"], data["disp_scale"], data["tile_scale"]) == (1.5, 2, 3)
assert all(r["reference"] == "rmip" and r["missed"] == 0 and r["dt_p99"] == 0 for r in data["results"])'
expect_text stderr.txt "primary"

# A method that does not fit is rows with a reason, and status 4 if it was the only one.
expect 4 "$knurl" bench $surface --methods rmip --rays primary,diffuse --count 600 --rounds 1 --json small.json \
    --memory-limit 2K
expect_text stdout.txt "rmip: "
"$python" -c '
import json
rows = json.load(open("small.json"))["results"]
assert rows and all("out of memory" in r["error"] and r["mrays_median"] is None and r["bytes"] is None for r in rows), rows'
cat >away.gltf <<'GLTF'
{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"camera": 0}],
 "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]}
GLTF
expect 0 "$knurl" bench away.gltf --methods rmip --rays primary,diffuse,occlusion --count 600 --rounds 1 --json away.json
"$python" -c '
import json
rows = json.load(open("away.json"))["results"]
assert all(r["missed"] == 0 and r["error"] is None for r in rows if r["rays"] == "primary")
assert all("no camera ray hits" in r["error"] for r in rows if r["rays"] != "primary")'
expect_text stdout.txt "no camera ray hits anything"

# Two scenes; the second is broken: the first one's rows are saved.
echo '{' >broken.gltf
expect 3 "$knurl" bench plane.obj broken.gltf --disp noise.pgm --methods rmip --rays primary --count 600 --rounds 1 \
    --json partly.json
grep -q '"scene": "plane.obj"' partly.json || fail "finished rows are lost"

# Ctrl-C keeps finished rows.
found=0
"$python" - "$knurl" $surface <<'PY' || found=$?
import json, signal, subprocess, sys
run = subprocess.Popen([sys.argv[1], "bench", *sys.argv[2:], "--methods", "rmip", "--rays", "primary,diffuse", "--count",
                        "600", "--rounds", "1", "--json", "stopped.json", "--frame", "2000x2000x100"],
                       stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                       preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
for line in run.stdout:
    if line.startswith("diffuse"):
        run.send_signal(signal.SIGINT)
        break
run.stdout.read()
assert run.wait() == 130, run.returncode
data = json.load(open("stopped.json"))
assert data["interrupted"] and [r["rays"] for r in data["results"]][0] == "primary"
assert all(r["mrays_median"] > 0 for r in data["results"])
PY
[ $found -eq 0 ] || fail "interrupting"

# Wrong command lines
expect_error 2 "the scene file is missing" "$knurl" bench --methods rmip
expect_error 2 "--methods: method 'magic' is not known; methods are " "$knurl" bench plane.obj --methods rmip,magic
expect_error 2 "method rmip: found 'speed=9', expected" "$knurl" bench plane.obj --methods rmip:speed=9
expect_error 2 "--methods: found 'rmip,', expected names" "$knurl" bench plane.obj --methods rmip,
expect_error 2 "--rays: found 'secondary', expected one of primary, grazing" "$knurl" bench plane.obj --rays secondary
expect_error 2 "--rays: found 'none' without --frame" "$knurl" bench plane.obj --rays none
expect_error 2 "--calls: found 'packets', expected one of single, batch, both" "$knurl" bench plane.obj --calls packets
expect_error 2 "--reference: method 'magic'" "$knurl" bench plane.obj --reference magic
expect_error 2 "--frame: found '10x10', expected WIDTHxHEIGHTxSAMPLES" "$knurl" bench plane.obj --frame 10x10
expect_error 2 "--count: found '3', expected a whole number from 64" "$knurl" bench plane.obj --count 3
expect_error 2 "--heat-map: found 'a.exr', expected a name ending in .png" "$knurl" bench plane.obj --heat-map a.exr
expect_error 2 "--heat-map: needs primary" "$knurl" bench plane.obj --heat-map a.png --rays inside
expect_error 2 "--camera: found 'top'" "$knurl" bench plane.obj --methods rmip --camera top
expect_error 3 "cannot write there" "$knurl" bench plane.obj --json nowhere/out.json
expect_error 3 "none.obj" "$knurl" bench none.obj --methods rmip
echo good

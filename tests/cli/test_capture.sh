#!/usr/bin/env bash
# knurl capture: depths that come back, seams of the cube, holes, frusta, cuts, failures, interruption.
. "$(dirname "$0")/lib.sh" "$@"

"$python" - <<'PY'
import math
# A bumpy ball (star-shaped about the origin, off the middle of its bounds), a flat ring that faces +z.
with open("ball.obj", "w") as out:
    rows, columns = 24, 48
    for i in range(rows + 1):
        for k in range(columns):
            a, b = math.pi * i / rows, 2 * math.pi * k / columns
            r = 1 + 0.2 * math.sin(3 * a) * math.cos(4 * b)
            out.write("v %.9g %.9g %.9g\n" % (r * math.sin(a) * math.cos(b), r * math.cos(a), r * math.sin(a) * math.sin(b)))
    for i in range(rows):
        for k in range(columns):
            p, q = i * columns + k + 1, i * columns + (k + 1) % columns + 1
            out.write("f %d %d %d %d\n" % (p, q, q + columns, p + columns))
with open("ring.obj", "w") as out:
    for k in range(64):
        for r in (0.4, 1.0):
            out.write("v %.9g %.9g 0\n" % (r * math.cos(math.pi * k / 32), r * math.sin(math.pi * k / 32)))
    for k in range(64):
        out.write("f %d %d %d %d\n" % (2 * k + 1, 2 * k + 2, (2 * k + 3) % 128 + 1, (2 * k + 2) % 128 + 1))
PY

# Reads a capture: the relief's grid gives the rays through its texels, whatever the frustum.
cat >capture.py <<'PY'
import json, sys
import numpy as np

class Capture:
    def __init__(self, folder):
        self.gltf = json.load(open(folder + "/capture.gltf"))
        self.bytes = open(folder + "/capture.bin", "rb").read()

    def array(self, index):
        accessor = self.gltf["accessors"][index]
        view = self.gltf["bufferViews"][accessor["bufferView"]]
        kind, width = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]], {"VEC3": 3, "VEC2": 2, "SCALAR": 1}[accessor["type"]]
        return np.frombuffer(self.bytes, kind, accessor["count"] * width, view["byteOffset"]).reshape(-1, width).astype(float)

    def views(self):
        for node in self.gltf["nodes"]:
            if "mesh" in node:
                yield View(self, node)

class View:
    def __init__(self, capture, node):
        primitive = capture.gltf["meshes"][node["mesh"]]["primitives"][0]
        attributes = primitive["attributes"]
        self.name = node["name"]
        self.matrix = np.array(node["matrix"]).reshape(4, 4).T
        material = capture.gltf["materials"][primitive["material"]]
        displacement = material["extensions"]["KHR_materials_displacement"]
        self.factor = displacement["displacementGeometryFactor"]
        self.offset = displacement["displacementGeometryOffset"]
        self.masked = material.get("alphaMode") == "MASK"
        self.triangles = capture.array(primitive["indices"]).reshape(-1, 3)
        # P and D are affine in the texture coordinates over the whole view.
        texcoords = capture.array(attributes["TEXCOORD_0"])
        self.low, self.high = texcoords.min(0), texcoords.max(0)
        known = np.c_[texcoords, np.ones(len(texcoords))]
        self.points = np.linalg.lstsq(known, capture.array(attributes["POSITION"]), rcond=None)[0]
        self.directions = np.linalg.lstsq(known, capture.array(attributes["_DIRECTION"]), rcond=None)[0]

    # Rays towards the relief; t counts metres along the axis, from `above` over the highest height.
    def rays(self, uv, above=0.01):
        uv = np.c_[uv, np.ones(len(uv))]
        top = self.offset + self.factor + above
        direction = uv @ self.directions
        origin = uv @ self.points + top * direction
        axes = self.matrix[:3, :3]
        return np.c_[origin @ axes.T + self.matrix[:3, 3], -direction @ axes.T]

    # Coordinates of all texel centres of the map; the base ends at the centres of its border texels.
    def centres(self):
        width, height = np.rint(0.5 / self.low).astype(int)
        x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        return np.c_[x.ravel(), y.ravel()]
PY

# retrace MODEL FOLDER SIZE BOUND: rays through texel centres and between, into the model and into its capture.
# At the centres the depths agree within half a step of the map and the rounding of floats.
retrace() {
    "$python" - "$2" <<'PY'
import sys
import numpy as np
from capture import Capture
rays = []
for view in Capture(sys.argv[1]).views():
    rays.append(view.rays(view.centres()))
    rays.append(view.rays(np.random.default_rng(5).uniform(view.low, view.high, (2000, 2))))
np.save("rays.npy", np.concatenate(rays))
PY
    expect 0 "$knurl" trace "$1" --rays rays.npy --out model.npy -q
    expect 0 "$knurl" trace "$2/capture.gltf" --rays rays.npy --out relief.npy -q
    "$python" - "$2" "$3" "$4" <<'PY'
import sys
import numpy as np
from capture import Capture
size, bound = int(sys.argv[2]), float(sys.argv[3])
views = list(Capture(sys.argv[1]).views())
rays, model, relief = (np.load(name + ".npy") for name in ("rays", "model", "relief"))
block = size * size + 2000
assert len(rays) == len(views) * block
for k, view in enumerate(views):
    part = slice(k * block, (k + 1) * block)
    both = (model[part, 0] == 1) & (relief[part, 0] == 1)
    error = np.abs(model[part, 1] - relief[part, 1])
    centre = np.arange(block) < size * size
    worst = error[both & centre].max()
    between = np.quantile(error[both & ~centre], 0.99)
    step = view.factor / 65535
    print(sys.argv[1], view.name, "hits", both.sum(), "worst at centres", worst, "step", step, "between, 99 %", between)
    # Only outlines, where a ray may pass by on either side, may be hit on one side alone.
    alone = (model[part, 0] != relief[part, 0]) & centre
    assert both[centre].sum() > 0.4 * size * size
    assert not view.masked and not alone.any(), alone.sum()
    assert worst <= 0.5 * step + 2e-6, (worst, step)
    assert between <= bound, between
PY
}

# Six views, one range of heights; depths come back.
expect 0 "$knurl" capture ball.obj -o six --size 64 --samples 1 --cell 16 -q
[ ! -s stderr.txt ] || fail "--quiet is not quiet: $(cat stderr.txt)"
[ "$(ls -A six | wc -l)" -eq 14 ] || fail "files: $(ls -A six)"
retrace ball.obj six 64 0.01 # a texel is 0.04 across

# The seams of the cube are closed: along shared edges the same codes.
"$python" - <<'PY'
import json
from capture import Capture
views = list(Capture("six").views())
assert len(views) == 6 and len({(v.factor, v.offset) for v in views}) == 1
PY
expect 0 "$knurl" info --json six/height-px.png
"$python" - <<'PY'
import json
i = json.load(open("stdout.txt"))
assert (i["width"], i["height"], i["channels"], i["bits"]) == (64, 64, 1, 16), i
PY
"$python" - <<'PY'
import numpy as np
from capture import Capture
# Rays through the centre of the cube at random points of its twelve edges, from outside: none slips through.
views = list(Capture("six").views())
random = np.random.default_rng(9)
rays = []
for view in views:
    along = random.uniform(view.low, view.high, (4, 500, 2))
    along[0, :, 0], along[1, :, 0], along[2, :, 1], along[3, :, 1] = view.low[0], view.high[0], view.low[1], view.high[1]
    rays.append(view.rays(along.reshape(-1, 2), above=1))
np.save("rays.npy", np.concatenate(rays))
PY
expect 0 "$knurl" trace six/capture.gltf --rays rays.npy --out relief.npy -q
"$python" -c 'import numpy as np; h = np.load("relief.npy"); missed = (h[:, 0] != 1).sum(); print("seams:", len(h), "rays, missed", missed); assert missed < 0.001 * len(h), missed'

# Other methods and float depth; capturing a capture; one view with each frustum and from any side.
expect 0 "$knurl" trace six/capture.gltf --rays rays.npy --out other.npy -q --method tfdm
"$python" -c '
import numpy as np
a, b = np.load("relief.npy"), np.load("other.npy")
both = (a[:, 0] == 1) & (b[:, 0] == 1)
assert both.mean() > 0.999 and np.abs(a[both, 1] - b[both, 1]).max() < 1e-5'
expect 0 "$knurl" capture ball.obj -o exr --size 64 --samples 1 --depth exr -q
[ -f exr/height-nz.exr ] || fail "no float depth: $(ls exr)"
expect 0 "$knurl" info --json exr/capture.gltf
expect 0 "$knurl" capture six/capture.gltf -o again --size 32 --samples 1 -q
for frustum in "parallel --from -x" "reverse --from 1,2,3" "perspective --fov 50" "reverse --fov 70 --center 0,0.1,0"; do
    expect 0 "$knurl" capture ball.obj -o one --views 1 --frustum $frustum --size 64 --samples 1 -q
    "$python" - <<'PY'
import numpy as np
from capture import Capture
(view,) = Capture("one").views()
assert view.masked
np.save("rays.npy", view.rays(view.centres()))
PY
    expect 0 "$knurl" trace ball.obj --rays rays.npy --out model.npy -q
    expect 0 "$knurl" trace one/capture.gltf --rays rays.npy --out relief.npy -q
    "$python" - "$frustum" <<'PY'
import sys
import numpy as np
from capture import Capture
(view,) = Capture("one").views()
model, relief = np.load("model.npy"), np.load("relief.npy")
seen = model[:, 0] == 1
assert 0.2 < seen.mean() < 0.95, seen.mean()
assert (relief[seen, 0] == 1).mean() > 0.999  # pieces of the base go at most where nothing was seen
both = seen & (relief[:, 0] == 1)
worst = np.abs(model[both, 1] - relief[both, 1]).max()
print(sys.argv[1], "worst at centres", worst, "step", view.factor / 65535)
assert worst <= 0.5 * view.factor / 65535 + 2e-6, worst
PY
done

# Holes are cut out: the picture of the ring's capture is black where the ring's is.
expect 0 "$knurl" capture ring.obj -o ring --views 1 --size 64 --color-size 128 -q
shown="--width 160 --height 90 --spp 4 --integrator primary --background 0,0,0 -q"
expect 0 "$knurl" render ring.obj -o ring.pfm $shown
expect 0 "$knurl" render ring/capture.gltf -o relief.pfm $shown
"$python" - <<'PY'
import numpy as np
def load(name):
    data = open(name, "rb").read()
    assert data.startswith(b"PF\n160 90\n")
    return np.frombuffer(data[-160 * 90 * 12:], "<f4").reshape(90, 160, 3).sum(2)
ring, relief = load("ring.pfm"), load("relief.pfm")
assert ring[45, 80] == 0 and relief[45, 80] == 0
assert ring.max() > 0.5 and (ring > 0).sum() > 500
# Outlines are sampled per texel: they may be off by a pixel.
wrong = (ring > 0) != (relief > 0)
print("ring:", (ring > 0).sum(), "pixels, differing", wrong.sum())
assert wrong.sum() < 0.15 * (ring > 0).sum(), wrong.sum()
PY

# Materials that differ get a map of roughness and metalness; the model's own holes are passed.
expect 0 "$knurl" demo chainmail demo --map-size 64 -q
expect 0 "$knurl" capture demo/chainmail/chainmail.gltf -o mail --views 1 --clip=-1,0.5,0,1,1.5,2 --size 200 --samples 1 -q
[ "$(ls -A mail | tr '\n' ' ')" = "capture.bin capture.gltf color.png height.png surface.png " ] || fail "files: $(ls -A mail)"
expect 0 "$knurl" info --json mail/color.png
"$python" -c 'import json; a = json.load(open("stdout.txt"))["channel_ranges"][3]; assert a["min"] == 0 and 0.3 < a["mean"] < 0.95, a'
[ ! -e six/surface-px.png ] || fail "a map of one roughness"

# Cuts: near and far count from the front face; a box of the world.
expect 0 "$knurl" capture ball.obj -o cut --views 1 --near 0.5 --far 0.9 --size 64 --samples 1 -q
"$python" - <<'PY'
from capture import Capture
(view,) = Capture("cut").views()
assert view.masked and 0.2 < view.factor <= 0.4, view.factor
PY
expect 0 "$knurl" capture ball.obj -o box --views 1 --from +y --clip=-2,0.3,-2,2,0.7,2 --size 64 --samples 1 -q
"$python" - <<'PY'
from capture import Capture
(view,) = Capture("box").views()
top = view.matrix[1, 3] + view.points[2, 2] + view.offset + view.factor
assert view.masked and 0.65 < top <= 0.7 + 1e-6 and 0.2 < view.factor <= 0.4 + 1e-6, (top, view.factor)
PY

# The same bits with any number of threads.
for threads in 1 3; do
    expect 0 "$knurl" capture ball.obj -o threads$threads --size 40 --samples 1 --threads $threads -q
done
diff -r threads1 threads3 || fail "the number of threads changes the files"

# Wrong usage, bad files; nothing is left behind, what was there stays.
expect_error 2 "-o DIR is missing" "$knurl" capture ball.obj
expect_error 2 "the model's file is missing" "$knurl" capture -o bad
expect_error 2 "--views: found '2', expected one of 1, 6" "$knurl" capture ball.obj -o bad --views 2
expect_error 2 "--from: found with six views, expected --views 1" "$knurl" capture ball.obj -o bad --from +x
expect_error 2 "--fov: found with --frustum parallel" "$knurl" capture ball.obj -o bad --views 1 --frustum parallel --fov 40
expect_error 2 "--from: found '0,0,0'" "$knurl" capture ball.obj -o bad --views 1 --from 0,0,0
expect_error 2 "--clip: found '1,1,1,0,2,2'" "$knurl" capture ball.obj -o bad --clip 1,1,1,0,2,2
expect_error 2 "--size: found '1'" "$knurl" capture ball.obj -o bad --size 1
expect_error 2 "--near: found 2, expected less than --far 1" "$knurl" capture ball.obj -o bad --near 2 --far 1
expect_error 3 "nothing.obj" "$knurl" capture nothing.obj -o bad
expect_error 3 "nothing of it is in the box" "$knurl" capture ball.obj -o bad --clip 5,5,5,6,6,6
expect_error 3 "expected depths from 0 to" "$knurl" capture ball.obj -o bad --near 50
expect_error 3 "no view meets the model" "$knurl" capture ring.obj -o bad --center 5,0,0 --far 0.001
expect_error 3 "cannot make the folder" "$knurl" capture ball.obj -o ball.obj/bad
[ ! -e bad ] || fail "a failed run left $(ls -A bad)"
cp -r six kept
expect_error 4 "memory" "$knurl" capture ball.obj -o six --memory-limit 20K
"$python" -c 'import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])' "$knurl" capture ball.obj -o six --size 512 --samples 5 2>log.txt &
process=$!
for _ in $(seq 1 600); do
    grep -q '^capture: ' log.txt && break
    kill -0 $process 2>/dev/null || fail "ended before the signal: $(cat log.txt)"
    sleep 0.1
done
kill -INT $process
found=0
wait $process || found=$?
[ $found -eq 130 ] || fail "status $found after SIGINT, expected 130"
expect_text log.txt "interrupted; nothing was written"
diff -r six kept || fail "an interrupted run changed an old capture"
echo good

#!/usr/bin/env bash
# knurl trace with NumPy arrays: versions, types, shapes; the same hits as CSV; refused input.
. "$(dirname "$0")/lib.sh" "$@"
write_plane
write_map

"$python" - <<'PY'
import numpy as np
from numpy.lib import format
random = np.random.default_rng(5)
n = 70001
origin = np.column_stack([random.uniform(-1.3, 1.3, n), np.full(n, 1.0), random.uniform(-1.3, 1.3, n)])
direction = np.column_stack([random.uniform(-0.4, 0.4, n), random.uniform(-3, -0.5, n), random.uniform(-0.4, 0.4, n)])
rays = np.hstack([origin, direction])
np.save("rays.npy", rays)
np.savetxt("rays.csv", rays, fmt="%.17g", delimiter=",", header="ox,oy,oz,dx,dy,dz", comments="")
np.save("float.npy", rays.astype("<f4"))
np.savetxt("float.csv", rays.astype("<f4").astype(float), fmt="%.17g", delimiter=",", header="ox,oy,oz,dx,dy,dz", comments="")
ranged = np.hstack([rays, np.full((n, 1), 0.1), np.full((n, 1), 0.6)])
for version in [(1, 0), (2, 0), (3, 0)]:
    with open("ranged%d.npy" % version[0], "wb") as file:
        format.write_array(file, ranged, version=version)
np.save("fortran.npy", np.asfortranarray(rays[:10]))
np.save("big.npy", rays[:10].astype(">f8"))
np.save("int.npy", rays[:10].astype("<i8"))
np.save("flat.npy", rays[0])
np.save("cube.npy", rays[:10].reshape(2, 5, 6))
np.save("seven.npy", ranged[:10, :7])
np.save("none.npy", rays[:0])
bad = rays[:100].copy()
bad[42, 3:] = 0
np.save("still.npy", bad)
bad[42, 3:] = 1
bad[17, 1] = np.nan
np.save("nan.npy", bad)
bad = ranged[:10].copy()
bad[3, 6] = 2
np.save("range.npy", bad)
data = open("rays.npy", "rb").read()
open("short.npy", "wb").write(data[:-1])
open("long.npy", "wb").write(data + b"x")
open("text.npy", "w").write("ox,oy,oz\n")
open("header.npy", "wb").write(data[:40])
open("version.npy", "wb").write(data[:6] + b"\x09" + data[7:])
open("words.npy", "wb").write(data[:10] + b"[" + data[11:])
open("huge.npy", "wb").write(b"\x93NUMPY\x01\x00\x76\x00" +
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999, 6), }".ljust(117) + b"\n")
PY

options="--disp map.pgm --disp-factor 0.2 --tile 3x2"
expect 0 "$knurl" trace plane.obj $options --rays rays.npy --out hits.npy
expect 0 "$knurl" trace plane.obj $options --rays rays.csv --out hits.csv
expect 0 "$knurl" trace plane.obj $options --rays rays.csv --out from-csv.npy
expect 0 "$knurl" trace plane.obj $options --rays rays.npy --out from-npy.csv
expect 0 "$knurl" trace plane.obj $options --rays rays.npy --out any.npy --any-hit
expect 0 "$knurl" trace plane.obj $options --rays float.npy --out float-hits.csv
expect 0 "$knurl" trace plane.obj $options --rays float.csv --out float-expected.csv
for version in 1 2 3; do
    expect 0 "$knurl" trace plane.obj $options --rays ranged$version.npy --out ranged$version.csv
done
expect 0 "$knurl" trace plane.obj $options --rays none.npy --out none-hits.npy
"$knurl" trace plane.obj $options -q --rays - --out - <rays.npy >piped.npy
cat rays.npy | "$knurl" trace plane.obj $options -q --rays - --out piped.csv
cmp hits.csv from-npy.csv
cmp hits.csv piped.csv
cmp hits.npy from-csv.npy
cmp hits.npy piped.npy
cmp float-hits.csv float-expected.csv
cmp ranged1.csv ranged2.csv
cmp ranged1.csv ranged3.csv

"$python" - <<'PY'
import csv
import numpy as np
rays, hits, any_hit = np.load("rays.npy"), np.load("hits.npy"), np.load("any.npy")
assert hits.shape == (len(rays), 16) and hits.dtype == np.dtype("<f8"), (hits.shape, hits.dtype)
assert any_hit.shape == (len(rays),) and any_hit.dtype == np.uint8, (any_hit.shape, any_hit.dtype)
assert np.load("none-hits.npy").shape == (0, 16)
found = hits[:, 0] == 1
assert 0.3 < found.mean() < 0.9, found.mean()
assert np.all(hits[~found, 0] == 0) and np.all(np.isnan(hits[~found, 1:])) and np.all(np.isfinite(hits[found]))
assert np.array_equal(any_hit, found.astype(np.uint8))
h, r = hits[found], rays[found]
assert np.abs(r[:, :3] + h[:, 1:2] * r[:, 3:] - h[:, 2:5]).max() < 1e-6
assert np.abs(h[:, 3] - h[:, 13]).max() < 1e-6          # the base is y = 0
assert np.abs(np.linalg.norm(h[:, 5:8], axis=1) - 1).max() < 1e-6
assert np.abs(np.linalg.norm(h[:, 8:11], axis=1) - 1).max() < 1e-6
assert np.abs(h[:, 11] - 3 * (h[:, 2] + 1) / 2).max() < 1e-6 # u after the tiling, before wrapping
assert np.abs(h[:, 12] - 2 * (1 - h[:, 4]) / 2).max() < 1e-6 # OBJ counts v from below
assert set(np.unique(h[:, 15])) == {0.0, 1.0}

with open("hits.csv") as file:
    rows = list(csv.reader(file))
assert rows[0] == "hit,t,px,py,pz,ngx,ngy,ngz,nsx,nsy,nsz,u,v,height,object,triangle".split(",")
for row, hit in zip(rows[1:2001], hits):
    expected = ["%.9g" % x for x in hit] if hit[0] == 1 else ["0"] + [""] * 15
    assert row == expected, (row, expected)
ranged = list(csv.reader(open("ranged1.csv")))[1:]
for row, hit in zip(ranged, hits):
    if hit[0] == 1 and 0.1 < hit[1] < 0.6:
        assert row[0] == "1" and abs(float(row[1]) - hit[1]) < 1e-6
    assert row[0] == "0" or 0.1 <= float(row[1]) <= 0.6
PY

refused() { # TEXT FILE
    expect_error 3 "$1" "$knurl" trace plane.obj --rays "$2" --out bad.out
    [ ! -e bad.out ] || fail "an output was left for $2"
}
refused "fortran.npy: found Fortran order" fortran.npy
refused "big.npy: found big-endian type '>f8', expected little-endian floats" big.npy
refused "int.npy: found element type '<i8', expected little-endian floats" int.npy
refused "flat.npy: found 1 dimension, expected shape (n, 6) or (n, 8)" flat.npy
refused "cube.npy: found more than 2 dimensions, expected shape (n, 6) or (n, 8)" cube.npy
refused "seven.npy: found shape (10, 7), expected (n, 6) or (n, 8)" seven.npy
refused "still.npy: row 42: found direction 0,0,0" still.npy
refused "nan.npy: row 17: found nan, expected a finite number (column oy)" nan.npy
refused "range.npy: row 3: found tmin 2 above tmax 0.6" range.npy
refused "short.npy: ends after 70000 of 70001 rays" short.npy
refused "long.npy: goes on after its 70001 rays" long.npy
refused "text.npy: found no NumPy signature, expected a .npy file" text.npy
refused "header.npy: found a damaged .npy header" header.npy
refused "version.npy: found an unknown version of the .npy format" version.npy
refused "words.npy: found a damaged .npy header" words.npy
refused "huge.npy: ends after 0 of 99999999999999 rays" huge.npy
echo good

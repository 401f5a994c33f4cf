#!/usr/bin/env bash
# knurl compare: numbers, thresholds, maps, images that do not fit together.
. "$(dirname "$0")/lib.sh" "$@"

"$python" - <<'PY'
import struct
def pgm(name, rows, top=255):
    data = b"".join(bytes(row) for row in rows)
    open(name, "wb").write(b"P5\n%d %d\n%d\n" % (len(rows[0]), len(rows), top) + data)
a = [[10 * x + y for x in range(8)] for y in range(4)]
b = [row[:] for row in a]
b[2][5] += 51 # 0.2
pgm("a.pgm", a)
pgm("b.pgm", b)
pgm("narrow.pgm", [row[:7] for row in a])
open("c.ppm", "wb").write(b"P6\n8 4\n255\n" + bytes(96))
def pfm(name, values):
    open(name, "wb").write(b"Pf\n2 2\n-1\n" + struct.pack("<4f", *values))
pfm("finite.pfm", [0, 1, 2, 3])
pfm("infinite.pfm", [0, 1, 2, float("inf")])
PY

expect 0 "$knurl" compare a.pgm a.pgm --max-rmse 0 --max-abs 0 --max-relmse 0 --min-psnr 1000
expect_text stdout.txt "psnr       inf dB"
expect 0 "$knurl" compare a.pgm b.pgm
expect_text stdout.txt "at pixel 5,2"
expect 0 "$knurl" compare a.pgm b.pgm --json
"$python" - <<'PY'
import json, math
found = json.load(open("stdout.txt"))
rmse = math.sqrt(0.2 ** 2 / 32)
assert list(found) == ["rmse", "relmse", "psnr", "max_abs", "worst_pixel", "not_finite", "holds"], found
assert abs(found["rmse"] - rmse) < 1e-6 and abs(found["max_abs"] - 0.2) < 1e-6, found
assert abs(found["psnr"] + 20 * math.log10(rmse)) < 1e-4 and found["worst_pixel"] == [5, 2], found
PY

expect 0 "$knurl" compare a.pgm b.pgm --max-abs 0.21 --max-rmse 0.04 --min-psnr 28
expect_error 1 "--max-abs: found 0.2" "$knurl" compare a.pgm b.pgm --max-abs 0.19
expect_text stderr.txt ", expected at most 0.19"
expect_error 1 "--max-rmse: found 0.0353553" "$knurl" compare a.pgm b.pgm --max-rmse 0.035
expect_error 1 "--min-psnr: found 29.03" "$knurl" compare a.pgm b.pgm --min-psnr 30
expect_error 1 "--max-relmse: found" "$knurl" compare a.pgm b.pgm --max-relmse 1e-9
expect_error 1 "sizes differ: a.pgm is 8 x 4, narrow.pgm is 7 x 4" "$knurl" compare a.pgm narrow.pgm
expect_error 1 "channels differ: a.pgm has 1, c.ppm has 3" "$knurl" compare a.pgm c.ppm
expect_error 1 "1 samples are not finite in one image only" "$knurl" compare finite.pfm infinite.pfm --max-abs 10
expect_error 3 "nothing.png" "$knurl" compare a.pgm nothing.png

# The map is black but for the one pixel, which is white.
expect 0 "$knurl" compare a.pgm b.pgm --map map.ppm
"$python" - <<'PY'
data = open("map.ppm", "rb").read()
assert data.startswith(b"P6\n8 4\n255\n"), data[:20]
pixels = data[-96:]
place = 3 * (2 * 8 + 5)
assert pixels[place:place + 3] == b"\xff\xff\xff" and not any(pixels[:place]) and not any(pixels[place + 3:])
PY
expect 0 "$knurl" compare a.pgm b.pgm --map map.png
expect 0 "$knurl" compare a.pgm b.pgm --map map.exr
expect 0 "$knurl" info --json map.exr
"$python" -c 'import json; i = json.load(open("stdout.txt")); assert abs(i["channel_ranges"][0]["max"] - 0.2) < 1e-6, i'
expect 3 "$knurl" compare a.pgm b.pgm --map nowhere/map.png
echo good

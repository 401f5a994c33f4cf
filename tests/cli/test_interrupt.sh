#!/usr/bin/env bash
# Ctrl-C (and SIGTERM) save what was finished and end with status 130.
. "$(dirname "$0")/lib.sh" "$@"
write_plane
write_map

# interrupted SIGNAL LOG-PATTERN COMMAND...: starts it, signals once the log shows progress, wants 130.
interrupted() {
    local signal=$1 pattern=$2 found=0
    shift 2
    : >log.txt # not the one of the run before
    # A background job of a script ignores SIGINT unless it is told otherwise.
    "$python" -c 'import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])' "$@" >stdout.txt 2>log.txt &
    local process=$!
    for _ in $(seq 1 600); do
        grep -qE "$pattern" log.txt && break
        kill -0 $process 2>/dev/null || { cat log.txt >&2; fail "ended before the signal"; }
        sleep 0.1
    done
    sleep 1 # so that something is finished
    kill -"$signal" $process
    wait $process || found=$?
    [ $found -eq 130 ] || { cat log.txt >&2; fail "status $found after SIG$signal, expected 130"; }
}

endless="--width 64 --height 64 --spp 500000 --disp map.pgm --disp-factor 0.2"
for signal in INT TERM; do
    mkdir $signal
    interrupted $signal 'built in' "$knurl" render plane.obj -o $signal/a.png --stats $signal/a.json $endless --verbose
    expect_text log.txt "interrupted; $signal/a.png holds what was finished"
    [ "$(ls $signal | tr '\n' ' ')" = "a.json a.png " ] || fail "files: $(ls $signal)"
    expect 0 "$knurl" info --json $signal/a.png
    "$python" - $signal <<'PY'
import json, sys
stats = json.load(open(sys.argv[1] + "/a.json"))
assert stats["interrupted"] is True and stats["samples_done"] < stats["samples"] == 500000, stats
image = json.load(open("stdout.txt"))
assert image["width"] == 64 and image["height"] == 64
PY
done

# Rays: what was traced is there in whole lines, and no more.
"$python" - <<'PY'
import numpy as np
random = np.random.default_rng(3)
n = 4000000
rays = np.zeros((n, 6))
rays[:, :3] = random.uniform(-1, 1, (n, 3))
rays[:, 3:] = random.uniform(-1, 1, (n, 3)) + 1e-3
np.save("rays.npy", rays)
PY
for out in hits.csv hits.npy; do
    interrupted INT '^trace: ' "$knurl" trace plane.obj --disp map.pgm --disp-factor 0.2 --tile 50x50 --rays rays.npy --out $out
    expect_text log.txt "interrupted; the first"
done
"$python" - <<'PY'
import re
import numpy as np
hits = np.load("hits.npy")
assert 0 < len(hits) < 4000000 and hits.shape[1] == 16, hits.shape
said = int(re.search(r"the first (\d+) rays", open("log.txt").read()).group(1))
assert said == len(hits), (said, hits.shape)
lines = open("hits.csv").read().split("\n")
assert lines[-1] == "" and 2 < len(lines) < 4000000
assert all(line.count(",") == 15 for line in lines[:-1])
for line, hit in zip(lines[1:1000], hits):
    assert line.startswith("1," if hit[0] == 1 else "0,")
PY
rm -f rays.npy hits.csv hits.npy
echo good

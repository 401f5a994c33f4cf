"""Baboud and Decoret 2006, Table 1 and Figure 12; Kolb and Rezk-Salama 2005, Tables 1 to 3."""
import json
import math
import os

import chart
from common import SPEED, Result, find, number, value

# Frames per second on a GeForce 6800GT, about 800 x 600 pixels at 45 degrees: exact, robust, binary, per size.
BABOUD = {
    "terrain": {32: (115, 116, 109), 64: (87, 105, 109), 128: (58, 97, 110), 256: (36, 96, 108)},
    "grid": {32: (102, 110, 110), 64: (72, 93, 109), 128: (46, 79, 109), 256: (27, 73, 108)},
}
WALK, ROBUST, BINARY = "texel-walk", "robust-binary", "binary"


def mrays(rows, method, rays="primary", threads=1):
    return value(find(rows, method, rays, threads), SPEED)


def baboud_table_1(session):
    result = Result(session, "baboud-table-1", "Baboud and Decoret, Table 1: exact, robust and binary search")
    methods = [WALK, ROBUST, BINARY, "tessellation", "rmip"]
    table, series = [], []
    for field in BABOUD:
        speeds = {m: [] for m in methods}
        for texels, paper in BABOUD[field].items():
            path = result.scene("%s-%d" % (field, texels))
            rows = result.bench(path, methods, rays="primary", frame=False, label="%s-%d" % (field, texels)) if path else []
            if not rows:
                continue
            found = [mrays(rows, m) for m in methods]
            for m, speed in zip(methods, found):
                speeds[m].append((texels, speed))
            wrong = ["%s / %s" % (number(value(find(rows, m, "primary", 1), "missed")),
                                  number(value(find(rows, m, "primary", 1), "dt_p99"))) for m in methods[:3]]
            table.append(["%s %d" % (field, texels), *(number(f) for f in found), *wrong,
                          *("%.2f" % (p / paper[2]) for p in paper[:2]), *("%.2f" % (f / found[2]) for f in found[:2])])
        series += [("%s, %s" % (field, m), speeds[m]) for m in methods[:3]]
    result.text("Mrays/s of primary rays on one thread (processor time), at 45 degrees; then rays missed of %d / 99th percentile of |dt| in "
                "diagonals of the scene. The last columns are speeds relative to binary search, theirs (GeForce 6800GT) and "
                "ours. Theirs for the mesh: 800 Hz against 27 to 116 Hz. Car, camera and van of the paper are models "
                "that are not public." % session.limits["count"])
    result.table(["height field", "exact", "robust", "binary", "tessellated", "rmip", "exact: missed / dt",
                  "robust: missed / dt", "binary: missed / dt", "theirs: exact", "robust", "ours: exact", "robust"], table)
    if table:
        result.figure("baboud-table-1", chart.lines("Speed against resolution", "texels per side", "Mrays/s", series, log_x=True),
                      "Speed against resolution")
    result.save()


def baboud_figure_12(session):
    result = Result(session, "baboud-figure-12", "Baboud and Decoret, Figure 12: allowed error of the safety radius")
    allowances = {3: [0, 0.02, 0.1]}.get(session.limits["points"], [0, 0.004, 0.016, 0.064, 0.25])
    methods = ["robust-binary:allowance=%g" % a for a in allowances]
    for field in ("terrain-256", "grid-256"):
        path = result.scene(field)
        rows = result.bench(path, methods, rays="primary,grazing", frame=False, label=field) if path else []
        if not rows:
            continue
        result.text("### `%s`" % field)
        table = []
        for method, allowance in zip(methods, allowances):
            cells = ["%g" % allowance]
            for rays in ("primary", "grazing"):
                row = find(rows, method, rays, 1)
                cells += [number(value(row, key)) for key in (SPEED, "steps_mean", "missed", "false", "dt_p99")]
            table.append(cells)
        result.table(["allowance", "primary: Mrays/s", "steps", "missed", "false", "dt p99",
                      "grazing: Mrays/s", "steps", "missed", "false", "dt p99"], table)
        series = [("%s, steps" % rays, [(i, value(find(rows, m, rays, 1), "steps_mean")) for i, m in enumerate(methods)])
                  for rays in ("primary", "grazing")]
        series += [("%s, wrong per 1000" % rays, [(i, wrong_per_thousand(find(rows, m, rays, 1)))
                                                for i, m in enumerate(methods)]) for rays in ("primary", "grazing")]
        result.figure("baboud-figure-12-" + field, chart.lines(
            "%s: allowance %s" % (field, ", ".join("%g" % a for a in allowances)), "allowance, from the list above",
            "steps; wrong rays per 1000", series), "Steps and errors against allowance")
    result.text("The allowance is a depth, as a part of the map's range, that may be passed unseen. Larger safety radii "
                "mean fewer steps, and more wrong hits at silhouettes.")
    result.save()


def wrong_per_thousand(row):
    return 1000 * (value(row, "missed") + value(row, "false")) / row["count"] if row else math.nan


# ---- Kolb and Rezk-Salama ----

def with_cameras(path, cameras):
    """A copy of a glTF scene beside it with only these cameras: (name, degrees from the vertical, distance)."""
    with open(path) as file:
        scene = json.load(file)
    for node in scene["nodes"]:
        node.pop("camera", None)
    scene["cameras"] = []
    root = scene["scenes"][scene.get("scene", 0)]["nodes"]
    for name, degrees, distance in cameras:
        angle = math.radians(degrees)
        back = (0.0, math.cos(angle), math.sin(angle))
        up = (0.0, math.sin(angle), -math.cos(angle))
        matrix = [1, 0, 0, 0, *up, 0, *back, 0, *(distance * b for b in back), 1]
        scene["cameras"].append({"name": name, "type": "perspective",
                                 "perspective": {"yfov": math.radians(32), "aspectRatio": 16 / 9, "znear": 0.01}})
        root.append(len(scene["nodes"]))
        scene["nodes"].append({"name": name, "camera": len(scene["cameras"]) - 1, "matrix": matrix})
    changed = path.replace(".gltf", "-views.gltf")
    with open(changed, "w") as file:
        json.dump(scene, file)
    return changed


SKIPS = (0, 1, 2)
PER_SKIP = ["empty-skip:samples=75:skips=%d" % s for s in SKIPS]
# Frames per second: 0, 1 and 2 skips. The angel is not public; its numbers are beside our spikes.
TABLE_1 = {"simple": ("15 / 20 / 20", "57 / 59 / 55"), "spikes": ("10 / 20 / 15", "30 / 30 / 30")}
TABLE_2 = {0: (15, 20, 20), 15: (15, 20, 20), 30: (15, 20, 20), 45: (15, 20, 20), 60: (20, 30, 30), 75: (30, 30, 30)}
TABLE_3 = [(10, 0, 0, 30.0), (10, 2, 0, 30.0), (40, 2, 0, 15.0), (40, 2, 1, 19.6), (40, 2, 2, 19.9), (75, 2, 0, 10.0),
           (75, 2, 1, 12.0), (75, 2, 2, 15.0)]


def measure_view(result, path, methods, view):
    return result.bench(path, methods, rays="primary", frame=False, label="%s, %s" % (os.path.basename(path), view),
                        extra=["--camera", view])


def kolb(session):
    result = Result(session, "kolb-tables", "Kolb and Rezk-Salama, Tables 1 to 3: empty space skipping")
    angles = list(TABLE_2)
    cameras = [("angle-%d" % a, a, 4.4) for a in angles] + [("tangential", 80, 4.4), ("close", 45, 1.3)]
    paths = {}
    for name in ("simple", "spikes"):
        path = result.scene("relief-" + name)
        if path:
            paths[name] = with_cameras(path, cameras)
    head = ["Mrays/s", "0 skips", "1 skip", "2 skips", "steps: 0", "1", "2", "missed + false: 0", "1", "2", "theirs, fps"]

    def skip_row(label, rows, theirs):
        found = [find(rows, m, "primary", 1) for m in PER_SKIP]
        return [label, *(number(value(r, SPEED)) for r in found),
                *(number(value(r, "steps_mean")) for r in found),
                *(number(value(r, "missed") + value(r, "false")) for r in found), theirs]

    result.text("Mrays/s of primary rays on one thread (processor time), 75 samples per unit of length, 2 bisections.", "### Table 1")
    table = []
    for name, path in paths.items():
        for view, label, i in (("angle-0", "perpendicular", 0), ("tangential", "tangential", 1)):
            table.append(skip_row("%s, %s" % (name, label), measure_view(result, path, PER_SKIP, view), TABLE_1[name][i]))
    result.table(head, table)
    result.text("### Table 2", "By the angle between view and surface normal. Theirs is the angel, which is not public; "
                "ours are the spikes.")
    if "spikes" in paths:
        table, series = [], [("%d skips" % s, []) for s in SKIPS]
        for angle in angles:
            rows = measure_view(result, paths["spikes"], PER_SKIP, "angle-%d" % angle)
            table.append(skip_row("%d degrees" % angle, rows, " / ".join(map(str, TABLE_2[angle]))))
            for (_, points), method in zip(series, PER_SKIP):
                points.append((angle, mrays(rows, method)))
        result.table(head, table)
        result.figure("kolb-table-2", chart.lines("spikes: speed against angle", "degrees", "Mrays/s", series),
                      "Speed against viewing angle")
        result.text("### Table 3", "Close-up of the spikes (theirs: of the angel). Wrong is missed + false of %d rays; "
                    "|dt| in diagonals of the scene." % session.limits["count"])
        methods = ["empty-skip:samples=%d:bisections=%d:skips=%d" % row[:3] for row in TABLE_3]
        rows = measure_view(result, paths["spikes"], methods + ["rmip"], "close")
        table = []
        for (samples, bisections, skips, fps), method in zip(TABLE_3, methods):
            row = find(rows, method, "primary", 1)
            table.append([str(samples), str(bisections), str(skips), number(value(row, SPEED)),
                          number(value(row, "steps_mean")), number(value(row, "missed") + value(row, "false")),
                          number(value(row, "dt_median")), number(value(row, "dt_p99")), "%.1f" % fps])
        exact = find(rows, "rmip", "primary", 1)
        table.append(["rmip", "", "", number(value(exact, SPEED)), number(value(exact, "steps_mean")),
                      number(value(exact, "missed") + value(exact, "false")), number(value(exact, "dt_median")),
                      number(value(exact, "dt_p99")), ""])
        result.table(["samples", "bisections", "skips", "Mrays/s", "steps", "wrong", "dt median", "dt p99", "theirs, fps"],
                     table)
    result.save()


RESULTS = {"baboud-table-1": baboud_table_1, "baboud-figure-12": baboud_figure_12, "kolb-tables": kolb}

"""The method `fast` against Embree on the same surface cut into triangles or grids, and against rmip and tfdm."""
import math
import os
import subprocess

import chart
from common import SPEED, Result, geometric_mean, number, size, times, value

TABLE_1 = ["alien-sphere", "wicker-basket", "creature", "diving-helmet", "medieval-helmet", "elven-armor",
           "ninja-head", "terracotta-roof", "desert-tire", "rough-glass"]
RAYS = ["primary", "grazing", "diffuse", "diffuse-shuffled", "occlusion", "inside", "inside-shuffled"]
TRIANGLES, GRIDS = "tessellation", "tessellation:primitive=grids"
# Secondary rays start this far off the surface, in diagonals of the scene: from the exact surface itself, a third
# of them would start behind a facet and end there at once. For maps of 1k and more; smaller ones need more.
LIFT = 3e-4
MOST_RAYS = 20000  # of a set, unless two threads share them: there are many sets, scenes and methods
MEMORY_BOUND = 5e9  # bytes, for one method on one scene at the default level: twice what other pages may take
# Of the tessellated size that `knurl info` estimates for triangles: with rows of the facets' own numbers, and
# grids, as measured.
ESTIMATE = {TRIANGLES: 1.05, GRIDS: 0.25}


class Page(Result):
    """Says once for a scene, not for each method, that it has no inside."""
    label = ""

    def skip(self, text):
        if "the scene is not closed" in text:
            text = "%s: rays from inside, as the surface is not closed" % self.label
        super().skip(text)


class Scene:
    """A scene file with a tiling, and what the bench said of it."""

    def __init__(self, label, path, tile=1):
        self.label, self.path, self.tile, self.rows = label, path, tile, []

    def row(self, method, rays, calls, threads=1):
        for row in self.rows:
            if (row["method"], row["rays"], row["calls"], row["threads"]) == (method, rays, calls, threads) and \
                    not row["error"]:
                return row
        return None

    def speed(self, method, rays, calls, threads=1, key=SPEED):
        return value(self.row(method, rays, calls, threads), key)

    def best(self, method, rays):
        """Of single calls and batches, which for facets are packets and streams."""
        found = [x for x in (self.speed(method, rays, c) for c in ("single", "batch")) if not math.isnan(x)]
        return max(found) if found else math.nan

    def any_row(self, method):
        return next((r for r in self.rows if r["method"] == method and r["bytes"]), None)


def reduction(session):
    """How much smaller maps are at this level than at full size."""
    longest = session.limits["map_size"]
    return 1 if not longest else max(1, 4096 // longest)


def map_sizes(session):
    """Stands for maps of 1k, 2k, 4k and 8k."""
    return [n // reduction(session) for n in (1024, 2048, 4096, 8192)]


def sized_scene(result, name, texels):
    """A demo scene with height maps of that size; None, and a line on the page, if it cannot be written."""
    session = result.session
    folder = os.path.join(session.scenes, "texels-%d" % texels)
    path = os.path.join(folder, name, name + ".gltf")
    if os.path.exists(path) and os.path.getmtime(path) >= os.path.getmtime(session.knurl):
        return path
    done = subprocess.run([session.knurl, "demo", name, folder, "-q", "--size", str(texels)], capture_output=True,
                          text=True)
    if done.returncode == 0 and os.path.exists(path):
        return path
    result.skip("scene `%s` with %d texels: %s" % (name, texels, done.stderr.strip().split("\n")[0]))
    return None


def memory_limit(session):
    units = {"K": 2**10, "M": 2**20, "G": 2**30}
    text = session.limits["memory"]
    limit = int(text[:-1]) * units[text[-1]]
    return limit if limit < 2**30 else max(MEMORY_BOUND, limit)


def fitting(result, scene, methods):
    """Those of the methods whose facets fit in memory, as far as can be told before."""
    info, kept = result.session.info(scene.path), []
    for method in methods:
        if method in ESTIMATE and info:
            need = info["tessellated_bytes"] * scene.tile ** 2 * ESTIMATE[method]
            if need > memory_limit(result.session):
                result.skip("%s: `%s` would take about %s, over the bound of %s" %
                            (scene.label, method, size(need), size(memory_limit(result.session))))
                continue
        kept.append(method)
    return kept


def run(result, scene, methods, threads=1, count=None):
    result.label = scene.label
    kept = fitting(result, scene, methods)
    extra = ["--displaced-only", "--calls", "both", "--threads", threads, "--tile-scale", scene.tile, "--lift", LIFT * reduction(result.session),
             "--memory-limit", int(memory_limit(result.session))]
    count = count or min(MOST_RAYS, result.session.limits["count"])
    scene.rows = result.bench(scene.path, kept, rays=",".join(RAYS), frame=False, count=count, extra=extra,
                              label=scene.label)
    return scene


# ---- ratios ----

RATIOS = {
    "single / triangles single": lambda s, m, r: s.speed(m, r, "single") / s.speed(TRIANGLES, r, "single"),
    "batch / triangles' best": lambda s, m, r: s.speed(m, r, "batch") / s.best(TRIANGLES, r),
    "single / grids single": lambda s, m, r: s.speed(m, r, "single") / s.speed(GRIDS, r, "single"),
    "batch / grids' best": lambda s, m, r: s.speed(m, r, "batch") / s.best(GRIDS, r),
    "single / rmip": lambda s, m, r: s.speed(m, r, "single") / s.speed("rmip", r, "single"),
    "single / tfdm": lambda s, m, r: s.speed(m, r, "single") / s.speed("tfdm", r, "single"),
}


def collect(scenes, method, name):
    """[(ratio, where)] over scenes and ray sets."""
    found = [(RATIOS[name](s, method, r), "%s, %s" % (s.label, r)) for s in scenes for r in RAYS]
    return [item for item in found if not math.isnan(item[0])]


def facet_bytes(row):
    """Vertices, facets and hierarchy: a tessellated surface needs no map any more."""
    return row["bytes"]["shells"] + row["bytes"]["bvh"] if row else math.nan


def total_bytes(row):
    return row["bytes"]["total"] if row else math.nan


def compare_sizes(scenes, method, facets):
    found = [(facet_bytes(s.any_row(facets)) / total_bytes(s.any_row(method)), s.label) for s in scenes]
    return [item for item in found if not math.isnan(item[0])]


def compare_builds(scenes, method):
    found = [(value(s.any_row(TRIANGLES), "build_ms") / value(s.any_row(method), "build_ms"), s.label)
             for s in scenes]
    return [item for item in found if not math.isnan(item[0])]


class Aims:
    """Lines of the first table: what was aimed at, and what was reached."""

    def __init__(self):
        self.lines = []

    def add(self, text, found, mean=None, each=None, fewer=False):
        """`found`: [(ratio, where)]; aims for their geometric mean and for each of them, at least (or at most,
        if `fewer` is better)."""
        values = [x for x, _ in found]
        assert all(x > 0 for x in values), text
        middle = geometric_mean(values)
        worst = (max if fewer else min)(found, default=(math.nan, "-"))
        sign = "at most" if fewer else "at least"
        verdicts = []
        for aim, reached in ((mean, middle), (each, worst[0])):
            if aim is not None and not math.isnan(reached):
                verdicts.append((reached <= aim) if fewer else (reached >= aim))
        aims = [("mean %s %s" % (sign, number(float(mean)))) if mean is not None else "",
                ("each %s %s" % (sign, number(float(each)))) if each is not None else ""]
        verdict = "not measured" if not verdicts else "reached" if all(verdicts) else "missed"
        self.lines.append([text, "; ".join(a for a in aims if a), number(middle), number(worst[0]),
                           worst[1], str(len(values)), verdict])


# ---- the parts of the page ----

def speed_table(result, scenes, method):
    head = ["scene", "rays", method, "batch", "triangles", "batch", "grids", "batch", "rmip", "tfdm",
            *("%s" % name for name in list(RATIOS)[:4])]
    table = []
    for s in scenes:
        for rays in RAYS:
            if not s.row(method, rays, "single"):
                continue
            row = [s.label, rays]
            for m in (method, TRIANGLES, GRIDS):
                row += [number(s.speed(m, rays, c)) for c in ("single", "batch")]
            row += [number(s.speed(m, rays, "single")) for m in ("rmip", "tfdm")]
            row += [times(RATIOS[name](s, method, rays)) for name in list(RATIOS)[:4]]
            table.append(row)
    result.table(head, table, left=2)


def means_table(result, scenes, method):
    table = []
    for rays in RAYS:
        row = [rays]
        for name in RATIOS:
            found = [x for x, where in collect(scenes, method, name) if where.endswith(", " + rays)]
            row.append(times(geometric_mean(found)))
        table.append(row)
    result.table(["rays", *RATIOS], table)


def false_share(scenes):
    """The largest share of secondary rays that meet a triangle where the exact surface has nothing."""
    found = [(row["false"] / row["count"], "%s, %s" % (s.label, row["rays"])) for s in scenes for row in s.rows
             if row["method"] == TRIANGLES and row["false"] is not None]
    return max(found, default=(math.nan, "-"))


def size_table(result, scenes, method):
    table = []
    for s in scenes:
        own, triangles, grids = (s.any_row(m) for m in (method, TRIANGLES, GRIDS))
        table.append([s.label, size(total_bytes(own)), size(facet_bytes(triangles)), size(facet_bytes(grids)),
                      times(facet_bytes(triangles) / total_bytes(own)), times(facet_bytes(grids) / total_bytes(own)),
                      *(number(value(row, "build_ms")) for row in (own, triangles, grids)),
                      times(value(triangles, "build_ms") / value(own, "build_ms"))])
    result.table(["scene", method, "triangles", "grids", "triangles / " + method, "grids / " + method,
                  method + ": build ms", "triangles", "grids", "triangles / " + method], table)


def growth(result, method, first, second):
    """[(time ratio, where)] of the same rays' cost on two scenes, single calls and batches."""
    found = []
    for rays in RAYS:
        for calls in ("single", "batch"):
            ratio = first.speed(method, rays, calls) / second.speed(method, rays, calls)
            if not math.isnan(ratio):
                found.append((ratio, "%s, %s, %s" % (second.label, rays, calls)))
    return found


def measure_growth(result, method, names, sizes):
    """Larger maps at the same view, and tiling."""
    grown, tiled = [], []
    for name in names:
        small, large = (sized_scene(result, name, n) for n in (sizes[0], sizes[3]))
        if not small or not large:
            continue
        base = run(result, Scene("%s %d" % (name, sizes[0]), small), [method])
        grown += growth(result, method, base, run(result, Scene("%s %d" % (name, sizes[3]), large), [method]))
        tiled += growth(result, method, base,
                        run(result, Scene("%s %d, 25 x 25" % (name, sizes[0]), small, 25), [method]))
    return grown, tiled


def measure_threads(result, method, names, sizes):
    found = []
    for name in names:
        path = sized_scene(result, name, sizes[1])
        if not path:
            continue
        s = run(result, Scene("%s %d, two threads" % (name, sizes[1]), path), [method], threads=2,
                count=max(100000, result.session.limits["count"]))
        for rays in RAYS:
            for calls in ("single", "batch"):
                ratio = (s.speed(method, rays, calls, 2, "mrays_median") /
                         s.speed(method, rays, calls, 1, "mrays_median"))
                if not math.isnan(ratio):
                    found.append((ratio, "%s, %s, %s" % (s.label, rays, calls)))
    return found


def measure_scenes(result, methods, names, sizes):
    """One tile (the demo scenes of Table 1 with their own tiling), and 8 x 8 tiles."""
    one, many = [], []
    for name in TABLE_1:
        path = result.scene(name)
        if path:
            one.append(run(result, Scene(name, path), methods))
    for name in names:
        for n in sizes[:3]:
            path = sized_scene(result, name, n)
            if path:
                one.append(run(result, Scene("%s %d" % (name, n), path), methods))
                many.append(run(result, Scene("%s %d, 8 x 8" % (name, n), path, 8), methods))
    return [s for s in one if s.rows], [s for s in many if s.rows]


def fill_aims(aims, method, one, many, grown, tiled, threads):
    scenes = one + many
    plain = [s for s in one if s.label not in TABLE_1]
    aims.add("single calls / Embree triangles, single", collect(scenes, method, "single / triangles single"), 1.0, 0.8)
    aims.add("batches / Embree triangles, the better of single and packets",
             collect(scenes, method, "batch / triangles' best"), 1.5)
    aims.add("single calls / Embree grids, single", collect(scenes, method, "single / grids single"), each=1.0)
    aims.add("batches / Embree grids, the better of single and packets",
             collect(scenes, method, "batch / grids' best"), each=1.0)
    aims.add("bytes: triangles / ours, one tile", compare_sizes(plain, method, TRIANGLES), 25)
    aims.add("bytes: grids / ours, one tile", compare_sizes(plain, method, GRIDS), 4)
    aims.add("bytes: triangles / ours, 8 x 8 tiles", compare_sizes(many, method, TRIANGLES), 100)
    aims.add("bytes: grids / ours, 8 x 8 tiles", compare_sizes(many, method, GRIDS), 20)
    aims.add("build time: triangles / ours", compare_builds(scenes, method), 20)
    aims.add("single calls / rmip", collect(scenes, method, "single / rmip"), 2.0, 1.0)
    aims.add("single calls / tfdm", collect(scenes, method, "single / tfdm"), 8.0)
    aims.add("time per ray, map 8 times as wide / as it was, same view", grown, 1.4, fewer=True)
    aims.add("time per ray, 25 x 25 tiles / one", tiled, 2.0, fewer=True)
    aims.add("speed, two threads / one", threads, 1.8)


def page(session):
    result = Page(session, "fast", "The method `fast` against Embree, RMIP and TFDM")
    method = "fast" if "fast" in session.methods else "rmip"
    names, sizes = ["sphere", "plane"], map_sizes(session)
    if method != "fast":
        result.skip("method `fast` is not in this build; `%s` stands in for it" % method)
    methods = list(dict.fromkeys([method, TRIANGLES, GRIDS, "rmip", "tfdm"]))
    one, many = measure_scenes(result, methods, names, sizes)
    grown, tiled = measure_growth(result, method, names, sizes)
    threads = measure_threads(result, method, names, sizes)
    aims = Aims()
    fill_aims(aims, method, one, many, grown, tiled, threads)
    if method != "fast":
        result.text("**This build has no method `fast`: `%s` stands in for it in all that follows.**" % method)
    result.text("Aims and what was reached. The figures are ratios over all scenes and ray sets below; *mean* is the "
                "geometric one. Scenes hold their displaced surfaces only (`--displaced-only`): floors and stands cost "
                "every method the same. Of each set %d rays are traced on this page, %d where two threads share them, and a "
                "method may take %s on a scene." %
                (min(MOST_RAYS, session.limits["count"]), max(100000, session.limits["count"]),
                 size(memory_limit(session))))
    result.table(["figure", "aim", "mean", "worst", "where", "of", ""], aims.lines, left=2)
    result.text("Million rays per second of processor time on one core, medians of rounds in which all methods and kinds "
                "of calls take turns. *single* is a call for each ray; *batch* is `knurl_scene_intersect_batch`, which "
                "for triangles and grids means Embree's packets of 16 where neighbouring rays are alike, streams for any "
                "hits, and single calls for the rest: whichever was measured to be fastest. Every method gives the same "
                "full hit (position, normals, texture coordinates, height); Embree alone, asked for a distance and "
                "nothing else, is faster than these columns show. `inside` is measured where the surface is closed.",
                "Secondary rays start %g diagonals of the scene off the exact surface. Without that, up to a third of "
                "them start behind a facet and meet it at once, which makes tessellation look fast; with it, at most %.1f %% "
                "do (%s)." % (LIFT * reduction(session), 100 * false_share(one + many)[0], false_share(one + many)[1]),
                "## Means by ray set")
    means_table(result, one + many, method)
    scenes = one + many
    if scenes:
        names_list = [s.label for s in scenes]
        series = [[geometric_mean([RATIOS[name](s, method, r) for r in RAYS
                                   if not math.isnan(RATIOS[name](s, method, r))]) for s in scenes]
                  for name in list(RATIOS)[:2]]
        series = [[0 if math.isnan(x) else x for x in row] for row in series]
        result.figure("fast", chart.bars("Speed over Embree triangles (0: not measured)", "ratio", names_list,
                                         list(RATIOS)[:2], series), "Speed over Embree triangles, mean per scene")
    result.text("## Memory and build time",
                "Ours counts mesh, map with everything built on it, and the method's own data; triangles and grids count "
                "vertices, facets and hierarchy only. Building is on one thread.")
    size_table(result, scenes, method)
    result.text("## Every scene and ray set")
    speed_table(result, scenes, method)
    result.save()


RESULTS = {"fast": page}

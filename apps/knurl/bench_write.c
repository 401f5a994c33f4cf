/* bench_write.c: results as a table, as JSON and as CSV. */
#include "bench.h"
#include "json_file.h"
#include "output.h"

#include <math.h>
#include <string.h>

FILE *bench_table_stream(const bench_options *options)
{
    bool taken = (options->json && strcmp(options->json, "-") == 0) ||
                 (options->csv && strcmp(options->csv, "-") == 0);
    return taken ? stderr : stdout;
}

/* ---- table ---- */

/* A number in `width` columns with about three digits; a dash if it does not exist. */
static void print_number(FILE *out, int width, double value)
{
    double size = fabs(value);
    int decimals = size >= 100 || value == floor(value) ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
    if (isnan(value))
        fprintf(out, " %*s", width, "-");
    else if (value == 0 || (size >= 0.01 && size < 1e7))
        fprintf(out, " %*.*f", width, decimals, value);
    else
        fprintf(out, " %*.1e", width, value);
}

void bench_table_scene(FILE *out, const char *scene, const subject *rays_from)
{
    fprintf(out, "\n%s, rays from the surface of %s\n\n%10s %10s %10s %10s %10s  method (compared with)\n",
            scene, rays_from->method, "build ms", "maps", "shells", "bvh", "total");
}

void bench_table_subject(FILE *out, const subject *s, const char *reference)
{
    if (s->failure[0]) {
        fprintf(out, "%10s %10s %10s %10s %10s  %s: %s\n", "-", "-", "-", "-", "-", s->method, s->failure);
        return;
    }
    const knurl_scene_memory *m = &s->memory;
    char maps[32], shells[32], bvh[32], total[32];
    fprintf(out, "%10.1f %10s %10s %10s %10s  %s (%s)\n", s->build_ms, format_bytes(maps, (double)m->maps),
            format_bytes(shells, (double)m->shells), format_bytes(bvh, (double)m->bvh),
            format_bytes(total, (double)(m->mesh + m->shells + m->maps + m->bvh)), s->method, reference);
}

void bench_table_rows(FILE *out, const bench_row *rows, size_t count, bool heading)
{
    if (heading)
        fprintf(out, "\n%-16s %3s %-6s %8s %8s %8s %8s %7s %7s %7s %7s %7s %8s %8s  %s\n", "rays", "thr",
                "calls", "Mrays/s", "min", "max", "frame ms", "steps", "p99", "max", "missed", "false",
                "dt med", "dt p99", "method");
    for (size_t i = 0; i < count; i++) {
        const bench_row *row = &rows[i];
        fprintf(out, "%-16s %3d %-6s", row->rays, row->threads, row->calls ? row->calls : "");
        if (row->failure[0]) {
            bool built = row->has_memory; /* else the table of scenes has said why */
            fprintf(out, " %s: %s\n", row->method, built ? row->failure : "not built, see above");
            continue;
        }
        print_number(out, 8, row->mrays.median);
        print_number(out, 8, row->mrays.lowest);
        print_number(out, 8, row->mrays.highest);
        print_number(out, 8, row->frame_ms);
        print_number(out, 7, row->steps.mean);
        print_number(out, 7, row->steps.p99);
        print_number(out, 7, row->steps.highest);
        print_number(out, 7, row->missed);
        print_number(out, 7, row->invented);
        print_number(out, 8, row->dt_median);
        print_number(out, 8, row->dt_p99);
        fprintf(out, "  %s\n", row->method);
    }
    fflush(out);
}

/* ---- bytes ---- */

enum { STRUCTURES = 9 };
static const char *const structure_names[STRUCTURES] = {
    "mesh", "shells", "bvh", "map_samples", "map_levels", "map_minmax", "map_rmip", "map_blocks", "total"};

static void list_bytes(const knurl_scene_memory *memory, uint64_t bytes[STRUCTURES])
{
    const knurl_heightmap_bytes *map = &memory->map_parts;
    const uint64_t list[STRUCTURES] = {
        memory->mesh, memory->shells, memory->bvh,
        map->samples, map->levels,    map->minmax,
        map->rmip,    map->blocks,    memory->mesh + memory->shells + memory->bvh + memory->maps};
    memcpy(bytes, list, sizeof list);
}

/* ---- JSON ---- */

static json_t *describe_bytes(const bench_row *row)
{
    if (!row->has_memory) return json_null();
    uint64_t bytes[STRUCTURES];
    list_bytes(&row->memory, bytes);
    json_t *object = json_object();
    for (int i = 0; i < STRUCTURES; i++)
        json_object_set_new(object, structure_names[i], json_count(bytes[i]));
    return object;
}

static json_t *json_whole(double value)
{
    return isnan(value) ? json_null() : json_count((uint64_t)value);
}

static json_t *describe_row(const bench_row *row)
{
    return json_pack(
        "{s:o, s:s, s:s, s:i, s:s?, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, "
        "s:o, "
        "s:o, "
        "s:o}",
        "scene", json_text(row->scene), "method", row->method, "rays", row->rays, "threads", row->threads,
        "calls", row->calls, "count", json_count(row->count), "mrays_min", json_number(row->mrays.lowest),
        "mrays_median", json_number(row->mrays.median), "mrays_max", json_number(row->mrays.highest),
        "mrays_cpu_median", json_number(row->mrays_cpu), "frame_ms_median", json_number(row->frame_ms),
        "steps_mean", json_number(row->steps.mean), "steps_p99", json_whole(row->steps.p99), "steps_max",
        json_whole(row->steps.highest), "build_ms", json_number(row->build_ms), "bytes", describe_bytes(row),
        "missed", json_whole(row->missed), "false", json_whole(row->invented), "dt_median",
        json_number(row->dt_median), "dt_p99", json_number(row->dt_p99), "reference",
        row->reference[0] ? json_text(row->reference) : json_null(), "error",
        row->failure[0] ? json_text(row->failure) : json_null());
}

static json_t *describe_maps(const bench_results *results)
{
    json_t *list = json_array();
    for (size_t i = 0; i < results->map_count; i++) {
        const heat_map *map = &results->maps[i];
        json_array_append_new(list, json_pack("{s:o, s:o, s:s, s:i, s:i}", "file", json_text(map->file),
                                              "scene", json_text(map->scene), "method", map->method, "black",
                                              (int)map->lowest, "white", (int)map->highest));
    }
    return list;
}

static int save_json(command_session *session, const bench_options *options, const bench_results *results,
                     bool interrupted)
{
    json_t *rows = json_array();
    for (size_t i = 0; i < results->row_count; i++)
        json_array_append_new(rows, describe_row(&results->rows[i]));
    json_t *frame = options->frame_width ? json_pack("[i, i, i]", options->frame_width, options->frame_height,
                                                     options->frame_samples)
                                         : json_null();
    json_t *root = json_pack("{s:s, s:i, s:i, s:o, s:o, s:o, s:o, s:o, s:o, s:s, s:b, s:o, s:o}", "knurl",
                             KNURL_VERSION_STRING, "threads", (int)knurl_context_threads(session->context),
                             "rounds", options->rounds, "count", json_count(options->count), "seed",
                             json_count(options->seed), "lod", json_number(options->lod), "disp_scale",
                             json_number(options->disp_scale), "tile_scale", json_number(options->tile_scale),
                             "frame", frame, "dt_unit", "diagonal of the scene's bounds", "interrupted",
                             (int)interrupted, "heat_maps", describe_maps(results), "results", rows);
    return json_save(session, root, options->json);
}

/* ---- CSV ---- */

/* In quotes if it needs them (RFC 4180). */
static void write_text(FILE *file, const char *text)
{
    if (!text) return;
    if (!strpbrk(text, ",\"\r\n")) {
        fputs(text, file);
        return;
    }
    fputc('"', file);
    for (; *text; text++) {
        if (*text == '"') fputc('"', file);
        fputc(*text, file);
    }
    fputc('"', file);
}

/* With its comma in front; nothing if it does not exist. */
static void write_number(FILE *file, double value)
{
    fputc(',', file);
    if (isfinite(value)) fprintf(file, "%.9g", value);
}

static void write_row(FILE *file, const bench_row *row)
{
    write_text(file, row->scene);
    fputc(',', file);
    write_text(file, row->method);
    fprintf(file, ",%s,%d,%s,%zu", row->rays, row->threads, row->calls ? row->calls : "", row->count);
    const double numbers[] = {row->mrays.lowest, row->mrays.median,  row->mrays.highest,
                              row->mrays_cpu,    row->frame_ms,      row->steps.mean,
                              row->steps.p99,    row->steps.highest, row->build_ms};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) write_number(file, numbers[i]);
    uint64_t bytes[STRUCTURES];
    list_bytes(&row->memory, bytes);
    for (int i = 0; i < STRUCTURES; i++) {
        fputc(',', file);
        if (row->has_memory) fprintf(file, "%llu", (unsigned long long)bytes[i]);
    }
    const double differences[] = {row->missed, row->invented, row->dt_median, row->dt_p99};
    for (int i = 0; i < 4; i++) write_number(file, differences[i]);
    fputc(',', file);
    write_text(file, row->reference);
    fputc(',', file);
    write_text(file, row->failure);
    fputs("\r\n", file);
}

static int save_csv(command_session *session, const bench_options *options, const bench_results *results)
{
    output_file output;
    int code = output_open(session, &output, options->csv);
    if (code != CODE_DONE) return code;
    fputs("scene,method,rays,threads,calls,count,mrays_min,mrays_median,mrays_max,mrays_cpu_median,frame_ms_"
          "median,"
          "steps_mean,"
          "steps_p99,steps_max,build_ms",
          output.file);
    for (int i = 0; i < STRUCTURES; i++) fprintf(output.file, ",bytes_%s", structure_names[i]);
    fputs(",missed,false,dt_median,dt_p99,reference,error\r\n", output.file);
    for (size_t i = 0; i < results->row_count; i++) write_row(output.file, &results->rows[i]);
    return output_commit(session, &output);
}

int bench_results_save(command_session *session, const bench_options *options, const bench_results *results,
                       bool interrupted)
{
    int code = options->json ? save_json(session, options, results, interrupted) : CODE_DONE;
    int saved = options->csv ? save_csv(session, options, results) : CODE_DONE;
    return code != CODE_DONE ? code : saved;
}

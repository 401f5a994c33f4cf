/* bench.c: `knurl bench`, methods side by side. */
#include "bench.h"
#include "commands.h"

#include <math.h>
#include <stdlib.h>

bench_row *bench_results_add(bench_results *results)
{
    if (results->row_count == results->row_capacity) {
        size_t capacity = results->row_capacity ? 2 * results->row_capacity : 64;
        bench_row *rows = realloc(results->rows, capacity * sizeof *rows);
        if (!rows) return NULL;
        results->rows = rows;
        results->row_capacity = capacity;
    }
    bench_row *row = &results->rows[results->row_count++];
    *row = (bench_row){.mrays = {NAN, NAN, NAN},
                       .mrays_cpu = NAN,
                       .frame_ms = NAN,
                       .steps = {NAN, NAN, NAN},
                       .build_ms = NAN,
                       .missed = NAN,
                       .invented = NAN,
                       .dt_median = NAN,
                       .dt_p99 = NAN};
    return row;
}

void bench_results_free(bench_results *results)
{
    for (size_t i = 0; i < results->map_count; i++) free(results->maps[i].file);
    free(results->maps);
    free(results->rows);
}

static int check_outputs(command_session *session, const bench_options *options)
{
    int code = CODE_DONE;
    if (options->json) code = output_check(session, options->json);
    if (options->csv && code == CODE_DONE) code = output_check(session, options->csv);
    if (options->heat_map && code == CODE_DONE) code = output_check(session, options->heat_map);
    return code;
}

/* Whether there are rows, and each says why it holds nothing. */
static bool nothing_measured(const bench_results *results)
{
    for (size_t i = 0; i < results->row_count; i++)
        if (!results->rows[i].failure[0]) return false;
    return results->row_count > 0;
}

/* All scenes; what was finished before a failure is saved too. */
static int run(command_session *session, const bench_options *options)
{
    bench_results results = {0};
    int code = CODE_DONE;
    for (int i = 0; i < options->scene_count && code == CODE_DONE; i++)
        code = bench_scene(session, options, options->scenes[i], &results);
    progress_clear(&session->progress);
    bool interrupted = code == CODE_INTERRUPTED || signals_stop_requested();
    int saved = bench_results_save(session, options, &results, interrupted);
    if (interrupted)
        code = session_fail_with(session, CODE_INTERRUPTED, "interrupted; %zu rows were finished%s",
                                 results.row_count, options->json || options->csv ? " and are saved" : "");
    if (code == CODE_DONE && saved == CODE_DONE && nothing_measured(&results))
        code = session_fail_with(session, CODE_LIMIT, "no method could be measured; the rows say why");
    bench_results_free(&results);
    return code != CODE_DONE ? code : saved;
}

int bench_command(int argc, char **argv)
{
    bench_options options;
    bench_options_parse(argc, argv, &options);
    signals_install();
    command_session session;
    int code = session_open(&session, "bench", &options.general);
    if (code == CODE_DONE) code = check_outputs(&session, &options);
    if (code == CODE_DONE) code = run(&session, &options);
    session_close(&session);
    bench_options_free(&options);
    return code;
}

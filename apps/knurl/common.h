/* common.h: what the commands share: options, the context, loading, and how failures are reported. */
#ifndef APP_COMMON_H
#define APP_COMMON_H

#include "exit_code.h"
#include "progress.h"

#include <argp.h>
#include <knurl/knurl.h>

/* Options that every command with real work has. Parse with general_argp as an argp child. */
typedef struct general_options {
    int threads; /* 0: one per core */
    uint64_t memory_limit;
    bool quiet, verbose;
} general_options;

/* How the surface is traced. Parse with method_argp; not to be copied after that. */
typedef struct method_options {
    const char *method; /* with its parameters; NULL: the library's default. May point to `budgeted` */
    int rmip_cell;      /* 0: the library's default */
    double budget;      /* MiB, of --accel-budget; NaN: not given */
    char budgeted[256]; /* the method with that as a parameter */
} method_options;

/* Displacement given on the command line. Parse with displacement_argp. */
typedef struct displacement_options {
    const char *map, *color;
    double factor, offset, tile_u, tile_v; /* NaN: as the scene says */
    int wrap;                              /* -1: as the scene says */
    bool remove;
} displacement_options;

extern const struct argp general_argp, method_argp, displacement_argp;

/* For ARGP_KEY_ARG of commands that work on one scene. */
void take_scene(struct argp_state *state, const char *argument, const char **scene);

/* For struct argp's help_filter: leaves out argp's remark on short options, which newcomers stumble over. */
char *help_filter(int key, const char *text, void *input);

general_options general_options_default(void);
method_options method_options_default(void);
displacement_options displacement_options_default(void);

/* A running command: its name for messages, its context, its progress. */
typedef struct command_session {
    const char *command;
    general_options general;
    knurl_context *context;
    progress_view progress;
} command_session;

/* All of these report a failure on standard error themselves and return an exit code. */
int session_open(command_session *session, const char *command, const general_options *general);
void session_close(command_session *session);
/* Writes "knurl COMMAND: message" and returns the exit code that goes with the status. */
int session_fail(command_session *session, const knurl_error *error);
/* The same for a message of the program's own. */
int session_fail_with(command_session *session, enum exit_code code, const char *format, ...)
    KNURL_PRINTF(3, 4);
/* A remark on standard error; silent when quiet. */
void session_note(command_session *session, const char *format, ...) KNURL_PRINTF(2, 3);

typedef struct loaded_scene {
    knurl_description *description;
    knurl_scene *scene;
    double load_seconds, build_seconds;
} loaded_scene;

int scene_load(command_session *session, const char *path, const displacement_options *displacement,
               const method_options *method, loaded_scene *loaded);
void scene_release(loaded_scene *loaded);

/* The camera that --camera names, by number or by name; a NULL text leaves *camera as it is. */
int camera_find(command_session *session, const knurl_description *description, const char *text,
                int32_t *camera);

/* The description's displacement as the options ask for it. */
knurl_status displacement_override(knurl_description *description, const displacement_options *options,
                                   knurl_error *error);

/* Heightmap parameters that method options name. */
knurl_heightmap_def heightmap_def_from(const method_options *method);

/* "1.5 MiB", written into `text`, which is returned. */
const char *format_bytes(char text[32], double bytes);

/* Lower-case extension with its dot, "" if there is none. */
void path_extension(const char *path, char extension[16]);

/* Whether a file could be made at `path`: the folder exists and takes files. Reports and returns
 * CODE_FILE if not, so that long work does not end with nowhere to go. */
int output_check(command_session *session, const char *path);

#endif

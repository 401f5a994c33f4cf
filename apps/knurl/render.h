/* render.h: inside of `knurl render`: its options, and its output files. */
#ifndef APP_RENDER_H
#define APP_RENDER_H

#include "common.h"

typedef struct render_options {
    const char *scene, *out, *environment, *stats;
    const char *camera; /* index or name, NULL: the first */
    double exposure;    /* stops, for display formats */
    knurl_render_def def;
    general_options general;
    method_options method;
    displacement_options displacement;
} render_options;

/* Parses the command line of `knurl render`; ends the program when it is wrong. */
void render_options_parse(int argc, char **argv, render_options *options);

/* Whether pictures can be written to a file of this name. */
bool render_format_known(const char *path);
extern const char render_formats[]; /* for messages */

/* Whether all that will be written can be, before the work is done. */
int render_check_outputs(command_session *session, const render_options *options);
/* Writes the picture and the AOVs. Reports failures, returns an exit code. */
int render_save(command_session *session, const render_options *options, const knurl_render_result *result);

#endif

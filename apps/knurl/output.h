/* output.h: files that appear under their name only when they are complete. */
#ifndef APP_OUTPUT_H
#define APP_OUTPUT_H

#include "common.h"

#include <stdio.h>

typedef struct output_file {
    FILE *file;
    char target[4096];    /* for messages; "standard output" for "-" */
    char final[4096];     /* renamed to this; empty if written in place (pipes, devices) */
    char temporary[4096]; /* written to this; empty if written in place */
} output_file;

/* "-" is standard output. Devices and pipes are written in place. All report failures themselves and
 * return an exit code. */
int output_open(command_session *session, output_file *output, const char *path);
/* Closes and renames; a failed write of before shows here. */
int output_commit(command_session *session, output_file *output);
/* Leaves nothing behind. Does nothing after a commit. */
void output_discard(output_file *output);

#endif

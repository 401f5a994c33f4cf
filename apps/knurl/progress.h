/* progress.h: how far long work has come, and the signals that stop it. */
#ifndef APP_PROGRESS_H
#define APP_PROGRESS_H

#include <stdbool.h>

typedef enum progress_mode {
    PROGRESS_SILENT = 0,
    PROGRESS_LINES, /* one line for every tenth: logs, pipes */
    PROGRESS_BAR    /* one line redrawn in place: terminals */
} progress_mode;

typedef struct progress_view {
    progress_mode mode;
    char stage_name[64]; /* the stage now shown */
    double stage_start;  /* seconds of the monotonic clock */
    double last_drawn;
    int last_tenth;
    bool bar_visible;
} progress_view;

/* Bars on a terminal, lines elsewhere, nothing when quiet. */
void progress_start(progress_view *progress, bool quiet);
/* A knurl_progress_fn with a progress_view * as its user; false once a signal asked to stop. */
bool progress_update(void *progress, const char *stage, double fraction);
/* Takes the bar off the screen, before other text or at the end. */
void progress_clear(progress_view *progress);

/* From now on the first SIGINT or SIGTERM only raises a flag; a second one ends the program. */
void signals_install(void);
bool signals_stop_requested(void);

double seconds_now(void); /* monotonic */

#endif

/* progress.c: progress bars and signals. */
#include "progress.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* A signal handler can reach nothing but this. */
static volatile sig_atomic_t stop_requested;

static void on_signal(int number)
{
    (void)number;
    stop_requested = 1;
}

void signals_install(void)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    sigemptyset(&action.sa_mask);
    action.sa_flags = (int)SA_RESETHAND; /* the second one has its usual effect */
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

bool signals_stop_requested(void)
{
    return stop_requested != 0;
}

double seconds_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void progress_start(progress_view *progress, bool quiet)
{
    memset(progress, 0, sizeof *progress);
    progress->mode = quiet ? PROGRESS_SILENT : isatty(STDERR_FILENO) ? PROGRESS_BAR : PROGRESS_LINES;
    progress->last_tenth = -1;
}

/* "1:05" or "2:03:04". */
static void format_clock(char *text, size_t size, double seconds)
{
    long long whole = seconds > 0 && seconds < 1e9 ? (long long)(seconds + 0.5) : 0;
    long long hours = whole / 3600, minutes = whole / 60 % 60, rest = whole % 60;
    if (hours > 0)
        snprintf(text, size, "%lld:%02lld:%02lld", hours, minutes, rest);
    else
        snprintf(text, size, "%lld:%02lld", minutes, rest);
}

static void draw_bar(progress_view *progress, double fraction, const char *elapsed, const char *left)
{
    enum { WIDTH = 30 };
    char bar[WIDTH + 1];
    int filled = (int)(fraction * WIDTH);
    for (int i = 0; i < WIDTH; i++) bar[i] = i < filled ? '#' : '.';
    bar[WIDTH] = 0;
    fprintf(stderr, "\r\033[K%s [%s] %3d%%  elapsed %s", progress->stage_name, bar, (int)(fraction * 100),
            elapsed);
    if (*left) fprintf(stderr, "  left %s", left);
    fflush(stderr);
    progress->bar_visible = true;
}

static void draw(progress_view *progress, double now, double fraction)
{
    double since = now - progress->stage_start;
    char elapsed[32], left[32] = "";
    format_clock(elapsed, sizeof elapsed, since);
    if (fraction > 0.005) format_clock(left, sizeof left, since * (1 - fraction) / fraction);
    if (progress->mode == PROGRESS_BAR) {
        if (now - progress->last_drawn < 0.1 && fraction < 1) return;
        progress->last_drawn = now;
        draw_bar(progress, fraction, elapsed, left);
        return;
    }
    int tenth = (int)(fraction * 10 + 1e-9);
    /* Stages that are over at once are not worth a line. */
    if (tenth <= progress->last_tenth || tenth == 0 || since < 0.25) return;
    progress->last_tenth = tenth;
    fprintf(stderr, "%s: %d%%, elapsed %s, left %s\n", progress->stage_name, tenth * 10, elapsed, left);
}

bool progress_update(void *user, const char *stage, double fraction)
{
    progress_view *progress = user;
    if (progress->mode != PROGRESS_SILENT) {
        double now = seconds_now();
        if (strncmp(progress->stage_name, stage, sizeof progress->stage_name - 1) != 0) {
            progress_clear(progress);
            snprintf(progress->stage_name, sizeof progress->stage_name, "%s", stage);
            progress->stage_start = now;
            progress->last_drawn = 0;
            progress->last_tenth = -1;
        }
        draw(progress, now, fraction < 0 ? 0 : fraction > 1 ? 1 : fraction);
    }
    return !signals_stop_requested();
}

void progress_clear(progress_view *progress)
{
    if (!progress->bar_visible) return;
    fputs("\r\033[K", stderr);
    fflush(stderr);
    progress->bar_visible = false;
}

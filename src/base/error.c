/* Error messages, log lines and status names. */
#include "base/base.h"

#include <stdio.h>
#include <string.h>

const char *knurl_status_name(knurl_status status)
{
    switch (status) {
    case KNURL_OK:
        return "ok";
    case KNURL_ERROR_ARGUMENT:
        return "bad argument";
    case KNURL_ERROR_INPUT:
        return "bad input";
    case KNURL_ERROR_UNSUPPORTED:
        return "not supported";
    case KNURL_ERROR_OUTPUT:
        return "cannot write";
    case KNURL_ERROR_MEMORY:
        return "out of memory";
    case KNURL_ERROR_LIMIT:
        return "over a limit";
    case KNURL_INTERRUPTED:
        return "interrupted";
    }
    return "unknown status";
}

knurl_status knurl_fail(knurl_error *error, knurl_status status, const char *format, ...)
{
    if (error) {
        va_list args;
        va_start(args, format);
        error->status = status;
        (void)vsnprintf(error->message, sizeof error->message, format, args);
        va_end(args);
    }
    return status;
}

knurl_status knurl_fail_prefix(knurl_error *error, knurl_status status, const char *format, ...)
{
    if (error) {
        char old[sizeof error->message];
        memcpy(old, error->message, sizeof old);
        old[sizeof old - 1] = 0;
        va_list args;
        va_start(args, format);
        int length = vsnprintf(error->message, sizeof error->message, format, args);
        va_end(args);
        error->status = status;
        /* Joined by hand: what does not fit is cut, which is meant. */
        size_t used = length < 0 ? 0 : (size_t)length;
        for (const char *from = ": "; used + 1 < sizeof error->message && *from;)
            error->message[used++] = *from++;
        for (const char *from = old; used + 1 < sizeof error->message && *from;)
            error->message[used++] = *from++;
        if (used < sizeof error->message) error->message[used] = 0;
    }
    return status;
}

knurl_status knurl_fail_memory(knurl_error *error, size_t bytes, const char *what)
{
    if (bytes < 1048576)
        return knurl_fail(error, KNURL_ERROR_MEMORY,
                          "out of memory or over the memory limit: %zu bytes for %s", bytes, what);
    return knurl_fail(error, KNURL_ERROR_MEMORY, "out of memory or over the memory limit: %.1f MiB for %s",
                      (double)bytes / 1048576.0, what);
}

void knurl_log(const knurl_context *context, knurl_log_level level, const char *format, ...)
{
    const knurl_context_def *def = knurl_context_get_def(context);
    if (!def->log) return;
    char message[1024];
    va_list args;
    va_start(args, format);
    (void)vsnprintf(message, sizeof message, format, args);
    va_end(args);
    def->log(def->log_user, level, message);
}

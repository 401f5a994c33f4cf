/* output.c: output files. */
#include "output.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int open_in_place(command_session *session, output_file *output, const char *path)
{
    output->file = fopen(path, "wb");
    if (!output->file) return session_fail_with(session, CODE_FILE, "%s: %s", path, strerror(errno));
    return CODE_DONE;
}

int output_open(command_session *session, output_file *output, const char *path)
{
    memset(output, 0, sizeof *output);
    if (strcmp(path, "-") == 0) {
        snprintf(output->target, sizeof output->target, "standard output");
        output->file = stdout;
        return CODE_DONE;
    }
    int code = output_check(session, path);
    if (code != CODE_DONE) return code;
    snprintf(output->target, sizeof output->target, "%s", path);
    struct stat info;
    bool exists = stat(path, &info) == 0;
    if (exists && !S_ISREG(info.st_mode)) return open_in_place(session, output, path);
    /* A link stays a link: what it points to is replaced. */
    char *resolved = exists ? realpath(path, NULL) : NULL;
    int length = snprintf(output->final, sizeof output->final, "%s", resolved ? resolved : path);
    free(resolved);
    int more = snprintf(output->temporary, sizeof output->temporary, "%s.XXXXXX", output->final);
    if (length < 0 || more < 0 || (size_t)more >= sizeof output->temporary) {
        output->temporary[0] = 0;
        return session_fail_with(session, CODE_FILE, "the output name is too long");
    }
    int file = mkstemp(output->temporary);
    if (file < 0) {
        output->temporary[0] = 0;
        return session_fail_with(session, CODE_FILE, "%s: %s", path, strerror(errno));
    }
    mode_t mask = umask(0);
    umask(mask);
    (void)fchmod(file, exists ? info.st_mode & 0777 : 0666 & ~mask);
    output->file = fdopen(file, "wb");
    if (output->file) return CODE_DONE;
    close(file);
    output_discard(output);
    return session_fail_with(session, CODE_LIMIT, "%s: out of memory", path);
}

int output_commit(command_session *session, output_file *output)
{
    errno = 0;
    bool good = fflush(output->file) == 0 && !ferror(output->file);
    int reason = errno;
    if (output->file != stdout && fclose(output->file) != 0 && good) {
        good = false;
        reason = errno;
    }
    output->file = NULL;
    if (good && output->temporary[0] && rename(output->temporary, output->final) != 0) {
        good = false;
        reason = errno;
    }
    if (good) {
        output->temporary[0] = 0;
        return CODE_DONE;
    }
    output_discard(output);
    return session_fail_with(session, CODE_FILE, "%s: write failed: %s", output->target,
                             reason ? strerror(reason) : "unknown reason");
}

void output_discard(output_file *output)
{
    if (output->file && output->file != stdout) fclose(output->file);
    output->file = NULL;
    if (output->temporary[0]) unlink(output->temporary);
    output->temporary[0] = 0;
}

/* Whole-file reading, and writing that never leaves half a file behind. */
#include "base/base.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

knurl_status knurl_file_read(knurl_context *context, const char *path, unsigned char **bytes, size_t *size,
                             knurl_error *error)
{
    *bytes = NULL;
    *size = 0;
    int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); /* never waits for a pipe */
    if (file < 0) return knurl_fail(error, KNURL_ERROR_INPUT, "%s: %s", path, strerror(errno));
    struct stat info;
    knurl_status status = KNURL_OK;
    unsigned char *data = NULL;
    size_t length = 0;
    if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode)) {
        status = knurl_fail(error, KNURL_ERROR_INPUT, "%s: not a regular file", path);
    } else if ((uint64_t)info.st_size > knurl_context_get_def(context)->max_file_bytes) {
        status = knurl_fail(error, KNURL_ERROR_LIMIT, "%s: %lld bytes, the limit is %llu", path,
                            (long long)info.st_size,
                            (unsigned long long)knurl_context_get_def(context)->max_file_bytes);
    } else {
        length = (size_t)info.st_size;
        data = knurl_alloc(context, length + 1);
        if (!data) status = knurl_fail_memory(error, length, path);
    }
    size_t have = 0;
    while (status == KNURL_OK && have < length) {
        ssize_t got = read(file, data + have, length - have);
        if (got > 0)
            have += (size_t)got;
        else if (got == 0)
            break;
        else if (errno != EINTR)
            status = knurl_fail(error, KNURL_ERROR_INPUT, "%s: read failed: %s", path, strerror(errno));
    }
    if (status == KNURL_OK && have < length)
        status = knurl_fail(error, KNURL_ERROR_INPUT, "%s: ends after %zu of %zu bytes", path, have, length);
    close(file);
    if (status != KNURL_OK) {
        knurl_free(context, data);
        return status;
    }
    data[length] = 0;
    *bytes = data;
    *size = length;
    return KNURL_OK;
}

/* A new file beside `target`, empty, with the permissions of `existing` or, if that is NULL, those that
 * the process's mask leaves. Its name goes to output->path, which is empty after a failure. */
static int make_beside(knurl_output *output, const struct stat *existing)
{
    for (unsigned attempt = 0; attempt < 1000; attempt++) {
        unsigned stamp = (unsigned)(fmod(knurl_seconds() * 1e6, 4e9)) + attempt;
        int length = snprintf(output->path, sizeof output->path, "%s.%ld-%08x.tmp", output->target,
                              (long)getpid(), stamp);
        if (length < 0 || (size_t)length >= sizeof output->path) {
            errno = ENAMETOOLONG;
            break;
        }
        int file = open(output->path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file >= 0) {
            if (existing) (void)fchmod(file, existing->st_mode & 0777);
            return file;
        }
        if (errno != EEXIST) break;
    }
    output->path[0] = 0;
    return -1;
}

knurl_status knurl_output_open(const char *target, knurl_output *output, knurl_error *error)
{
    memset(output, 0, sizeof *output);
    struct stat info;
    bool exists = stat(target, &info) == 0;
    if (exists && S_ISDIR(info.st_mode))
        return knurl_fail(error, KNURL_ERROR_OUTPUT, "%s: is a directory", target);
    /* A link stays a link: what it points to is replaced. */
    char *resolved = exists ? realpath(target, NULL) : NULL;
    int length = snprintf(output->target, sizeof output->target, "%s", resolved ? resolved : target);
    free(resolved);
    if (length <= 0 || (size_t)length >= sizeof output->target)
        return knurl_fail(error, KNURL_ERROR_OUTPUT, "output name is empty or too long");
    output->in_place = exists && !S_ISREG(info.st_mode);
    if (output->in_place) {
        memcpy(output->path, output->target, sizeof output->path);
        return KNURL_OK;
    }
    int file = make_beside(output, exists ? &info : NULL);
    if (file < 0) return knurl_fail(error, KNURL_ERROR_OUTPUT, "%s: %s", target, strerror(errno));
    close(file);
    return KNURL_OK;
}

knurl_status knurl_output_commit(knurl_output *output, knurl_error *error)
{
    if (!output->in_place && rename(output->path, output->target) != 0) {
        knurl_status status =
            knurl_fail(error, KNURL_ERROR_OUTPUT, "%s: %s", output->target, strerror(errno));
        knurl_output_discard(output);
        return status;
    }
    output->path[0] = 0;
    return KNURL_OK;
}

void knurl_output_discard(knurl_output *output)
{
    if (output->path[0] && !output->in_place) unlink(output->path);
    output->path[0] = 0;
}

knurl_status knurl_file_write(const char *path, const void *bytes, size_t size, knurl_error *error)
{
    knurl_output output;
    knurl_status status = knurl_output_open(path, &output, error);
    if (status != KNURL_OK) return status;
    FILE *file = fopen(output.path, "wb");
    bool good = file && (size == 0 || fwrite(bytes, 1, size, file) == size);
    int saved = errno;
    if (file && fclose(file) != 0) {
        good = false;
        saved = errno;
    }
    if (!good) {
        knurl_output_discard(&output);
        return knurl_fail(error, KNURL_ERROR_OUTPUT, "%s: %s", path, strerror(saved));
    }
    return knurl_output_commit(&output, error);
}

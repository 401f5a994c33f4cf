/* parallel.h: one loop over several threads, for the program's own text and copy work. */
#ifndef APP_PARALLEL_H
#define APP_PARALLEL_H

#include <stddef.h>

/* Calls work(user, chunk) once for every chunk in [0, count), on up to `threads` threads. Runs on fewer
 * if threads cannot be made. */
typedef void parallel_fn(void *user, size_t chunk);
void parallel_chunks(int threads, size_t count, parallel_fn *work, void *user);

#endif

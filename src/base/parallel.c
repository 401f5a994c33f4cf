/* Data-parallel loops on POSIX threads. Threads live for one loop: builds and renders run for
 * milliseconds to minutes, so starting a few threads (tens of microseconds) is not worth a pool. */
#include "base/base.h"

#include <pthread.h>

typedef struct loop {
    knurl_range_fn *work;
    void *user;
    size_t count, grain;
    atomic_size_t next;
} loop;

typedef struct worker {
    loop *loop;
    int32_t thread;
} worker;

static _Thread_local bool inside_loop;

static void run_chunks(loop *l, int32_t thread)
{
    inside_loop = true;
    for (;;) {
        size_t begin = atomic_fetch_add_explicit(&l->next, l->grain, memory_order_relaxed);
        if (begin >= l->count) break;
        size_t end = l->count - begin < l->grain ? l->count : begin + l->grain;
        l->work(l->user, begin, end, thread);
    }
    inside_loop = false;
}

static void *worker_main(void *argument)
{
    worker *w = argument;
    run_chunks(w->loop, w->thread);
    return NULL;
}

void knurl_parallel_for(knurl_context *context, size_t count, size_t grain, knurl_range_fn *work, void *user)
{
    if (count == 0) return;
    if (grain == 0) grain = 1;
    if (inside_loop) {
        for (size_t begin = 0; begin < count; begin += grain)
            work(user, begin, count - begin < grain ? count : begin + grain, 0);
        return;
    }
    enum { MAX_THREADS = 1024 };
    loop l = {.work = work, .user = user, .count = count, .grain = grain};
    atomic_init(&l.next, 0);
    size_t chunks = (count - 1) / grain + 1;
    size_t wanted = (size_t)knurl_context_threads(context);
    if (wanted > chunks) wanted = chunks;
    pthread_t threads[MAX_THREADS];
    worker workers[MAX_THREADS];
    size_t started = 0;
    for (size_t i = 1; i < wanted; i++) {
        workers[started] = (worker){&l, (int32_t)started + 1};
        /* Fewer threads than wanted is slower, never wrong. */
        if (pthread_create(&threads[started], NULL, worker_main, &workers[started]) != 0) break;
        started++;
    }
    run_chunks(&l, 0);
    for (size_t i = 0; i < started; i++) pthread_join(threads[i], NULL);
}

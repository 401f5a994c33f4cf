/* parallel.c: threads are made for each loop; a loop is a few milliseconds of work. */
#include "parallel.h"

#include <pthread.h>
#include <stdatomic.h>

typedef struct chunk_loop {
    parallel_fn *work;
    void *user;
    size_t count;
    atomic_size_t next;
} chunk_loop;

static void *run_chunks(void *argument)
{
    chunk_loop *loop = argument;
    for (;;) {
        size_t chunk = atomic_fetch_add_explicit(&loop->next, 1, memory_order_relaxed);
        if (chunk >= loop->count) return NULL;
        loop->work(loop->user, chunk);
    }
}

void parallel_chunks(int threads, size_t count, parallel_fn *work, void *user)
{
    enum { MOST = 64 };
    chunk_loop loop = {.work = work, .user = user, .count = count};
    atomic_init(&loop.next, 0);
    pthread_t made[MOST];
    int wanted = threads < MOST ? threads : MOST;
    if ((size_t)wanted > count) wanted = (int)count;
    int running = 0;
    while (running < wanted - 1 && pthread_create(&made[running], NULL, run_chunks, &loop) == 0) running++;
    run_chunks(&loop);
    for (int i = 0; i < running; i++) pthread_join(made[i], NULL);
}

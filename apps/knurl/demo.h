/* demo.h: `knurl demo`, procedural sample scenes. */
#ifndef KNURL_APPS_DEMO_H
#define KNURL_APPS_DEMO_H

/* argv[0] is "demo". Returns the exit code: 0 done, 2 bad usage, 3 a file could not be written,
 * 4 out of memory. */
int demo_command(int argc, char **argv);

#endif

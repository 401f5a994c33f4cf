/* exit_code.h: what the program's exit status means; scripts rely on it. */
#ifndef APP_EXIT_CODE_H
#define APP_EXIT_CODE_H

enum exit_code {
    CODE_DONE = 0,
    CODE_CHECK = 1,        /* the comparison or check that was asked for did not hold */
    CODE_USAGE = 2,        /* the command line is wrong */
    CODE_FILE = 3,         /* a file could not be read, understood or written */
    CODE_LIMIT = 4,        /* out of memory, or over a limit */
    CODE_INTERRUPTED = 130 /* stopped by a signal; what was finished is saved */
};

#endif

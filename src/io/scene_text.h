/* io/scene_text.h: lines, words and numbers of OBJ and MTL files, and names beside a scene file. */
#ifndef KNURL_SRC_IO_SCENE_TEXT_H
#define KNURL_SRC_IO_SCENE_TEXT_H

#include <knurl/description.h>

#include "base/base.h"

/* A piece of text that is not terminated. */
typedef struct text_span {
    const char *begin, *end;
} text_span;

/* Lines of a file in memory. A backslash at the end of a line joins it to the next one. */
typedef struct text_lines {
    char *at, *end;  /* the unread rest; joined lines are edited in place */
    uint32_t line;   /* of the line returned last, from 1 */
    uint32_t joined; /* lines that the last one took beyond its first */
} text_lines;

/* The next line without its end, comments (#) and surrounding blanks; false at the end. */
bool text_next_line(text_lines *lines, text_span *line);
/* Takes the next word off the front of *line; false when there is none. */
bool text_next_word(text_span *line, text_span *word);
/* Compares without regard to case (ASCII). */
bool text_is(text_span word, const char *name);
/* A decimal number that fills the whole word, correctly rounded whatever the locale; refuses nan,
 * infinities, hexadecimal and what overflows. */
bool text_number(text_span word, double *value);
/* Likewise for an integer in [-2^31, 2^31). */
bool text_integer(text_span word, int64_t *value);

/* Length for "%.*s", shortened so that messages stay readable. */
int text_shown(text_span word);

/* `name` relative to the folder of the file `base` (absolute names stay); NULL when out of memory.
 * Backslashes, which Windows programs write, become slashes. */
char *text_path_beside(knurl_context *context, const char *base, const char *name, size_t length);
char *text_copy(knurl_context *context, text_span word);

#endif

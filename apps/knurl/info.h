/* info.h: inside of `knurl info`. What is known is gathered as JSON first; text is printed from it. */
#ifndef APP_INFO_H
#define APP_INFO_H

#include "json_file.h"

typedef struct info_options {
    const char *path;
    bool json, timing;
    general_options general;
    method_options method;
    displacement_options displacement;
} info_options;

/* Gather what is known of a file. Report failures, return an exit code. */
int info_gather_image(command_session *session, const info_options *options, json_t **root);
int info_gather_scene(command_session *session, const info_options *options, json_t **root);

/* Print it for people. */
void info_print_image(const json_t *root);
void info_print_scene(const json_t *root);

/* "1,234,567". */
const char *info_count_text(char text[32], double count);
/* Members of a JSON object: a number (0 for null or none), text ("" for null or none). */
double info_number(const json_t *object, const char *key);
const char *info_text(const json_t *object, const char *key);

#endif

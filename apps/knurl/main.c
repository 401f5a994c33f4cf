/* main.c: the command table of `knurl`. */
#include "commands.h"
#include "demo.h"
#include "exit_code.h"
#include "values.h"

#include <argp.h>
#include <knurl/surface.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* "    name:parameter=preset   summary (range)" */
static void print_parameter(const char *method, const knurl_method_parameter *p)
{
    char assignment[96];
    if (!p->choices) {
        (void)snprintf(assignment, sizeof assignment, "%s:%s=%g", method, p->name, p->preset);
        printf("    %-34s %s; %g to %g\n", assignment, p->summary, p->least, p->most);
        return;
    }
    const char *choice = p->choices;
    for (int i = 0; i < (int)p->preset; i++) choice += strcspn(choice, "|") + 1;
    (void)snprintf(assignment, sizeof assignment, "%s:%s=%.*s", method, p->name, (int)strcspn(choice, "|"),
                   choice);
    printf("    %-34s %s; %s\n", assignment, p->summary, p->choices);
}

static int methods_command(int argc, char **argv);
static int help_command(int argc, char **argv);

typedef struct command_entry {
    const char *name;
    const char *summary;
    int (*run)(int argc, char **argv);
} command_entry;

static const command_entry commands[] = {
    {"render", "Make a picture of a scene", render_command},
    {"trace", "Trace your own rays and get the hits as CSV or NumPy", trace_command},
    {"info", "Describe a scene, an image or a height map", info_command},
    {"compare", "Compare two images, with thresholds for scripts", compare_command},
    {"bench", "Measure intersection methods side by side", bench_command},
    {"bake", "Write displaced surfaces as plain meshes", bake_command},
    {"capture", "Turn a model into textures with depth", capture_command},
    {"demo", "Write sample scenes to play with", demo_command},
    {"methods", "List the ways to intersect a displaced surface", methods_command},
    {"help", "Explain a command", help_command},
};
enum { COMMAND_COUNT = sizeof commands / sizeof commands[0] };

static void print_help(FILE *out)
{
    fputs("knurl: ray tracing of displacement-mapped surfaces, without tessellating them.\n\n"
          "Usage: knurl COMMAND [OPTION...]\n\nCommands:\n",
          out);
    for (int i = 0; i < COMMAND_COUNT; i++)
        fprintf(out, "  %-9s %s\n", commands[i].name, commands[i].summary);
    fputs("\n`knurl COMMAND --help' explains a command; `knurl --version' prints the version.\n\n"
          "Examples:\n"
          "  knurl demo gallery out                  write out/gallery/gallery.gltf\n"
          "  knurl render scene.gltf -o picture.png  render a scene\n"
          "  knurl render ball.obj --disp rock.png --disp-factor 0.1 --tile 4x4 -o ball.exr\n"
          "  knurl trace scene.obj --rays rays.csv --out hits.csv\n"
          "  knurl info scene.gltf                   what is in it, and what it costs\n\n"
          "Exit status: 0 done; 1 a comparison or check did not hold; 2 wrong usage; 3 a file\n"
          "could not be read or written; 4 out of memory or over a limit; 130 interrupted.\n",
          out);
}

static const command_entry *find_command(const char *name)
{
    for (int i = 0; i < COMMAND_COUNT; i++)
        if (strcmp(name, commands[i].name) == 0) return &commands[i];
    return NULL;
}

static int unknown_command(const char *name)
{
    const char *names[COMMAND_COUNT + 1];
    for (int i = 0; i < COMMAND_COUNT; i++) names[i] = commands[i].name;
    names[COMMAND_COUNT] = NULL;
    const char *near = nearest_name(name, names);
    fprintf(stderr, "knurl: found '%s', expected a command", name);
    if (near) fprintf(stderr, "; did you mean '%s'?", near);
    fputs("\nTry `knurl --help' for a list.\n", stderr);
    return CODE_USAGE;
}

/* Runs a command with "knurl NAME" as its argv[0], which argp shows in messages. */
static int run_command(const command_entry *found, int argc, char **argv)
{
    char name[32];
    snprintf(name, sizeof name, "knurl %s", found->name);
    argv[0] = name;
    return found->run(argc, argv);
}

static int help_command(int argc, char **argv)
{
    if (argc < 2 || argv[1][0] == '-') {
        print_help(stdout);
        return CODE_DONE;
    }
    const command_entry *found = find_command(argv[1]);
    if (!found) return unknown_command(argv[1]);
    char option[] = "--help";
    char *arguments[] = {argv[0], option, NULL};
    if (found->run == help_command) {
        puts("Usage: knurl help [COMMAND]");
        return CODE_DONE;
    }
    return run_command(found, 2, arguments);
}

static int methods_command(int argc, char **argv)
{
    static const struct argp argp = {
        NULL,
        NULL,
        NULL,
        "List the ways to intersect a displaced surface; * marks the default.\v"
        "Name one with --method in `knurl render', `knurl trace' and `knurl info', with parameters after "
        "colons if the default values, shown here, do not suit: --method "
        "rmip:marching-scale=4:bounds=minmax.",
        NULL,
        NULL,
        NULL};
    argp_parse(&argp, argc, argv, 0, NULL, NULL);
    const char *standard = knurl_surface_def_default().method;
    for (int32_t i = 0; i < knurl_method_count(); i++)
        printf("%c %-14s %s\n", strcmp(knurl_method_name(i), standard) == 0 ? '*' : ' ', knurl_method_name(i),
               knurl_method_summary(i));
    for (int32_t i = 0; i < knurl_method_count(); i++) {
        const knurl_method_parameter *p;
        for (int32_t k = 0; (p = knurl_method_get_parameter(i, k)); k++)
            print_parameter(knurl_method_name(i), p);
    }
    return CODE_DONE;
}

/* Results that did not reach standard output must not end with status 0. */
static int finish(int code)
{
    if (fflush(stdout) != 0 || ferror(stdout)) {
        fputs("knurl: standard output: write failed\n", stderr);
        if (code == CODE_DONE) code = CODE_FILE;
    }
    return code;
}

int main(int argc, char **argv)
{
    argp_err_exit_status = CODE_USAGE;
    argp_program_version = "knurl " KNURL_VERSION_STRING;
    if (argc < 2) {
        print_help(stderr);
        return CODE_USAGE;
    }
    const char *first = argv[1];
    if (strcmp(first, "--help") == 0 || strcmp(first, "-h") == 0 || strcmp(first, "-?") == 0) {
        print_help(stdout);
        return finish(CODE_DONE);
    }
    if (strcmp(first, "--version") == 0 || strcmp(first, "-V") == 0) {
        puts(argp_program_version);
        return finish(CODE_DONE);
    }
    const command_entry *found = find_command(first);
    if (!found) return unknown_command(first);
    return finish(run_command(found, argc - 1, argv + 1));
}

/* `knurl demo`: writes procedural sample scenes. */
#include "demo.h"

#include "demo_scenes.h"
#include "exit_code.h"
#include "values.h"

#include <argp.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

typedef struct demo_options {
    const char *name, *folder;
    int32_t size;
    uint32_t seed;
    bool glb, quiet;
} demo_options;

enum { SIZE_KEY = 256, SEED_KEY, GLB_KEY };

static const struct argp_option options[] = {
    {"size", SIZE_KEY, "N", 0,
     "Texels along the longer side of each height map, 16 to 16384 (default: each map's own)", 0},
    {"seed", SEED_KEY, "N", 0, "Start of all random numbers (default 0); same seed, same files", 0},
    {"glb", GLB_KEY, NULL, 0, "One NAME.glb in place of NAME.gltf and NAME.bin; maps stay files", 0},
    {"quiet", 'q', NULL, 0, "Print nothing", 0},
    {0}};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    demo_options *o = state->input;
    switch (key) {
    case SIZE_KEY:
        o->size = (int32_t)value_integer(state, "--size", argument, 16, 16384);
        return 0;
    case SEED_KEY:
        o->seed = (uint32_t)value_integer(state, "--seed", argument, 0, UINT32_MAX);
        return 0;
    case GLB_KEY:
        o->glb = true;
        return 0;
    case 'q':
        o->quiet = true;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num == 0)
            o->name = argument;
        else if (state->arg_num == 1)
            o->folder = argument;
        else
            argp_error(state, "found a third argument '%s', expected NAME and DIR", argument);
        return 0;
    case ARGP_KEY_END:
        if (!o->name) argp_error(state, "no scene named; `knurl demo list' lists them");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {
    options,
    parse_option,
    "NAME|all DIR\nlist",
    "Write sample scenes: glTF 2.0 with 16-bit displacement maps, made on the spot.\v"
    "A scene goes to DIR/NAME/NAME.gltf with its files beside it. Folders are made as needed.\n\n"
    "  knurl demo list                  name the scenes\n"
    "  knurl demo gallery scenes        write scenes/gallery/gallery.gltf\n"
    "  knurl demo all scenes --size 512 write every scene with small maps\n",
    NULL,
    NULL,
    NULL};

static int list_scenes(void)
{
    for (int i = 0; i < demo_entry_count; i++)
        printf("%-13s %s\n", demo_entries[i].name, demo_entries[i].summary);
    return CODE_DONE;
}

static int unknown_scene(const char *name)
{
    const char *names[64] = {NULL};
    for (int i = 0; i < demo_entry_count && i < 63; i++) names[i] = demo_entries[i].name;
    const char *near = nearest_name(name, names);
    fprintf(stderr, "knurl demo: found '%s', expected the name of a scene", name);
    if (near) fprintf(stderr, "; did you mean '%s'?", near);
    fputs("\nScenes: all", stderr);
    for (int i = 0; names[i]; i++) fprintf(stderr, ", %s", names[i]);
    fputs("\n", stderr);
    return CODE_USAGE;
}

static int fail(const char *message)
{
    fprintf(stderr, "knurl demo: %s\n", message);
    return CODE_FILE;
}

/* Makes a folder and those above it. */
static int make_folder(char *path)
{
    for (char *p = path + 1;; p++) {
        if (*p != '/' && *p != 0) continue;
        char saved = *p;
        *p = 0;
        int made = mkdir(path, 0777), reason = errno;
        struct stat info;
        bool there = made == 0 || (stat(path, &info) == 0 && S_ISDIR(info.st_mode));
        if (!there) {
            fprintf(stderr, "knurl demo: cannot make the folder %s: %s\n", path,
                    strerror(reason == EEXIST ? ENOTDIR : reason));
            return CODE_FILE;
        }
        *p = saved;
        if (saved == 0) return CODE_DONE;
    }
}

static int write_scene(const demo_options *o, const demo_entry *entry, knurl_context *context)
{
    knurl_error error = {0};
    demo_scene scene = {.context = context,
                        .error = &error,
                        .name = entry->name,
                        .map_size = o->size,
                        .seed = o->seed * 1009u + 1u,
                        .glb = o->glb};
    int length = snprintf(scene.folder, sizeof scene.folder, "%s/%s", o->folder, entry->name);
    if (length < 0 || (size_t)length >= sizeof scene.folder) return fail("the path of DIR is too long");
    int code = make_folder(scene.folder);
    if (code != CODE_DONE) return code;
    demo_scene_begin(&scene);
    entry->write(&scene);
    knurl_status status = demo_scene_finish(&scene);
    if (status != KNURL_OK) {
        (void)fail(error.message);
        return status == KNURL_ERROR_MEMORY || status == KNURL_ERROR_LIMIT ? CODE_LIMIT : CODE_FILE;
    }
    if (!o->quiet)
        printf("%s/%s.%s: %llu triangles, %llu of them displaced, %.1f million texels\n", scene.folder,
               entry->name, o->glb ? "glb" : "gltf", (unsigned long long)scene.triangles,
               (unsigned long long)scene.displaced, (double)scene.texels * 1e-6);
    return CODE_DONE;
}

int demo_command(int argc, char **argv)
{
    demo_options o = {0};
    argp_parse(&parser, argc, argv, 0, NULL, &o);
    if (!strcmp(o.name, "list")) return list_scenes();
    bool all = !strcmp(o.name, "all"), found = all;
    for (int i = 0; i < demo_entry_count; i++) found = found || !strcmp(o.name, demo_entries[i].name);
    if (!found) return unknown_scene(o.name);
    if (!o.folder || !o.folder[0]) {
        fprintf(stderr, "knurl demo: no folder given, expected `knurl demo %s DIR'\n", o.name);
        return CODE_USAGE;
    }
    knurl_context_def def = knurl_context_def_default();
    knurl_context *context = NULL;
    knurl_error error = {0};
    if (knurl_context_create(&def, &context, &error) != KNURL_OK) {
        (void)fail(error.message);
        return CODE_LIMIT;
    }
    int code = CODE_DONE;
    for (int i = 0; i < demo_entry_count && code == CODE_DONE; i++)
        if (all || !strcmp(o.name, demo_entries[i].name)) code = write_scene(&o, &demo_entries[i], context);
    knurl_context_release(context);
    return code;
}

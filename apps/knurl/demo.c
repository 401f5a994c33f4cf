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
    int32_t size, limit;
    uint32_t seed;
    bool glb, quiet;
} demo_options;

enum { SIZE_KEY = 256, LIMIT_KEY, SEED_KEY, GLB_KEY };

static const struct argp_option options[] = {
    {"size", SIZE_KEY, "N", 0,
     "Texels along the longer side of each height map, 16 to 16384 (default: each map's own)", 0},
    {"map-size", LIMIT_KEY, "N", 0,
     "Reduce every map whose longer side has more texels than N, 16 to 16384; the pattern stays", 0},
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
    case LIMIT_KEY:
        o->limit = (int32_t)value_integer(state, "--map-size", argument, 16, 16384);
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
    "NAME|GROUP|all DIR\nlist",
    "Write sample scenes: glTF 2.0 with 16-bit displacement maps, made on the spot.\v"
    "A scene goes to DIR/NAME/NAME.gltf with its files beside it. Folders are made as needed.\n\n"
    "  knurl demo list                  name the scenes\n"
    "  knurl demo gallery scenes        write scenes/gallery/gallery.gltf\n"
    "  knurl demo all scenes --size 512 write every sample with small maps\n"
    "  knurl demo rmip scenes           write a group of bench scenes\n\n"
    "`all' leaves the groups rmip, pdm, baboud and kolb out: they stand for the tables of papers and have "
    "maps of up to 8192 x 8192 texels; --map-size makes them small.\n",
    NULL,
    NULL,
    NULL};

/* Samples have no group, and are what `all' means. */
static const char *group_of(const demo_entry *entry)
{
    return entry->group ? entry->group : "all";
}

static bool is_named(const demo_entry *entry, const char *name)
{
    return !strcmp(entry->name, name) || !strcmp(group_of(entry), name);
}

static int list_scenes(void)
{
    for (int i = 0; i < demo_entry_count; i++)
        printf("%-16s %-7s %s\n", demo_entries[i].name, group_of(&demo_entries[i]), demo_entries[i].summary);
    return CODE_DONE;
}

static int unknown_scene(const char *name)
{
    enum { MOST = 96 };
    const char *names[MOST + 1] = {NULL};
    int count = 0;
    for (int i = 0; i < demo_entry_count && count < MOST - 1; i++) {
        /* Each group before its first scene. */
        const char *group = group_of(&demo_entries[i]);
        if (i == 0 || strcmp(group, group_of(&demo_entries[i - 1])) != 0) names[count++] = group;
        names[count++] = demo_entries[i].name;
    }
    const char *near = nearest_name(name, names);
    fprintf(stderr, "knurl demo: found '%s', expected the name of a scene or group", name);
    if (near) fprintf(stderr, "; did you mean '%s'?", near);
    fputs("\nScenes and groups:", stderr);
    for (int i = 0; names[i]; i++) fprintf(stderr, "%s%s", i ? ", " : " ", names[i]);
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
                        .map_limit = o->limit,
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
    bool found = false;
    for (int i = 0; i < demo_entry_count; i++) found = found || is_named(&demo_entries[i], o.name);
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
        if (is_named(&demo_entries[i], o.name)) code = write_scene(&o, &demo_entries[i], context);
    knurl_context_release(context);
    return code;
}

#!/usr/bin/env bash
# The README cannot rot: its C compiles, the options it names exist, and so do the files it points to.
. "$(dirname "$0")/lib.sh" "$@"
readme=$source_folder/README.md

# Each block of C becomes a function; what it takes from its surroundings comes in as parameters.
awk '
    /^```c$/ { inside = 1; blocks++; next }
    /^```/ { inside = 0; next }
    inside && /^#include/ { includes = includes $0 "\n"; next }
    inside { body[blocks] = body[blocks] $0 "\n" }
    END {
        printf "#include <stdio.h>\n%s", includes
        print "#define SURROUNDINGS RTCDevice device, RTCScene scene, knurl_context *context, knurl_image *image, \\"
        print "    knurl_heightmap *map, knurl_surface *surface, knurl_error error, const float *positions, \\"
        print "    const float *normals, const float *texcoords, uint32_t vertex_count, const uint32_t *triangles, \\"
        print "    uint32_t triangle_count, const double origin[3], const double direction[3]"
        print "int complain(const char *message);"
        for (i = 1; i <= blocks; i++)
            printf "int block%d(SURROUNDINGS);\nint block%d(SURROUNDINGS)\n{\n{\n%s}\nreturn 0;\n}\n", i, i, body[i]
    }' "$readme" >readme.c
[ "$(grep -c '^int block[0-9]*(SURROUNDINGS)$' readme.c)" -eq 2 ] || fail "expected 2 blocks of C in the README"
expect 0 cc -std=c17 -Wall -Wextra -Werror -Wno-unused -Wno-unused-parameter -fsyntax-only \
    -DKNURL_EMBREE_VERSION=3 -I"$source_folder/include" readme.c

# Commands: every option after `knurl COMMAND` is in that command's help.
grep -oE '(^ +(build/bin/)?|`)knurl [a-z]+ [^`]*' "$readme" >commands.txt
[ "$(wc -l <commands.txt)" -ge 4 ] || fail "found only $(wc -l <commands.txt) commands in the README"
while read -r _ command rest; do
    expect 0 "$knurl" "$command" --help
    for word in $rest; do
        case $word in
        --*) expect_text stdout.txt "$word" ;;
        esac
    done
done <commands.txt

# Links, here and in docs/, to files of the tree.
for page in "$readme" "$source_folder"/docs/*.md "$source_folder"/docs/results/*.md; do
    for target in $(sed -n 's/](\([^)#:]*\))/\n@\1\n/gp' "$page" | sed -n 's/^@//p'); do
        [ -e "$(dirname "$page")/$target" ] || fail "${page#"$source_folder"/} points to $target, which is not there"
    done
done
for script in $(grep -oE '(scripts/[a-z_]+\.sh|\.ci/run)' "$readme" | sort -u); do
    [ -x "$source_folder/$script" ] || fail "$script is not there, or not executable"
done
echo good

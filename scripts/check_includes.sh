#!/usr/bin/env bash
# Fails on an #include that points the wrong way:
#   - a folder of src/ includes only folders to its left in the order below, by "folder/file.h";
#   - method folders do not include each other;
#   - programs, tests/api and tests/truth see the public headers only;
#   - only src/accel and knurl/embree.h see Embree; only src/io sees image and mesh libraries;
#   - every public header compiles alone, as C and as C++.
# Another tree can be checked by naming it (the script's own test does).
. "$(dirname "$0")/common.sh"
cd "${1:-$root}"

# One line for each include: FILE:LINE:INCLUDED, with its <> or "".
list_includes() {
    find "$@" -type f \( -name '*.c' -o -name '*.h' -o -name '*.cpp' \) -print0 2>/dev/null | sort -z |
        xargs -0 -r grep -nHE '^[[:space:]]*#[[:space:]]*include' |
        sed -E 's/^([^:]*:[0-9]+):[[:space:]]*#[[:space:]]*include[[:space:]]*([<"][^>"]*[>"]).*/\1:\2/'
}

check_order() {
    awk -F: '
        BEGIN {
            count = split("base math data io bounds shell methods accel scene render", order, " ")
            for (i = 1; i <= count; i++) rank[order[i]] = i
            media = "^<(png|jpeglib|jerror|jmorecfg|tiff|tiffio|openexr)\\.h>$|^<(OpenEXR|Imf|Imath|stb|assimp|jansson)"
        }
        function refuse(why) { print $1 ":" $2 ": " $3 ": " why; bad = 1 }
        {
            split($1, path, "/")
            included = substr($3, 2, length($3) - 2)
            quoted = substr($3, 1, 1) == "\""
            split(included, target, "/")
            embree = included ~ /^embree/ || included == "knurl/embree.h"
            library = $3 ~ media
        }
        path[1] == "include" {
            if (quoted) refuse("public headers include <knurl/...> and the C library only")
            if (embree && included ~ /^embree/ && $1 != "include/knurl/embree.h") refuse("only knurl/embree.h sees Embree")
            if (library) refuse("public headers include no image or mesh library")
            next
        }
        path[1] == "src" {
            module = path[2]
            if (!(module in rank)) refuse("src/" module " is not in the order of modules")
            if (embree && module != "accel") refuse("only src/accel sees Embree")
            if (library && module != "io") refuse("only src/io sees image and mesh libraries")
            if (!quoted) next
            if (!(target[1] in rank)) refuse("expected \"module/file.h\"")
            else if (rank[target[1]] > rank[module]) refuse("src/" module " may not include src/" target[1])
            else if (module == "methods" && path[4] != "" && target[1] == "methods" && target[3] != "" && target[2] != path[3])
                refuse("method folders do not include each other")
            next
        }
        {
            open_door = !(path[1] == "tests" && (path[2] == "unit" || path[2] == "fuzz" || path[2] == "support"))
            if (open_door && quoted && (target[1] in rank)) refuse("only <knurl/...> is visible here")
            if (open_door && library && !(path[1] == "apps" && included == "jansson.h"))
                refuse("only src/io sees image and mesh libraries")
        }
        END { exit bad }'
}

folders=()
for folder in include src apps bench tests; do [ ! -d "$folder" ] || folders+=("$folder"); done
failed=0
list_includes "${folders[@]}" | check_order || failed=1

for header in include/knurl/*.h; do
    [ -e "$header" ] || continue
    printf '#include <knurl/%s>\n' "$(basename "$header")" |
        cc -std=c17 -Wall -Wextra -Werror -fsyntax-only -Iinclude -x c - || failed=1
    printf '#include <knurl/%s>\n' "$(basename "$header")" |
        c++ -std=c++17 -Wall -Wextra -Werror -fsyntax-only -Iinclude -x c++ - || failed=1
done
[ $failed -eq 0 ] || { echo "includes: bad" >&2; exit 1; }
echo "includes: good"

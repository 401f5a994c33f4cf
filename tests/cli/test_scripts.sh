#!/usr/bin/env bash
# The scripts that guard the tree: the include check refuses what it should; seeds for fuzzing are valid.
. "$(dirname "$0")/lib.sh" "$@"
check=$source_folder/scripts/check_includes.sh

# tree PATH LINE: a tree with one source file of one line.
tree() {
    rm -rf tree
    mkdir -p "tree/$(dirname "$1")" tree/include/knurl
    echo "$2" >"tree/$1"
}
accepted() {
    tree "$@"
    expect 0 "$check" "$PWD/tree"
}
refused() { # TEXT PATH LINE
    tree "$2" "$3"
    expect 1 "$check" "$PWD/tree"
    expect_text stdout.txt "$2:1"
    expect_text stdout.txt "$1"
}
accepted src/shell/a.c '#include "bounds/heightmap.h"'
accepted src/io/a.c '#include <png.h>'
accepted src/accel/a.c '#include <embree3/rtcore.h>'
accepted src/methods/rmip/a.c '#include "methods/method.h"'
accepted src/methods/rmip/a.c '#include "methods/rmip/b.h"'
accepted apps/knurl/a.c '#include <jansson.h>'
accepted apps/knurl/a.c '#include "common.h"'
accepted tests/unit/a.c '#include "io/gltf.h"'
refused "src/bounds may not include src/shell" src/bounds/a.c '#include "shell/shell.h"'
refused "src/base may not include src/math" src/base/a.c '  #  include "math/vec.h" // why'
refused 'expected "module/file.h"' src/io/a.c '#include "gltf.h"'
refused "is not in the order of modules" src/misc/a.c '#include <math.h>'
refused "only src/accel sees Embree" src/scene/a.c '#include <knurl/embree.h>'
refused "only src/accel sees Embree" src/render/a.c '#include <embree3/rtcore.h>'
refused "only src/io sees image and mesh libraries" src/render/a.c '#include <png.h>'
refused "only src/io sees image and mesh libraries" src/scene/a.c '#include <assimp/cimport.h>'
refused "only src/io sees image and mesh libraries" apps/knurl/a.c '#include <tiffio.h>'
refused "method folders do not include each other" src/methods/tfdm/a.c '#include "methods/rmip/rmip.h"'
refused "only <knurl/...> is visible here" apps/samples/a.c '#include "base/base.h"'
refused "only <knurl/...> is visible here" tests/api/a.c '#include "math/vec.h"'
refused "only <knurl/...> is visible here" tests/truth/a.c '#include "scene/scene.h"'

# A public header that needs another one first.
tree include/knurl/a.h 'size_t knurl_size(void);'
expect 1 "$check" "$PWD/tree"

# Seeds are read by the program; every format is there.
"$python" "$source_folder/scripts/fuzz_seeds.py" seeds
for file in seeds/*; do
    case $file in
    *.csv | *.mtl) continue ;;
    esac
    expect 0 "$knurl" info "$file" -q
done
[ "$(ls seeds | wc -l)" -ge 20 ] || fail "only $(ls seeds | wc -l) seeds"

# A script that takes a number refuses a word.
expect_error 2 "usage: scripts/fuzz.sh" "$source_folder/scripts/fuzz.sh" soon
echo good

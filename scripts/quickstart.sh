#!/usr/bin/env bash
# quickstart.sh [RENDER OPTION...]: from a fresh checkout to a picture: installs what is missing, builds,
# writes the demo gallery, renders it. Options go to knurl render, for example: --spp 64 --width 1920 --height 1080
# KNURL_CMAKE_OPTIONS are added to the build's options.
. "$(dirname "$0")/common.sh"
echo "1/4 packages"
scripts/setup.sh
echo "2/4 building in build/ (a minute or two the first time)"
# shellcheck disable=SC2086 # the options are words
build_tree build -DCMAKE_BUILD_TYPE=Release -DKNURL_TESTS=OFF ${KNURL_CMAKE_OPTIONS:-}
echo "3/4 writing the demo scene to out/gallery"
scene=out/gallery/gallery.gltf
build/bin/knurl demo gallery out
echo "4/4 rendering $scene (a minute or two on two cores)"
build/bin/knurl render "$scene" -o out/knurl.png --width 960 --height 540 --spp 16 "$@"
echo
echo "The picture is $root/out/knurl.png"
echo "What is in the scene, and what it costs: build/bin/knurl info $scene"

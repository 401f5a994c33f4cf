#!/usr/bin/env bash
# cmake --install puts the program, the library, its headers and knurl.pc under any prefix.
. "$(dirname "$0")/lib.sh"
build=$(dirname "$(dirname "$knurl")")
prefix=$PWD/prefix
rm -rf "$prefix"
cmake --install "$build" --prefix "$prefix" >install.txt
[ "$("$prefix/bin/knurl" --version)" = "$("$knurl" --version)" ]
pc=$(find "$prefix" -name knurl.pc)
[ -n "$pc" ]
export PKG_CONFIG_PATH=${pc%/*}
[ -e "$(pkg-config --variable=libdir knurl)/libknurl.a" ]
# shellcheck disable=SC2046
cc -fsyntax-only $(pkg-config --cflags knurl) "$source_folder/apps/samples/embree_sample.c"
echo "installed files serve a program elsewhere"

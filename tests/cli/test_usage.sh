#!/usr/bin/env bash
# Help, versions, wrong command lines: messages name the option, what was found and what was expected.
. "$(dirname "$0")/lib.sh" "$@"

expect 0 "$knurl" --version
grep -qE '^knurl [0-9]+\.[0-9]+\.[0-9]+$' stdout.txt || fail "version is not 'knurl X.Y.Z'"

expect 0 "$knurl" --help
for command in render trace info compare bench demo methods help; do
    expect_text stdout.txt "  $command "
    expect 0 "$knurl" help "$command"
    [ -s stdout.txt ] || fail "no help on $command"
    [ "$command" = help ] || {
        cp stdout.txt help.txt
        expect 0 "$knurl" "$command" --help
        cmp -s help.txt stdout.txt || fail "help $command and $command --help differ"
    }
    expect 0 "$knurl" --help
done
for command in render trace info compare bench; do
    expect 0 "$knurl" "$command" --help
    expect_text stdout.txt "Usage: knurl $command "
    expect_text stdout.txt "Examples:"
    [ "$(wc -L <stdout.txt)" -le 80 ] || fail "help of $command is wider than 80 columns"
done
expect 0 "$knurl" methods
expect_text stdout.txt "* fast"

# Commands
expect 2 "$knurl"
expect_text stderr.txt "Usage: knurl COMMAND"
expect_error 2 "did you mean 'render'?" "$knurl" rendr
expect_error 2 "did you mean 'compare'?" "$knurl" help compre
expect_error 2 "found 'xyzzy', expected a command" "$knurl" xyzzy
! grep -q "did you mean" stderr.txt || fail "a suggestion from nowhere"

# render
write_plane
expect_error 2 "the scene file is missing" "$knurl" render -o a.png
expect_error 2 "-o FILE is missing" "$knurl" render plane.obj
expect_error 2 "found 'b.obj' after scene 'plane.obj'" "$knurl" render plane.obj b.obj -o a.png
expect_error 2 "--out: found 'a.gif', expected a name ending in .png" "$knurl" render plane.obj -o a.gif
expect_error 2 "--out: found 'a', expected a name" "$knurl" render plane.obj -o a
expect_error 2 "--width: found '0', expected a whole number from 1 to 65536" "$knurl" render plane.obj -o a.png --width 0
expect_error 2 "--width: found '12x', expected" "$knurl" render plane.obj -o a.png --width 12x
expect_error 2 "--height: found '99999999999999999999', expected" "$knurl" render plane.obj -o a.png --height 99999999999999999999
expect_error 2 "--spp: found 'many', expected" "$knurl" render plane.obj -o a.png --spp many
expect_error 2 "--seed: found '-1', expected" "$knurl" render plane.obj -o a.png --seed -1
expect_error 2 "--integrator: found 'light', expected one of path, ao, primary" "$knurl" render plane.obj -o a.png --integrator light
expect_error 2 "--method: method 'magic' is not known; methods are fast, rmip" "$knurl" render plane.obj -o a.png --method magic
expect_error 2 "--background: found '1,2', expected three numbers" "$knurl" render plane.obj -o a.png --background 1,2
expect_error 2 "--background: found '1,2,nan', expected three numbers" "$knurl" render plane.obj -o a.png --background 1,2,nan
expect_error 2 "--crop: found '0,0,10', expected four whole numbers" "$knurl" render plane.obj -o a.png --crop 0,0,10
expect_error 2 "--crop: found 90,0,20,10, expected a part of the 100 x 50" "$knurl" render plane.obj -o a.png --width 100 --height 50 --crop 90,0,20,10
expect_error 2 "--aov: found 'dept', expected some of all, depth" "$knurl" render plane.obj -o a.exr --aov albedo,dept
expect_error 2 "--lod: found '-1', expected a number from 0 to 32" "$knurl" render plane.obj -o a.png --lod -1
expect_error 2 "--exposure: found 'inf', expected" "$knurl" render plane.obj -o a.png --exposure inf
expect_error 2 "--tile: found '4', expected two numbers such as 4x4" "$knurl" render plane.obj -o a.png --tile 4
expect_error 2 "--tile: found '4x0', expected numbers other than zero" "$knurl" render plane.obj -o a.png --tile 4x0
expect_error 2 "--wrap: found 'wave', expected one of repeat, mirror, clamp" "$knurl" render plane.obj -o a.png --wrap wave
expect_error 2 "--rmip-cell: found '12', expected 1, 2, 4, 8, 16 or 32" "$knurl" render plane.obj -o a.png --rmip-cell 12
for command in render trace info capture; do
    "$knurl" $command --help >stdout.txt
    expect_text stdout.txt "--accel-budget=SIZE"
done
expect_error 2 "--accel-budget: found '2X', expected bytes such as 500M" "$knurl" render plane.obj -o a.png --accel-budget 2X
expect_error 2 "--accel-budget: found '2T', expected 1T at most" "$knurl" info plane.obj --accel-budget 2T
expect_error 2 "--accel-budget: found with --method rmip:bounds=minmax, expected method fast" "$knurl" trace plane.obj --rays a --out b --accel-budget 1M --method rmip:bounds=minmax
expect_error 2 "--accel-budget: found beside --method fast:budget=3, expected one budget" "$knurl" render plane.obj -o a.png --method fast:budget=3 --accel-budget 1M
expect_error 2 "method parameter bounds: found 'boxes', expected one of minmax|rmip" "$knurl" render plane.obj -o a.png --method rmip:bounds=boxes
expect_error 2 "method rmip: found 'speed=9', expected PARAMETER=VALUE" "$knurl" render plane.obj -o a.png --method rmip:speed=9
expect_error 2 "method parameter budget: given twice" "$knurl" render plane.obj -o a.png --method fast:budget=1:budget=2
expect_error 2 "marching-scale: found '0', expected a number from 1 to 4096" "$knurl" render plane.obj -o a.png --method rmip:marching-scale=0
expect_error 2 "--memory-limit: found '2X', expected bytes such as 500M" "$knurl" render plane.obj -o a.png --memory-limit 2X
expect_error 2 "--threads: found '4096', expected" "$knurl" render plane.obj -o a.png --threads 4096
expect_error 2 "unrecognized option '--wdth=3'" "$knurl" render plane.obj -o a.png --wdth=3
expect_error 2 "--camera: found 'top'" "$knurl" render plane.obj -o a.png --camera top

# trace, info, compare
expect_error 2 "the scene file is missing" "$knurl" trace --rays a --out b
expect_error 2 "--rays FILE is missing" "$knurl" trace plane.obj --out b
expect_error 2 "--out FILE is missing" "$knurl" trace plane.obj --rays a
expect_error 2 "the file is missing" "$knurl" info
expect_error 2 "expected two images" "$knurl" compare a.png
expect_error 2 "--min-psnr: found 'x', expected a number" "$knurl" compare a.png b.png --min-psnr x
expect_only plane.obj help.txt

# Standard output that takes nothing is an error, not a success.
if [ -w /dev/full ]; then
    found=0
    "$knurl" methods >/dev/full 2>stderr.txt || found=$?
    [ $found -eq 3 ] || fail "status $found on a full disk"
fi
echo good

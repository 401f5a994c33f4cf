#!/usr/bin/env bash
# knurl trace with CSV: the contract's columns, exact values on a flat surface, refused input.
. "$(dirname "$0")/lib.sh" "$@"
write_plane

# A plane at height 0.25, hit from above at an angle, with a direction of length 2.
cat >rays.csv <<'CSV'
ox,oy,oz,dx,dy,dz
0.25,1.25,-0.5,0,-2,0
0.25,1.25,-0.5,0,2,0
-0.5,1.25,0.5,0.5,-1,0
CSV
expect 0 "$knurl" trace plane.obj --disp-offset 0.25 --rays rays.csv --out hits.csv
cat >expected.csv <<'CSV'
hit,t,px,py,pz,ngx,ngy,ngz,nsx,nsy,nsz,u,v,height,object,triangle
1,0.5,0.25,0.25,-0.5,0,1,0,0,1,0,0.625,0.75,0.25,0,1
0,,,,,,,,,,,,,,,
1,1,0,0.25,0.5,0,1,0,0,1,0,0.5,0.25,0.25,0,0
CSV
sed 's/-0,/0,/g' hits.csv | cmp - expected.csv || { cat hits.csv; fail "hits differ"; }

# Columns in any order, CRLF, a byte order mark, blanks, no end of line at the end, tmin and tmax.
printf '\357\273\277tmax,dx,dy,dz,oz,oy,ox,tmin\r\ninf,0,-2,0, -0.5 ,1.25,0.25,0\r\n0.4,0,-2,0,-0.5,1.25,0.25,0\r\nINF,0,-2,0,-0.5,1.25,2.5e-1,0.75' >order.csv
expect 0 "$knurl" trace plane.obj --disp-offset 0.25 --rays order.csv --out out.csv
[ "$(wc -l <out.csv)" -eq 4 ] || fail "expected a header and three lines"
[ "$(sed -n 2p out.csv)" = "$(sed -n 2p hits.csv)" ] || fail "the same ray gave another hit"
[ "$(sed -n 3p out.csv)" = "0,,,,,,,,,,,,,,," ] || fail "tmax is ignored"
[ "$(sed -n 4p out.csv)" = "0,,,,,,,,,,,,,,," ] || fail "tmin is ignored"

# Rays from beyond all precision miss, and do not end the program.
printf 'ox,oy,oz,dx,dy,dz\n0,1e34,0,0,-1,0\n0,1e308,0,0,-1,0\n1e300,1,0,-1e300,0,0\n' >far.csv
expect 0 "$knurl" trace plane.obj --disp-offset 0.25 --rays far.csv --out far-hits.csv
[ "$(wc -l <far-hits.csv)" -eq 4 ] || fail "expected a header and three lines"
expect 0 "$knurl" trace plane.obj --rays far.csv --out far-hits.csv --any-hit
expect 0 "$knurl" trace plane.obj --tile 2x2 --rays rays.csv --out out.csv
expect_text stderr.txt "warning: no material has a displacement map"

# Standard input and output, any hit, no rays at all.
expect 0 "$knurl" trace plane.obj --disp-offset 0.25 --rays - --out - <rays.csv
cmp -s stdout.txt hits.csv || fail "standard output differs from the file"
expect 0 "$knurl" trace plane.obj --disp-offset 0.25 --rays rays.csv --out any.csv --any-hit
[ "$(tr '\n' ' ' <any.csv)" = "hit 1 0 1 " ] || fail "--any-hit gave $(tr '\n' ' ' <any.csv)"
echo "ox,oy,oz,dx,dy,dz" >none.csv
expect 0 "$knurl" trace plane.obj --rays none.csv --out none-hits.csv
[ "$(cat none-hits.csv)" = "$(head -n 1 hits.csv)" ] || fail "no rays should give the header only"

# Refused input: file, line, what was found, what was expected; nothing is written.
rm -f bad.out
refused() { # TEXT LINES...
    local text=$1
    shift
    printf '%s\n' "$@" >bad.csv
    expect_error 3 "$text" "$knurl" trace plane.obj --rays bad.csv --out bad.out
    [ ! -e bad.out ] || fail "an output was left after: $text"
}
header=ox,oy,oz,dx,dy,dz
good=0,1,0,0,-1,0
refused "bad.csv:3: found 'abc', expected a number (column dx)" $header $good 0,1,0,abc,-1,0
refused "bad.csv:2: found '', expected a number (column oz)" $header 0,1,,0,-1,0
refused "bad.csv:2: found '0x10', expected a number (column ox)" $header 0x10,1,0,0,-1,0
refused "bad.csv:2: found '1e', expected a number (column ox)" $header 1e,1,0,0,-1,0
refused "bad.csv:2: found '1 2', expected a number (column ox)" $header "1 2,1,0,0,-1,0"
refused "bad.csv:2: found 'nan', expected a finite number (column oy)" $header 0,nan,0,0,-1,0
refused "bad.csv:2: found '1e999', expected a finite number (column dz)" $header 0,1,0,0,-1,1e999
refused "bad.csv:3: found direction 0,0,0, expected any other" $header $good 0,1,0,0,-0,0
refused "bad.csv:3: blank line, expected a ray" $header $good "" $good
refused "bad.csv:2: found 5 fields, expected 6" $header 0,1,0,0,-1
refused "bad.csv:2: found 7 fields, expected 6" $header 0,1,0,0,-1,0,0
refused "bad.csv:1: column dz is missing" ox,oy,oz,dx,dy 1,2,3,4,5
refused "bad.csv:1: found column ox twice" ox,ox,oz,dx,dy,dz $good
refused "bad.csv:1: found 'time', expected a column name" $header,time $good,0
refused "bad.csv:2: found tmin 2 above tmax 1" $header,tmin,tmax $good,2,1
refused "bad.csv:2: found '-1', expected a number not below 0 (column tmin)" $header,tmin $good,-1
refused "bad.csv:2: found 'inf', expected a finite number (column tmin)" $header,tmin $good,inf
refused "bad.csv:1: found '', expected a column name" ""
: >empty.csv
expect_error 3 "empty.csv: is empty, expected a header" "$knurl" trace plane.obj --rays empty.csv --out bad.out
expect_error 3 "nothing.csv: No such file" "$knurl" trace plane.obj --rays nothing.csv --out bad.out
expect_error 3 "is a folder" "$knurl" trace plane.obj --rays . --out bad.out
expect_error 3 "nowhere/hits.csv: cannot write there" "$knurl" trace plane.obj --rays rays.csv --out nowhere/hits.csv
expect_error 3 "nothing.obj" "$knurl" trace nothing.obj --rays rays.csv --out bad.out
[ ! -e bad.out ] || fail "an output was left"

# A fault far into a large file: the line number is exact, an old output stays as it was.
"$python" - <<'PY'
lines = ["ox,oy,oz,dx,dy,dz"] + ["%.9g,1,%.9g,0.01,-1,0.02" % (i % 97 / 60 - 0.8, i % 89 / 60 - 0.7) for i in range(150000)]
open("large.csv", "w").write("\n".join(lines) + "\n")
lines[140000 - 1] = "0,1,0,0,-1,oops"
open("large-bad.csv", "w").write("\n".join(lines) + "\n")
PY
echo old >kept.csv
expect_error 3 "large-bad.csv:140000: found 'oops', expected a number (column dz)" \
    "$knurl" trace plane.obj --rays large-bad.csv --out kept.csv
[ "$(cat kept.csv)" = old ] || fail "a failed run changed an old output"
if ls kept.csv?* 2>/dev/null; then fail "a temporary file was left"; fi

# The number of threads changes nothing; a link stays a link; several blocks come out in order.
write_map
expect 0 "$knurl" trace plane.obj --disp map.pgm --disp-factor 0.1 --rays large.csv --out one.csv --threads 1
ln -s linked-to.csv link.csv
: >linked-to.csv
expect 0 "$knurl" trace plane.obj --disp map.pgm --disp-factor 0.1 --rays large.csv --out link.csv --threads 3
[ -L link.csv ] || fail "the link was replaced"
cmp -s one.csv linked-to.csv || fail "one and three threads differ"
[ "$(wc -l <one.csv)" -eq 150001 ] || fail "expected 150001 lines"

# Devices are written in place.
expect 0 "$knurl" trace plane.obj --rays rays.csv --out /dev/null
[ -c /dev/null ] || fail "/dev/null was replaced"
echo good

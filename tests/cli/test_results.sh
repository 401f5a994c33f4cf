#!/usr/bin/env bash
# scripts/results.sh: pages, charts and data are complete, discussions survive, missing things are named.
. "$(dirname "$0")/lib.sh" "$@"
results() {
    KNURL=$knurl "$source_folder/scripts/results.sh" --quick --out "$scratch/pages" --scenes "$scratch/scenes" "$@"
}
mkdir -p pages/discussion
echo "Skipping pays when looking straight down." >pages/discussion/kolb-tables.md
expect 0 results --only kolb-tables,rmip-figure-9
expect_text stdout.txt "maps of at most 128 texels a side"
"$python" - <<'PY'
import glob, json, os, re, xml.dom.minidom
pages = sorted(glob.glob("pages/*.md"))
assert pages == ["pages/README.md", "pages/kolb-tables.md", "pages/rmip-figure-9.md"], pages
for page in pages:
    text = open(page).read()
    for link in re.findall(r"\]\(([^)]*)\)", text):
        assert os.path.getsize(os.path.join("pages", link)) > 0, link
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        assert len({line.count("|") for line in table.strip().split("\n")}) == 1, table
for file in glob.glob("pages/*.svg"):
    xml.dom.minidom.parse(file)
    assert "nan" not in open(file).read().lower(), file
kolb = open("pages/kolb-tables.md").read()
assert "looking straight down" in kolb and kolb.count("degrees |") == 6
data = json.load(open("pages/data/kolb-tables.json"))
assert data["level"] == "quick" and len(data["runs"]) == 11 and data["skipped"] == []
assert all(run["command"].startswith("knurl bench ") and run["results"] for run in data["runs"])
views = [run["label"] for run in data["runs"]]
assert len(set(views[4:])) == 7, views
PY
expect_error 2 "found 'table-9', expected some of rmip-table-1" results --only table-9

# A program without some methods: they are named, the others are measured.
cat >some-knurl <<PROGRAM
#!/usr/bin/env bash
[ "\$1" != methods ] || { echo "* rmip  only this one"; exit; }
exec "$knurl" "\$@"
PROGRAM
chmod +x some-knurl
knurl=$scratch/some-knurl expect 0 results --only rmip-figure-9
expect_text stdout.txt "skipped: method \`tfdm\` is not in this build"
expect_text pages/rmip-figure-9.md "method \`tfdm\` is not in this build"
echo good

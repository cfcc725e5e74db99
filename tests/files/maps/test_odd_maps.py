"""Odd and damaged maps: one line that says what is wrong and what to do, and nothing written."""

import pytest

NODES = '<node id="1" lat="49" lon="9"/><node id="2" lat="49.0001" lon="9"/>'


def osm(node="", refs=(1, 2), before="", tags=""):
    return f"<osm>{before}{NODES}{node}<way id='7'>{''.join(f'<nd ref={str(r)!r}/>' for r in refs)}{tags}</way></osm>"


def far_node(lat="49.0002", lon="9", ele="1"):
    return osm(f'<node id="3" lat="{lat}" lon="{lon}"><tag k="ele" v="{ele}"/></node>', (1, 3))


def xodr(length="50", x="0", curve="<line/>", section='s="0"', lane='<width a="3"/>', head="", after=""):
    return (
        f'<OpenDRIVE>{head}<road id="1" length="{length}"><planView><geometry s="0" x="{x}" y="0" hdg="0" length="50">'
        f'{curve}</geometry></planView><lanes><laneSection {section}><right><lane id="-1">{lane}<roadMark type="solid"/>'
        f"</lane></right></laneSection>{after}</lanes></road></OpenDRIVE>"
    )


LAUGHS = '<!DOCTYPE o [<!ENTITY a "xxxxxxxx"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><{root}>&b;</{root}>'
MAPS = {
    "empty": ("", "empty file"),
    "truncated": (osm()[:-20], "is not XML"),
    "another root": ("<kml/>", "its root is kml"),
    "entities": (LAUGHS.format(root="osm"), "document type is not read"),
    "utf-16": (osm().encode("utf-16"), "is not UTF-8"),
    "latin-1": (osm(tags='<tag k="a" v="ï"/>').encode("latin-1"), "is not UTF-8"),
    "binary": (bytes(range(256)), "is not"),
    "NaN": (far_node(lat="nan"), "node 3 has no place"),
    "inf": (far_node(lon="inf"), "node 3 has no place"),
    "huge": (far_node(lat="1e308"), "node 3 has no place"),
    "height of 1e308": (far_node(ele="1e308"), "node 3 has no place"),
    "no coordinates": (osm('<node id="3"/>', (1, 3)), "node 3 has no place"),
    "dangling": (osm(refs=(1, 99)), "node 99 is not in the file"),
    "no ids": ("<osm><node lat='49' lon='9'/><way><nd/><nd/></way></osm>", "less than two places"),
    "one place": (osm(refs=(1, 1)), "way 7: less than two places"),
    "one node": (osm(refs=(1,)), "way 7: less than two places"),
    "unknown CRS": (osm(before='<MetaInfo crs="EPSG:999999"/>'), "not known to PROJ"),
}
ROADS = {
    "empty": ("", "empty file"),
    "truncated": (xodr()[:-20], "is not XML"),
    "another root": ("<osm/>", "its root is osm"),
    "entities": (LAUGHS.format(root="OpenDRIVE"), "document type is not read"),
    "utf-16": (xodr().encode("utf-16"), "is not UTF-8"),
    "binary": (bytes(range(256)), "is not"),
    "NaN": (xodr(x="nan"), "without finite s, x"),
    "huge": (xodr(x="1e308"), "beyond 1e+08 m"),
    "huge offset": (xodr(head='<header><offset x="1e300"/></header>'), "beyond 1e+08 m"),
    "curvature NaN": (xodr(curve='<arc curvature="nan"/>'), "no numbers"),
    "huge cubic": (xodr(curve='<poly3 a="0" b="0" c="1e300" d="0"/>'), "beyond 1e+08 m"),
    "cubic of nothing": (xodr(curve="<paramPoly3/>"), "a line without length"),
    "long": (xodr(length="1e12"), "a length of 1e+12 m"),
    "negative length": (xodr(length="-50"), "a length of -50 m"),
    "section far behind": (xodr(section='s="1e300"'), "sections of lanes"),
    "section far before": (xodr(section='s="-1e9"'), "sections of lanes"),
    "sections out of order": (xodr(after='<laneSection s="10"/><laneSection s="5"/>'), "sections of lanes"),
    "huge width": (xodr(lane='<width a="1e308" b="1e308"/>'), "beyond 1e+08 m"),
    "no width": (xodr(lane=""), "lane -1 has no width"),
    "no lanes": (xodr().replace("lanes>", "gone>"), "road 1: no lanes"),
    "no plan": (xodr().replace("planView>", "gone>"), "road 1: no reference line"),
}


@pytest.mark.parametrize(
    ("suffix", "content", "words"),
    [
        pytest.param(suffix, *row, id=f"{suffix} {name}")
        for suffix, table in (("osm", MAPS), ("xodr", ROADS))
        for name, row in table.items()
    ],
)
def test_damaged_maps_are_one_line_and_nothing_is_written(linework, tmp_path, suffix, content, words):
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    crs = ["--crs", "EPSG:32632"] if suffix == "osm" and "MetaInfo" not in str(content) else []
    found = linework("convert", path, tmp_path / "a.gpkg", *crs)
    assert found.code == 3 and words in found.line, found.stderr
    assert str(path) in found.line and found.line.endswith(".")
    assert list(tmp_path.iterdir()) == [path]


def test_odd_maps_that_can_be_read_are(linework, tmp_path):
    deep = f"{'<a>' * 50_000}{'</a>' * 50_000}"
    texts = {
        "plain": osm(), "deep": osm(before=deep), "twice": osm(node='<node id="1" lat="49.001" lon="9"/>'),
        "kind": osm(tags="<tag k='type' v='a/b&#10;&quot;; drop'/>"),
        "long number": osm(before='<MetaInfo crs="EPSG:32632"/>', tags=f'<tag k="line" v="{"9" * 6000}"/>'),
    }  # fmt: skip
    for name, text in texts.items():
        (tmp_path / f"{name}.osm").write_text(text)
        crs = [] if "MetaInfo" in text else ["--crs", "EPSG:32632"]
        found = linework("convert", tmp_path / f"{name}.osm", tmp_path / f"{name}.gpkg", *crs)
        assert found.code == 0 and "1 lines" in found.stdout, (name, found.stderr)

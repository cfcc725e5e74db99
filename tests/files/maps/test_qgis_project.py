"""QGIS projects: the layers of the file in its styles, found by a relative path; read by QGIS where it is installed."""

import subprocess
import zipfile
from xml.etree import ElementTree

import numpy as np
import pyogrio
import pytest
from tests.scenes.map_scenes import road_lines

from linework.errors import UsageError
from linework.files.images.geotiff import write_geotiff
from linework.files.maps.qgis_project import write_qgis_project
from linework.files.vectors.read_write import write_lines
from linework.model.grid import Grid, Image

_BY_QGIS = """
import sys
from qgis.core import QgsApplication, QgsProject
app = QgsApplication([], False); app.initQgis()
project = QgsProject.instance()
assert project.read(sys.argv[1])
for layer in project.mapLayers().values():
    if layer.type() != 0:
        print(layer.name(), layer.isValid(), layer.crs().authid(), layer.renderer().type())
        continue
    print(layer.name(), layer.isValid(), layer.featureCount(), layer.crs().authid(),
          layer.renderer().symbol().color().name())
print("project", project.crs().authid(), len(project.layerTreeRoot().findLayers()))
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "maps & more").mkdir()
    write_lines(road_lines(), tmp_path / "lines.gpkg")
    return tmp_path


def test_layers_are_those_of_the_file(linework, folder):
    project = folder / "maps & more" / "road.qgz"
    found = linework("convert", folder / "lines.gpkg", project)
    assert found.code == 0 and found.stdout.startswith("7 layers of")
    with zipfile.ZipFile(project) as archive:
        assert archive.namelist() == ["road.qgs"]
        root = ElementTree.fromstring(archive.read("road.qgs"))
    sources = [layer.findtext("datasource") for layer in root.iter("maplayer")]
    names = [str(name) for name, kind in pyogrio.list_layers(folder / "lines.gpkg") if kind]
    assert sources == [f"../lines.gpkg|layername={name}" for name in names]
    assert (project.parent / sources[0].split("|")[0]).resolve() == (folder / "lines.gpkg").resolve()
    ids = [layer.findtext("id") for layer in root.iter("maplayer")]
    assert [layer.get("id") for layer in root.iter("layer-tree-layer")] == ids
    assert root.find("projectCrs/spatialrefsys/authid").text == "EPSG:25832"
    assert len(list(root.iter("renderer-v2"))) == 7
    assert linework("convert", folder / "lines.gpkg", project).code == 6
    write_qgis_project(folder / "lines.gpkg", folder / "maps & more" / "b.qgz")
    with zipfile.ZipFile(folder / "maps & more" / "b.qgz") as archive:
        assert ElementTree.tostring(ElementTree.fromstring(archive.read("b.qgs"))) == ElementTree.tostring(
            root
        )


def test_qgis_opens_it(folder):
    python = "/usr/bin/python3"
    if subprocess.run([python, "-c", "import qgis.core"], capture_output=True).returncode:
        pytest.skip("no QGIS: apt install python3-qgis")
    write_image(folder / "density.tif")
    write_qgis_project(folder / "lines.gpkg", folder / "road.qgz", [folder / "density.tif"])
    environment = {"QT_QPA_PLATFORM": "offscreen", "PATH": "/usr/bin", "HOME": str(folder)}
    done = subprocess.run(
        [python, "-c", _BY_QGIS, str(folder / "road.qgz")], capture_output=True, text=True, env=environment
    )
    rows = [line.split() for line in done.stdout.splitlines()]
    assert ["guardrail", "True", "1", "EPSG:25832", "#0072b2"] in rows, done.stderr
    assert ["road_boundary", "True", "2", "EPSG:25832", "#d55e00"] in rows
    assert ["density.tif", "True", "EPSG:25832", "singlebandgray"] in rows
    assert rows[-1] == ["project", "EPSG:25832", "8"]


def write_image(path):
    cells = np.arange(200, dtype=np.float32).reshape(10, 20)
    write_geotiff(Image(cells, Grid(500_000.0, 5_400_000.0, 0.5, 0.5, 10, 20)), path, crs="EPSG:25832")


def test_images_and_points_lie_below_the_lines(linework, folder):
    write_image(folder / "density.tif")
    for name in ("a.LAZ", "b.copc.laz"):
        (folder / name).write_bytes(b"QGIS reads it")
    below = [
        part for name in ("density.tif", "a.LAZ", "b.copc.laz") for part in ("--background", folder / name)
    ]
    found = linework("convert", folder / "lines.gpkg", folder / "maps & more" / "road.qgz", *below)
    assert found.code == 0, found.stderr
    with zipfile.ZipFile(folder / "maps & more" / "road.qgz") as archive:
        root = ElementTree.fromstring(archive.read("road.qgs"))
    layers = [
        (layer.get("type"), layer.findtext("provider"), layer.findtext("datasource"))
        for layer in root.iter("maplayer")
    ]
    assert layers[-3:] == [
        ("raster", "gdal", "../density.tif"), ("point-cloud", "pdal", "../a.LAZ"), ("point-cloud", "copc", "../b.copc.laz"),
    ]  # fmt: skip
    assert [layer.get("id") for layer in root.iter("layer-tree-layer")] == [
        layer.findtext("id") for layer in root.iter("maplayer")
    ]


@pytest.mark.parametrize(("name", "output", "code", "said"), [
    ("missing.tif", "a.qgz", 3, "missing.tif"), ("odd.tif", "a.qgz", 3, "not a GeoTIFF"), ("lines.dxf", "a.qgz", 2, "Give a .tif"), ("density.tif", "a.geojson", 2, "Give a .qgz"),
])  # fmt: skip
def test_what_cannot_lie_below_is_one_line(linework, folder, name, output, code, said):
    write_image(folder / "density.tif")
    (folder / "odd.tif").write_text("an image?")
    found = linework("convert", folder / "lines.gpkg", folder / output, "--background", folder / name)
    assert found.code == code and said in found.line
    assert not (folder / output).exists()


def test_other_formats_have_no_projects(folder):
    with pytest.raises(UsageError, match="needs a GeoPackage"):
        write_qgis_project(folder / "lines.dxf", folder / "a.qgz")

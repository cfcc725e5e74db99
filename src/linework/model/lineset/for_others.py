"""What a LineSet offers to other libraries and to notebooks.

Separate from `linework.model.lines`, which would be too long with it. Each library is imported when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from linework.arrays import AnyArray
from linework.errors import printable

if TYPE_CHECKING:
    from linework.model.lines import LineSet


class ForOtherLibraries:
    """Base of `LineSet`: conversions to and from shapely, GeoPandas and Arrow, and pictures."""

    __slots__ = ()

    @property
    def _lines(self) -> LineSet:
        return cast("LineSet", self)

    def __repr__(self) -> str:
        from linework.model.lineset.shown import text_of

        return printable(text_of(self._lines), keep="\n")

    def _repr_html_(self) -> str:
        from linework.model.lineset.shown import html_of

        return html_of(self._lines)

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The lines as a GeoJSON-like FeatureCollection with 3-D coordinates and all columns as properties.

        Values that are not known are None. Coordinates stay in the set's CRS, which the member "crs" names.
        """
        from linework.model.lineset.geometries import feature_collection

        return feature_collection(self._lines)

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        """Return the lines as an Arrow stream: a row per line, its geometry as a GeoArrow linestring with the CRS.

        Columns of vertices are lists. Whoever reads Arrow takes the set itself: ``polars.DataFrame(lines)``,
        ``pyarrow.table(lines)``, ``duckdb.sql("FROM lines")``, ``geopandas.GeoDataFrame.from_arrow(lines)``.
        """
        from linework.model.lineset.arrow import table_of

        return table_of(self._lines).__arrow_c_stream__(requested_schema)

    def to_shapely(self) -> AnyArray:
        """Return the lines as (m,) shapely LineString Z; their columns stay behind.

        Raises
        ------
        InputError
            A line of a single vertex.
        """
        from linework.model.lineset.geometries import geometries

        return geometries(self._lines)

    @classmethod
    def from_shapely(cls, shapes: Any, *, crs: Any = "local", **columns: Any) -> LineSet:
        """Return a set of the lines in shapely geometries.

        Parameters
        ----------
        shapes
            (m,) LineStrings; multi-part geometries become one line per part, polygons one closed line per ring.
            Missing heights are NaN.
        crs
            As in `from_lines`.
        **columns
            Columns by name: a value per geometry, or a value per vertex, concatenated.

        Raises
        ------
        InputError
            A geometry that does not consist of lines.

        Examples
        --------
        >>> import shapely
        >>> from linework import LineSet
        >>> LineSet.from_shapely([shapely.LineString([[0, 0, 5], [3, 4, 5]])], kind="guardrail").length_m.tolist()
        [5.0]
        """
        from linework.model.lineset.geometries import lines_of_shapes

        return lines_of_shapes(shapes, crs, columns)

    def to_geopandas(self, *, per_vertex: bool = True) -> Any:
        """Return the lines as a `geopandas.GeoDataFrame`: geometry, CRS and all columns.

        Parameters
        ----------
        per_vertex
            Include the columns of vertices, as arrays. False: leave them out, for formats that hold no lists.

        Raises
        ------
        MissingPackageError
            GeoPandas is not installed.
        """
        from linework.model.lineset.frames import frame_of

        return frame_of(self._lines, per_vertex=per_vertex)

    @classmethod
    def from_geopandas(cls, frame: Any, *, crs: Any = "local", **columns: Any) -> LineSet:
        """Return a set of the lines in a `geopandas.GeoDataFrame`.

        Parameters
        ----------
        frame
            A row per line. Columns with the names of a LineSet's are taken, missing values as "" or NaN; those of
            vertices must be lists. Other columns are ignored.
        crs
            CRS where the frame does not state it.
        **columns
            Columns that replace those of the frame: ``kind="guardrail"``.

        Raises
        ------
        InputError
            A geometry that does not consist of lines, or a list of another length than the line.
        CrsError
            The frame is in degrees.
        """
        from linework.model.lineset.frames import lines_of_frame

        return lines_of_frame(frame, crs, columns)

    @classmethod
    def from_arrow(cls, table: Any, *, crs: Any = "local", **columns: Any) -> LineSet:
        """Return a set of the lines in an Arrow table, such as one of pyarrow, polars or DuckDB.

        Parameters
        ----------
        table
            An object with ``__arrow_c_stream__``. The geometry is the column that GeoArrow's metadata mark, or one
            named "geometry" or "geom"; lists of positions or WKB.
        crs
            CRS where the table does not state it: DuckDB leaves it out.
        **columns
            Columns that replace those of the table.

        Raises
        ------
        InputError
            There is no column of lines, or a list of another length than the line.
        """
        from linework.model.lineset.arrow import lines_of_table

        return lines_of_table(table, crs, columns)

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the lines in plan, to scale, a colour per kind, bridged stretches dashed; return the axes.

        Parameters
        ----------
        ax
            matplotlib axes; None: those of a new figure.
        **options
            Passed to `matplotlib.collections.LineCollection`: linewidths, colors, alpha ...

        Raises
        ------
        MissingPackageError
            matplotlib is not installed.
        """
        from linework.model.lineset.plotted import plot_lines

        return plot_lines(self._lines, ax, **options)

"""Restrictions of GDAL: import this wherever pyogrio or rasterio is imported.

Opening a file with GDAL can reach other files and the network. Two copies of GDAL live in this process
(pyogrio's and rasterio's); both read this variable. A value set by the user stays.
"""

from __future__ import annotations

import os

os.environ.setdefault("CPL_VSIL_CURL_ALLOWED_EXTENSIONS", ".invalid")

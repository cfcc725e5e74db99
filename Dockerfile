# The command line of linework, all extras included. See docs/install.md for how to run it.
#
#   docker build -t linework .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" linework extract points/*.laz -o lines.gpkg
FROM python:3.12-slim AS build
WORKDIR /source
# What changes rarely comes first: a change of the sources installs no dependency again
COPY constraints.txt pyproject.toml README.md LICENSE ./
RUN python -m venv /opt/linework \
    && mkdir -p src/linework && printf '__version__ = "0"\n' > src/linework/__init__.py \
    && /opt/linework/bin/pip install --no-cache-dir --constraint constraints.txt '.[all]' \
    && /opt/linework/bin/pip uninstall --yes linework
COPY src src
RUN /opt/linework/bin/pip install --no-cache-dir --no-deps .
# Compiled code is valid for sources of one modification time, and layers of images keep whole seconds of it
RUN ["/opt/linework/bin/python", "-c", "import os, pathlib; [os.utime(path, (int(path.stat().st_mtime),) * 2) for path in pathlib.Path('/opt/linework').rglob('*.py')]"]
# Compiled here once, for any processor of this architecture, instead of at the first run of every container
RUN NUMBA_CPU_NAME=generic NUMBA_CACHE_DIR=/opt/kernels /opt/linework/bin/python -c 'import linework; linework.compile_kernels()' \
    && chmod -R a+rwX /opt/kernels

FROM python:3.12-slim
COPY --from=build /opt/linework /opt/linework
COPY --from=build /opt/kernels /opt/kernels
ENV PATH=/opt/linework/bin:$PATH NUMBA_CPU_NAME=generic NUMBA_CACHE_DIR=/opt/kernels HOME=/tmp
RUN useradd --uid 1000 --no-create-home linework
USER linework
WORKDIR /data
ENTRYPOINT ["linework"]
CMD ["--help"]

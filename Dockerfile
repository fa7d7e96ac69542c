# ctrlgen from its wheel, with a C compiler, on Debian. `make release` builds the wheel; then
#   docker build --tag ctrlgen:0.1.0 .
#   docker run --rm --volume "$PWD:/work" ctrlgen:0.1.0 run scenarios/circle20 --out out/circle20
FROM python:3.11-slim
ARG VERSION=0.1.0
# `run`, `compare` and `verify` build the generated C
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
COPY dist/ctrlgen-${VERSION}-py3-none-any.whl /tmp/
RUN pip install --no-cache-dir "/tmp/ctrlgen-${VERSION}-py3-none-any.whl[recordings,view]" && rm /tmp/*.whl
RUN useradd --create-home user
USER user
WORKDIR /work
# it is tried while it is built
RUN cd /tmp && ctrlgen example circle20 --to scenarios && ctrlgen run scenarios/circle20 --out out/circle20 && rm -r scenarios out
ENTRYPOINT ["ctrlgen"]
CMD ["--help"]

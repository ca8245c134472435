# SPDX-License-Identifier: Apache-2.0
# docker build -t dkb-slam . && docker run --rm -v "$PWD:/data" dkb-slam run /data/sequence --out /data/result
FROM debian:12-slim AS build
WORKDIR /src
RUN apt-get update -qq && apt-get install -y -qq --no-install-recommends make && rm -rf /var/lib/apt/lists/*
# The packages alone first: they are installed anew only when the list changes.
COPY scripts/deps.sh scripts/deps.sh
RUN bash scripts/deps.sh && rm -rf /var/lib/apt/lists/*
COPY . .
RUN make install PREFIX=/opt/dkb-slam

FROM debian:12-slim
RUN apt-get update -qq \
 && apt-get install -y -qq --no-install-recommends libpng16-16 libjpeg62-turbo libyaml-cpp0.7 libfmt9 libbz2-1.0 \
      liblz4-1 libzstd1 libsqlite3-0 libopencv-dnn406 libopencv-features2d406 \
 && rm -rf /var/lib/apt/lists/*
COPY --from=build /opt/dkb-slam /usr/local
RUN ldconfig
WORKDIR /data
ENTRYPOINT ["dkb-slam"]

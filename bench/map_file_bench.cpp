// SPDX-License-Identifier: Apache-2.0
// Size of a map file and the time to make and to read it, for keyframes of 1000 features of which 600 are tried for
// points. Usage: map_file_bench [keyframes]
#include <fmt/core.h>

#include <cstdlib>

#include "dkb/map/map_file.h"
#include "dkb/map/map_test_tools.h"
#include "dkb/util/timing.h"

int main(int argc, char** argv) {
  using namespace dkb;
  const int keyframes = argc > 1 ? std::atoi(argv[1]) : 500;
  Random random(1);
  Map map;
  for (int k = 0; k < keyframes; ++k) test::add_random_keyframe(map, random, 1000, 600, 160);
  MapFileContext context;
  context.camera = test::distorted_camera();
  for (int round = 0; round < 3; ++round) {
    const Stopwatch encoding;
    const std::string bytes = encode_map(map, context);
    const double encode_ms = encoding.ms();
    const Stopwatch decoding;
    const MapFile file = decode_map(bytes, "map.dkb");
    fmt::print("{} keyframes, {} points: {:.1f} kB per keyframe, encode {:.0f} ms, decode {:.0f} ms\n", keyframes,
               file.map.point_count(), static_cast<double>(bytes.size()) / 1000.0 / keyframes, encode_ms,
               decoding.ms());
  }
  return 0;
}

// SPDX-License-Identifier: Apache-2.0
// Place recognition on real frames: the second half of TUM fr1_xyz looks at the desk of the first half again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

// jpeglib.h relies on what stdio declares.
#include <jpeglib.h>

#include "dkb/features/orb_extractor.h"
#include "dkb/place/place_index.h"
#include "dkb/util/files.h"
#include "dkb/util/test_data.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;

GreyImage read_jpeg(const fs::path& path) {
  const std::string bytes = read_file(path);
  jpeg_decompress_struct jpeg;
  jpeg_error_mgr errors;
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  jpeg.out_color_space = JCS_GRAYSCALE;
  jpeg_start_decompress(&jpeg);
  GreyImage image(static_cast<int>(jpeg.output_width), static_cast<int>(jpeg.output_height));
  while (jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = image.row(static_cast<int>(jpeg.output_scanline));
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_decompress(&jpeg);
  jpeg_destroy_decompress(&jpeg);
  return image;
}

struct Listed {
  double stamp;
  std::string path;
};

std::vector<Listed> rgb_list(const fs::path& folder) {
  std::vector<Listed> list;
  std::ifstream in(folder / "rgb.txt");
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream row(line);
    Listed entry;
    if (row >> entry.stamp >> entry.path) list.push_back(entry);
  }
  return list;
}

// Position of the camera by the ground truth row that is nearest in time.
std::array<double, 3> position_at(const fs::path& folder, double stamp) {
  std::ifstream in(folder / "groundtruth.txt");
  std::array<double, 3> best{};
  double min_difference = 1e9;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream row(line);
    double t, x, y, z;
    if (row >> t >> x >> y >> z && std::abs(t - stamp) < min_difference) {
      min_difference = std::abs(t - stamp);
      best = {x, y, z};
    }
  }
  return best;
}

double distance(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

TEST(PlaceIndexOnRealFrames, FindsTheDeskAgain) {
  const fs::path data = test_data();
  const fs::path desk = data / "rgbd_dataset_freiburg1_xyz",
                 office = data / "rgbd_dataset_freiburg3_walking_halfsphere";
  if (!fs::exists(desk / "rgb.txt") || !fs::exists(office / "rgb.txt")) GTEST_SKIP() << "skipped: no TUM sequences";

  OrbExtractor extractor;
  PlaceIndex index;
  const auto frames = rgb_list(desk);
  std::vector<std::array<double, 3>> positions;
  int32_t id = 0;
  for (size_t i = 0; i < frames.size() / 2; i += 8, ++id) {
    index.add(id, extractor.extract(read_jpeg(desk / frames[i].path)).descriptors);
    positions.push_back(position_at(desk, frames[i].stamp));
  }
  const int32_t first_strange = id;
  const auto elsewhere = rgb_list(office);
  for (size_t i = 0; i < elsewhere.size(); i += 2, ++id)
    index.add(id, extractor.extract(read_jpeg(office / elsewhere[i].path)).descriptors);

  int queries = 0, at_1 = 0, at_5 = 0;
  for (size_t i = frames.size() / 2 + 15; i < frames.size(); i += 6, ++queries) {
    const auto matches = index.query(extractor.extract(read_jpeg(desk / frames[i].path)).descriptors, 5);
    const auto here = position_at(desk, frames[i].stamp);
    // Right: a keyframe of the desk, from not more than 10 cm farther away than the nearest there is.
    double nearest = 1e9;
    for (const auto& p : positions) nearest = std::min(nearest, distance(p, here));
    const auto right = [&](const PlaceMatch& m) {
      return m.id < first_strange && distance(positions[static_cast<size_t>(m.id)], here) <= nearest + 0.10;
    };
    at_1 += !matches.empty() && right(matches[0]);
    at_5 += std::any_of(matches.begin(), matches.end(), right);
  }
  RecordProperty("recall_at_1", std::to_string(at_1 / static_cast<double>(queries)));
  RecordProperty("recall_at_5", std::to_string(at_5 / static_cast<double>(queries)));
  EXPECT_GE(queries, 15);
  EXPECT_GE(at_5, 0.95 * queries);
  EXPECT_GE(at_1, 0.8 * queries);
}

}  // namespace
}  // namespace dkb

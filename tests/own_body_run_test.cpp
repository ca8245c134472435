// SPDX-License-Identifier: Apache-2.0
// A robot that sees a part of itself, through the whole program: the camera's mask leaves it out.
#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/dataset/image_codecs.h"
#include "dkb/util/files.h"
#include "dkb/util/random.h"
#include "e2e_support.h"
#include "people_support.h"

namespace dkb::test {
namespace {
namespace fs = std::filesystem;

constexpr int kBodyTop = 320;  // [px] from there down every image shows the robot

// Each colour image of a sequence with the same patterned body at its lower end.
void put_body(const fs::path& folder) {
  Random random(1);
  Image<uint8_t> squares(640 / 8, (480 - kBodyTop) / 8);  // grey levels of 8 px each
  std::generate(squares.data(), squares.data() + squares.size(),
                [&] { return static_cast<uint8_t>(random.uniform(20, 235)); });
  ColourImage body(640, 480 - kBodyTop);
  for (int y = 0; y < body.height(); ++y)
    for (int x = 0; x < body.width(); ++x) {
      const uint8_t level = squares(x / 8, y / 8);
      body(x, y) = {level, level, level};
    }
  for (const auto& row : rows_of(folder / "rgb.txt")) {
    ColourImage image = decode_picture(read_file(folder / row[1]), row[1]).colour;
    std::copy(body.data(), body.data() + body.size(), image.row(kBodyTop));
    write_file_atomically(folder / row[1], encode_png(image, 1));
  }
}

int features_on_body(const fs::path& csv) {
  int on_body = 0;
  for (const auto& [stamp, features] : read_features(csv))
    on_body += static_cast<int>(
        std::count_if(features.begin(), features.end(), [](const FeatureRow& f) { return f.y > kBodyTop - 2; }));
  return on_body;
}

TEST(OwnBody, TheCamerasMaskLeavesItOut) {
  const TempFolder temp;
  const fs::path data = temp / "sequence";
  copy_sequence(data, kSequenceFrames, true);
  put_body(data);
  GreyImage mask(640, 480);
  std::fill(mask.row(kBodyTop), mask.data() + mask.size(), uint8_t{255});
  write_file_atomically(data / "body.png", encode_png(mask));
  const fs::path plain = data / "camera.yaml", masked = data / "masked.yaml";
  write_text(masked, read_text(plain) + "mask: body.png\n");

  const SlamRun without(data, temp / "without", {"--dump-features", "--camera", plain.string()}),
      with(data, temp / "with", {"--dump-features", "--dense", "--camera", masked.string()});
  ASSERT_EQ(with.finished.exit_code, 0) << with.finished.err;
  EXPECT_GT(features_on_body(without.out / "features.csv"), 1000) << "the pattern has corners";
  EXPECT_EQ(features_on_body(with.out / "features.csv"), 0);
  EXPECT_EQ(with.stats.at("tracked"), kSequenceFrames);
  EXPECT_LT(ape_of(data, with.out / "trajectory.txt"), 0.01);
  EXPECT_LT(ape_of(data, with.out / "trajectory.txt"), ape_of(data, without.out / "trajectory.txt"));
}

}  // namespace
}  // namespace dkb::test

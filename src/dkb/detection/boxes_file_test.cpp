// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/boxes_file.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"
#include "dkb/util/random.h"
#include "dkb/util/stamps.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

std::string error_of(const std::string& text) {
  return test::input_error_of([&] { parse_boxes(text, "b.txt", 640, 480); });
}

TEST(BoxesFile, RowsAreGroupedByStampAndSorted) {
  const BoxesByTime boxes = parse_boxes(
      "\xEF\xBB\xBF# rgb_timestamp class x y w h score\r\n\r\n2.5 person 10 20 30 40 0.75\r\n1.5 dog 1 2 3 4\r\n"
      "2.5 chair 5 6 7 8 0.5 more",
      "b.txt", 640, 480);
  ASSERT_EQ(boxes.size(), 2u);
  EXPECT_EQ(boxes[0].timestamp, 1.5);
  EXPECT_EQ(boxes[0].boxes, (std::vector<Detection>{{"dog", {1, 2, 3, 4}, 1.0f}}));
  EXPECT_EQ(boxes[1].boxes,
            (std::vector<Detection>{{"person", {10, 20, 30, 40}, 0.75f}, {"chair", {5, 6, 7, 8}, 0.5f}}));
}

TEST(BoxesFile, BoxesAreClippedToTheImage) {
  EXPECT_EQ(parse_boxes("1 person -10 400 30 200", "b.txt", 640, 480)[0].boxes[0].box, (Box{0, 400, 20, 80}));
}

TEST(BoxesFile, BadLinesAreNamedByLine) {
  const std::string good = "# head\n1 person 1 2 3 4\n";
  for (const char* bad :
       {"1 person 1 2 3", "1 person nan 2 3 4", "1 person 1 2 inf 4", "x person 1 2 3 4", "1 person 1 2 0 4",
        "1 person 1 2 3 -4", "1 person 640 2 3 4", "1 person 1 480 3 4", "1 person -9 2 9 4", "1 person 1 -9 3 9",
        "1 person 1 2 3 4 high", "1 person 1,5 2 3 4", "1 person 1e300 2 3 4"})
    EXPECT_EQ(error_of(good + bad + "\n").find("b.txt:3: "), 0u) << bad << ": " << error_of(good + bad);
}

TEST(BoxesFile, SharesOfTheImageAreRefused) {
  EXPECT_EQ(error_of("# head\n1 person 0.25 0.5 0.1 0.2\n2 person 0.3 0.5 0.1 0.2\n").find("b.txt:2: "), 0u);
  EXPECT_EQ(parse_boxes("1 person 0 0 1 1\n1 person 1 2 3 4\n", "b.txt", 640, 480)[0].boxes.size(), 2u);
}

TEST(BoxesFile, MissingFilesAreNamed) {
  EXPECT_THROW(FileDetector("/nowhere/b.txt", 640, 480), InputError);
}

TEST(BoxesFile, AnyMutationIsReadOrRefused) {
  const std::string whole =
      "# t c x y w h s\n1305031102.175304 person 0 119 107 236 0.389\n1305031102.211214 person 0 115 109 237\n";
  Random random(3);
  for (int i = 0; i < 20000; ++i) {
    std::string text = whole;
    for (uint32_t k = 1 + random.below(4); k > 0; --k)
      text[random.below(static_cast<uint32_t>(text.size()))] = static_cast<char>(random.below(256));
    try {
      for (const TimedBoxes& at : parse_boxes(text, "b.txt", 640, 480))
        for (const Detection& d : at.boxes) {
          EXPECT_GT(d.box.w, 0);
          EXPECT_LE(d.box.x + d.box.w, 640);
          EXPECT_GT(d.box.h, 0);
          EXPECT_LE(d.box.y + d.box.h, 480);
        }
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find("b.txt:"), 0u);
    }
  }
}

TEST(FileDetector, TakesTheNearestStampWithinTwoMilliseconds) {
  FileDetector detector(BoxesByTime{{1.000, {{"a", {0, 0, 1, 1}, 1}}}, {1.003, {{"b", {0, 0, 1, 1}, 1}}}});
  const auto class_at = [&](double stamp) {
    DetectorInput image;
    image.stamp_ns = ns_from_seconds(stamp);
    const Detections found = detector.detect(image);
    return found.boxes.empty() ? "" : found.boxes[0].class_name;
  };
  EXPECT_EQ(class_at(1.0), "a");
  EXPECT_EQ(class_at(1.0012), "a");
  EXPECT_EQ(class_at(1.0018), "b");
  EXPECT_EQ(class_at(1.0049), "b");
  EXPECT_EQ(class_at(1.0055), "");
  EXPECT_EQ(class_at(0.9975), "");
}

}  // namespace
}  // namespace dkb

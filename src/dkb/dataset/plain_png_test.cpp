// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/plain_png.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/mutation_test_tools.h"

namespace dkb::formats {
namespace {

std::string word(size_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 255);
  return bytes;
}

std::string chunk(const std::string& type, const std::string& data) {
  const std::string checked = type + data;
  return word(data.size()) + checked + word(crc32(0, reinterpret_cast<const Bytef*>(checked.data()), checked.size()));
}

std::string deflated(const std::string& bytes) {
  std::string out(compressBound(bytes.size()), '\0');
  uLongf size = out.size();
  compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  out.resize(size);
  return out;
}

struct PlainImage {
  int width = 0, height = 0, bpp = 1;  // 16-bit samples stand as they do in the file
  std::vector<uint8_t> bytes;

  PlainImage(int w, int h, int bytes_per_pixel, Random& random) : width(w), height(h), bpp(bytes_per_pixel) {
    for (int i = 0; i < w * h * bpp; ++i)  // small and large steps, so that every choice of every filter is made
      bytes.push_back(static_cast<uint8_t>(random.below(3) == 0 ? random.below(256) : random.below(6)));
  }
  int at(int x, int y) const { return x < 0 || y < 0 ? 0 : bytes[static_cast<size_t>(y * width * bpp + x)]; }
  // What the PNG specification predicts for byte x of row y.
  int expected(int filter, int x, int y) const {
    const int left = at(x - bpp, y), above = at(x, y - 1), corner = y > 0 ? at(x - bpp, y - 1) : 0;
    const int sum = left + above - corner;
    const int from_left = std::abs(sum - left), from_above = std::abs(sum - above),
              from_corner = std::abs(sum - corner);
    switch (filter) {
      case 1:
        return left;
      case 2:
        return above;
      case 3:
        return (left + above) / 2;
      case 4:
        return from_left <= from_above && from_left <= from_corner ? left : from_above <= from_corner ? above : corner;
      default:
        return 0;
    }
  }
  std::string filtered(Random& random) const {
    std::string rows;
    for (int y = 0; y < height; ++y) {
      const auto filter = static_cast<int>(random.below(5));
      rows += static_cast<char>(filter);
      for (int x = 0; x < width * bpp; ++x) rows += static_cast<char>(at(x, y) - expected(filter, x, y));
    }
    return rows;
  }
  std::string header(char interlace = 0) const {
    return "\x89PNG\r\n\x1A\n" +
           chunk("IHDR", word(static_cast<size_t>(width)) + word(static_cast<size_t>(height)) +
                             static_cast<char>(bpp == 2 ? 16 : 8) + static_cast<char>(bpp == 3 ? 2 : 0) +
                             std::string(2, '\0') + interlace);
  }
  std::vector<uint8_t> in_machine_order() const {
    std::vector<uint8_t> swapped = bytes;
    if (bpp == 2)
      for (size_t i = 0; i < swapped.size(); i += 2) std::swap(swapped[i], swapped[i + 1]);
    return swapped;
  }
  // Empty when it is not read.
  std::vector<uint8_t> read_from(const std::string& file) const {
    std::vector<uint8_t> out(bytes.size());
    return decode_plain_png(file, width, height, bpp, out.data()) ? out : std::vector<uint8_t>();
  }
};

const std::string kEnd = chunk("IEND", "");

class PlainPngTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!DKB_HAS_DEFLATE) GTEST_SKIP() << "skipped: this build has no libdeflate";
  }
  Random random_{4};
};

TEST_F(PlainPngTest, EveryFilterIsUndoneAtEverySize) {
  for (const int bpp : {1, 2, 3})
    for (int width = 1; width < 50; ++width)
      for (int height = 1; height < 18; height += width < 15 ? 1 : 7) {
        const PlainImage image(width, height, bpp, random_);
        const std::string file = image.header() + chunk("IDAT", deflated(image.filtered(random_))) + kEnd;
        ASSERT_EQ(image.read_from(file), image.in_machine_order()) << bpp << " " << width << "x" << height;
      }
}

TEST_F(PlainPngTest, LibpngReadsTheSame) {
  const PlainImage image(150, 120, 3, random_);
  std::string stream = deflated(image.filtered(random_));
  const std::string plain = image.header() + chunk("IDAT", stream) + kEnd;
  const std::string other = image.header() + chunk("PLTE", std::string(3, '\0')) + chunk("IDAT", stream) + kEnd;
  EXPECT_TRUE(image.read_from(other).empty());
  EXPECT_EQ(decode_picture(plain, "a").colour, decode_picture(other, "b").colour);
}

TEST_F(PlainPngTest, PixelsMayBeInPiecesAndTextBesideThem) {
  const PlainImage image(9, 7, 2, random_);
  const std::string stream = deflated(image.filtered(random_));
  const std::string first = chunk("IDAT", stream.substr(0, 5)), second = chunk("IDAT", stream.substr(5));
  const std::string text = chunk("tEXt", std::string("a\0b", 3));
  EXPECT_EQ(image.read_from(image.header() + text + first + second + text + kEnd + "more"), image.in_machine_order());
  EXPECT_TRUE(image.read_from(image.header() + first + text + second + kEnd).empty()) << "the pieces are apart";
}

TEST_F(PlainPngTest, WhatIsNotPlainOrNotSoundIsLeftToLibpng) {
  const PlainImage image(40, 30, 1, random_);
  const std::string rows = image.filtered(random_), pixels = chunk("IDAT", deflated(rows));
  const std::string whole = image.header() + pixels + kEnd;
  ASSERT_FALSE(image.read_from(whole).empty());
  for (size_t n = 0; n < whole.size(); ++n) EXPECT_TRUE(image.read_from(whole.substr(0, n)).empty()) << n;
  std::string wrong_filter = rows;
  wrong_filter[41] = 5;
  for (const std::string& file :
       {image.header(1) + pixels + kEnd, image.header() + chunk("tRNS", std::string(2, '\0')) + pixels + kEnd,
        image.header() + chunk("ABCD", "") + pixels + kEnd, image.header() + kEnd,
        image.header() + image.header() + kEnd, image.header() + chunk("IDAT", deflated(wrong_filter)) + kEnd,
        image.header() + chunk("IDAT", deflated(rows + " ")) + kEnd,
        image.header() + chunk("IDAT", deflated(rows.substr(1))) + kEnd})
    EXPECT_TRUE(image.read_from(file).empty());
  std::string flipped = whole;
  flipped[whole.size() / 2] ^= 1;
  EXPECT_TRUE(image.read_from(flipped).empty());
}

TEST_F(PlainPngTest, MutatedPixelsUnderRightChecksumsAreReadOrLeft) {
  const PlainImage image(24, 18, 3, random_);
  const std::string rows = image.filtered(random_), stream = deflated(rows);
  int read = 0;
  for (int i = 0; i < 3000; ++i) {
    const std::string changed = i % 2 == 0 ? mutated(stream, random_) : deflated(mutated(rows, random_));
    const std::string body = chunk("IDAT", changed) + kEnd;
    read += image.read_from(image.header() + body).empty() ? 0 : 1;
    read += image.read_from(mutated(image.header(), random_) + body).empty() ? 0 : 1;
  }
  EXPECT_GT(read, 100);
}

}  // namespace
}  // namespace dkb::formats

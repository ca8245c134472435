// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/image_codecs.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

ColourImage colour_picture(int width = 37, int height = 23) {
  ColourImage image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image(x, y) = {static_cast<uint8_t>(5 * x), static_cast<uint8_t>(7 * y), static_cast<uint8_t>(100 + x - y)};
  return image;
}

Image<float> float_depth(int width = 19, int height = 17) {
  Image<float> image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image(x, y) = 1.0f + 0.01f * static_cast<float>(x) + 0.1f * static_cast<float>(y);
  return image;
}

// Little-endian samples, row by row.
std::string bytes_of(const Image<float>& image) {
  return encode_tiff(image).substr(8, 4 * image.size());
}

std::string encode_pfm(const Image<float>& image) {
  Image<float> upside_down(image.width(), image.height());
  for (int y = 0; y < image.height(); ++y)
    std::copy_n(image.row(image.height() - 1 - y), image.width(), upside_down.row(y));
  return "Pf\n" + std::to_string(image.width()) + " " + std::to_string(image.height()) + "\n-1.0\n" +
         bytes_of(upside_down);
}

// Bytes of a .npy file, of these samples as they are in memory, little endian.
template <class Sample>
std::string encode_npy(const Image<Sample>& image, const std::string& type = "<f4") {
  std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (" + std::to_string(image.height()) +
                       ", " + std::to_string(image.width()) + "), }";
  header += std::string(64 - (header.size() + 11) % 64, ' ') + "\n";
  std::string out("\x93NUMPY\x01\x00", 8);
  out += static_cast<char>(header.size());
  out += '\0';
  return out + header + std::string(reinterpret_cast<const char*>(image.data()), image.size() * sizeof(Sample));
}

TEST(Png, ColourAndGreyComeBackExactly) {
  const ColourImage colour = colour_picture();
  const Picture back = decode_picture(encode_png(colour), "a.png");
  EXPECT_EQ(back.colour, colour);
  EXPECT_EQ(back.grey, grey_from_colour(colour));
  const Picture grey = decode_picture(encode_png(back.grey), "b.png");
  EXPECT_EQ(grey.grey, back.grey);
  EXPECT_TRUE(grey.colour.empty());
}

TEST(Png, SixteenBitPicturesAreScaledToEight) {
  Image<uint16_t> image(3, 1);
  image(0, 0) = 0, image(1, 0) = 257 * 100, image(2, 0) = 65535;  // 8-bit v stands for 257 v
  const Picture back = decode_picture(encode_png(image), "a.png");
  EXPECT_EQ(back.grey(0, 0), 0);
  EXPECT_EQ(back.grey(1, 0), 100);
  EXPECT_EQ(back.grey(2, 0), 255);
}

TEST(Png, DepthIsDividedByTheFactorAndLimited) {
  Image<uint16_t> image(5, 1);
  image(0, 0) = 0, image(1, 0) = 5000, image(2, 0) = 999, image(3, 0) = 1000, image(4, 0) = 50001;
  CameraModel camera;  // 5000 units per metre, 0.2 ... 10 m
  const DepthImage depth = decode_depth(encode_png(image), "d.png", camera);
  EXPECT_EQ(depth(0, 0), 0.0f);
  EXPECT_EQ(depth(1, 0), 1.0f);
  EXPECT_EQ(depth(2, 0), 0.0f) << "0.1998 m is too near";
  EXPECT_EQ(depth(3, 0), 0.2f) << "the limit itself is in";
  EXPECT_EQ(depth(4, 0), 0.0f) << "10.0002 m is too far";
  camera.depth_factor = 1000;
  EXPECT_EQ(decode_depth(encode_png(image), "d.png", camera)(1, 0), 5.0f);
}

TEST(Png, PalettesAndInterlaceAreResolved) {
  // 3 x 3 pixels of one bit in Adam7 order: indices 0 1 0 / 1 1 0 / 0 0 1 into the palette (1, 2, 3) (4, 5, 6).
  static constexpr unsigned char kBytes[] = {
      0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0x00, 0x00, 0x00, 0x0D, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00, 0x00,
      0x03, 0x00, 0x00, 0x00, 0x03, 0x01, 0x03, 0x00, 0x00, 0x01, 0x1B, 0xE1, 0x17, 0x6A, 0x00, 0x00, 0x00, 0x06, 0x50,
      0x4C, 0x54, 0x45, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x95, 0x53, 0x6F, 0x48, 0x00, 0x00, 0x00, 0x11, 0x49, 0x44,
      0x41, 0x54, 0x78, 0x9C, 0x63, 0x60, 0x00, 0x02, 0x07, 0x86, 0x06, 0x20, 0x79, 0x00, 0x00, 0x05, 0x0C, 0x01, 0x81,
      0x51, 0x91, 0x08, 0xF0, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82};
  const std::string bytes(reinterpret_cast<const char*>(kBytes), sizeof kBytes);
  const Rgb a{1, 2, 3}, b{4, 5, 6};
  const Rgb expected[3][3] = {{a, b, a}, {b, b, a}, {a, a, b}};
  const Picture picture = decode_picture(bytes, "p.png");
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 3; ++x) EXPECT_EQ(picture.colour(x, y), expected[y][x]);
  EXPECT_EQ(why_not_depth(read_image_header(bytes, "p.png")), "an 8-bit palette PNG");
}

TEST(Jpeg, ComesBackNearlyTheSame) {
  const ColourImage colour = colour_picture(64, 48);
  const Picture back = decode_picture(encode_jpeg(colour, 98), "a.jpg");
  ASSERT_EQ(back.colour.width(), 64);
  for (size_t i = 0; i < colour.size(); ++i) {
    EXPECT_NEAR(back.colour.data()[i].r, colour.data()[i].r, 12);
    EXPECT_NEAR(back.colour.data()[i].g, colour.data()[i].g, 12);
    EXPECT_NEAR(back.colour.data()[i].b, colour.data()[i].b, 12);
  }
  EXPECT_EQ(back.grey, grey_from_colour(back.colour));
  const Picture grey = decode_picture(encode_jpeg(GreyImage(40, 30, 77), 95), "g.jpg");
  EXPECT_TRUE(grey.colour.empty());
  EXPECT_EQ(grey.grey, GreyImage(40, 30, 77));
}

TEST(FloatDepth, EveryFormatGivesTheSameMetres) {
  Image<float> image = float_depth();
  image(3, 4) = std::numeric_limits<float>::quiet_NaN();
  image(5, 4) = std::numeric_limits<float>::infinity();
  image(6, 4) = -1.0f;
  image(7, 4) = 0.1f;
  CameraModel camera;
  camera.depth_factor = 1000;  // of integers only
  for (const std::string& bytes : {encode_tiff(image), encode_pfm(image), encode_npy(image)}) {
    const DepthImage depth = decode_depth(bytes, "d", camera);
    ASSERT_EQ(depth.width(), image.width());
    ASSERT_EQ(depth.height(), image.height());
    for (int y = 0; y < image.height(); ++y)
      for (int x = 0; x < image.width(); ++x) {
        const bool bad = y == 4 && (x == 3 || x == 5 || x == 6 || x == 7);
        EXPECT_EQ(depth(x, y), bad ? 0.0f : image(x, y));
      }
  }
}

TEST(UnitDepth, NumpysUint16IsAsAPng) {
  Image<uint16_t> units(4, 2, 2000);
  units(1, 1) = 0x0203, units(2, 1) = 0;
  CameraModel camera;
  camera.depth_factor = 1000;
  const DepthImage png = decode_depth(encode_png(units), "d", camera);
  EXPECT_EQ(decode_depth(encode_npy(units, "<u2"), "d", camera), png);
  Image<uint16_t> swapped = units;
  for (size_t i = 0; i < swapped.size(); ++i)
    swapped.data()[i] = static_cast<uint16_t>(units.data()[i] << 8 | units.data()[i] >> 8);
  EXPECT_EQ(decode_depth(encode_npy(swapped, ">u2"), "d", camera), png);
  std::string cut = encode_npy(units, "<u2");
  cut.pop_back();
  EXPECT_EQ(test::input_error_of([&] { decode_depth(cut, "d.npy", camera); }),
            "d.npy: is a broken NPY (the file is truncated)");
}

TEST(FloatDepth, BigEndianTiffInSeveralStripsIsRead) {
  // 1 x 2 pixels, 1.0 and 2.0 m, one row a strip; the strips stand after the directory in reverse order.
  std::string t("MM\0*\0\0\0\x08", 8);
  const auto put = [&t](uint32_t value, int n) {
    for (int i = n - 1; i >= 0; --i) t += static_cast<char>(value >> (8 * i) & 0xFF);
  };
  const auto field = [&](uint32_t tag, uint32_t count, uint32_t value) {
    put(tag, 2), put(4, 2), put(count, 4), put(value, 4);
  };
  put(7, 2);
  field(256, 1, 1), field(257, 1, 2), field(258, 1, 32), field(259, 1, 1), field(273, 2, 98), field(278, 1, 1),
      field(339, 1, 3);
  put(0, 4);                               // 8 + 2 + 7 * 12 + 4 = 98: here the offsets of the strips
  put(110, 4), put(106, 4);                // of row 0 and row 1
  put(0x40000000, 4), put(0x3F800000, 4);  // 2.0 at 106, 1.0 at 110
  const DepthImage depth = decode_depth(t, "d.tiff", CameraModel());
  EXPECT_EQ(depth(0, 0), 1.0f);
  EXPECT_EQ(depth(0, 1), 2.0f);
}

// One row of samples, named by every strip.
TEST(FloatDepth, ATiffHoldsAsManySamplesAsItShows) {
  const uint32_t side = 64, data = 8, offsets = data + 4 * side, directory = offsets + 4 * side;
  std::string bytes("II*\0", 4);
  const auto put = [&bytes](uint32_t value, int n) {
    for (int i = 0; i < n; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFF);
  };
  put(directory, 4);
  for (uint32_t i = 0; i < side; ++i) put(0x3F800000, 4);
  for (uint32_t i = 0; i < side; ++i) put(data, 4);
  const uint32_t fields[][3] = {{256, 1, side},       {257, 1, side}, {258, 1, 32}, {259, 1, 1},
                                {273, side, offsets}, {277, 1, 1},    {278, 1, 1},  {339, 1, 3}};
  put(static_cast<uint32_t>(std::size(fields)), 2);
  for (const auto& [tag, count, value] : fields) put(tag, 2), put(4, 2), put(count, 4), put(value, 4);
  EXPECT_EQ(test::input_error_of([&] { decode_depth(bytes, "d.tiff", CameraModel(Camera::named("fr1"))); }),
            "d.tiff: is a broken TIFF (the file is truncated)");
}

TEST(ImageCodecs, WrongTypesAreCalledByName) {
  const CameraModel camera;
  const std::string ending =
      "; depth must be 16-bit grey PNG, 32-bit float in TIFF or PFM, or uint16 or float32 in NPY";
  const std::string numpys = ending + ": store depth.astype(np.float32) in metres";
  EXPECT_EQ(test::input_error_of([&] { decode_depth(encode_npy(Image<double>(20, 20), "<f8"), "d.npy", camera); }),
            "d.npy: is a 64-bit float grey NPY" + numpys);
  EXPECT_EQ(test::input_error_of([&] { decode_depth(encode_npy(Image<uint16_t>(20, 20), "<i2"), "d.npy", camera); }),
            "d.npy: is a 16-bit signed grey NPY" + numpys);
  EXPECT_EQ(test::input_error_of([&] { decode_depth(encode_png(GreyImage(20, 20)), "d.png", camera); }),
            "d.png: is an 8-bit grey PNG" + ending);
  EXPECT_EQ(test::input_error_of([&] { decode_depth(encode_jpeg(colour_picture()), "d.png", camera); }),
            "d.png: is an 8-bit colour JPEG" + ending);
  EXPECT_EQ(test::input_error_of([&] { decode_picture(encode_pfm(float_depth()), "a.png"); }),
            "a.png: is a 32-bit float grey PFM; a picture must be PNG or JPEG");
  EXPECT_EQ(test::input_error_of([&] { decode_picture("", "a.png"); }), "a.png: is empty");
  EXPECT_EQ(test::input_error_of([&] { decode_picture("GIF89a", "a.png"); }),
            "a.png: is not an image of a known kind (PNG, JPEG; depth also TIFF, PFM, NPY)");
  EXPECT_NE(test::input_error_of([&] { read_picture("/no/a.png"); }).find("/no/a.png"), std::string::npos);
}

TEST(ImageCodecs, ContentDecidesNotTheName) {
  EXPECT_EQ(decode_picture(encode_png(colour_picture()), "a.jpg").colour, colour_picture());
}

TEST(ImageCodecs, EveryTruncationIsAnInputError) {
  Image<uint16_t> depth(30, 20);
  for (size_t i = 0; i < depth.size(); ++i) depth.data()[i] = static_cast<uint16_t>(1000 + 37 * i);
  const CameraModel camera;
  for (const std::string& whole : {encode_png(colour_picture()), encode_jpeg(colour_picture(), 90), encode_png(depth),
                                   encode_tiff(float_depth()), encode_pfm(float_depth()), encode_npy(float_depth())})
    for (size_t length = 0; length + 4 < whole.size(); ++length) {  // a TIFF's last 4 bytes are of no use
      const std::string part = whole.substr(0, length);
      EXPECT_THROW(decode_picture(part, "a"), InputError) << length;
      EXPECT_THROW(decode_depth(part, "a", camera), InputError) << length << " of " << whole.size();
    }
}

TEST(ImageCodecs, SidesAreBounded) {
  std::string png = encode_png(GreyImage(20, 20));
  png[16] = 0x7F;  // width 0x7F000014
  EXPECT_NE(test::input_error_of([&] { decode_picture(png, "a.png"); }).find("sides must be 1 ... 16384"),
            std::string::npos);
  EXPECT_NE(test::input_error_of([&] { decode_depth("Pf\n0 5\n-1\n", "a", CameraModel()); }).find("sides must be"),
            std::string::npos);
  EXPECT_EQ(test::input_error_of([&] { decode_depth("Pf\n16384 16384\n-1\n", "a", CameraModel()); }),
            "a: is truncated");
}

TEST(ImageCodecs, MutatedImagesThrowNothingButInputErrors) {
  Image<uint16_t> depth(24, 18);
  for (size_t i = 0; i < depth.size(); ++i) depth.data()[i] = static_cast<uint16_t>(1000 + 37 * i);
  const CameraModel camera;
  Random random(51);
  for (const std::string& original :
       {encode_png(colour_picture(24, 18)), encode_png(colour_picture(24, 18), 0),
        encode_jpeg(colour_picture(24, 18), 90), encode_jpeg(GreyImage(24, 18, 9), 50), encode_png(depth),
        encode_png(depth, 0), encode_tiff(float_depth()), encode_pfm(float_depth()), encode_npy(float_depth())})
    for (int i = 0; i < 1500; ++i) {
      const std::string bytes = mutated(original, random);
      for (const bool is_depth : {false, true}) try {
          if (is_depth)
            decode_depth(bytes, "m", camera);
          else
            decode_picture(bytes, "m");
        } catch (const InputError& e) {
          EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
        }
    }
}

TEST(ImageCodecs, MasksMarkWhatIsAboveZero) {
  const std::filesystem::path path =
      std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_mask.png");
  Image<uint16_t> ids(4, 3);
  ids(1, 2) = 1, ids(3, 0) = 40000;
  GreyImage marked(4, 3);
  marked(1, 2) = marked(3, 0) = 255;
  write_image_file(path, encode_png(ids));
  EXPECT_EQ(read_mask(path), marked) << "numbers of instances are small ones";
  GreyImage small(4, 3);
  small(1, 2) = 1, small(3, 0) = 200;
  write_image_file(path, encode_png(small));
  EXPECT_EQ(read_mask(path), marked);
  std::filesystem::remove(path);
}

TEST(ImageCodecs, FilesAreWrittenAndReadBack) {
  const std::filesystem::path path =
      std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_codec.png");
  write_image_file(path, encode_png(colour_picture()));
  EXPECT_EQ(read_picture(path).colour, colour_picture());
  std::filesystem::remove(path);
  EXPECT_THROW(write_image_file("/no/folder/a.png", "x"), InputError);
  EXPECT_THROW(encode_png(GreyImage(), 6), InputError);
  EXPECT_THROW(encode_jpeg(GreyImage(8, 8), 101), InvalidOption);
}

}  // namespace
}  // namespace dkb

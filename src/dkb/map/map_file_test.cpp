// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/map_file.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "dkb/map/byte_stream.h"
#include "dkb/map/entropy_coder.h"
#include "dkb/map/map_sections.h"
#include "dkb/map/map_test_tools.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

using test::fingerprint;

MapFileContext fr1_context() {
  MapFileContext context;
  context.camera = test::distorted_camera();
  return context;
}

// What decode_map() complains of.
std::string complaint(std::string_view bytes) {
  return test::input_error_of([&] { decode_map(bytes, "a.dkb"); });
}

// How many damaged files to try: $DKB_MUTATIONS, for a long run under the sanitizers.
int mutations(int usual) {
  const char* wanted = std::getenv("DKB_MUTATIONS");
  return wanted != nullptr ? std::max(1, std::atoi(wanted)) : usual;
}

using Contents = std::array<std::string, MapSections::kCount>;

// The file of these sections, with right checksums.
std::string sealed(const Contents& contents, uint32_t format = 3, size_t count = MapSections::kCount) {
  ByteWriter preamble;
  preamble.raw(encode_map(Map(), MapFileContext()).substr(0, 8));
  preamble.u32(format);
  preamble.u32(static_cast<uint32_t>(count));
  preamble.u32(crc32c(preamble.bytes()));
  std::string file = preamble.bytes();
  for (size_t i = 0; i < count; ++i) {
    ByteWriter header, crc;
    header.raw(MapSections::kTags[i]);
    header.u64(contents[i].size());
    crc.u32(crc32c(contents[i], crc32c(header.bytes())));
    file += header.bytes() + crc.bytes() + contents[i];
  }
  return file;
}

TEST(Crc32c, GivesTheCheckValuesOfItsStandard) {
  EXPECT_EQ(crc32c("123456789"), 0xE3069283u);
  EXPECT_EQ(crc32c(std::string(32, '\0')), 0x8A9136AAu);    // RFC 3720 B.4
  EXPECT_EQ(crc32c(std::string(32, '\xff')), 0x62A8AB43u);  // RFC 3720 B.4
  EXPECT_EQ(crc32c("6789", crc32c("12345")), 0xE3069283u);
}

TEST(ByteStream, ReadsBackWhatWasWrittenLittleEndian) {
  ByteWriter out;
  out.u32(0x01020304);
  out.varint(300);
  for (int64_t v : {std::numeric_limits<int64_t>::min(), int64_t{-1}, int64_t{0}, std::numeric_limits<int64_t>::max()})
    out.zigzag(v);
  out.f64(-0.5);
  EXPECT_EQ(out.bytes().substr(0, 6), std::string("\x04\x03\x02\x01\xac\x02"));
  ByteReader in(out.bytes(), "the test");
  EXPECT_EQ(in.u32(), 0x01020304u);
  EXPECT_EQ(in.varint(), 300u);
  for (int64_t v : {std::numeric_limits<int64_t>::min(), int64_t{-1}, int64_t{0}, std::numeric_limits<int64_t>::max()})
    EXPECT_EQ(in.zigzag(), v);
  EXPECT_EQ(in.f64(), -0.5);
  in.expect_end();
  EXPECT_THROW(in.u8(), InputError);
}

TEST(EntropyCoder, GivesBackEveryKindOfBytes) {
  Random random(3);
  std::vector<std::string> samples = {"", "x", std::string(200000, 'a'), std::string(65536, 'b') + "c"};
  std::string skewed, noise, rare(70000, 'q');
  for (int i = 0; i < 150000; ++i) skewed.push_back(static_cast<char>(random.below(1 + random.below(200))));
  for (int i = 0; i < 100000; ++i) noise.push_back(static_cast<char>(random.below(256)));
  for (int i = 0; i < 256; ++i) rare[static_cast<size_t>(i * 100)] = static_cast<char>(i);
  samples.insert(samples.end(), {skewed, noise, rare});
  for (const std::string& s : samples) {
    ByteWriter out;
    write_packed(out, s);
    EXPECT_LE(out.bytes().size(), s.size() + s.size() / 65536 + 1);
    ByteReader in(out.bytes(), "the test");
    EXPECT_EQ(read_packed(in, s.size()), s);
    in.expect_end();
  }
}

TEST(EntropyCoder, ComesNearTheEntropy) {
  // Bytes 0 and 1 in the ratio 9 : 1 have 0.469 bits each.
  Random random(4);
  std::string bytes;
  for (int i = 0; i < 65536; ++i) bytes.push_back(random.below(10) == 0 ? 1 : 0);
  ByteWriter out;
  write_packed(out, bytes);
  EXPECT_LT(static_cast<double>(out.bytes().size()), 1.03 * 0.469 / 8 * 65536 + 50);
}

TEST(EntropyCoder, RefusesDamagedCodes) {
  Random random(5);
  std::string bytes;
  for (int i = 0; i < 2000; ++i) bytes.push_back(static_cast<char>(random.below(7)));
  ByteWriter out;
  write_packed(out, bytes);
  for (int i = 0; i < 2000; ++i) {
    std::string damaged = out.bytes();
    damaged[random.below(static_cast<uint32_t>(damaged.size()))] ^= static_cast<char>(1 + random.below(255));
    ByteReader in(damaged, "the test");
    try {
      EXPECT_EQ(read_packed(in, bytes.size()).size(), bytes.size());
    } catch (const InputError&) {
    }
  }
}

TEST(MapFile, LoadsExactlyWhatWasSaved) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const Map map = test::random_map(seed, 12, 40, 15);
    const std::string bytes = encode_map(map, fr1_context());
    const MapFile loaded = decode_map(bytes, "a.dkb");
    ASSERT_EQ(fingerprint(loaded.map), fingerprint(map)) << "seed " << seed;
    ASSERT_EQ(encode_map(loaded.map, loaded.context), bytes) << "seed " << seed;
    ASSERT_EQ(test::broken_invariant(loaded.map), "");
  }
}

TEST(MapFile, LoadedMapsGoOnAsTheSavedOnesWould) {
  Map map = test::random_map(4, 10, 30, 10);
  MapFile loaded = decode_map(encode_map(map, fr1_context()), "a.dkb");
  Random a(1), b(1);
  for (int k = 0; k < 5; ++k) {
    test::add_random_keyframe(map, a, 30, 15, 6);
    test::add_random_keyframe(loaded.map, b, 30, 15, 6);
    for (int e = 0; e < 20; ++e) {
      test::random_edit(map, a);
      test::random_edit(loaded.map, b);
    }
  }
  EXPECT_EQ(fingerprint(loaded.map), fingerprint(map));
}

TEST(MapFile, KeepsTheContext) {
  MapFileContext context = fr1_context();
  context.scale_factor = 1.25;
  context.levels = 9;
  context.camera.depth_factor = 1000;
  const MapFileContext loaded = decode_map(encode_map(Map(), context), "a.dkb").context;
  EXPECT_EQ(loaded.scale_factor, 1.25);
  EXPECT_EQ(loaded.levels, 9);
  EXPECT_EQ(loaded.camera.fx, context.camera.fx);
  EXPECT_EQ(loaded.camera.k3, context.camera.k3);
  EXPECT_EQ(loaded.camera.depth_factor, 1000);
  EXPECT_EQ(loaded.camera.width, 640);
}

TEST(MapFile, KeepsRationalDistortionWhereThereIsSome) {
  MapFileContext context = fr1_context();
  const size_t size = encode_map(Map(), context).size();
  context.camera.k4 = 0.1, context.camera.k6 = 0.2;
  const std::string bytes = encode_map(Map(), context);
  EXPECT_EQ(bytes.size(), size + 3 * 8) << "others are as they were";
  const MapFileContext loaded = decode_map(bytes, "a.dkb").context;
  EXPECT_EQ(loaded.camera.k4, 0.1);
  EXPECT_EQ(loaded.camera.k5, 0);
  EXPECT_EQ(loaded.camera.k6, 0.2);
}

TEST(MapFile, TheEmptyMapIsAMap) {
  const MapFile loaded = decode_map(encode_map(Map(), fr1_context()), "a.dkb");
  EXPECT_EQ(loaded.map.keyframe_count(), 0);
  EXPECT_EQ(loaded.map.point_count(), 0u);
}

TEST(MapFile, CopiesAndSnapshotsGiveTheSameBytes) {
  Map map = test::random_map(6, 8, 30, 10);
  const std::string bytes = encode_map(map, fr1_context());
  EXPECT_EQ(encode_map(*map.snapshot(), fr1_context()), bytes);
}

TEST(MapFile, AKeyframeOfAThousandFeaturesTakesAtMost60Kilobytes) {
  Random random(2);
  Map map;
  for (int k = 0; k < 12; ++k) test::add_random_keyframe(map, random, 1000, 600, 160);
  const size_t bytes = encode_map(map, fr1_context()).size();
  RecordProperty("bytes_per_keyframe", std::to_string(bytes / 12));
  EXPECT_LE(bytes / 12, 60000u);
}

TEST(MapFile, EveryTruncationIsNoticed) {
  const std::string bytes = encode_map(test::random_map(7, 4, 10, 5), fr1_context());
  for (size_t n = 0; n < bytes.size(); ++n) ASSERT_NE(complaint(std::string_view(bytes).substr(0, n)), "no error") << n;
  EXPECT_NE(complaint(bytes + "x"), "no error");
}

TEST(MapFile, EveryFlippedBitIsNoticed) {
  const std::string bytes = encode_map(test::random_map(7, 3, 8, 5), fr1_context());
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ (1 << (i % 8)));
    ASSERT_NE(complaint(damaged), "no error") << i;
  }
}

TEST(MapFile, NoMutationCrashesEvenWithRightChecksums) {
  const Map map = test::random_map(8, 6, 12, 10);
  const MapSections sections = write_sections(map, fr1_context());
  Random random(11);
  int refused = 0;
  const int rounds = mutations(6000);
  for (int round = 0; round < rounds; ++round) {
    auto contents = sections.bytes;
    std::string& target = contents[random.below(MapSections::kCount)];
    const int changes = 1 + static_cast<int>(random.below(3));
    for (int c = 0; c < changes && !target.empty(); ++c) {
      const size_t at = random.below(static_cast<uint32_t>(target.size()));
      switch (random.below(5)) {
        case 0:
          target[at] = static_cast<char>(target[at] ^ (1 << random.below(8)));
          break;
        case 1:
          target[at] = static_cast<char>(random.below(256));
          break;
        case 2:
          target.erase(at, 1 + random.below(8));
          break;
        case 3:
          target.insert(at, std::string(1 + random.below(8), static_cast<char>(random.below(256))));
          break;
        default:
          for (size_t i = at; i < std::min(at + 8, target.size()); ++i) target[i] = '\xff';
      }
    }
    const std::string file = sealed(contents);
    try {
      const MapFile loaded = decode_map(file, "a.dkb");
      ASSERT_EQ(test::broken_invariant(loaded.map), "") << "round " << round;
      encode_map(loaded.map, loaded.context);
    } catch (const InputError& e) {
      ++refused;
      ASSERT_EQ(std::string(e.what()).find("a.dkb: "), 0u) << e.what();
      ASSERT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
  EXPECT_GT(refused, rounds / 4);
}

TEST(MapFile, MutationsOfTheWholeFileAreRefused) {
  const std::string bytes = encode_map(test::random_map(9, 5, 10, 10), fr1_context());
  Random random(12);
  for (int round = 0, rounds = mutations(5000); round < rounds; ++round) {
    std::string damaged = bytes;
    const size_t at = random.below(static_cast<uint32_t>(bytes.size()));
    const size_t length = 1 + random.below(64);
    switch (random.below(4)) {
      case 0:
        for (size_t i = at; i < std::min(at + length, damaged.size()); ++i)
          damaged[i] = static_cast<char>(random.below(256));
        break;
      case 1:
        damaged.erase(at, length);
        break;
      case 2:
        damaged.insert(at, damaged.substr(random.below(static_cast<uint32_t>(bytes.size())), length));
        break;
      default:
        for (size_t i = at; i < std::min(at + length, damaged.size()); ++i) damaged[i] = '\0';
    }
    if (damaged == bytes) continue;
    ASSERT_NE(complaint(damaged), "no error") << "round " << round;
  }
}

TEST(MapFile, LengthsAreCheckedBeforeAnythingIsAllocated) {
  const MapSections good = write_sections(test::random_map(10, 3, 8, 0), fr1_context());
  ByteWriter huge;
  huge.varint(1ull << 60);
  for (size_t s : {size_t{1}, size_t{4}, size_t{5}, size_t{6}}) {
    auto contents = good.bytes;
    contents[s] = huge.bytes();
    EXPECT_NE(complaint(sealed(contents)).find("claims more items than it can hold"), std::string::npos);
  }
}

TEST(MapFile, ForeignFilesAreNamedAsSuch) {
  EXPECT_EQ(complaint(""), "a.dkb: is no map of dkb-slam; give a map.dkb");
  EXPECT_EQ(complaint("ply\nformat ascii 1.0\n"), "a.dkb: is no map of dkb-slam; give a map.dkb");
  std::string converted = encode_map(Map(), fr1_context());
  converted.erase(6, 1);  // CRLF to LF
  EXPECT_EQ(complaint(converted), "a.dkb: its line ends were converted on the way; copy it in binary mode");
}

TEST(MapFile, NewerFormatsAreRefusedByNumber) {
  EXPECT_EQ(complaint(sealed(write_sections(Map(), fr1_context()).bytes, 4)),
            "a.dkb: is of map format 4, this program reads formats 1 to 3; use the version of dkb-slam that wrote it");
}

// The sections of `map` as format 2 has them: without lent depths and place sigmas.
Contents of_format_2(const Map& map) {
  std::vector<float> depth, depth_or_lent, place_sigma;
  for (KeyframeId id : map.live_keyframes())
    for (const Keypoint& k : map.keyframe(id)->features->keypoints) {
      depth.push_back(k.depth);
      depth_or_lent.push_back(k.depth > 0 ? k.depth : -k.lent_depth);
      place_sigma.push_back(k.place_sigma);
    }
  const auto packed = [](const std::vector<float>& column) {
    ByteWriter out;
    write_packed_floats(out, column);
    return out.bytes();
  };
  Contents contents = write_sections(map, fr1_context()).bytes;
  const auto replace = [&](const std::string& from, const std::string& to) {
    contents[3].replace(contents[3].find(from), from.size(), to);
  };
  replace(packed(depth_or_lent), packed(depth));
  replace(packed(place_sigma), "");
  return contents;
}

// Files of format 2 do not have all of a feature, those of format 1 neither motions nor planes, which the map does
// without.
TEST(MapFile, TheOlderFormatsAreRead) {
  const Map map = test::random_map(5, 12, 40, 15);
  const Contents contents = of_format_2(map);
  const MapFile before = decode_map(sealed(contents, 2), "a.dkb");
  for (KeyframeId id : map.live_keyframes())
    for (size_t f = 0; f < map.keyframe(id)->features->size(); ++f) {
      const Keypoint &saved = map.keyframe(id)->features->keypoints[f],
                     &read = before.map.keyframe(id)->features->keypoints[f];
      ASSERT_EQ(read.depth, saved.depth);
      ASSERT_EQ(read.colour, saved.colour);
      ASSERT_EQ(read.lent_depth, 0);
      ASSERT_EQ(read.place_sigma, 0);
    }
  const MapFile older = decode_map(sealed(contents, 1, MapSections::kOfFormat1), "a.dkb");
  EXPECT_EQ(older.map.live_points(), map.live_points());
  for (KeyframeId id = 0; id < older.map.keyframe_count(); ++id) {
    EXPECT_EQ(older.map.keyframe(id)->motion, nullptr);
    EXPECT_EQ(older.map.keyframe(id)->planes, nullptr);
  }
  EXPECT_EQ(complaint(sealed(contents, 1)),
            "a.dkb: has 7 sections instead of 5; take it from a backup or make the map anew");
}

TEST(MapFile, KeepsMotionsAndPlanesAndPutsNewPlanesBesideThem) {
  const Map map = test::random_map(5, 30, 10, 2);
  Map loaded = decode_map(encode_map(map, fr1_context()), "a.dkb").map;
  int motions = 0, planes = 0;
  for (KeyframeId id : loaded.live_keyframes()) {
    motions += loaded.keyframe(id)->motion != nullptr;
    planes += loaded.keyframe(id)->planes != nullptr;
    for (PlaneId p : loaded.keyframe(id)->plane_of_patch) EXPECT_EQ(loaded.plane(p), p);
  }
  EXPECT_GT(motions, 10);
  EXPECT_GT(planes, 10);
  const PlaneId made = loaded.add_plane();
  for (KeyframeId id : loaded.live_keyframes())
    for (PlaneId p : loaded.keyframe(id)->plane_of_patch) EXPECT_NE(p, made);
}

TEST(MapFile, AMotionWhoseTranslationIsUnknownIsRefused) {
  Map map;
  map.add_keyframe(test::keyframe_at(0, 0));
  Keyframe next = test::keyframe_at(1, 1);
  next.motion = std::make_shared<const KeyframeMotion>(KeyframeMotion{0, {{}, false, Matrix6d::Identity()}});
  map.add_keyframe(std::move(next));
  Contents contents = write_sections(map, fr1_context()).bytes;
  std::string& motions = contents[5];
  EXPECT_EQ(complaint(sealed(contents)), "no error");
  motions[3] = 1;  // of its kind: after the number of motions, the keyframe and the step back
  EXPECT_NE(complaint(sealed(contents)).find("section MOTN has a motion of an unknown kind"), std::string::npos)
      << complaint(sealed(contents));
}

TEST(MapFile, DamageIsPutDownToItsSection) {
  std::string bytes = encode_map(test::random_map(7, 3, 8, 5), fr1_context());
  bytes.back() = static_cast<char>(bytes.back() ^ 1);
  EXPECT_EQ(
      complaint(bytes),
      "a.dkb: the checksum of section PLAN is wrong: the file is damaged; take it from a backup or make the map anew");
}

TEST(MapFile, MapsThatNoFileCanHoldAreRefusedWhenSaved) {
  Map map = test::random_map(3, 2, 10, 0);
  Map bad = map;
  bad.edit_point(bad.live_points()[0]).position.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(encode_map(bad, fr1_context()), std::logic_error);
  bad = map;
  bad.set_pose(0, Rigid3(Eigen::Quaterniond(2, 0, 0, 0), Eigen::Vector3d::Zero()));
  EXPECT_THROW(encode_map(bad, fr1_context()), std::logic_error);
  bad = map;
  MapPoint unborn;
  unborn.id = make_point_id(9, 0);
  bad.add_point(unborn);
  EXPECT_THROW(encode_map(bad, fr1_context()), std::logic_error);
  MapFileContext flat = fr1_context();
  flat.levels = 1;
  EXPECT_THROW(encode_map(map, flat), std::logic_error);
  flat.levels = 0;
  EXPECT_THROW(encode_map(map, flat), InvalidOption);
}

class MapFileOnDisk : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("dkb_map_file_test_" + std::to_string(::getpid()));
};

TEST_F(MapFileOnDisk, SavesAndLoads) {
  const Map map = test::random_map(2, 5, 20, 5);
  save_map(folder_ / "map.dkb", map, fr1_context());
  EXPECT_EQ(fingerprint(load_map(folder_ / "map.dkb").map), fingerprint(map));
  EXPECT_EQ(read_file(folder_ / "map.dkb"), encode_map(map, fr1_context()));
}

TEST_F(MapFileOnDisk, AMapWithoutKeyframesIsRefused) {
  const auto path = folder_ / "map.dkb";
  save_map(path, Map(), fr1_context());
  try {
    load_map(path);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).find(path.string() + ": holds no keyframes"), 0u) << e.what();
  }
}

TEST(MapFile, AnotherCameraIsToldByTheFieldsThatDiffer) {
  const MapFileContext of_map = fr1_context();
  MapFileContext wanted = of_map;
  const auto complaint = [&] { return test::input_error_of([&] { check_same_optics(of_map, wanted, "a.dkb"); }); };
  EXPECT_EQ(complaint(), "no error");
  wanted.camera.k1 = 0.5, wanted.camera.width = 4;
  EXPECT_EQ(
      complaint(),
      "a.dkb: was made with another camera (width " + std::to_string(of_map.camera.width) +
          fmt::format(", k1 {}) than this one (width 4, k1 0.5); give a map of this camera, or the camera of the map",
                      of_map.camera.k1));
}

TEST_F(MapFileOnDisk, ErrorsNameTheFile) {
  const auto path = folder_ / "nothing.dkb";
  try {
    load_map(path);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).find(path.string() + ":"), 0u) << e.what();
  }
  EXPECT_THROW(save_map(folder_ / "no" / "such" / "map.dkb", Map(), fr1_context()), InputError);
}

}  // namespace
}  // namespace dkb

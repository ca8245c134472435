// SPDX-License-Identifier: Apache-2.0
//
// Format 3. Formats 1 and 2 are read too: they have neither lent depths nor place sigmas, which are 0 then, and format
// 1 ends after section POIN. All numbers are little-endian; a varint has 7 bits per byte, low ones first; zigzag is a
// signed varint; floats are IEEE 754, bit for bit; "packed" is the entropy coding of entropy_coder.h.
//
//   file     "DKBMAP\r\n", format u32, sections u32, CRC-32C u32 of these 16 bytes, then the sections in this order:
//   section  tag (4 letters), length u64 of the content, CRC-32C u32 of tag, length and content, content
//
//   HEAD  camera: width, height u32; fx fy cx cy k1 k2 p1 p2 k3 depth_factor fps depth_min depth_max readout f64
//         pyramid: scale_factor f64, levels u32; of cameras with rational distortion then k4 k5 k6 f64
//   KEYF  count varint, then per keyframe: culled u8, frame i32, timestamp f64, parent i32,
//         cam_from_world 7 x f64 (quaternion x y z w, translation);
//         culled: cam_from_parent 7 x f64;
//         live: features varint, covisible varint, per covisible: keyframe varint, shared varint
//   DESC  the descriptors of all features of the live keyframes in turn: 4 x u64 each
//   FEAT  the other fields of the same features, field by field: image pixel x, y packed floats;
//         pixel x, y as distance, in floats, from where the camera's UndistortionTable puts the image pixel:
//         words (sign in the low bit), packed; depth, or minus the lent depth where it has none, angle, response,
//         place sigma packed floats;
//         octave packed, as difference to the feature before; colour g, r - g, b - g packed;
//         point seen: age (keyframe - birth keyframe) as zigzag + 1, 0 = none, length u64 and packed;
//         birth features u16 of those that see one (minus the own index where the age is 0), low and high bytes packed
//   POIN  live: count varint; per point id varint minus the one before, position 3 x f64;
//         packed: normal x, y, z, reference distance and scale floats; colour as above;
//         length u64 and packed: per point found zigzag, visible zigzag, 0 (older programs: another number), number of
//         the first observation with the same descriptor counted from 1, 0 = none: then the descriptor follows: 4 x u64
//         fused: count varint; per point id varint minus the one before, survivor - id zigzag
//   MOTN  count varint, then per keyframe with a motion: id varint minus the one before (-1 before the first), id minus
//         that of the keyframe that it is since varint, rotation only u8, previous_from_current 7 x f64, covariance
//         36 x f64
//   PLAN  count varint, then per keyframe whose flat surfaces are known: id varint as in MOTN, surfaces varint, per
//         surface: plane varint (numbered from 0 as they come), normal over distance 3 x f64, covariance 9 x f64,
//         centre 3 x f64; then the surface that each block of 16 x 16 px shows, from 1, 0 = none: u8 each, row by row,
//         packed
//
// Observations are not stored: they are the keyframes' points turned round. Of the points that are no more, those are
// stored that were fused into one that lives, which is all that Map::resolve() can tell of them.
#include "dkb/map/map_file.h"

#include <fmt/format.h>

#include <array>

#include "dkb/map/byte_stream.h"
#include "dkb/map/map_sections.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb {
namespace {

// The line end shows a transfer that "converted" the file.
constexpr std::string_view kMagic("DKBMAP\r\n", 8);
constexpr uint32_t kFormat = 3;
constexpr size_t kPreamble = 20;
constexpr const char* kRemedy = "; take it from a backup or make the map anew";

std::string section_header(std::string_view tag, size_t length) {
  ByteWriter header;
  header.raw(tag);
  header.u64(length);
  return header.bytes();
}

struct Split {
  std::array<std::string_view, MapSections::kCount> sections;
  uint32_t format;
};

Split split(std::string_view bytes) {
  if (bytes.substr(0, kMagic.size()) != kMagic) {
    if (bytes.substr(0, 6) == kMagic.substr(0, 6))
      throw InputError("its line ends were converted on the way; copy it in binary mode");
    throw InputError("is no map of dkb-slam; give a map.dkb");
  }
  if (bytes.size() < kPreamble) throw InputError("ends within its first bytes" + std::string(kRemedy));
  ByteReader preamble(bytes.substr(kMagic.size(), kPreamble - kMagic.size()), "the file's head");
  const uint32_t format = preamble.u32(), count = preamble.u32();
  if (preamble.u32() != crc32c(bytes.substr(0, 16)))
    throw InputError("the head of the file is damaged" + std::string(kRemedy));
  if (format < 1 || format > kFormat)
    throw InputError("is of map format " + std::to_string(format) + ", this program reads formats 1 to " +
                     std::to_string(kFormat) + "; use the version of dkb-slam that wrote it");
  const size_t expected = format == 1 ? MapSections::kOfFormat1 : MapSections::kCount;
  if (count != expected) throw InputError(fmt::format("has {} sections instead of {}{}", count, expected, kRemedy));

  std::array<std::string_view, MapSections::kCount> sections;
  ByteReader in(bytes.substr(kPreamble), "the file");
  for (size_t i = 0; i < expected; ++i) {
    const std::string tag(MapSections::kTags[i]);
    if (in.left() < 16) throw InputError("ends before section " + tag + kRemedy);
    const std::string_view header = in.raw(12);
    const uint32_t crc = in.u32();
    if (header.substr(0, 4) != tag) throw InputError("has no section " + tag + " where it should be" + kRemedy);
    const uint64_t length = ByteReader(header.substr(4), tag).u64();
    if (length > in.left()) throw InputError("ends within section " + tag + kRemedy);
    sections[i] = in.raw(static_cast<size_t>(length));
    if (crc32c(sections[i], crc32c(header)) != crc)
      throw InputError("the checksum of section " + tag + " is wrong: the file is damaged" + kRemedy);
  }
  if (in.left() > 0) throw InputError("has " + std::to_string(in.left()) + " bytes too many at its end" + kRemedy);
  return {sections, format};
}

}  // namespace

void MapFileContext::check() const {
  camera.check();
  require_option(scale_factor > 1 && scale_factor <= 4, "scale_factor", scale_factor, "above 1 and at most 4");
  require_option(levels >= 1 && levels <= 32, "levels", levels, "1 ... 32");
}

std::string encode_map(const Map& map, const MapFileContext& context) {
  context.check();
  const MapSections sections = write_sections(map, context);
  ByteWriter preamble;
  preamble.raw(kMagic);
  preamble.u32(kFormat);
  preamble.u32(static_cast<uint32_t>(sections.bytes.size()));
  preamble.u32(crc32c(preamble.bytes()));
  std::string file = preamble.bytes();
  size_t size = file.size();
  for (const std::string& s : sections.bytes) size += 16 + s.size();
  file.reserve(size);
  for (size_t i = 0; i < sections.bytes.size(); ++i) {
    const std::string& content = sections.bytes[i];
    const std::string header = section_header(MapSections::kTags[i], content.size());
    ByteWriter crc;
    crc.u32(crc32c(content, crc32c(header)));
    file += header;
    file += crc.bytes();
    file += content;
  }
  return file;
}

MapFile decode_map(std::string_view bytes, const std::string& name) {
  Split file;
  try {
    file = split(bytes);
  } catch (const InputError& e) {
    throw InputError(name + ": " + e.what());
  }
  try {
    return read_sections(file.sections, file.format);
  } catch (const InputError& e) {
    throw InputError(name + ": the checksums are right but the content is not: " + e.what() + kRemedy);
  }
}

void save_map(const std::filesystem::path& path, const Map& map, const MapFileContext& context) {
  write_file_atomically(path, encode_map(map, context));
}

MapFile load_map(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw InputError(path.string() + ": is a folder; give the map in it, as " + (path / "map.dkb").string());
  MapFile file = decode_map(read_file(path), path.string());
  if (file.map.live_keyframe_count() == 0)
    throw InputError(path.string() +
                     ": holds no keyframes, so that nothing can be found in it; give the map of a run "
                     "that tracked");
  return file;
}

namespace {

struct OpticsField {
  const char* name;
  double of_map, wanted;
};
std::vector<OpticsField> differing_fields(const CameraModel& a, const CameraModel& b) {
  std::vector<OpticsField> fields{{"width", static_cast<double>(a.width), static_cast<double>(b.width)},
                                  {"height", static_cast<double>(a.height), static_cast<double>(b.height)},
                                  {"fx", a.fx, b.fx},
                                  {"fy", a.fy, b.fy},
                                  {"cx", a.cx, b.cx},
                                  {"cy", a.cy, b.cy},
                                  {"k1", a.k1, b.k1},
                                  {"k2", a.k2, b.k2},
                                  {"p1", a.p1, b.p1},
                                  {"p2", a.p2, b.p2},
                                  {"k3", a.k3, b.k3},
                                  {"k4", a.k4, b.k4},
                                  {"k5", a.k5, b.k5},
                                  {"k6", a.k6, b.k6}};
  std::erase_if(fields, [](const OpticsField& f) { return f.of_map == f.wanted; });
  return fields;
}

}  // namespace

bool same_optics(const CameraModel& a, const CameraModel& b) {
  return differing_fields(a, b).empty();
}

void check_same_optics(const MapFileContext& of_map, const MapFileContext& wanted, const std::string& name) {
  std::string of, here;
  for (const OpticsField& f : differing_fields(of_map.camera, wanted.camera)) {
    of += fmt::format("{}{} {}", of.empty() ? "" : ", ", f.name, f.of_map);
    here += fmt::format("{}{} {}", here.empty() ? "" : ", ", f.name, f.wanted);
  }
  if (!of.empty())
    throw InputError(
        fmt::format("{}: was made with another camera ({}) than this one ({}); give a map of this camera, "
                    "or the camera of the map",
                    name, of, here));
  if (of_map.levels != wanted.levels || of_map.scale_factor != wanted.scale_factor)
    throw InputError(
        fmt::format("{}: was made with {} pyramid levels of {}; set features.levels={} and "
                    "features.scale={}",
                    name, of_map.levels, of_map.scale_factor, of_map.levels, of_map.scale_factor));
}

}  // namespace dkb

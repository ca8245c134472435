// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/oni_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <utility>
#include <vector>

#include "dkb/dataset/image_codecs.h"
#include "dkb/devices/device_source.h"
#include "dkb/devices/oni_codecs.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

// A file is a header of 24 bytes and records. A record: "NIR\0", type, stream, bytes of header and fields, bytes of
// data, place of an earlier record (8 bytes), the fields, the data. Numbers are little endian, of 4 bytes where nothing
// else is said.
constexpr size_t kFileHeader = 24, kRecordHeader = 28;
constexpr uint32_t kMaxFields = 1 << 20;
enum RecordType : uint32_t {
  kAdded4 = 2,
  kInteger = 3,
  kGeneral = 6,
  kData = 10,
  kEnd = 11,
  kAdded5 = 12,
  kAdded = 13
};
enum OniPixels : int64_t { kDepth100um = 101, kRgb888 = 200, kGray8 = 202, kJpeg = 204 };

struct Record {
  uint32_t type = 0, stream = 0;
  std::string fields, data;
};

// Takes numbers and texts from a record's fields; what is not there is zero.
class Fields {
 public:
  explicit Fields(const std::string& bytes) : bytes_(bytes) {}
  template <class T>
  T take() {
    T value{};
    if (bytes_.size() - at_ < sizeof value) return at_ = bytes_.size(), value;
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string text() {
    const auto claimed = take<uint32_t>();
    const size_t size = std::min<size_t>(claimed, bytes_.size() - at_);
    std::string text = bytes_.substr(at_, size);
    at_ += size;
    return text.substr(0, text.find('\0'));
  }

 private:
  const std::string& bytes_;
  size_t at_ = 0;
};

struct OniStream {
  uint32_t type = 0;  // 2 depth, 3 colour
  std::string codec;
  int width = 0, height = 0, fps = 0;
  int64_t pixels = 0;  // OniPixels
  bool mirrored = false;
  double horizontal_fov = 0, vertical_fov = 0;  // [rad]
};

class OniFile final : public ImageDevice {
 public:
  explicit OniFile(const std::filesystem::path& path) : name_(path.string()), in_(path, std::ios::binary) {
    std::error_code ec;
    size_ = std::filesystem::file_size(path, ec);
    if (!in_ || ec) throw InputError(name_ + ": cannot be opened");
    std::string header(kFileHeader, '\0');
    if (!read(header.data(), header.size()) || header.substr(0, 4) != "NI10")
      throw InputError(name_ + ": is no recording of OpenNI 2 (.oni)");
    // Up to where both streams have begun, so that their sizes are known.
    std::streamoff first_data = 0;
    while (!(depth_id_ && colour_id_ && first_data != 0)) {
      const std::streamoff before = in_.tellg();
      const std::optional<Record> record = next_record();
      if (!record) break;
      if (record->type == kData && first_data == 0) first_data = before;
      note(*record);
      if (first_data != 0 && in_.tellg() - first_data > kLongestStart) break;
    }
    if (!depth_id_ || !colour_id_)
      throw InputError(name_ + ": holds no " + (depth_id_ ? "colour" : "depth") + " stream; record both");
    in_.clear();
    in_.seekg(first_data == 0 ? static_cast<std::streamoff>(size_) : first_data);
    warnings_.clear(), cut_ = false;
    check();
    checked_ = true;
  }

  const OniStream& colour() const { return streams_.at(*colour_id_); }
  double depth_factor() const { return streams_.at(*depth_id_).pixels == kDepth100um ? 10000 : 1000; }

  DeviceState next(int, DeviceImages* images) override {
    while (std::optional<Record> record = next_record()) {
      if (record->type == kEnd) return DeviceState::ended;
      note(*record);
      const bool is_depth = depth_id_ && record->stream == *depth_id_;
      if (record->type != kData || (!is_depth && record->stream != *colour_id_)) continue;
      const int64_t stamp_us = Fields(record->fields).take<int64_t>();
      if (stamp_us < 0 || stamp_us > kMaxStampNs / 1000) continue;
      data_ = std::move(record->data);
      try {
        const ImageView view = is_depth ? depth_view(streams_.at(*depth_id_)) : colour_view(streams_.at(*colour_id_));
        (is_depth ? images->depth : images->colour) = DeviceImage{view, stamp_us * 1000};
      } catch (const InputError& e) {
        images->broken = e.what();
      }
      return DeviceState::images;
    }
    return DeviceState::ended;
  }
  bool reopen() override { return false; }
  std::string description() const override { return "recording of OpenNI 2"; }
  std::vector<std::string> take_warnings() override { return std::exchange(warnings_, {}); }

 private:
  static constexpr std::streamoff kLongestStart = 64 << 20;  // [bytes]

  bool read(char* to, size_t size) { return static_cast<bool>(in_.read(to, static_cast<std::streamsize>(size))); }

  // Nothing at the end, and from a place on that is broken.
  std::optional<Record> next_record() {
    const auto at = static_cast<uint64_t>(std::max<std::streamoff>(in_.tellg(), 0));
    if (cut_ || !in_ || at >= size_) return cut("it has no end mark");
    std::string header(kRecordHeader, '\0');
    if (!read(header.data(), header.size())) return cut("a record is truncated");
    if (header.substr(0, 4) != std::string("NIR\0", 4)) return cut("a record is broken");
    const std::string rest = header.substr(4);
    Fields numbers(rest);
    Record record;
    record.type = numbers.take<uint32_t>(), record.stream = numbers.take<uint32_t>();
    const auto fields = numbers.take<uint32_t>(), data = numbers.take<uint32_t>();
    if (fields < kRecordHeader || fields > kMaxFields) return cut("a record is broken");
    if (uint64_t{fields} + data > size_ - at) return cut("a record is truncated");
    record.fields.resize(fields - kRecordHeader), record.data.resize(data);
    if (!read(record.fields.data(), record.fields.size()) || !read(record.data.data(), data))
      return cut("a record is truncated");
    return record;
  }
  std::nullopt_t cut(const char* reason) {
    if (!cut_) warnings_.push_back(name_ + ": " + reason + "; used up to there");
    cut_ = true;
    return std::nullopt;
  }

  // Learns of streams and their properties.
  void note(const Record& record) {
    Fields fields(record.fields);
    if (record.type == kAdded || record.type == kAdded4 || record.type == kAdded5) {
      fields.text();
      OniStream stream;
      stream.type = fields.take<uint32_t>();
      const auto codec = fields.take<uint32_t>();
      stream.codec.assign(reinterpret_cast<const char*>(&codec), 4);
      if (stream.type != 2 && stream.type != 3) return;
      std::optional<uint32_t>& id = stream.type == 2 ? depth_id_ : colour_id_;
      if (id || record.stream == depth_id_ || record.stream == colour_id_) return;  // the first one only
      id = record.stream;
      streams_[record.stream] = stream;
      return;
    }
    const auto found = streams_.find(record.stream);
    if (found == streams_.end() || (record.type != kInteger && record.type != kGeneral)) return;
    const std::string property = fields.text();
    fields.take<uint32_t>();  // bytes that follow
    if (property == "xnMapOutputMode" && record.type == kGeneral) {
      const auto width = fields.take<int32_t>(), height = fields.take<int32_t>();
      if (checked_ && (width != found->second.width || height != found->second.height)) {
        cut("its images change their size");
        return;
      }
      found->second.width = width, found->second.height = height;
      found->second.fps = fields.take<int32_t>();
    } else if (property == "oniPixelFormat" && record.type == kInteger) {
      found->second.pixels = fields.take<int64_t>();
    } else if (property == "xnMirror" && record.type == kInteger) {
      found->second.mirrored = fields.take<int64_t>() != 0;
    } else if (property == "xnFOV" && record.type == kGeneral) {
      found->second.horizontal_fov = fields.take<double>(), found->second.vertical_fov = fields.take<double>();
    }
  }

  void check() const {
    const OniStream &c = streams_.at(*colour_id_), &d = streams_.at(*depth_id_);
    for (const OniStream* s : {&c, &d})
      if (s->width < 16 || s->height < 16 || s->width > 16384 || s->height > 16384)
        throw InputError(name_ + ": a stream's images are of " + std::to_string(s->width) + "x" +
                         std::to_string(s->height) + " px; sides must be 16 ... 16384");
    if (c.width != d.width || c.height != d.height)
      throw InputError(name_ + ": depth is of " + std::to_string(d.width) + "x" + std::to_string(d.height) +
                       " px, colour of " + std::to_string(c.width) + "x" + std::to_string(c.height) +
                       "; record both at one size, depth registered to colour");
    if (d.codec != "NONE" && d.codec != "16zP" && d.codec != "16zT")
      throw InputError(name_ + ": its depth is compressed by a codec that is not supported");
    const bool jpeg = c.codec == "JPEG" || (c.codec == "NONE" && c.pixels == kJpeg);
    if (!jpeg && (c.codec != "NONE" || (c.pixels != kRgb888 && c.pixels != kGray8)))
      throw InputError(name_ + ": its colour is neither RGB888, GRAY8 nor JPEG; record it as RGB888");
  }

  template <class Pixel>
  void turn_back(Pixel* pixels, const OniStream& stream) const {
    if (!stream.mirrored) return;
    for (int y = 0; y < stream.height; ++y, pixels += stream.width) std::reverse(pixels, pixels + stream.width);
  }

  ImageView depth_view(const OniStream& stream) {
    const size_t pixels = static_cast<size_t>(stream.width) * static_cast<size_t>(stream.height);
    if (stream.codec == "NONE") {
      if (data_.size() < pixels * 2) throw InputError(name_ + ": a depth image is truncated");
      depth_.resize(pixels);
      std::memcpy(depth_.data(), data_.data(), pixels * 2);
    } else {
      const std::span bytes(reinterpret_cast<const uint8_t*>(data_.data()), data_.size());
      depth_ = decode_16z(bytes, pixels, stream.codec == "16zT", name_);
    }
    turn_back(depth_.data(), stream);
    return {depth_.data(), stream.width, stream.height, 0, PixelFormat::depth_u16};
  }

  ImageView colour_view(const OniStream& stream) {
    if (stream.codec == "JPEG" || stream.pixels == kJpeg) {
      picture_ = decode_picture(data_, name_);
      if (picture_.grey.width() != stream.width || picture_.grey.height() != stream.height)
        throw InputError(name_ + ": a JPEG in it has another size than its stream");
      turn_back(picture_.grey.data(), stream);
      if (picture_.colour.empty()) return {picture_.grey.data(), stream.width, stream.height, 0, PixelFormat::grey8};
      turn_back(picture_.colour.data(), stream);
      return {picture_.colour.data(), stream.width, stream.height, 0, PixelFormat::rgb8};
    }
    const bool grey = stream.pixels == kGray8;
    const ImageView view{data_.data(), stream.width, stream.height, 0, grey ? PixelFormat::grey8 : PixelFormat::rgb8};
    if (data_.size() < view.row_bytes() * static_cast<size_t>(stream.height))
      throw InputError(name_ + ": a colour image is truncated");
    if (grey)
      turn_back(data_.data(), stream);
    else
      turn_back(reinterpret_cast<Rgb*>(data_.data()), stream);
    return view;
  }

  const std::string name_;
  std::ifstream in_;
  uint64_t size_ = 0;
  std::map<uint32_t, OniStream> streams_;
  std::optional<uint32_t> depth_id_, colour_id_;
  std::string data_;  // of the image given out last
  std::vector<uint16_t> depth_;
  Picture picture_;
  std::vector<std::string> warnings_;
  bool cut_ = false;
  bool checked_ = false;  // the sizes are known and stay what they are
};

Camera camera_of(const OniFile& file, const std::string& name, const SourceOptions& options) {
  const OniStream& stream = file.colour();
  Camera told;
  told.width = stream.width, told.height = stream.height;
  told.fps = std::clamp(stream.fps, 0, 1000);  // 0: as the first stamps say
  told.fx = told.fy = 0;
  if (stream.horizontal_fov > 0 && stream.vertical_fov > 0) {
    told.fx = stream.width / (2 * std::tan(stream.horizontal_fov / 2));
    told.fy = stream.height / (2 * std::tan(stream.vertical_fov / 2));
    told.cx = (stream.width - 1) / 2.0, told.cy = (stream.height - 1) / 2.0;
  }
  told.depth_factor = file.depth_factor();
  return device_camera(name, told, options);
}

}  // namespace

std::unique_ptr<Source> open_oni_file(const std::filesystem::path& path, const SourceOptions& options) {
  auto file = std::make_unique<OniFile>(path);
  const Camera camera = camera_of(*file, path.string(), options);
  return std::make_unique<DeviceSource>(std::move(file), camera, options);
}

}  // namespace dkb

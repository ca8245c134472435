// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/pair_writer.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/tum_dataset.h"
#include "dkb/image/image.h"
#include "dkb/recordings/recording_writer.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/recordings/topic_names.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/new_folder.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;

// The whole units of which the reader makes exactly these depths; nothing where there are none.
std::optional<Image<uint16_t>> exact_units(const DepthImage& depth, const Camera& camera) {
  Image<uint16_t> units(depth.width(), depth.height());
  for (size_t i = 0; i < depth.size(); ++i) {
    const double unit = std::round(depth.data()[i] * camera.depth_factor);
    if (!(unit >= 0 && unit <= 65535)) return std::nullopt;
    units.data()[i] = static_cast<uint16_t>(unit);
  }
  DepthImage back(depth.width(), depth.height());
  depth_from_units(units.data(), units.size(), without_limits(camera), back.data());
  if (!std::equal(back.data(), back.data() + back.size(), depth.data())) return std::nullopt;
  return units;
}

template <class T>
std::string_view pixels_of(const Image<T>& image) {
  return {reinterpret_cast<const char*>(image.data()), image.size() * sizeof(T)};
}

bool is_jpeg(std::string_view file) {
  return file.substr(0, 2) == "\xFF\xD8";
}

class FolderPairWriter final : public PairWriter {
 public:
  FolderPairWriter(const fs::path& path, const Camera& camera, const std::string& camera_text, int png_level)
      : path_(path.has_filename() ? path : path.parent_path()),
        target_(behind_links(path_)),
        temporary_(temporary_beside(target_)),
        camera_(camera),
        png_level_(png_level) {
    std::error_code error;
    if (fs::exists(path_, error) && !(fs::is_directory(path_, error) && fs::is_empty(path_, error)))
      throw InputError(path_.string() + ": is there already and not empty; choose another folder with --out");
    make_output_folder(temporary_.path() / "rgb");
    make_output_folder(temporary_.path() / "depth");
    write_image_file(temporary_.path() / "camera.yaml", camera_text);
  }

  void add(const PairToWrite& pair) override {
    Row row;
    row.stamp = stamp_text(pair.stamp_ns), row.depth_stamp = stamp_text(pair.depth_stamp_ns);
    row.colour = "rgb/" + row.stamp + (is_jpeg(pair.colour_file) ? ".jpg" : ".png");
    const std::optional<Image<uint16_t>> units = exact_units(*pair.depth, camera_);
    row.depth = "depth/" + row.depth_stamp + (units ? ".png" : ".tiff");
    rows_.push_back(row);
    try {
      write_images(row, pair, units);
    } catch (...) {
      drop_last();  // half a pair is none
      throw;
    }
  }

  void close() override {
    write_lists();
    put_in_place();
  }

  void salvage() override {
    while (!rows_.empty()) {
      try {
        write_lists();
      } catch (const OutputError&) {  // the room that the last pair takes is needed for the lists
        drop_last();
        continue;
      }
      return put_in_place();
    }
    throw OutputError(path_.string() + ": no pair could be kept; make room on the disk");
  }

 private:
  struct Row {
    std::string stamp, colour, depth_stamp, depth;  // as in the lists
  };
  void write_images(const Row& row, const PairToWrite& pair, const std::optional<Image<uint16_t>>& units) const {
    const fs::path colour = temporary_.path() / row.colour;
    if (!pair.colour_file.empty())
      write_image_file(colour, pair.colour_file);
    else if (pair.picture->colour.empty())
      write_image_file(colour, encode_png(pair.picture->grey, png_level_));
    else
      write_image_file(colour, encode_png(pair.picture->colour, png_level_));
    // An image that the pair before shares is there, and would be broken by a write that fails.
    if (rows_.size() > 1 && rows_[rows_.size() - 2].depth == row.depth) return;
    write_image_file(temporary_.path() / row.depth, units ? encode_png(*units, png_level_) : encode_tiff(*pair.depth));
  }

  void drop_last() {
    std::error_code error;
    const Row row = std::move(rows_.back());
    rows_.pop_back();
    fs::remove(temporary_.path() / row.colour, error);
    // Pairs in a row may share a depth image.
    if (rows_.empty() || rows_.back().depth != row.depth) fs::remove(temporary_.path() / row.depth, error);
  }

  void write_lists() const {
    std::string colour = "# timestamp filename\n", depth = colour;
    std::string associations = "# rgb_timestamp rgb_file depth_timestamp depth_file\n";
    const std::string* last_depth_stamp = nullptr;
    for (const Row& row : rows_) {
      colour += row.stamp + " " + row.colour + "\n";
      if (last_depth_stamp == nullptr || row.depth_stamp != *last_depth_stamp)
        depth += row.depth_stamp + " " + row.depth + "\n";
      last_depth_stamp = &row.depth_stamp;
      associations += row.stamp + " " + row.colour + " " + row.depth_stamp + " " + row.depth + "\n";
    }
    write_image_file(temporary_.path() / "rgb.txt", colour);
    write_image_file(temporary_.path() / "depth.txt", depth);
    write_image_file(temporary_.path() / "associations.txt", associations);
  }

  void put_in_place() {
    std::error_code error;
    fs::rename(temporary_.path(), target_, error);  // also over an empty folder
    if (error) throw OutputError(path_.string() + ": cannot be written (" + error.message() + ")");
    temporary_.keep();
  }

  const fs::path path_, target_;  // as it was given; behind its links
  NewFolder temporary_;           // until it is in its place
  const Camera camera_;
  const int png_level_;
  std::vector<Row> rows_;
};

// The pairs of a recording so far, to which a reader is to find back by stamps alone: it pairs the nearest ones first.
class StampedPairs {
 public:
  // Whether a pair with these stamps, after the others, is found. One of equal stamps is, since nothing is nearer.
  bool finds(int64_t colour_ns, int64_t depth_ns) const {
    const double c = seconds_from_ns(colour_ns), d = seconds_from_ns(depth_ns);
    const auto taken_apart = [&](const Pair& other) {
      const double own = std::abs(c - d), others = std::abs(other.colour - other.depth);
      const auto nearer = [&](double difference) { return difference <= own && difference <= others; };
      return nearer(std::abs(c - other.depth)) || nearer(std::abs(other.colour - d));
    };
    if (!pairs_.empty() && d <= pairs_.back().depth) return false;
    return d >= c - kPairLimit && d <= c + kPairLimit && std::none_of(pairs_.begin(), pairs_.end(), taken_apart);
  }
  void add(int64_t colour_ns, int64_t depth_ns) {
    pairs_.push_back({seconds_from_ns(colour_ns), seconds_from_ns(depth_ns)});
    // What is farther away than twice the limit shares no image in reach with those to come.
    while (pairs_.front().colour < pairs_.back().colour - 3 * kPairLimit) pairs_.pop_front();
  }

 private:
  struct Pair {
    double colour, depth;  // [s]
  };
  std::deque<Pair> pairs_;
};

class RecordingPairWriter final : public PairWriter {
 public:
  RecordingPairWriter(const fs::path& path, const Camera& camera, const std::string& camera_text,
                      const PairWriterOptions& options)
      : name_(path.string()),
        camera_(camera),
        camera_text_(camera_text),
        warn_(options.warn),
        writer_(write_recording(path, options.compression)) {
    writer_->add_text(kCameraText, camera_text_);
  }

  void add(const PairToWrite& pair) override {
    for (const int64_t ns : {pair.stamp_ns, pair.depth_stamp_ns})
      if (ns < 0 || ns >= int64_t{UINT32_MAX} * kNsPerSecond)
        throw OutputError(name_ + ": the stamp " + stamp_text(ns) + " cannot be written; ROS counts from 1970 to 2106");
    if (!began_)
      writer_->write(topic(kCameraTopic, "std_msgs/String", true), std::min(pair.stamp_ns, pair.depth_stamp_ns),
                     encode_string(camera_text_));
    began_ = true;
    write_late_depth(pair.stamp_ns);
    const bool told = pairs_.finds(pair.stamp_ns, pair.depth_stamp_ns);
    if (!told) warn_of_stamps(pair.stamp_ns);
    const int64_t depth_ns = told ? pair.depth_stamp_ns : pair.stamp_ns;
    if (depth_ns < pair.stamp_ns) add_depth(*pair.depth, pair.stamp_ns, depth_ns);
    add_camera_info(pair.stamp_ns);
    add_colour(pair);
    if (depth_ns == pair.stamp_ns) add_depth(*pair.depth, pair.stamp_ns, depth_ns);
    if (depth_ns > pair.stamp_ns) late_depth_ = {*pair.depth, pair.stamp_ns, depth_ns};
  }

  void close() override {
    write_late_depth(std::nullopt);
    writer_->close();
  }
  void salvage() override { writer_->salvage(); }

 private:
  // Depth that was taken after its colour image: whether the next one comes between them decides on its stamp. It is
  // lost where the writer ends by a full disk.
  struct LateDepth {
    DepthImage depth;
    int64_t colour_ns = 0, depth_ns = 0;
  };
  void write_late_depth(std::optional<int64_t> next_colour_ns) {
    const std::optional<LateDepth> late = std::exchange(late_depth_, std::nullopt);
    if (!late) return;
    const bool told = !next_colour_ns || seconds_from_ns(late->depth_ns) < seconds_from_ns(*next_colour_ns);
    if (!told) warn_of_stamps(late->colour_ns);
    add_depth(late->depth, late->colour_ns, told ? late->depth_ns : late->colour_ns);
  }

  void warn_of_stamps(int64_t colour_ns) {
    if (std::exchange(warned_, true)) return;
    warn_(name_ + ": by stamps alone the images at " + stamp_text(colour_ns) +
          " would be paired otherwise; such depth images get the stamps of their colour images");
  }

  size_t topic(const std::string& name, const std::string& type, bool latched = false) {
    const auto [known, is_new] = topics_.try_emplace(name, 0);
    if (is_new) known->second = writer_->add_topic(name, type, latched);
    return known->second;
  }

  static HeaderMessage header(int64_t stamp_ns) { return {stamp_ns, "camera_rgb_optical_frame"}; }

  void add_camera_info(int64_t stamp_ns) {
    const Camera& c = camera_;
    CameraInfoMessage info;
    info.header = header(stamp_ns);
    info.height = static_cast<uint32_t>(c.height), info.width = static_cast<uint32_t>(c.width);
    info.distortion_model = c.rational() ? "rational_polynomial" : "plumb_bob";
    info.d = {c.k1, c.k2, c.p1, c.p2, c.k3};
    if (c.rational()) info.d.insert(info.d.end(), {c.k4, c.k5, c.k6});
    info.k = {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1};
    info.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    info.p = {c.fx, 0, c.cx, 0, 0, c.fy, c.cy, 0, 0, 0, 1, 0};
    writer_->write(topic("/camera/rgb/camera_info", "sensor_msgs/CameraInfo"), stamp_ns, encode(info));
  }

  void add_colour(const PairToWrite& pair) {
    if (!pair.colour_file.empty()) {
      CompressedImageMessage message;
      message.header = header(pair.stamp_ns);
      message.format = is_jpeg(pair.colour_file) ? "jpeg" : "png";
      message.data = pair.colour_file;
      writer_->write(topic("/camera/rgb/image_raw/compressed", "sensor_msgs/CompressedImage"), pair.stamp_ns,
                     encode(message));
    } else if (pair.picture->colour.empty()) {
      add_image("/camera/rgb/image_raw", "mono8", pair.stamp_ns, pair.picture->grey);
    } else {
      add_image("/camera/rgb/image_raw", "rgb8", pair.stamp_ns, pair.picture->colour);
    }
  }

  void add_depth(const DepthImage& depth, int64_t colour_ns, int64_t stamp_ns) {
    pairs_.add(colour_ns, stamp_ns);
    constexpr const char* kTopic = "/camera/depth/image_raw";
    std::optional<Image<uint16_t>> millimetres;
    if (camera_.depth_factor == kMillimetres) millimetres = exact_units(depth, camera_);
    if (millimetres)
      add_image(kTopic, "16UC1", stamp_ns, *millimetres);
    else
      add_image(kTopic, "32FC1", stamp_ns, depth);
  }

  template <class T>
  void add_image(const std::string& name, const char* encoding, int64_t stamp_ns, const Image<T>& image) {
    ImageMessage message;
    message.header = header(stamp_ns);
    message.height = static_cast<uint32_t>(image.height()), message.width = static_cast<uint32_t>(image.width());
    message.encoding = encoding;
    message.is_bigendian = std::endian::native == std::endian::big;
    message.step = static_cast<uint32_t>(message.width * sizeof(T));
    message.data = pixels_of(image);
    writer_->write(topic(name, "sensor_msgs/Image"), stamp_ns, encode(message));
  }

  const std::string name_;
  const Camera camera_;
  const std::string camera_text_;
  const std::function<void(const std::string&)> warn_;
  const std::unique_ptr<RecordingWriter> writer_;
  std::map<std::string, size_t> topics_;
  StampedPairs pairs_;
  std::optional<LateDepth> late_depth_;
  bool began_ = false, warned_ = false;
};

}  // namespace

std::unique_ptr<PairWriter> write_pairs(const fs::path& path, const Camera& camera, const std::string& camera_text,
                                        const PairWriterOptions& options) {
  if (is_recording_name(path)) return std::make_unique<RecordingPairWriter>(path, camera, camera_text, options);
  if (path.extension() == ".db3" || path.extension() == ".oni")
    throw InputError(path.string() + ": recordings are written as FILE.mcap or FILE.bag, not as " +
                     path.extension().string());
  return std::make_unique<FolderPairWriter>(path, camera, camera_text, options.png_level);
}

}  // namespace dkb

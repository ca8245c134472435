// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/rgbd_reader.h"

#include <algorithm>
#include <exception>

#include "dkb/dataset/image_codecs.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb {
namespace {

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

// A file's content with what its header says.
struct OpenedImage {
  std::string bytes, name;
  ImageHeader header;
};

OpenedImage open_image(const std::filesystem::path& path) {
  OpenedImage image;
  image.name = path.string();
  image.bytes = read_file(path);
  image.header = read_image_header(image.bytes, image.name);
  return image;
}

// What is wrong with the type or the size of an image that may be sound in itself; empty when nothing is.
std::string mismatch(const OpenedImage& image, bool is_depth, const CameraModel& camera, bool any_size) {
  const ImageHeader& h = image.header;
  const std::string other = is_depth ? why_not_depth(h) : why_not_picture(h);
  if (!other.empty())
    return image.name + ": is " + other +
           (is_depth ? "; depth must be 16-bit grey PNG, or 32-bit float in TIFF, PFM or NPY"
                     : "; colour images must be PNG or JPEG");
  if (!any_size && (h.width != camera.width || h.height != camera.height))
    return image.name + ": is of " + size_text(h.width, h.height) + " px, the camera of " +
           size_text(camera.width, camera.height) + "; give the camera of this dataset, and depth registered to colour";
  return "";
}

// Throws unless the pixels can be decoded, whatever the image is.
void decode_any(const OpenedImage& image, const CameraModel& camera) {
  if (why_not_picture(image.header).empty())
    decode_picture(image.bytes, image.name);
  else if (why_not_depth(image.header).empty())
    decode_depth(image.bytes, image.name, camera);
}

}  // namespace

struct RgbdReader::Decoded {
  std::shared_ptr<const RgbdImage> image;  // null when skipped
  std::string skipped;
  double ms = 0;
};

void RgbdReaderOptions::check() const {
  require_option(queue >= 1 && queue <= 1000, "reader.queue", queue, "1 ... 1000 pairs");
  require_option(probed >= 1, "reader.probed", probed, "at least 1 pair");
}

RgbdReader::RgbdReader(std::vector<DatasetPair> pairs, const CameraModel& camera, const RgbdReaderOptions& options)
    : pairs_(std::move(pairs)),
      camera_(camera),
      options_(options),
      queue_((options.check(), camera.check(), static_cast<size_t>(options.queue))) {
  probe();
  if (options_.threaded) thread_ = std::thread([this] { run(); });
}

RgbdReader::~RgbdReader() {
  stop();
  if (thread_.joinable()) thread_.join();
}

void RgbdReader::stop() {
  stopped_ = true;
  queue_.close();
}

// Start-up pays for this, so it decodes as little as proves the point: headers tell type and size; pixels are decoded
// until one pair has proved sound, and where a header is wrong, to tell a wrong dataset from a single broken file.
void RgbdReader::probe() {
  const size_t count = std::min(pairs_.size(), static_cast<size_t>(options_.probed));
  std::string first_failure;
  bool found_sound = false;
  for (size_t i = 0; i < count; ++i) {
    bool headers_good = true;
    for (const bool is_depth : {false, true}) {
      std::string wrong;
      try {
        const OpenedImage image = open_image(is_depth ? pairs_[i].depth_path : pairs_[i].colour_path);
        wrong = mismatch(image, is_depth, camera_, options_.fit_colour && !is_depth);
        if (!wrong.empty()) decode_any(image, camera_);
      } catch (const InputError& e) {
        wrong.clear();
        headers_good = false;
        if (first_failure.empty()) first_failure = e.what();
      }
      if (!wrong.empty()) throw InputError(wrong);
    }
    if (!headers_good || found_sound) continue;
    probed_.resize(i + 1);
    probed_[i] = std::make_unique<Decoded>(decode(i));
    found_sound = probed_[i]->image != nullptr;
    if (!found_sound && first_failure.empty()) first_failure = probed_[i]->skipped;
  }
  if (!found_sound && count > 0)
    throw InputError("none of the first " + std::to_string(count) + " pairs can be decoded: " + first_failure);
}

RgbdReader::Decoded RgbdReader::decode(size_t index) const {
  const Stopwatch watch;
  const DatasetPair& pair = pairs_[index];
  Decoded decoded;
  try {
    auto image = std::make_shared<RgbdImage>();
    image->timestamp = pair.timestamp, image->depth_timestamp = pair.depth_timestamp;
    const auto open = [&](const std::filesystem::path& path, bool is_depth) {
      OpenedImage opened = open_image(path);
      const std::string wrong = mismatch(opened, is_depth, camera_, options_.fit_colour && !is_depth);
      if (!wrong.empty()) throw InputError(wrong);
      return opened;
    };
    const OpenedImage colour = open(pair.colour_path, false), depth = open(pair.depth_path, true);
    Picture picture = decode_picture(colour.bytes, colour.name);
    if (options_.fit_colour) picture = resampled(picture, camera_.width, camera_.height);
    image->grey = std::move(picture.grey), image->colour = std::move(picture.colour);
    image->depth = decode_depth(depth.bytes, depth.name, camera_);
    decoded.image = std::move(image);
  } catch (const std::exception& e) {  // a frame that cannot be had is a gap, whatever the reason
    decoded.skipped = e.what();
  }
  decoded.ms = watch.ms();
  return decoded;
}

DatasetFrame RgbdReader::deliver(size_t index) {
  Decoded decoded = index < probed_.size() && probed_[index] ? std::move(*probed_[index]) : decode(index);
  if (index < probed_.size()) probed_[index].reset();
  {
    const std::lock_guard lock(times_mutex_);
    times_.add("decoding", decoded.ms);
  }
  return {index, pairs_[index].timestamp, pairs_[index].stamp, std::move(decoded.image), std::move(decoded.skipped)};
}

void RgbdReader::run() {
  for (size_t i = 0; i < pairs_.size() && !stopped_; ++i)
    if (!queue_.push(deliver(i))) return;
  queue_.close();
}

std::optional<DatasetFrame> RgbdReader::next() {
  if (stopped_) return std::nullopt;
  if (!options_.threaded) {
    if (next_index_ >= pairs_.size()) return std::nullopt;
    return deliver(next_index_++);
  }
  std::optional<DatasetFrame> frame = queue_.pop();
  if (stopped_) return std::nullopt;
  return frame;
}

StageTimes RgbdReader::times() const {
  const std::lock_guard lock(times_mutex_);
  return times_;
}

}  // namespace dkb

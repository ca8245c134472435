// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/stored_pair.h"

#include "dkb/dataset/image_codecs.h"
#include "dkb/image/image.h"
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
std::string mismatch(const OpenedImage& image, bool is_depth, const CameraModel& camera, bool fit_colour) {
  const ImageHeader& h = image.header;
  const std::string other = is_depth ? why_not_depth(h) : why_not_picture(h);
  if (!other.empty())
    return image.name + ": is " + other + (is_depth ? depth_remedy(h) : "; colour images must be PNG or JPEG");
  return fit_colour && !is_depth ? "" : size_mismatch(image.name, h.width, h.height, camera);
}

// Throws unless the pixels can be decoded, whatever the image is.
void decode_any(const OpenedImage& image, const CameraModel& camera) {
  if (why_not_picture(image.header).empty())
    decode_picture(image.bytes, image.name);
  else if (why_not_depth(image.header).empty())
    decode_depth(image.bytes, image.name, camera);
}

// Headers tell type and size; where one is wrong the pixels are decoded as well, to tell a wrong dataset from a single
// broken file.
std::string mismatch(const DatasetPair& pair, const CameraModel& camera, bool fit_colour) {
  return pair_mismatch([&](bool is_depth) {
    const OpenedImage image = open_image(is_depth ? pair.depth_path : pair.colour_path);
    const std::string wrong = mismatch(image, is_depth, camera, fit_colour);
    if (!wrong.empty()) decode_any(image, camera);
    return wrong;
  });
}

std::shared_ptr<RgbdImage> decode(const DatasetPair& pair, const CameraModel& camera, bool fit_colour) {
  auto image = std::make_shared<RgbdImage>();
  image->timestamp = pair.timestamp, image->depth_timestamp = pair.depth_timestamp;
  const auto open = [&](const std::filesystem::path& path, bool is_depth) {
    OpenedImage opened = open_image(path);
    const std::string wrong = mismatch(opened, is_depth, camera, fit_colour);
    if (wrong.empty()) return opened;
    const ImageHeader& h = opened.header;
    const std::string size = size_change(opened.name, h.width, h.height, camera);
    throw InputError((is_depth ? why_not_depth(h) : why_not_picture(h)).empty() ? size : wrong);
  };
  const OpenedImage colour = open(pair.colour_path, false), depth = open(pair.depth_path, true);
  Picture picture = decode_picture(colour.bytes, colour.name);
  if (fit_colour) picture = resampled(picture, camera.width, camera.height);
  image->grey = std::move(picture.grey), image->colour = std::move(picture.colour);
  image->depth = decode_depth(depth.bytes, depth.name, camera);
  leave_out_masked(camera, image->depth);
  return image;
}

}  // namespace

std::string pair_mismatch(const std::function<std::string(bool is_depth)>& of_image) {
  std::optional<InputError> broken;
  for (const bool is_depth : {false, true}) {
    try {
      if (std::string wrong = of_image(is_depth); !wrong.empty()) return wrong;
    } catch (const InputError& e) {
      if (!broken) broken = e;
    }
  }
  if (broken) throw InputError(*broken);
  return "";
}

std::string size_mismatch(const std::string& name, int width, int height, const CameraModel& camera) {
  if (width == camera.width && height == camera.height) return "";
  return name + ": is of " + size_text(width, height) + " px, the camera of " + size_text(camera.width, camera.height) +
         "; give the camera of this dataset, and depth registered to colour";
}

std::string size_change(const std::string& name, int width, int height, const CameraModel& camera) {
  if (width == camera.width && height == camera.height) return "";
  return name + ": is of " + size_text(width, height) + " px, of another size than the frames before (" +
         size_text(camera.width, camera.height) + ")";
}

PairStream pairs_in_files(std::vector<DatasetPair> pairs, const CameraModel& camera, bool fit_colour) {
  const auto shared = std::make_shared<const std::vector<DatasetPair>>(std::move(pairs));
  return [shared, camera, fit_colour, next = size_t{0}]() mutable -> std::optional<StoredPair> {
    if (next >= shared->size()) return std::nullopt;
    const DatasetPair& pair = (*shared)[next++];
    StoredPair stored;
    stored.timestamp = pair.timestamp, stored.stamp = pair.stamp;
    stored.stamp_ns = pair.stamp_ns, stored.depth_stamp_ns = pair.depth_stamp_ns;
    stored.mismatch = [shared, &pair, camera, fit_colour] { return mismatch(pair, camera, fit_colour); };
    stored.decode = [shared, &pair, camera, fit_colour] { return decode(pair, camera, fit_colour); };
    return stored;
  };
}

}  // namespace dkb

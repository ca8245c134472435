// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/folder_layouts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/layout_cameras.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/settings.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

constexpr double kRate = 30;  // [1/s] of images without stamps
constexpr const char* kNumbered = ", stamps by number at 30/s";

bool there(const fs::path& path) {
  std::error_code ec;
  return fs::exists(path, ec);
}

// An image whose name has a number where others have a stamp.
struct NumberedImage {
  fs::path path;
  std::optional<int64_t> stamp_ns;  // Redwood's scans: 0000012-000000400430.jpg is at 400430 us
};
using NumberedImages = std::map<int64_t, NumberedImage>;

// What a name tells that is `before`, a number, and one of the endings; nothing of other names.
struct NumberedName {
  int64_t number = 0;
  std::optional<int64_t> stamp_ns;
};
std::optional<NumberedName> read_name(const std::string& name, const std::string& before,
                                      const std::vector<std::string>& endings) {
  const auto digits = [](const std::string& text, int64_t* value) {
    return !text.empty() && text.size() <= 15 && text.find_first_not_of("0123456789") == std::string::npos &&
           parse_number(text, value);
  };
  for (const std::string& ending : endings) {
    if (!name.starts_with(before) || !name.ends_with(ending) || name.size() < before.size() + ending.size()) continue;
    const std::string middle = name.substr(before.size(), name.size() - before.size() - ending.size());
    const size_t dash = middle.find('-');
    NumberedName read;
    if (!digits(middle.substr(0, dash), &read.number) || read.number > 100'000'000) continue;
    if (dash == std::string::npos) return read;
    int64_t microseconds = 0;
    if (!digits(middle.substr(dash + 1), &microseconds)) continue;
    read.stamp_ns = microseconds * 1000;
    return read;
  }
  return std::nullopt;
}

// The images of a folder with such names; of equal numbers the first name's.
NumberedImages numbered_images(const fs::path& folder, const std::string& before,
                               const std::vector<std::string>& endings) {
  std::vector<fs::path> paths;
  std::error_code ec;
  for (fs::directory_iterator it(folder, ec), end; !ec && it != end; it.increment(ec)) paths.push_back(it->path());
  std::sort(paths.begin(), paths.end());
  NumberedImages images;
  for (const fs::path& path : paths)
    if (const auto name = read_name(path.filename().string(), before, endings))
      images.emplace(name->number, NumberedImage{path, name->stamp_ns});
  return images;
}

// Whether there is one at all; the first ends the search.
bool holds_numbered(const fs::path& folder, const std::string& before, const std::vector<std::string>& endings) {
  std::error_code ec;
  for (fs::directory_iterator it(folder, ec), end; !ec && it != end; it.increment(ec))
    if (read_name(it->path().filename().string(), before, endings)) return true;
  return false;
}

const std::vector<std::string> kPictures = {".jpg", ".jpeg", ".png"}, kPng = {".png"};
const std::vector<std::string> kSevenScenesColour = {".color.png", ".color.jpg"}, kReplicaColour = {".jpg", ".png"};

int64_t stamp_of_number(int64_t number) {
  return ns_from_seconds(static_cast<double>(number) / kRate);
}

// The images that have the same number in both.
TumDataset paired_by_number(const fs::path& folder, const std::string& layout, const NumberedImages& colour,
                            const NumberedImages& depth) {
  TumDataset dataset;
  dataset.folder = folder;
  // All by their names or all by their numbers: two scales of time must not mix.
  const bool stamped = std::all_of(colour.begin(), colour.end(), [&](const auto& numbered) {
    const auto other = depth.find(numbered.first);
    return other == depth.end() || (numbered.second.stamp_ns && other->second.stamp_ns);
  });
  for (const auto& [number, image] : colour) {
    const auto other = depth.find(number);
    if (other == depth.end()) continue;
    DatasetPair pair;
    pair.stamp_ns = stamped ? *image.stamp_ns : stamp_of_number(number);
    pair.depth_stamp_ns = stamped ? *other->second.stamp_ns : pair.stamp_ns;
    pair.colour_path = image.path, pair.depth_path = other->second.path;
    dataset.pairs.push_back(std::move(pair));
  }
  dataset.unpaired = colour.size() + depth.size() - 2 * dataset.pairs.size();
  if (dataset.pairs.empty())
    throw InputError(folder.string() + ": looks like " + layout +
                     ", but no colour image has a depth image of the same number");
  for (size_t i = 0; i < dataset.pairs.size(); ++i) {
    DatasetPair& pair = dataset.pairs[i];
    pair.timestamp = seconds_from_ns(pair.stamp_ns), pair.depth_timestamp = seconds_from_ns(pair.depth_stamp_ns);
    pair.stamp = stamp_text(pair.stamp_ns), pair.depth_stamp = stamp_text(pair.depth_stamp_ns);
    if (i > 0 && pair.stamp_ns <= dataset.pairs[i - 1].stamp_ns)
      throw InputError(pair.colour_path.string() + ": its stamp " + pair.stamp +
                       " is not after the image's before it (" + dataset.pairs[i - 1].stamp +
                       "); rename the images so that stamps rise with their numbers");
  }
  dataset.list = "the layout of " + layout + (stamped ? ", stamps by name" : kNumbered);
  return dataset;
}

CameraModel kinect(double focal, double cx, double cy) {
  CameraModel camera;
  camera.fx = camera.fy = focal, camera.cx = cx, camera.cy = cy, camera.depth_factor = kMillimetres;
  return camera;
}

// The first file of the names that is in one of the folders.
std::optional<fs::path> first_of(const std::vector<fs::path>& folders, const std::vector<std::string>& names) {
  for (const fs::path& folder : folders)
    for (const std::string& name : names)
      if (there(folder / name)) return folder / name;
  return std::nullopt;
}

// ICL-NUIM in TUM's layout: associations.txt counts images instead of stamping them, and names depth first.
bool counted(const TumDataset& dataset) {
  return dataset.list == "associations.txt" && dataset.pairs.size() > 1 &&
         std::all_of(dataset.pairs.begin(), dataset.pairs.end(), [&](const DatasetPair& pair) {
           return pair.stamp == pair.depth_stamp && pair.stamp.find_first_not_of("0123456789") == std::string::npos &&
                  pair.stamp.size() <= 7;
         });
}

FolderLayout open_tum(const fs::path& folder) {
  FolderLayout layout;
  layout.dataset = open_tum_dataset(folder);
  if (!counted(layout.dataset)) return layout;
  for (DatasetPair& pair : layout.dataset.pairs) {
    pair.stamp_ns = pair.depth_stamp_ns = stamp_of_number(pair.stamp_ns / kNsPerSecond);
    pair.timestamp = pair.depth_timestamp = seconds_from_ns(pair.stamp_ns);
    pair.stamp = pair.depth_stamp = stamp_text(pair.stamp_ns);
  }
  layout.dataset.list += kNumbered;
  // Its authors give fy as -480, for a y axis that points up; the images are as any others.
  CameraModel camera;
  camera.fx = 481.2, camera.fy = 480, camera.cx = 319.5, camera.cy = 239.5, camera.depth_factor = 5000;
  layout.camera = {camera, "of ICL-NUIM"};
  return layout;
}

FolderLayout open_openloris(const fs::path& folder) {
  FolderLayout layout;
  layout.dataset = pair_image_lists(folder, "color.txt", "aligned_depth.txt");
  layout.dataset.list = "the layout of OpenLORIS";
  if (const fs::path sensors = folder / "sensors.yaml"; there(sensors))
    layout.camera = {parse_openloris_camera(read_file(sensors), sensors.string()), sensors.string()};
  return layout;
}

FolderLayout open_replica(const fs::path& folder) {
  FolderLayout layout;
  const fs::path results = folder / "results";
  layout.dataset = paired_by_number(folder, "Replica", numbered_images(results, "frame", kReplicaColour),
                                    numbered_images(results, "depth", kPng));
  const fs::path above = fs::absolute(folder / "..").lexically_normal();
  if (const auto file = first_of({folder, results, above}, {"cam_params.json"}))
    layout.camera = {parse_replica_camera(read_file(*file), file->string()), file->string()};
  return layout;
}

FolderLayout open_redwood(const fs::path& folder, const std::string& colour) {
  FolderLayout layout;
  layout.dataset = paired_by_number(folder, "Redwood", numbered_images(folder / colour, "", kPictures),
                                    numbered_images(folder / "depth", "", kPng));
  if (const auto file = first_of({folder}, {"camera_intrinsic.json", "intrinsic.json"}))
    layout.camera = {parse_open3d_camera(read_file(*file), file->string()), file->string()};
  else
    layout.camera = {kinect(525, 319.5, 239.5), "of Redwood (no camera_intrinsic.json)",
                     folder.string() +
                         ": tells no camera; that of Redwood is assumed, 525 px and depth in millimetres: "
                         "put a camera.yaml into the folder, or give --camera FILE"};
  return layout;
}

ImageHeader first_header(const TumDataset& dataset, fs::path DatasetPair::*path) {
  for (size_t i = 0;; ++i) try {
      const fs::path& file = dataset.pairs[i].*path;
      return read_image_header(read_file(file), file.string());
    } catch (const InputError&) {
      if (i + 1 >= std::min<size_t>(dataset.pairs.size(), 5)) throw;
    }
}

FolderLayout open_scannet(const fs::path& folder) {
  FolderLayout layout;
  layout.dataset = paired_by_number(folder, "ScanNet", numbered_images(folder / "color", "", {".jpg", ".png"}),
                                    numbered_images(folder / "depth", "", {".png"}));
  const ImageHeader colour = first_header(layout.dataset, &DatasetPair::colour_path),
                    depth = first_header(layout.dataset, &DatasetPair::depth_path);
  const fs::path of_colour = folder / "intrinsic" / "intrinsic_color.txt",
                 of_depth = folder / "intrinsic" / "intrinsic_depth.txt";
  const CameraModel camera =
      resized(parse_intrinsic_matrix(read_file(of_colour), of_colour.string(), colour.width, colour.height),
              depth.width, depth.height);
  if (there(of_depth)) {
    const CameraModel other = parse_intrinsic_matrix(read_file(of_depth), of_depth.string(), depth.width, depth.height);
    const auto far_off = [&](double a, double b) { return std::abs(a - b) > 0.03 * depth.width; };
    if (far_off(camera.fx, other.fx) || far_off(camera.fy, other.fy) || far_off(camera.cx, other.cx) ||
        far_off(camera.cy, other.cy))
      throw InputError(of_depth.string() +
                       ": the depth camera sees another field than the colour camera; register depth to colour, then "
                       "give a camera.yaml or --camera FILE");
  }
  layout.fit_colour = true;
  layout.camera = {camera, of_colour.string()};
  return layout;
}

FolderLayout open_seven_scenes(const fs::path& folder) {
  FolderLayout layout;
  layout.dataset = paired_by_number(folder, "7-Scenes", numbered_images(folder, "frame-", kSevenScenesColour),
                                    numbered_images(folder, "frame-", {".depth.png"}));
  layout.camera = {kinect(585, 320, 240), "of 7-Scenes"};
  return layout;
}

constexpr const char* kColourFolders[] = {"color", "image", "rgb"};

// Whether a folder holds an image that is named by its stamp; what may be its number is none.
bool holds_stamped(const fs::path& folder) {
  std::error_code ec;
  for (fs::directory_iterator it(folder, ec), end; !ec && it != end; it.increment(ec)) {
    const fs::path name = it->path().filename();
    const bool picture = std::find(kPictures.begin(), kPictures.end(), name.extension()) != kPictures.end();
    if (picture && is_stamp(name.stem().string()) && !read_name(name.string(), "", kPictures)) return true;
  }
  return false;
}

bool holds_pictures(const fs::path& folder) {
  std::error_code ec;
  for (fs::directory_iterator it(folder, ec), end; !ec && it != end; it.increment(ec))
    if (std::find(kPictures.begin(), kPictures.end(), it->path().extension()) != kPictures.end()) return true;
  return false;
}

FolderLayout open_stamped(const fs::path& folder, const std::string& colour) {
  FolderLayout layout;
  layout.dataset = pair_image_folders(folder, colour, "depth");
  return layout;
}

// Names that many folders have tell a layout only with its images in them.
using Opener = std::function<FolderLayout(const fs::path&)>;
Opener opener_of(const fs::path& folder) {
  if (has_tum_lists(folder)) return open_tum;
  if (there(folder / "color.txt") && there(folder / "aligned_depth.txt")) return open_openloris;
  if (holds_numbered(folder, "frame-", kSevenScenesColour)) return open_seven_scenes;
  if (holds_numbered(folder / "results", "frame", kReplicaColour)) return open_replica;
  if (there(folder / "intrinsic" / "intrinsic_color.txt")) return open_scannet;
  if (!there(folder / "depth")) return nullptr;
  // Stamps go first: a program that writes 0.966667.png, 1.png, 1.033333.png numbers nothing.
  for (const char* colour : kColourFolders)
    if (holds_stamped(folder / colour) && !there(folder / "depth.txt"))  // a list alone has lost the other
      return [colour](const fs::path& of) { return open_stamped(of, colour); };
  for (const char* colour : kColourFolders)
    if (holds_numbered(folder / colour, "", kPictures))
      return [colour](const fs::path& of) { return open_redwood(of, colour); };
  return nullptr;
}

// Throws where a folder that is no sequence is one of those that are taken for it. Called when nothing else is left.
void refuse_other_folders(const fs::path& folder) {
  if (there(folder / "depth.txt")) return;  // a list that has lost the other
  if (there(folder / "trajectory.txt") && there(folder / "stats.json"))
    throw InputError(folder.string() + ": is a result folder, which `run` wrote; give the folder of the sequence");
  for (const char* colour : kColourFolders)
    if (const std::string others = other_endings(folder / colour, kPictures);
        there(folder / "depth") && !others.empty())
      throw InputError((folder / colour).string() + ": holds no PNG or JPEG" + others);
  std::vector<std::string> sequences;
  std::error_code ec;
  for (fs::directory_iterator it(folder, ec), end; !ec && it != end; it.increment(ec))
    if (it->is_directory(ec) && opener_of(it->path()) != nullptr) sequences.push_back(it->path().string());
  if (sequences.empty()) return;
  throw InputError(folder.string() + ": holds " + std::to_string(sequences.size()) +
                   (sequences.size() == 1 ? " sequence: name it, " : " sequences: name one, such as ") +
                   *std::min_element(sequences.begin(), sequences.end()));
}

}  // namespace

bool has_folder_layout(const fs::path& folder) {
  return opener_of(folder) != nullptr;
}

FolderLayout open_folder_layout(const fs::path& folder) {
  if (const Opener open = opener_of(folder)) return open(folder);
  for (const char* colour : kColourFolders)  // images by the right folders, whose names tell nothing: the error says so
    if (!there(folder / "depth.txt") && there(folder / "depth") && holds_pictures(folder / colour))
      return open_stamped(folder, colour);
  refuse_other_folders(folder);
  return open_tum(folder);
}

}  // namespace dkb

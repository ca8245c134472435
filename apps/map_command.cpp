// SPDX-License-Identifier: Apache-2.0
#include "map_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "dkb/dataset/detector_choice.h"
#include "dkb/map/map_file.h"
#include "dkb/map/point_cloud.h"
#include "dkb/slam/map_merge.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/new_folder.h"
#include "dkb/util/plural.h"
#include "dkb_slam/slam.h"
#include "dkb_slam/source.h"
#include "export/keyframe_pictures.h"
#include "export/map_model.h"
#include "interrupt.h"
#include "run_session.h"
#include "source_options.h"
#include "terminal.h"

namespace dkb {
namespace {

// One `key: value` per line, so that people and scripts read the same.
void print_info(const std::string& path) {
  const MapFile file = load_map(path);
  const Map& map = file.map;
  size_t features = 0, observations = 0;
  double first_stamp = 0, last_stamp = 0;
  const auto live = map.live_keyframes();
  for (KeyframeId id : live) {
    const Keyframe& k = *map.keyframe(id);
    features += k.features->size();
    first_stamp = id == live.front() ? k.timestamp : std::min(first_stamp, k.timestamp);
    last_stamp = id == live.front() ? k.timestamp : std::max(last_stamp, k.timestamp);
  }
  Eigen::AlignedBox3d extent;
  for (PointId id : map.live_points()) {
    observations += map.point(id)->observations.size();
    extent.extend(map.point(id)->position);
  }
  const Eigen::Vector3d size = extent.isEmpty() ? Eigen::Vector3d::Zero().eval() : extent.sizes().eval();
  const size_t fused = map.removed_points().size();  // a file keeps no others
  const CameraModel& c = file.context.camera;
  tell(stdout, "file: {}\n", path);
  tell(stdout, "checksums: right\n");
  tell(stdout, "bytes: {}\n", std::filesystem::file_size(path));
  tell(stdout, "keyframes: {}\n", live.size());
  tell(stdout, "maps: {}\n", map.roots().size());
  tell(stdout, "culled_keyframes: {}\n", map.keyframe_count() - map.live_keyframe_count());
  tell(stdout, "features: {}\n", features);
  tell(stdout, "points: {}\n", map.point_count());
  tell(stdout, "observations: {}\n", observations);
  tell(stdout, "fused_points: {}\n", fused);
  tell(stdout, "first_stamp_s: {:.6f}\n", first_stamp);
  tell(stdout, "last_stamp_s: {:.6f}\n", last_stamp);
  tell(stdout, "extent_m: {:.2f} {:.2f} {:.2f}\n", size.x(), size.y(), size.z());
  tell(stdout, "camera: {}x{} fx {} fy {} cx {} cy {}\n", c.width, c.height, c.fx, c.fy, c.cx, c.cy);
  tell(stdout, "pyramid: {} levels of {}\n", file.context.levels, file.context.scale_factor);
}

struct MapExportArguments {
  std::string file, format, out, images;
  SourceOptions reading;
  DetectorChoice detection;
};

// What an export of one map leaves out of a file with several.
std::string left_out(const Map& map, size_t points, size_t keyframes) {
  const size_t maps = map.roots().size();
  if (maps < 2) return "";
  return fmt::format("; left out: {} that {} never joined to it, with {} and {}", plural(maps - 1, "map", "maps"),
                     maps == 2 ? "was" : "were",
                     plural(static_cast<size_t>(map.live_keyframe_count()) - keyframes, "keyframe", "keyframes"),
                     plural(map.point_count() - points, "point", "points"));
}

// A model for photogrammetry or splatting, with pictures and masks where their source is given.
void export_model(const MapExportArguments& arguments) {
  const MapFile file = load_map(arguments.file);
  const bool colmap = arguments.format == "colmap";
  if (!colmap && file.context.camera.rational())
    throw InputError("--format nerfstudio: has no cameras with rational distortion (k4, k5, k6); give --format colmap");
  const std::filesystem::path out = arguments.out;
  const Interrupt interrupt([] {});
  NewFolder folder(out);
  std::vector<KeyframeId> keyframes = keyframes_of_largest_map(file.map);
  const size_t all = keyframes.size();
  const std::string others = left_out(file.map, file.map.points_of(keyframes).size(), all);
  std::string pictures = "no images: --images SOURCE adds them, with masks of what moves";
  if (!arguments.images.empty()) {
    SourceOptions reading = arguments.reading;
    reading.fallback_camera = file.context.camera;
    reading.prior = PriorKind::none;
    const std::unique_ptr<Source> source = open_source(arguments.images, reading);
    Options options;
    options.set("features.scale", fmt::format("{}", file.context.scale_factor), "map");
    options.set("features.levels", std::to_string(file.context.levels), "map");
    Slam slam(source->camera(), options, make_detectors(arguments.detection, source->camera()));
    slam.load_map(arguments.file);
    slam.localize_only(true);
    keyframes =
        write_keyframe_pictures(file, *source, slam, colmap ? MaskNames::with_ending : MaskNames::as_picture, out);
    pictures = plural(keyframes.size(), "image with its mask", "images with masks");
    if (keyframes.size() < all)
      tell(stderr, "warning: {}: holds {} of the map's {} keyframes; the model has these alone\n", arguments.images,
           keyframes.size(), all);
  }
  if (colmap)
    write_colmap(file, keyframes, out);
  else
    write_nerfstudio(file, keyframes, !arguments.images.empty(), out);
  folder.keep();
  tell(stdout, "{}: {}, {}; {}{}\n", arguments.out, plural(keyframes.size(), "keyframe", "keyframes"),
       plural(file.map.points_of(keyframes).size(), "point", "points"), pictures, others);
}

void check_arguments(const MapExportArguments& arguments) {
  const bool model = arguments.format == "colmap" || arguments.format == "nerfstudio";
  if (!model && !arguments.images.empty())
    throw InputError("--images: --format " + arguments.format + " holds no pictures; leave it out");
  if (!arguments.images.empty()) return check_detector(arguments.detection, !model_of(arguments.detection).empty());
  if (const std::string option = source_option_given(arguments.reading); !option.empty())
    throw InputError(option + ": is that of --images; add them, or leave it out");
  const DetectorChoice& d = arguments.detection;
  const DetectorChoice by_default;
  const std::string unused = d.kinds != by_default.kinds           ? "--detector"
                             : !d.model.empty()                    ? "--model"
                             : !d.labels.empty()                   ? "--labels"
                             : !d.classes.empty()                  ? "--classes"
                             : d.inference != by_default.inference ? "--inference"
                                                                   : "";
  if (!unused.empty())
    throw InputError(unused + ": is for the masks of pictures, and there are none; leave it out" +
                     (model ? ", or add --images" : ""));
}

void export_map(const MapExportArguments& arguments) {
  check_arguments(arguments);
  if (arguments.format == "colmap" || arguments.format == "nerfstudio") return export_model(arguments);
  const MapFile file = load_map(arguments.file);
  const Map& map = file.map;
  if (arguments.format == "json") {  // which tells the maps apart
    write_file_atomically(arguments.out, point_cloud_json(map));
    const size_t maps = map.roots().size();
    tell(stdout, "{}: {}{}\n", arguments.out, plural(map.point_count(), "point", "points"),
         maps > 1 ? fmt::format(" of {} maps that were never joined", maps) : "");
    return;
  }
  const std::vector<PointId> points = points_by_map(map).front();
  write_file_atomically(arguments.out,
                        arguments.format == "ply" ? point_cloud_ply(map, points) : point_cloud_pcd(map, points));
  tell(stdout, "{}: {}{}\n", arguments.out, plural(points.size(), "point", "points"),
       left_out(map, points.size(), map.keyframes_by_map().front().size()));
}

struct MergeArguments {
  std::string first, second, out;
};

void merge(const MergeArguments& arguments) {
  // Found out before the work.
  const std::filesystem::path out = arguments.out;
  if (std::filesystem::is_directory(out)) fail_to_write(out, "open", EISDIR);
  if (out.has_parent_path() && !std::filesystem::is_directory(out.parent_path())) fail_to_write(out, "open", ENOENT);
  std::error_code none;
  if (std::filesystem::equivalent(arguments.first, arguments.second, none))
    throw InputError(arguments.second + ": is the same file as " + arguments.first + "; give two maps");
  const MapFile first = load_map(arguments.first), second = load_map(arguments.second);
  const MapFileContext &a = first.context, &b = second.context;
  if (!same_optics(a.camera, b.camera))
    throw InputError(arguments.second + ": was made with another camera than " + arguments.first +
                     "; maps of one camera can be merged");
  if (a.levels != b.levels || a.scale_factor != b.scale_factor)
    throw InputError(arguments.second + ": was made with another image pyramid than " + arguments.first +
                     "; maps of one pyramid can be merged");
  const SlamOptions options;
  const auto merged = merge_maps(first.map, second.map, {a.camera, options.noise, a.scale_factor, a.levels}, options);
  if (!merged)
    throw InputError(arguments.second + ": shows no place for certain that " + arguments.first +
                     " shows; record the way from one to the other");
  save_map(arguments.out, merged->map, a);
  tell(stdout, "{}: {}, {}; {}, {} closed\n", arguments.out,
       plural(merged->map.live_keyframe_count(), "keyframe", "keyframes"),
       plural(merged->map.point_count(), "point", "points"), plural(merged->merges, "joint", "joints"),
       plural(merged->loops, "loop", "loops"));
}

}  // namespace

void register_map(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("map", "Look into saved maps and join them");
  command->require_subcommand(1);

  CLI::App* info = command->add_subcommand("info", "Verify every checksum and print what is in a map");
  auto path = std::make_shared<std::string>();
  info->add_option("FILE", *path, "map.dkb")->required();
  info->callback([path, &exit_code] {
    print_info(*path);
    exit_code = 0;
  });

  CLI::App* cloud = command->add_subcommand("export", "Write the map for other tools");
  auto arguments = std::make_shared<MapExportArguments>();
  cloud->add_option("FILE", arguments->file, "map.dkb")->required();
  cloud->add_option("--format", arguments->format, "ply, pcd, json: the points as a cloud; colmap, nerfstudio: a model")
      ->required()
      ->check(CLI::IsMember({"ply", "pcd", "json", "colmap", "nerfstudio"}));
  cloud->add_option("--out", arguments->out, "file to write; of a model the folder")->required();
  cloud->add_option("--images", arguments->images, "source of the map: keyframes' images and masks go into the model");
  add_source_options(*cloud, arguments->reading);
  cloud->add_option("--detector", arguments->detection.kinds, "of the masks: auto, yolo, motion, none");
  cloud->add_option("--model", arguments->detection.model, "ONNX file of the yolo detector");
  cloud->add_option("--labels", arguments->detection.labels, "Class names of that model, one per line");
  cloud->add_option("--classes", arguments->detection.classes, "Those of them that may move, by comma");
  cloud->add_option("--inference", arguments->detection.inference, "What computes it: auto, onnxruntime, opencv");
  cloud->callback([arguments, &exit_code] {
    export_map(*arguments);
    exit_code = 0;
  });

  CLI::App* join =
      command->add_subcommand("merge", "Join two maps that show a place in common, in the world of the first");
  auto parts = std::make_shared<MergeArguments>();
  join->add_option("FIRST", parts->first, "map.dkb that stays where it is")->required();
  join->add_option("SECOND", parts->second, "map.dkb that is moved onto it")->required();
  join->add_option("--out", parts->out, "file to write")->required();
  join->callback([parts, &exit_code] {
    merge(*parts);
    exit_code = 0;
  });
}

}  // namespace dkb

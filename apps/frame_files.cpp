// SPDX-License-Identifier: Apache-2.0
#include "frame_files.h"

#include <fmt/format.h>

#include <iterator>
#include <utility>

#include "dkb/dataset/movers_file.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

std::string rows_of_movers(const std::string& stamp, const FrameResult& result) {
  MoverRows rows;
  for (const Mover& mover : result.movers) rows.push_back({seconds_from_ns(result.stamp_ns), stamp, mover});
  return movers_to_csv(rows).substr(movers_to_csv({}).size());
}

std::string rows_of_features(const std::string& stamp, const FrameResult& result) {
  std::string csv;
  for (const FeatureReport& f : result.features)
    fmt::format_to(std::back_inserter(csv), "{},{:.2f},{:.2f},{}\n", stamp, f.image_x, f.image_y, name_of(f.state));
  return csv;
}

// As boxes files have them.
std::string rows_of_boxes(const std::string& stamp, const FrameResult& result) {
  std::string text;
  for (const Detection& d : result.detections)
    text += fmt::format("{} {} {:.2f} {:.2f} {:.2f} {:.2f} {:.3f}\n", stamp, written_class(d.class_name), d.box.x,
                        d.box.y, d.box.w, d.box.h, d.score);
  return text;
}

std::string row_of_log(const std::string& stamp, const FrameResult& result) {
  std::string log = fmt::format("{} frame {} {}", stamp, result.frame, name_of(result.state));
  if (result.tracked())
    log += fmt::format(", {} points; {}", result.inliers, result.keyframe_explanation);
  else if (result.state != TrackingState::paused)
    log += fmt::format(": {} features, {} with depth on what stands still, {} fit the map", result.features.size(),
                       result.with_depth, result.refused_inliers);
  return log + '\n';
}

}  // namespace

FrameFiles::File::File(const std::filesystem::path& folder, std::string file_name, const std::string& header)
    : name(std::move(file_name)), growing(folder / name, kUnfinished) {
  growing.append(header);
}

FrameFiles::FrameFiles(const std::filesystem::path& folder, const Wanted& wanted) {
  movers_.emplace(folder, "movers.csv", movers_to_csv({}));
  if (wanted.features) features_.emplace(folder, "features.csv", "timestamp,x,y,state\n");
  if (wanted.detections) detections_.emplace(folder, "detections.txt", "# rgb_timestamp class x y w h score\n");
  if (wanted.log) log_.emplace(folder, "debug.log", "");
}

void FrameFiles::write(std::optional<File>& file, const std::string& rows) {
  if (!file || file->lost) return;
  file->lost = true;
  file->growing.append(rows);
  file->lost = false;
}

void FrameFiles::add(const std::string& stamp, const FrameResult& result) {
  if (!result.movers.empty()) write(movers_, rows_of_movers(stamp, result));
  if (features_) write(features_, rows_of_features(stamp, result));
  if (detections_) write(detections_, rows_of_boxes(stamp, result));
  if (log_) write(log_, row_of_log(stamp, result));
}

void FrameFiles::commit() {
  for (auto* file : {&movers_, &features_, &detections_, &log_})
    if (*file && !(*file)->lost) (*file)->growing.commit();
}

std::set<std::string> FrameFiles::names() const {
  std::set<std::string> names;
  for (const auto* file : {&movers_, &features_, &detections_, &log_})
    if (*file) names.insert((*file)->name);
  return names;
}

}  // namespace dkb

// SPDX-License-Identifier: Apache-2.0
// How often, how fast and how rightly is a camera found again in a map? As a Markdown table.
//
//   relocalise_bench [--kidnaps N] [--shown N] [--frames N] [--map-from P] [--map-to P] [--motion]
//                    [--elsewhere FOLDER] [--verbose] FOLDER ...
//
// Each FOLDER is in TUM layout with a ground truth. A map is made of its pairs between P and P percent. Then the camera
// is kidnapped N times: it is shown black, then three frames (`--shown`) in a row from anywhere in the sequence (from
// `--elsewhere`, which shows another place with the same camera: there every pose is wrong). Poses are compared with
// those of the run that made the map; where there is none, with the ground truth, aligned to that run. `--motion`: with
// the motion segmentation, for sequences with people.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/evaluation/trajectory_error.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/image/test_frame.h"
#include "dkb/util/random.h"
#include "dkb/util/stamps.h"
#include "dkb_slam/slam.h"
#include "figures.h"

namespace {

namespace fs = std::filesystem;
using namespace dkb;

struct Arguments {
  int kidnaps = 200;
  size_t shown = 3, frames = 0;
  bool motion = false;
  double map_from = 0, map_to = 100;  // [%]
  fs::path elsewhere;
  bool verbose = false;
  std::vector<fs::path> folders;
};

// Where the camera was, in the world of the map.
class Reference {
 public:
  Reference(const fs::path& folder, const std::vector<TrajectoryFrame>& frames) {
    Trajectory run;
    for (const TrajectoryFrame& f : frames) {
      const double stamp = seconds_from_ns(f.stamp_ns);
      run_[stamp] = f.world_from_cam;
      run.push_back({stamp, "", f.world_from_cam});
    }
    if (!fs::exists(folder / "groundtruth.txt")) return;
    truth_ = read_trajectory(folder / "groundtruth.txt");
    const Evaluation evaluation = evaluate(truth_, run);
    map_from_truth_ = evaluation.truth_from_estimate.motion.inverse();
    // The tracked body need not be the camera: the rotation between them is the mean over the run.
    Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < evaluation.truth.size(); ++i)
      rotation += vector_from_rotation(evaluation.truth[i].rotation.conjugate() * evaluation.estimate[i].rotation);
    body_from_cam_.rotation = rotation_from_vector(rotation / static_cast<double>(evaluation.truth.size()));
  }
  bool mapped(double stamp) const { return run_.contains(stamp); }
  std::optional<Rigid3> at(double stamp) const {
    if (const auto known = run_.find(stamp); known != run_.end()) return known->second;
    const auto after = std::lower_bound(truth_.begin(), truth_.end(), stamp, [](const StampedPose& p, double wanted) {
      return p.timestamp < wanted - 0.005;
    });
    if (after == truth_.end() || after->timestamp > stamp + 0.005) return std::nullopt;
    return map_from_truth_ * after->world_from_cam * body_from_cam_;
  }

 private:
  std::map<double, Rigid3> run_;
  Trajectory truth_;
  Rigid3 map_from_truth_, body_from_cam_;
};

struct Score {
  int kidnaps = 0, found = 0, wrong = 0;
  std::vector<double> centimetres, degrees;
  std::vector<double> frames_needed;
  std::vector<double> search_ms;
};

Frame at_time(const RgbdImage& image, double seconds) {
  auto copy = std::make_shared<RgbdImage>(image);
  copy->depth_timestamp += seconds - copy->timestamp;
  copy->timestamp = seconds;
  return frame_of(std::move(copy));
}

Frame darkness(const CameraModel& camera, double seconds) {
  auto image = std::make_shared<RgbdImage>();
  image->timestamp = image->depth_timestamp = seconds;
  image->grey = GreyImage(camera.width, camera.height);
  image->depth = DepthImage(camera.width, camera.height);
  return frame_of(std::move(image));
}

void measure(const fs::path& folder, const Arguments& arguments) {
  std::vector<DatasetPair> pairs = open_tum_dataset(folder).pairs;
  if (arguments.frames > 0 && pairs.size() > arguments.frames) pairs.resize(arguments.frames);
  const CameraModel camera = choose_camera("", folder).camera;
  const auto share = [&](double percent) {
    return pairs.begin() + static_cast<long>(percent / 100 * static_cast<double>(pairs.size()));
  };
  const Detectors detectors = arguments.motion ? Detectors() : Detectors::none();
  Slam mapper(camera, Options(), detectors);
  RgbdReader reader({share(arguments.map_from), share(arguments.map_to)}, camera, {});
  while (const auto frame = reader.next())
    if (frame->image) mapper.process(frame_of(frame->image));
  mapper.finish();
  std::vector<TrajectoryFrame> first_map;
  for (const TrajectoryFrame& f : mapper.trajectory())
    if (f.map == 0) first_map.push_back(f);
  const Reference reference(folder, first_map);

  Slam slam(camera, Options(), detectors);
  const fs::path file = fs::temp_directory_path() / ("dkb-relocalise-bench-" + std::to_string(getpid()) + ".dkb");
  mapper.save_map(file);
  slam.load_map(file);
  fs::remove(file);
  slam.localize_only(true);
  const std::vector<DatasetPair> shown =
      arguments.elsewhere.empty() ? pairs : open_tum_dataset(arguments.elsewhere).pairs;
  Random random(1);
  Score inside, outside;
  double clock = 0;
  for (int n = 0; n < arguments.kidnaps; ++n) {
    const size_t start = random.below(static_cast<uint32_t>(shown.size() - arguments.shown + 1));
    const auto first = shown.begin() + static_cast<long>(start);
    RgbdReader frames({first, first + static_cast<long>(arguments.shown)}, camera, {.threaded = false});
    slam.process(darkness(camera, clock += 1));
    const bool mapped = arguments.elsewhere.empty() && reference.mapped(first->timestamp);
    Score& score = mapped ? inside : outside;
    ++score.kidnaps;
    bool found = false, wrong = false;
    while (const auto frame = frames.next()) {
      if (!frame->image) continue;
      const FrameResult result = slam.process(at_time(*frame->image, clock += 1 / camera.fps));
      if (!found) score.search_ms.push_back(result.tracking_ms);
      if (!result.tracked()) continue;
      if (!found) score.frames_needed.push_back(static_cast<double>(frame->index) + 1);
      found = true;
      const std::optional<Rigid3> truth = arguments.elsewhere.empty() ? reference.at(frame->image->timestamp) : std::nullopt;
      if (!truth) {
        wrong = wrong || !arguments.elsewhere.empty();
        continue;
      }
      const Rigid3 off = truth->inverse() * *result.world_from_cam;
      const double cm = 100 * off.translation.norm(), deg = vector_from_rotation(off.rotation).norm() * 180 / M_PI;
      score.centimetres.push_back(cm);
      score.degrees.push_back(deg);
      wrong = wrong || cm > 5 || deg > 2;
      if (arguments.verbose && (cm > 3 || deg > 1))
        fmt::print(stderr, "{} pair {}: off by {:.1f} cm, {:.2f} deg, {} inliers\n", folder.filename().string(),
                   start + frame->index, cm, deg, result.inliers);
    }
    if (arguments.verbose && mapped && !found)
      fmt::print(stderr, "{} pair {}: not found\n", folder.filename().string(), start);
    score.found += found;
    score.wrong += wrong;
  }
  const auto row = [&](const char* where, const Score& s) {
    if (s.kidnaps == 0) return;
    fmt::print(
        "| {} | {} | {} | {} | {} ({:.1f} %) | {:.0f} / {:.0f} / {:.0f} | {} | {:.2f} / {:.2f} | {:.2f} / {:.2f} | "
        "{:.1f} / {:.1f} "
        "|\n",
        folder.filename().string(), where, mapper.statistics().keyframes, s.kidnaps, s.found,
        100.0 * s.found / s.kidnaps, percentile(s.frames_needed, 0.5), percentile(s.frames_needed, 0.95),
        percentile(s.frames_needed, 1), s.wrong, percentile(s.centimetres, 0.5), percentile(s.centimetres, 1),
        percentile(s.degrees, 0.5), percentile(s.degrees, 1), percentile(s.search_ms, 0.5),
        percentile(s.search_ms, 0.95));
    std::fflush(stdout);
  };
  row("mapped", inside);
  row(arguments.elsewhere.empty() ? "not mapped" : "elsewhere", outside);
}

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto value = [&]() -> std::string {
      if (++i == argc) throw std::runtime_error(word + " needs a value");
      return argv[i];
    };
    if (word == "--kidnaps")
      arguments.kidnaps = std::stoi(value());
    else if (word == "--shown")
      arguments.shown = std::stoul(value());
    else if (word == "--motion")
      arguments.motion = true;
    else if (word == "--frames")
      arguments.frames = std::stoul(value());
    else if (word == "--map-from")
      arguments.map_from = std::stod(value());
    else if (word == "--map-to")
      arguments.map_to = std::stod(value());
    else if (word == "--elsewhere")
      arguments.elsewhere = value();
    else if (word == "--verbose")
      arguments.verbose = true;
    else
      arguments.folders.emplace_back(word);
  }
  return arguments;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Arguments arguments = parse(argc, argv);
    fmt::print(
        "| sequence | frames from | keyframes | kidnaps | found | with frame, median / p95 / last | wrong | off by, "
        "median / "
        "largest [cm] | [deg] | search median / p95 [ms] |\n|---|---|---|---|---|---|---|---|---|---|\n");
    for (const fs::path& folder : arguments.folders) measure(folder, arguments);
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 1;
  }
  return 0;
}

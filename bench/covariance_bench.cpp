// SPDX-License-Identifier: Apache-2.0
// Are the covariances of published poses true? As a Markdown table.
//
//   covariance_bench [--frames N] FOLDER ...
//
// Each FOLDER is simulated: its ground truth is the camera's. Both start at their first frame, which is the world's
// origin. NEES is the squared error by the covariance and degree of freedom (Bar-Shalom, Li and Kirubarajan, 2001,
// section 5.4), whose mean is 1 where covariances are true; the errors of one run hang together, so that a run's own
// mean varies by half of that and more.
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/test_frame.h"
#include "dkb_slam/slam.h"
#include "figures.h"

namespace {

namespace fs = std::filesystem;
using namespace dkb;

double squared(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
  return error.dot(covariance.llt().solve(error)) / static_cast<double>(error.size());
}

void measure(const fs::path& folder, size_t frames) {
  std::vector<DatasetPair> pairs = open_tum_dataset(folder).pairs;
  if (frames > 0 && pairs.size() > frames) pairs.resize(frames);
  const CameraModel camera = choose_camera("", folder).camera;
  const Trajectory truth = read_trajectory(folder / "groundtruth.txt");
  const auto truth_at = [&](double stamp) -> std::optional<Rigid3> {
    const auto at = std::lower_bound(truth.begin(), truth.end(), stamp - 1e-3,
                                     [](const StampedPose& p, double wanted) { return p.timestamp < wanted; });
    if (at == truth.end() || at->timestamp > stamp + 1e-3) return std::nullopt;
    return at->world_from_cam;
  };

  Slam slam(camera);
  RgbdReader reader({pairs.begin(), pairs.end()}, camera, {});
  std::optional<Rigid3> run_from_truth;
  std::vector<double> all, translations, rotations;
  double metres = 0, radians = 0, metres_claimed = 0, radians_claimed = 0;
  while (const auto frame = reader.next()) {
    if (!frame->image) continue;
    const FrameResult result = slam.process(frame_of(frame->image));
    const std::optional<Rigid3> there = truth_at(frame->image->timestamp);
    if (!result.tracked() || !there) continue;
    if (!run_from_truth) run_from_truth = *result.world_from_cam * there->inverse();
    const Vector6d error = tangent_from_rigid3(result.world_from_cam->inverse() * *run_from_truth * *there);
    const Matrix6d& claimed = *result.covariance;
    all.push_back(squared(error, claimed));
    translations.push_back(squared(error.head<3>(), claimed.topLeftCorner<3, 3>()));
    rotations.push_back(squared(error.tail<3>(), claimed.bottomRightCorner<3, 3>()));
    metres += error.head<3>().squaredNorm();
    radians += error.tail<3>().squaredNorm();
    metres_claimed += claimed.topLeftCorner<3, 3>().trace();
    radians_claimed += claimed.bottomRightCorner<3, 3>().trace();
  }
  const auto n = static_cast<double>(all.size());
  const auto mean = [n](const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v;
    return sum / n;
  };
  fmt::print("| {} | {} | {:.1f} / {:.1f} | {:.1f} / {:.1f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n",
             folder.filename().string(), all.size(), 1e3 * std::sqrt(metres / n), 1e3 * std::sqrt(metres_claimed / n),
             1e3 * std::sqrt(radians / n), 1e3 * std::sqrt(radians_claimed / n), mean(all), percentile(all, 0.5),
             mean(translations), mean(rotations));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    size_t frames = 0;
    fmt::print(
        "| sequence | frames | off by / claimed [mm] | [mrad] | NEES, mean | median | of the place | of the rotation |\n"
        "|---|---|---|---|---|---|---|---|\n");
    for (int i = 1; i < argc; ++i) {
      if (std::string(argv[i]) != "--frames")
        measure(argv[i], frames);
      else if (++i < argc)
        frames = std::stoul(argv[i]);
      else
        throw std::runtime_error("--frames needs a value");
    }
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 1;
  }
  return 0;
}

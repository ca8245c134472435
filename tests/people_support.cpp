// SPDX-License-Identifier: Apache-2.0
#include "people_support.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <stdexcept>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb_slam/geometry.h"
#include "e2e_support.h"

namespace dkb::test {
namespace fs = std::filesystem;
namespace {

// How many pixels of a mask are set in a rectangle, by sums over all rectangles that start at the corner.
class Silhouettes {
 public:
  explicit Silhouettes(const GreyImage& mask) : sums_(mask.width() + 1, mask.height() + 1) {
    for (int y = 0; y < mask.height(); ++y)
      for (int x = 0; x < mask.width(); ++x)
        sums_(x + 1, y + 1) = sums_(x, y + 1) + sums_(x + 1, y) - sums_(x, y) + (mask(x, y) > 0);
  }
  // Whether all, or any, pixels of the image within `reach` of (x, y), each way, are on people.
  bool all(int x, int y, int reach) const { return set(x, y, reach) == area(x, y, reach); }
  bool any(int x, int y, int reach) const { return set(x, y, reach) > 0; }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width() && y < height(); }
  int width() const { return sums_.width() - 1; }
  int height() const { return sums_.height() - 1; }

 private:
  struct Window {
    int x0, y0, x1, y1;
  };
  Window window(int x, int y, int reach) const {
    return {std::max(0, x - reach), std::max(0, y - reach), std::min(width(), x + reach + 1),
            std::min(height(), y + reach + 1)};
  }
  int area(int x, int y, int reach) const {
    const Window w = window(x, y, reach);
    return (w.x1 - w.x0) * (w.y1 - w.y0);
  }
  int set(int x, int y, int reach) const {
    const Window w = window(x, y, reach);
    return sums_(w.x1, w.y1) - sums_(w.x0, w.y1) - sums_(w.x1, w.y0) + sums_(w.x0, w.y0);
  }
  Image<int> sums_;
};

struct TrueBox {
  float x, y, w, h;
  bool contains(float px, float py) const { return px >= x && py >= y && px <= x + w && py <= y + h; }
};

std::map<std::string, std::vector<TrueBox>> read_boxes(const fs::path& file) {
  std::map<std::string, std::vector<TrueBox>> boxes;
  for (const auto& row : rows_of(file))
    boxes[row.at(0)].push_back(
        {std::stof(row.at(2)), std::stof(row.at(3)), std::stof(row.at(4)), std::stof(row.at(5))});
  return boxes;
}

}  // namespace

fs::path people_sequence() {
  return simulated(DKB_TEST_PEOPLE, {"--scene", DKB_TEST_PEOPLE_SCENE, "--seed", "3"});
}

std::vector<std::string> people_detector(const std::string& name) {
  const std::string boxes = people_sequence() / "boxes.txt", masks = people_sequence() / "masks";
  if (name == "nothing") return {"--detector", "none"};
  if (name == "motion") return {"--detector", "motion"};
  if (name == "boxes") return {"--detector", "file", "--boxes", boxes};
  if (name == "masks") return {"--detector", "none", "--masks", masks};
  if (name == "motion_with_boxes") return {"--detector", "motion+file", "--boxes", boxes};
  std::string network = name;
  const auto ended_with = [&](const std::string& end) {
    if (!network.ends_with(end)) return false;
    network.resize(network.size() - end.size());
    return true;
  };
  const bool by_opencv = ended_with("_by_opencv"), with_motion = ended_with("_with_motion");
  const fs::path model = outside_data("models/" + network + ".onnx");
  if (model.empty()) return {};
  std::vector<std::string> arguments = {"--detector", with_motion ? "yolo+motion" : "yolo", "--model", model};
  if (by_opencv) arguments.insert(arguments.end(), {"--inference", "opencv"});
  return arguments;
}

std::string no_people_detector(const std::string& network) {
  return no_outside_data("models/" + network + ".onnx");
}

FeatureRows read_features(const fs::path& csv) {
  FeatureRows features;
  std::istringstream text(read_text(csv));
  std::string line;
  std::getline(text, line);
  if (line != "timestamp,x,y,state") throw std::runtime_error(csv.string() + " starts with " + line);
  while (std::getline(text, line)) {
    std::istringstream columns(line);
    std::string stamp, x, y, state;
    std::getline(columns, stamp, ',');
    std::getline(columns, x, ',');
    std::getline(columns, y, ',');
    std::getline(columns, state, ',');
    features[stamp].push_back({std::stof(x), std::stof(y), state});
  }
  return features;
}

FeatureUse feature_use(const fs::path& dataset, const FeatureRows& features, int skipped) {
  const auto boxes = read_boxes(dataset / "boxes.txt");
  FeatureUse result;
  int leaked = 0, used_in_boxes = 0, outside = 0, used_outside = 0, frame = 0;
  for (const auto& [stamp, rows] : features) {
    if (frame++ < skipped) continue;
    const Silhouettes people(read_picture(dataset / "masks" / (stamp + ".png")).grey);
    const auto boxes_here = boxes.find(stamp);
    for (const FeatureRow& f : rows) {
      const int x = std::min(people.width() - 1, static_cast<int>(f.x)),
                y = std::min(people.height() - 1, static_cast<int>(f.y)), used = f.state == "used";
      const auto holds = [&](const TrueBox& box) { return box.contains(f.x, f.y); };
      if (people.all(x, y, 2)) {
        ++result.on_people;
        leaked += used;
      } else if (people.any(x, y, 10)) {
        continue;
      } else if (boxes_here != boxes.end() &&
                 std::any_of(boxes_here->second.begin(), boxes_here->second.end(), holds)) {
        ++result.in_boxes;
        used_in_boxes += used;
      } else {
        ++outside;
        used_outside += used;
      }
    }
  }
  const auto share = [](int part, int whole) { return static_cast<double>(part) / std::max(1, whole); };
  result.leak = share(leaked, result.on_people);
  const double outside_share = share(used_outside, outside);
  result.lost = outside_share > 0.2 ? 1 - share(used_in_boxes, result.in_boxes) / outside_share : 1.0;
  return result;
}

std::vector<Eigen::Vector3d> read_cloud(const fs::path& ply) {
  const std::string text = read_text(ply);
  const std::string count = "element vertex ", end = "end_header\n";
  const size_t points = std::stoul(text.substr(text.find(count) + count.size()));
  const size_t data = text.find(end) + end.size(), bytes = points > 0 ? (text.size() - data) / points : 0;
  std::vector<Eigen::Vector3d> cloud(points);
  for (size_t i = 0; i < points; ++i) {
    Eigen::Vector3f p;
    std::memcpy(p.data(), text.data() + data + i * bytes, sizeof p);
    cloud[i] = p.cast<double>();
  }
  return cloud;
}

Rigid3 truth_from_world(const fs::path& dataset, const fs::path& online_trajectory) {
  const Trajectory run = read_trajectory(online_trajectory);
  if (run.empty()) throw std::runtime_error(online_trajectory.string() + " has no poses");
  for (const StampedPose& truth : read_trajectory(dataset / "groundtruth.txt"))
    if (truth.stamp == run.front().stamp) return truth.world_from_cam * run.front().world_from_cam.inverse();
  throw std::runtime_error("no true pose at " + run.front().stamp);
}

int points_on_people(const fs::path& dataset, const std::vector<Eigen::Vector3d>& points,
                     const Rigid3& truth_from_world) {
  const Camera camera = Camera::load(dataset / "camera.yaml");
  const Trajectory truth = read_trajectory(dataset / "groundtruth.txt");
  const auto pairs = rows_of(dataset / "associations.txt");
  std::vector<bool> on_people(points.size(), false);
  for (size_t i = 0; i < pairs.size(); ++i) {
    const GreyImage mask = read_picture(dataset / "masks" / (pairs[i].at(0) + ".png")).grey;
    if (std::all_of(mask.data(), mask.data() + mask.size(), [](uint8_t v) { return v == 0; })) continue;
    const Silhouettes people(mask);
    const DepthImage depth = read_depth(dataset / pairs[i].at(3), camera);
    const Rigid3 cam_from_world = truth.at(i).world_from_cam.inverse() * truth_from_world;
    for (size_t p = 0; p < points.size(); ++p) {
      const Eigen::Vector3d point = cam_from_world * points[p];
      if (point.z() < 0.2) continue;
      const Eigen::Vector2d pixel = camera.project(point);
      const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
      if (!people.contains(x, y) || !people.all(x, y, 15) || !(depth(x, y) > 0)) continue;
      const double surface = depth(x, y);
      if (std::abs(surface - point.z()) < 0.02 + 0.02 * surface) on_people[p] = true;
    }
  }
  return static_cast<int>(std::count(on_people.begin(), on_people.end(), true));
}

}  // namespace dkb::test

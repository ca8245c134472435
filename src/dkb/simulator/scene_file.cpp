// SPDX-License-Identifier: Apache-2.0
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "dkb/simulator/noise.h"
#include "dkb/simulator/scene.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/settings.h"

namespace dkb::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = 0.017453292519943295;

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& n : names) out += (out.empty() ? "" : ", ") + n;
  return out;
}

// A map of the file whose keys are known; every complaint names the file and the line.
class Section {
 public:
  Section(const std::string& file, const YAML::Node& node, const std::string& name,
          const std::vector<std::string>& keys)
      : file_(file), node_(node), name_(name) {
    if (!node.IsMap()) fail(node, name + " must be a map of " + listed(keys));
    std::vector<std::string> seen;
    for (const auto& entry : node) {
      const auto key = entry.first.as<std::string>();
      if (std::find(keys.begin(), keys.end(), key) == keys.end())
        fail(entry.first,
             "unknown key \"" + key + "\" in " + name + did_you_mean(key, keys) + "; the keys are " + listed(keys));
      if (std::find(seen.begin(), seen.end(), key) != seen.end())
        fail(entry.first, "key \"" + key + "\" stands twice in " + name);
      seen.push_back(key);
    }
  }

  bool has(const std::string& key) const { return static_cast<bool>(node_[key]); }
  YAML::Node child(const std::string& key) const {
    if (!has(key)) fail(node_, name_ + " lacks the key \"" + key + "\"");
    return node_[key];
  }
  double number(const std::string& key, double low, double high) const { return checked(child(key), key, low, high); }
  double number(const std::string& key, double low, double high, double otherwise) const {
    return has(key) ? number(key, low, high) : otherwise;
  }
  int whole(const std::string& key, int low, int high, int otherwise) const {
    const double v = number(key, low, high, otherwise);
    if (v != std::floor(v)) fail(node_[key], key + " must be a whole number");
    return static_cast<int>(v);
  }
  bool flag(const std::string& key, bool otherwise) const {
    if (!has(key)) return otherwise;
    bool v = false;
    if (!YAML::convert<bool>::decode(node_[key], v)) fail(node_[key], key + " must be true or false");
    return v;
  }
  std::string choice(const std::string& key, const std::vector<std::string>& names,
                     const std::string& otherwise) const {
    if (!has(key) && !otherwise.empty()) return otherwise;
    const YAML::Node n = child(key);
    const std::string v = n.IsScalar() ? n.Scalar() : "";
    if (std::find(names.begin(), names.end(), v) == names.end())
      fail(n, key + ": unknown \"" + v + "\"" + did_you_mean(v, names) + "; there are " + listed(names));
    return v;
  }
  std::vector<double> numbers(const std::string& key, size_t count) const {
    const YAML::Node n = child(key);
    if (!n.IsSequence() || n.size() != count)
      fail(n, key + " must be a list of " + std::to_string(count) + " numbers [m]");
    std::vector<double> out;
    for (const auto& v : n) out.push_back(checked(v, key, -1000, 1000));
    return out;
  }
  YAML::Node list(const std::string& key) const {
    const YAML::Node n = child(key);
    if (!n.IsSequence() || n.size() == 0) fail(n, key + " must be a list with at least one entry");
    return n;
  }
  [[noreturn]] void fail(const YAML::Node& at, const std::string& what) const {
    throw InputError(file_ + ":" + std::to_string(at.Mark().line + 1) + ": " + what);
  }

 private:
  double checked(const YAML::Node& n, const std::string& key, double low, double high) const {
    double v = 0;
    if (!n.IsScalar() || !parse_number(n.Scalar(), &v) || !std::isfinite(v)) fail(n, key + " must be a number");
    if (v < low || v > high)
      fail(n, key + ": " + n.Scalar() + " is out of range; it must be " + std::to_string(low) + " ... " +
                  std::to_string(high));
    return v;
  }
  std::string file_;
  YAML::Node node_;
  std::string name_;
};

void read_room(const std::string& file, const Section& top, uint64_t seed, Scene* scene) {
  double width = 6, depth = 5, height = 2.6;
  std::string floor = "planks";
  bool furnished = true;
  if (top.has("room")) {
    const Section room(file, top.child("room"), "room", {"size", "height", "floor", "furnished"});
    if (room.has("size")) {
      const std::vector<double> size = room.numbers("size", 2);
      width = size[0];
      depth = size[1];
      if (width < 2 || depth < 2 || width > 50 || depth > 50)
        room.fail(room.child("size"), "size must be 2 ... 50 m each way");
    }
    height = room.number("height", 2, 10, height);
    floor = room.choice("floor", {"planks", "carpet", "plaster", "wood"}, floor);
    furnished = room.flag("furnished", true);
  }
  const auto& names = material_names();
  const auto material = static_cast<Material>(std::find(names.begin(), names.end(), floor) - names.begin());
  scene->inside = {-width / 2, -depth / 2, width / 2, depth / 2};
  const Footprint& r = scene->inside;
  Furnisher f(&scene->materials, &scene->furnishing, hash64(seed, 0xF00D));
  f.shell(r.x0, r.y0, r.x1, r.y1, height, material);
  if (!furnished) return;
  f.line_wall({r.x0 + 0.62, r.y0}, {1, 0}, width - 1.24, 0.45);
  f.line_wall({r.x1, r.y0 + 0.62}, {0, 1}, depth - 1.24, 0.45);
  f.line_wall({r.x1 - 0.62, r.y1}, {-1, 0}, width - 1.24, 0.45);
  f.line_wall({r.x0, r.y1 - 0.62}, {0, -1}, depth - 1.24, 0.45);
}

void read_objects(const std::string& file, const Section& top, uint64_t seed, Scene* scene) {
  if (!top.has("objects")) return;
  Furnisher f(&scene->materials, &scene->furnishing, hash64(seed, 0x0B7E));
  for (const auto& node : top.list("objects")) {
    const Section o(file, node, "objects", {"kind", "position", "yaw", "size", "material"});
    const std::string kind =
        o.choice("kind", {"box", "ellipsoid", "desk", "shelf", "cabinet", "chair", "plant", "cartons"}, "");
    const bool free = kind == "box" || kind == "ellipsoid";
    if (!free && (o.has("size") || o.has("material")))
      o.fail(node, "size and material belong to kind box and ellipsoid only");
    const std::vector<double> p = o.numbers("position", free ? 3 : 2);
    const double yaw = o.number("yaw", -360, 360, 0) * kDegree;
    if (!free) {
      const Rigid3 at = placed(p[0], p[1], 0, yaw);
      if (kind == "desk") f.desk(at, 1.4, 0.75, Clutter::monitors);
      if (kind == "shelf") f.shelf(at, 1.0, 0.3, 1.9);
      if (kind == "cabinet") f.cabinet(at, 0.8, 0.4, 1.1);
      if (kind == "chair") f.chair(at);
      if (kind == "plant") f.plant(at);
      if (kind == "cartons") f.cartons(at, 0.55, 0.45);
      continue;
    }
    const std::vector<double> size = o.numbers("size", 3);
    for (const double v : size)
      if (v < 0.005) o.fail(o.child("size"), "size must be at least 0.005 m each way");
    const std::string material = o.choice("material", material_names(), "carton");
    const auto kind_of = static_cast<Material>(std::find(material_names().begin(), material_names().end(), material) -
                                               material_names().begin());
    const int t = scene->materials.get(kind_of, hash64(seed, static_cast<uint64_t>(node.Mark().line)),
                                       std::max(size[0], size[1]), size[2]);
    Surfaces s;
    if (kind == "box") {
      s.add_box(-0.5 * Vector3d(size[0], size[1], size[2]), Vector3d(size[0], 0, 0), Vector3d(0, size[1], 0),
                Vector3d(0, 0, size[2]), {t, t, t, t, t, t});
    } else {
      TextureWindow look;
      look.texture = t;
      s.add_ellipsoid(Vector3d::Zero(), Eigen::Matrix3d::Identity(), 0.5 * Vector3d(size[0], size[1], size[2]), look);
    }
    scene->furnishing.surfaces.append(s.moved(placed(p[0], p[1], p[2], yaw)));
    const double radius = 0.5 * std::hypot(size[0], size[1]);
    scene->furnishing.footprints.push_back({p[0] - radius, p[1] - radius, p[0] + radius, p[1] + radius});
  }
}

void read_path(const std::string& file, const Section& top, uint64_t seed, Scene* scene) {
  std::vector<TimedPose> knots;
  for (const auto& node : top.list("path")) {
    const Section k(file, node, "path", {"time", "position", "look_at"});
    const double time = k.number("time", 0, 36000);
    if (!knots.empty() && time <= knots.back().time)
      k.fail(k.child("time"), "time must be later than that of the entry before");
    const std::vector<double> p = k.numbers("position", 3), q = k.numbers("look_at", 3);
    const Vector3d eye(p[0], p[1], p[2]), d = Vector3d(q[0], q[1], q[2]) - eye;
    const Footprint& in = scene->inside;
    if (eye.x() <= in.x0 || eye.x() >= in.x1 || eye.y() <= in.y0 || eye.y() >= in.y1 || eye.z() <= 0)
      k.fail(k.child("position"), "position is outside the room");
    if (std::hypot(d.x(), d.y()) < 1e-3)
      k.fail(k.child("look_at"), "look_at must not be straight above or below position");
    knots.push_back({time, camera_pose(eye, std::atan2(d.y(), d.x()), std::atan2(d.z(), std::hypot(d.x(), d.y())))});
  }
  const double tremor = top.number("tremor", 0, 10, 1);
  if (knots.size() == 1) knots.push_back({knots[0].time + 1, knots[0].world_from_cam});
  const CameraPath steady = smooth_path(knots, 0.2);
  scene->path = [steady, tremor, seed](double t) {
    if (tremor == 0) return steady(t);
    const Tremor h = hand_tremor(t, 0.006 * tremor, 0.008 * tremor, seed);
    const Rigid3 p = steady(t);
    return Rigid3((p.rotation * rotation_from_vector(Vector3d(h.pitch, h.yaw, h.roll))).normalized(),
                  p.translation + h.shift);
  };
}

void read_movers(const std::string& file, const Section& top, double duration, const SceneRequest& request,
                 Scene* scene) {
  if (!top.has("movers")) return;
  for (const auto& node : top.list("movers")) {
    const Section m(file, node, "movers", {"class", "waypoints"});
    std::vector<Waypoint> points;
    for (const auto& entry : m.list("waypoints")) {
      const Section w(file, entry, "waypoints", {"time", "position"});
      const std::vector<double> p = w.numbers("position", 2);
      points.push_back({{p[0], p[1]}, w.number("time", 0, 36000)});
      if (points.size() > 1 && points.back().time <= points[points.size() - 2].time)
        w.fail(w.child("time"), "time must be later than that of the entry before");
    }
    const std::string kind = m.choice("class", {"person", "chair"}, "person");
    const double later = kind == "person" ? request.stand_still : 0;
    for (Waypoint& w : points) w.time += later;
    add_mover(scene, kind, track_along(points, duration, later > 0),
              hash64(request.seed, static_cast<uint64_t>(scene->movers.size()), 3));
  }
}

}  // namespace

Scene read_scene_file(const std::string& file, const SceneRequest& request) {
  YAML::Node root;
  try {
    root = YAML::Load(read_file(file));
  } catch (const YAML::Exception& e) {
    throw InputError(file + ":" + std::to_string(std::max(0, e.mark.line) + 1) + ": not YAML: " + e.msg);
  }
  const std::vector<std::string> keys{"frames", "people", "exposure_ms", "tremor", "room", "path", "objects", "movers"};
  if (!root.IsMap()) throw InputError(file + ":1: a scene file is a map of " + listed(keys));
  try {
    const Section top(file, root, "the scene", keys);
    Scene scene;
    scene.frames = request.frames > 0 ? request.frames : top.whole("frames", 1, 1000000, 300);
    scene.exposure = top.number("exposure_ms", 1, 30, 14) * 1e-3;
    const double duration = scene.frames / request.fps;
    read_room(file, top, request.seed, &scene);
    read_objects(file, top, request.seed, &scene);
    read_path(file, top, hash64(request.seed, 12), &scene);
    read_movers(file, top, duration, request, &scene);
    const int people = request.people >= 0 ? request.people : top.whole("people", 0, 30, 0);
    if (people > 0) add_walkers(&scene, WalkArea{}, people, duration, request);
    return scene;
  } catch (const YAML::Exception& e) {
    throw InputError(file + ":" + std::to_string(std::max(0, e.mark.line) + 1) + ": " + e.msg);
  }
}

}  // namespace dkb::sim

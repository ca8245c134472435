// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "dkb/simulator/noise.h"
#include "dkb/simulator/scene.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/yaml_reader.h"

namespace dkb::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = 0.017453292519943295;
const Range kTimes{0, 36000};  // [s]

std::vector<double> metres(const YamlReader& value, size_t count, const Range& range = {-1000, 1000}) {
  std::vector<double> out;
  for (const YamlReader& entry : value.list()) out.push_back(entry.number(range));
  if (out.size() != count) value.fail(fmt::format("must be a list of {} numbers [m]", count));
  return out;
}

Material material_named(const std::string& name) {
  const auto& names = material_names();
  return static_cast<Material>(std::find(names.begin(), names.end(), name) - names.begin());
}

// Returns its height [m].
double read_room(const YamlReader& top, uint64_t seed, Scene* scene) {
  double width = 6, depth = 5, height = 2.6;
  std::string floor = "planks";
  bool furnished = true;
  if (top.has("room")) {
    const YamlReader room = top.at("room");
    room.check_keys({"size", "height", "floor", "furnished"});
    if (room.has("size")) {
      const std::vector<double> size = metres(room.at("size"), 2, {2, 50});
      width = size[0];
      depth = size[1];
    }
    room.read("height", &height, {2, 10});
    room.read("floor", &floor, {"planks", "carpet", "plaster", "wood"});
    room.read("furnished", &furnished);
  }
  scene->inside = {-width / 2, -depth / 2, width / 2, depth / 2};
  const Footprint& r = scene->inside;
  Furnisher f(&scene->materials, &scene->furnishing, hash64(seed, 0xF00D));
  f.shell(r.x0, r.y0, r.x1, r.y1, height, material_named(floor));
  if (!furnished) return height;
  f.line_wall({r.x0 + 0.62, r.y0}, {1, 0}, width - 1.24, 0.45);
  f.line_wall({r.x1, r.y0 + 0.62}, {0, 1}, depth - 1.24, 0.45);
  f.line_wall({r.x1 - 0.62, r.y1}, {-1, 0}, width - 1.24, 0.45);
  f.line_wall({r.x0, r.y1 - 0.62}, {0, -1}, depth - 1.24, 0.45);
  return height;
}

void read_objects(const YamlReader& top, uint64_t seed, Scene* scene) {
  if (!top.has("objects")) return;
  Furnisher f(&scene->materials, &scene->furnishing, hash64(seed, 0x0B7E));
  for (const YamlReader& o : top.at("objects").list(1)) {
    o.check_keys({"kind", "position", "yaw", "size", "material"});
    std::string kind, material = "carton";
    o.at("kind");  // has no default
    o.read("kind", &kind, {"box", "ellipsoid", "desk", "shelf", "cabinet", "chair", "plant", "cartons"});
    const bool free = kind == "box" || kind == "ellipsoid";
    for (const char* key : {"size", "material"})
      if (!free && o.has(key)) o.at(key).fail("belongs to kind box and ellipsoid only; leave it out of kind " + kind);
    const std::vector<double> p = metres(o.at("position"), free ? 3 : 2);
    double yaw = 0;
    o.read("yaw", &yaw, {-360, 360});
    yaw *= kDegree;
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
    const std::vector<double> size = metres(o.at("size"), 3, {0.005, 1000});
    o.read("material", &material, material_names());
    const int t = scene->materials.get(material_named(material), hash64(seed, static_cast<uint64_t>(o.line() - 1)),
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

void read_path(const YamlReader& top, uint64_t seed, double height, Scene* scene) {
  std::vector<TimedPose> knots;
  for (const YamlReader& k : top.at("path").list(1)) {
    k.check_keys({"time", "position", "look_at"});
    const double time = k.at("time").number(kTimes);
    if (!knots.empty() && time <= knots.back().time) k.at("time").fail("must be later than that of the entry before");
    const std::vector<double> p = metres(k.at("position"), 3), q = metres(k.at("look_at"), 3);
    const Vector3d eye(p[0], p[1], p[2]), d = Vector3d(q[0], q[1], q[2]) - eye;
    const Footprint& in = scene->inside;
    if (eye.x() <= in.x0 || eye.x() >= in.x1 || eye.y() <= in.y0 || eye.y() >= in.y1 || eye.z() <= 0 ||
        eye.z() >= height)
      k.at("position")
          .fail(fmt::format("({:g}, {:g}, {:g}) is outside the room; x must be between {:g} and {:g}, y between "
                            "{:g} and {:g}, z between 0 and {:g}, its height",
                            eye.x(), eye.y(), eye.z(), in.x0, in.x1, in.y0, in.y1, height));
    if (std::hypot(d.x(), d.y()) < 1e-3) k.at("look_at").fail("must not be straight above or below position");
    knots.push_back({time, camera_pose(eye, std::atan2(d.y(), d.x()), std::atan2(d.z(), std::hypot(d.x(), d.y())))});
  }
  double tremor = 1;
  top.read("tremor", &tremor, {0, 10});
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

void read_movers(const YamlReader& top, double duration, const SceneRequest& request, Scene* scene) {
  if (!top.has("movers")) return;
  for (const YamlReader& m : top.at("movers").list(1)) {
    m.check_keys({"class", "waypoints"});
    std::vector<Waypoint> points;
    for (const YamlReader& w : m.at("waypoints").list(1)) {
      w.check_keys({"time", "position"});
      const std::vector<double> p = metres(w.at("position"), 2);
      points.push_back({{p[0], p[1]}, w.at("time").number(kTimes)});
      if (points.size() > 1 && points.back().time <= points[points.size() - 2].time)
        w.at("time").fail("must be later than that of the entry before");
    }
    std::string kind = "person";
    m.read("class", &kind, {"person", "chair"});
    const double later = kind == "person" ? request.stand_still : 0;
    for (Waypoint& w : points) w.time += later;
    add_mover(scene, kind, track_along(points, duration, later > 0),
              hash64(request.seed, static_cast<uint64_t>(scene->movers.size()), 3));
  }
}

}  // namespace

Scene parse_scene(const std::string& text, const std::string& name, const SceneRequest& request) {
  const YamlReader top(text, name);
  top.check_keys({"frames", "people", "exposure_ms", "tremor", "room", "path", "objects", "movers"});
  Scene scene;
  int people = 0;
  double exposure_ms = 14;
  scene.frames = 300;
  top.read("frames", &scene.frames, {1, 1000000});
  top.read("people", &people, {0, 30});
  top.read("exposure_ms", &exposure_ms, {1, 30});
  if (request.frames > 0) scene.frames = request.frames;
  if (request.people >= 0) people = request.people;
  scene.exposure = exposure_ms * 1e-3;
  const double duration = scene.frames / request.fps;
  const double height = read_room(top, request.seed, &scene);
  read_objects(top, request.seed, &scene);
  read_path(top, hash64(request.seed, 12), height, &scene);
  read_movers(top, duration, request, &scene);
  if (people > 0) add_walkers(&scene, WalkArea{}, people, duration, request);
  return scene;
}

Scene read_scene_file(const std::string& file, const SceneRequest& request) {
  return parse_scene(read_file(file), file, request);
}

}  // namespace dkb::sim

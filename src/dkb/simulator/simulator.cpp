// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/simulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/simulator/disturbances.h"
#include "dkb/simulator/noise.h"
#include "dkb/simulator/rasteriser.h"
#include "dkb/simulator/scene.h"
#include "dkb/simulator/sensor.h"
#include "dkb/util/errors.h"
#include "dkb/util/quantile.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

// Ray positions in a pixel and moments of the exposure, one each per drawing: the two do not follow each other, so that
// neither direction of motion is favoured. 1/16 px.
constexpr std::array<std::array<int, 2>, 8> kRays{
    {{1, -3}, {-1, 3}, {5, 1}, {-3, -5}, {-5, 5}, {-7, -1}, {3, 7}, {7, -7}}};
constexpr double kLensBlur = 1.7;       // rays spread over that many pixels
constexpr int kBandRows = 16;           // rows read at the same time, as far as the rolling shutter goes
constexpr double kStampSpread = 0.016;  // [s] largest difference between the stamps of colour and depth, up to 30 Hz
constexpr double kSceneRate = 30;       // [Hz] in which scenes count their frames
constexpr double kLongest = 36000;      // [s]

std::vector<sim::TimedPose> poses_of_file(const std::string& file) {
  std::vector<sim::TimedPose> poses;
  for (const StampedPose& p : read_trajectory(file))
    if (poses.empty() || p.timestamp > poses.back().time) poses.push_back({p.timestamp, p.world_from_cam});
  if (poses.size() < 2)
    throw InputError(file + ": holds " + std::to_string(poses.size()) +
                     " poses; a camera path needs at least 2 at different times");
  if (poses.back().time - poses.front().time > kLongest)
    throw InputError(fmt::format("{}: its stamps reach from {:.3f} to {:.3f} s; a camera path lasts 10 hours at most",
                                 file, poses.front().time, poses.back().time));
  return poses;
}

}  // namespace

const std::vector<std::string>& simulator_scenes() {
  static const std::vector<std::string> names{"room",  "crowd", "loop",  "spin",     "rush", "straight",
                                              "cover", "chair", "twins", "corridor", "dim",  "building"};
  return names;
}

void SimulatorOptions::check() const {
  require_option(frames >= 0 && frames <= 1000000, "--frames", frames, "0 (as many as the scene needs) ... 1000000");
  require_option(people >= -1 && people <= 30, "--people", people, "0 ... 30");
  require_option(width >= 64 && width <= 4096, "--size WIDTH", width, "64 ... 4096 px");
  require_option(height >= 64 && height <= 4096, "--size HEIGHT", height, "64 ... 4096 px");
  require_option(exposure == 0 || (exposure >= 0.001 && exposure <= 0.03), "exposure", exposure,
                 "0.001 ... 0.03 s, or 0 for the scene's own");
  require_option(rate >= 1 && rate <= 60, "--rate", rate, "1 ... 60 Hz");
  require_option(frames <= kLongest * rate, "--frames", frames, "at most 10 hours at --rate");
  require_option(dropouts >= 0 && dropouts <= 0.9, "--dropouts", dropouts, "0 ... 0.9");
  require_option(stand_still >= 0 && stand_still <= 3600, "--stand-still", stand_still, "0 ... 3600 s");
  require_option(readout >= 0 && readout <= 0.033, "readout", readout, "0 ... 0.033 s");
  require_option(std::isfinite(blackout_start) && blackout_start >= 0, "--blackout START", blackout_start,
                 "at least 0 s");
  require_option(std::isfinite(blackout_seconds) && blackout_seconds >= 0, "--blackout SECONDS", blackout_seconds,
                 "at least 0 s");
  if (odometry_drift) require_option(std::abs(*odometry_drift) <= 0.5, "--odometry", *odometry_drift, "-0.5 ... 0.5");
  require_option(grey_noise >= 0 && grey_noise <= 20, "grey_noise", grey_noise, "0 ... 20 grey levels");
}

struct Simulator::Impl {
  SimulatorOptions options;
  CameraModel camera;
  sim::Scene scene;
  double exposure = 0.014, readout = 0.018;
  std::vector<int> shots;  // numbers of the frames that are not missing; a frame's noise is that of its number
  std::optional<sim::Flicker> flicker;

  uint64_t shot(int i) const { return static_cast<uint64_t>(shots[static_cast<size_t>(i)]); }
  int64_t start_us() const { return std::llround(scene.start_stamp * 1e6); }
  int64_t colour_us(int i) const { return std::llround(shots[static_cast<size_t>(i)] * 1e6 / camera.fps); }
  int64_t depth_us(int i) const {
    const double spread = camera.fps > 30 ? 0.48 / camera.fps : kStampSpread;
    const double shift =
        (2.0 * static_cast<double>(sim::unit_float(sim::hash64(options.seed, 0xD5, shot(i)))) - 1.0) * spread;
    return colour_us(i) + std::llround(shift * 1e6);
  }

  // [s] that these rows are read after the middle row.
  double row_delay(const sim::Rasteriser::Rows& rows) const {
    return readout * ((rows.first + rows.end) / (2.0 * camera.height) - 0.5);
  }

  // Surfaces of each mover at a time. `seen`: which cells are; empty where the scene has none.
  std::vector<sim::Surfaces> movers_at(double t, const std::vector<bool>& seen) const {
    std::vector<sim::Surfaces> out;
    for (const sim::Mover& mover : scene.movers) {
      const bool hidden = !seen.empty() && !seen[sim::cell_at(scene.cells, mover.track.at(t).position)];
      out.push_back(hidden ? sim::Surfaces() : mover.surfaces(t));
    }
    return out;
  }
  static sim::DrawList with(const sim::DrawList& still, const std::vector<sim::Surfaces>& movers) {
    sim::DrawList list = still;
    for (const sim::Surfaces& s : movers) list.add(s);
    return list;
  }
  // Index of the mover that owns each id; -1 for still things.
  static std::vector<int> owners(const sim::DrawList& still, const std::vector<sim::Surfaces>& movers) {
    std::vector<int> out(still.patches.size(), -1);
    for (size_t m = 0; m < movers.size(); ++m) out.insert(out.end(), movers[m].patches.size(), static_cast<int>(m));
    out.insert(out.end(), still.quadrics.size(), -1);
    for (size_t m = 0; m < movers.size(); ++m) out.insert(out.end(), movers[m].quadrics.size(), static_cast<int>(m));
    return out;
  }
  // `bands`: the rows that were drawn at one moment each.
  void observe_movers(const sim::GeometryImage& geometry, const std::vector<int>& owner,
                      const std::vector<sim::Rasteriser::Rows>& bands, double t, SimulatedFrame* frame) const;
  // How the sensor sees the light at a time, row by row.
  sim::Exposure exposure_at(double t) const {
    sim::Exposure out;
    out.grey_noise = options.grey_noise;
    out.photon_noise = scene.photon_noise;
    if (!flicker && scene.brightness == 1) return out;
    for (int y = 0; y < camera.height; ++y) {
      const double lamps = flicker ? flicker->gain(t) * flicker->lamps(t + row_delay({y, y + 1}), exposure) : 1;
      out.row_gain.push_back(static_cast<float>(scene.brightness * lamps));
    }
    return out;
  }
};

void Simulator::Impl::observe_movers(const sim::GeometryImage& geometry, const std::vector<int>& owner,
                                     const std::vector<sim::Rasteriser::Rows>& bands, double t,
                                     SimulatedFrame* frame) const {
  struct Seen {
    int x0 = 1 << 20, y0 = 1 << 20, x1 = -1, y1 = -1;
    std::vector<float> x, y, z;
  };
  std::vector<Seen> seen(scene.movers.size());
  frame->mask = GreyImage(camera.width, camera.height);
  const auto observe_row = [&](int y, const Rigid3& world_from_cam) {
    for (int x = 0; x < camera.width; ++x) {
      const int32_t id = geometry.id(x, y);
      if (id < 0 || owner[static_cast<size_t>(id)] < 0) continue;
      frame->mask(x, y) = 255;
      Seen& s = seen[static_cast<size_t>(owner[static_cast<size_t>(id)])];
      s.x0 = std::min(s.x0, x);
      s.y0 = std::min(s.y0, y);
      s.x1 = std::max(s.x1, x);
      s.y1 = std::max(s.y1, y);
      const Eigen::Vector3d p =
          world_from_cam * camera.unproject({x, y}, 1.0 / static_cast<double>(geometry.inverse_depth(x, y)));
      s.x.push_back(static_cast<float>(p.x()));
      s.y.push_back(static_cast<float>(p.y()));
      s.z.push_back(static_cast<float>(p.z()));
    }
  };
  for (const auto& rows : bands) {
    const Rigid3 world_from_cam = scene.world_from_scene * scene.path(t + row_delay(rows));
    for (int y = rows.first; y < rows.end; ++y) observe_row(y, world_from_cam);
  }
  for (size_t m = 0; m < seen.size(); ++m) {
    Seen& s = seen[m];
    if (s.x.empty()) continue;
    SimulatedMover out;
    out.id = scene.movers[m].id;
    out.kind = scene.movers[m].kind;
    out.position_in_world = Eigen::Vector3f(upper_median(s.x), upper_median(s.y), upper_median(s.z)).cast<double>();
    const Eigen::Vector2d v = scene.movers[m].track.at(t).velocity;
    out.velocity_in_world = scene.world_from_scene.rotation * Eigen::Vector3d(v.x(), v.y(), 0);
    out.box_x = s.x0;
    out.box_y = s.y0;
    out.box_width = s.x1 - s.x0 + 1;
    out.box_height = s.y1 - s.y0 + 1;
    frame->movers.push_back(out);
  }
}

Simulator::Simulator(const SimulatorOptions& options) : impl_(std::make_unique<Impl>()) {
  options.check();
  Impl& m = *impl_;
  m.options = options;
  const double scale = options.width / 640.0;
  m.camera.fps = options.rate;
  m.camera.width = options.width;
  m.camera.height = options.height;
  m.camera.fx = m.camera.fy = 525.0 * scale;
  m.camera.cx = (options.width - 1) / 2.0;
  m.camera.cy = (options.height - 1) / 2.0;
  m.camera.depth_min = 0.4;
  m.camera.depth_max = 8.0;
  m.camera.check();
  sim::SceneRequest request;
  request.name = options.scene;
  // As many at 30 Hz as last until the last frame.
  request.frames =
      options.frames > 0 ? static_cast<int>(std::ceil((options.frames - 1) * kSceneRate / options.rate - 1e-6)) + 1 : 0;
  request.people = options.people;
  request.seed = options.seed;
  request.fps = kSceneRate;
  request.stand_still = options.stand_still;
  const bool file = options.scene.find_first_of("./") != std::string::npos;
  const auto& names = simulator_scenes();
  if (!file && std::find(names.begin(), names.end(), options.scene) == names.end()) {
    std::string list;
    for (const std::string& n : names) list += (list.empty() ? "" : ", ") + n;
    throw InputError("--scene: unknown scene \"" + options.scene + "\"" + did_you_mean(options.scene, names) +
                     "; there are " + list + ", or a YAML file");
  }
  if (!options.path.empty()) {
    if (options.scene != "room")
      throw InputError("--path: the camera follows a path only in scene room, not in " + options.scene +
                       "; leave out --scene");
    m.scene = sim::build_scene_around(poses_of_file(options.path), request);
  } else if (file) {
    m.scene = sim::read_scene_file(options.scene, request);
  } else {
    m.scene = sim::build_scene(request);
  }
  m.exposure = options.exposure > 0 ? options.exposure : m.scene.exposure;
  m.readout = std::min(options.readout, 1 / options.rate);
  const double duration = (m.scene.frames - 1) / kSceneRate;
  int count = static_cast<int>(std::floor(duration * options.rate + 1e-6)) + 1;
  if (options.frames > count)
    m.scene.notes.push_back("the path lasts " + std::to_string(count) + " frames; " + std::to_string(options.frames) +
                            " were asked for");
  if (options.frames > 0) count = std::min(count, options.frames);
  m.shots = sim::frames_left(count, options.dropouts, sim::hash64(options.seed, 0xD809));
  if (options.flicker) m.flicker.emplace(duration, sim::hash64(options.seed, 0xF11C));
  if (options.stand_still <= 0) return;
  bool anybody = false;
  for (sim::Mover& mover : m.scene.movers) {
    if (mover.kind != "person") continue;
    anybody = true;
    mover.track.add_sway(sim::hash64(options.seed, 0x5A9, static_cast<uint64_t>(mover.id)));
  }
  if (!anybody) m.scene.notes.emplace_back("--stand-still: there is nobody in the scene; --people adds some");
}

Simulator::~Simulator() = default;
Simulator::Simulator(Simulator&&) noexcept = default;
Simulator& Simulator::operator=(Simulator&&) noexcept = default;

int Simulator::frames() const {
  return static_cast<int>(impl_->shots.size());
}
const CameraModel& Simulator::camera() const {
  return impl_->camera;
}
double Simulator::exposure() const {
  return impl_->exposure;
}
std::optional<double> Simulator::odometry_drift() const {
  return impl_->options.odometry_drift;
}
const std::vector<std::string>& Simulator::notes() const {
  return impl_->scene.notes;
}
Eigen::Vector3d Simulator::up_in_world() const {
  return impl_->scene.world_from_scene.rotation * Eigen::Vector3d::UnitZ();
}

Rigid3 Simulator::world_from_cam(double seconds) const {
  return impl_->scene.world_from_scene * impl_->scene.path(seconds);
}
double Simulator::stamp(int index) const {
  return static_cast<double>(impl_->start_us() + impl_->colour_us(index)) * 1e-6;
}

bool Simulator::black(int index) const {
  const double t = static_cast<double>(impl_->colour_us(index)) * 1e-6, start = impl_->options.blackout_start;
  return t >= start && t < start + impl_->options.blackout_seconds;
}

double Simulator::nearest_mover(double seconds) const {
  double nearest = std::numeric_limits<double>::infinity();
  const Eigen::Vector3d eye = impl_->scene.path(seconds).translation;
  for (const sim::Mover& mover : impl_->scene.movers)
    nearest = std::min(nearest, (mover.track.at(seconds).position - eye.head<2>()).norm());
  return nearest;
}

SimulatedFrame Simulator::render(int index) const {
  return render(index, true);
}
SimulatedFrame Simulator::render_without_true_depth(int index) const {
  return render(index, false);
}

SimulatedFrame Simulator::render(int index, bool with_true_depth) const {
  const Impl& m = *impl_;
  SimulatedFrame frame;
  const int64_t colour_us = m.colour_us(index), depth_us = m.depth_us(index);
  frame.image.timestamp = static_cast<double>(m.start_us() + colour_us) * 1e-6;
  frame.image.depth_timestamp = static_cast<double>(m.start_us() + depth_us) * 1e-6;
  frame.stamp = fmt::format("{:.6f}", frame.image.timestamp);
  frame.depth_stamp = fmt::format("{:.6f}", frame.image.depth_timestamp);
  const double t = static_cast<double>(colour_us) * 1e-6, depth_t = static_cast<double>(depth_us) * 1e-6;
  const Rigid3 middle = m.scene.path(t);
  frame.world_from_cam = m.scene.world_from_scene * middle;

  if (black(index)) {
    frame.image.colour = ColourImage(m.camera.width, m.camera.height);
    frame.image.grey = frame.mask = GreyImage(m.camera.width, m.camera.height);
    frame.image.depth = DepthImage(m.camera.width, m.camera.height);
    if (with_true_depth) frame.true_depth = frame.image.depth;
    return frame;
  }

  // What may be seen at any moment of the frame.
  double slack = 0;
  for (const double other : {t - (m.exposure + m.readout) / 2, t + (m.exposure + m.readout) / 2, depth_t}) {
    const Rigid3 motion = m.scene.path(other).inverse() * middle;
    slack = std::max({slack, motion.translation.norm(), vector_from_rotation(motion.rotation).norm()});
  }
  sim::DrawList still;
  slack = 1.5 * slack + 0.02;
  still.add_visible(m.scene.furnishing.surfaces, m.camera, middle.inverse(), slack);
  std::vector<bool> seen;
  if (!m.scene.cells.empty()) seen = sim::visible_cells(m.scene.cells, m.camera, middle, slack);
  for (size_t i = 0; i < seen.size(); ++i)
    if (seen[i]) still.add_visible(m.scene.cells[i].furnishing.surfaces, m.camera, middle.inverse(), slack);

  std::vector<sim::Rasteriser::Rows> bands;
  const int band = m.readout > 0 ? kBandRows : m.camera.height;
  for (int y = 0; y < m.camera.height; y += band) bands.push_back({y, std::min(y + band, m.camera.height)});
  sim::Rasteriser rasteriser(m.camera);
  sim::GeometryImage geometry;
  const uint64_t seed = sim::hash64(m.options.seed, 0x5EED, m.shot(index));
  {
    const auto movers = m.movers_at(t, seen);
    const sim::DrawList list = Impl::with(still, movers);
    for (const auto& rows : bands)
      rasteriser.draw(list, m.scene.path(t + m.row_delay(rows)).inverse(), Eigen::Vector2d::Zero(), rows, &geometry);
    m.observe_movers(geometry, Impl::owners(still, movers), bands, t, &frame);
    if (with_true_depth) {
      if (m.readout > 0)  // the depth image has no rolling shutter
        rasteriser.draw(list, middle.inverse(), Eigen::Vector2d::Zero(), {0, m.camera.height}, &geometry);
      frame.true_depth = DepthImage(m.camera.width, m.camera.height);
      for (size_t i = 0; i < geometry.inverse_depth.size(); ++i) {
        const float inverse = geometry.inverse_depth.data()[i];
        frame.true_depth.data()[i] = inverse > 0 ? 1 / inverse : 0;
      }
    }
  }
  std::vector<uint64_t> sum(static_cast<size_t>(m.camera.width) * static_cast<size_t>(m.camera.height), 0);
  for (size_t k = 0; k < kRays.size(); ++k) {
    const double at = t + m.exposure * ((static_cast<double>(k) + 0.5) / kRays.size() - 0.5);
    const auto movers = m.movers_at(at, seen);
    const sim::DrawList list = Impl::with(still, movers);
    const Eigen::Vector2d offset = kLensBlur / 16.0 * Eigen::Vector2d(kRays[k][0], kRays[k][1]);
    // The mip level is dithered in an order of its own.
    const float level_shift = (static_cast<float>((k * 3) % kRays.size()) + 0.5F) / static_cast<float>(kRays.size());
    for (const auto& rows : bands) {
      rasteriser.draw(list, m.scene.path(at + m.row_delay(rows)).inverse(), offset, rows, &geometry);
      rasteriser.add_colour(list, m.scene.materials, geometry, level_shift, &sum);
    }
  }
  frame.image.colour = sim::expose(sum, m.camera.width, m.camera.height, m.exposure_at(t), sim::hash64(seed, 1));
  frame.image.grey = grey_from_colour(frame.image.colour);
  {
    const auto movers = m.movers_at(depth_t, seen);
    const sim::DrawList list = Impl::with(still, movers);
    rasteriser.draw(list, m.scene.path(depth_t).inverse(), Eigen::Vector2d::Zero(), {0, m.camera.height}, &geometry);
    if (m.options.depth_noise) {
      Image<float> grey, cosine;
      rasteriser.reflectance(list, m.scene.materials, geometry, &grey, &cosine);
      sim::DrawList glass;
      glass.add_visible(m.scene.glass, m.camera, middle.inverse(), slack);
      if (!glass.patches.empty()) {
        sim::GeometryImage panes;
        Image<float> pane_grey, pane_cosine;
        rasteriser.draw(glass, m.scene.path(depth_t).inverse(), Eigen::Vector2d::Zero(), {0, m.camera.height}, &panes);
        rasteriser.reflectance(glass, m.scene.materials, panes, &pane_grey, &pane_cosine);
        sim::look_through(panes.inverse_depth, pane_cosine, geometry.inverse_depth, &grey);
      }
      frame.image.depth = sim::sense_depth(geometry.inverse_depth, grey, cosine, m.camera, sim::hash64(seed, 2));
    } else {
      frame.image.depth = sim::round_depth(geometry.inverse_depth, m.camera);
    }
  }
  return frame;
}

}  // namespace dkb

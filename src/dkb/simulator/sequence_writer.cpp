// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/sequence_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb {
namespace {

// What the lists need of a frame once its images are written.
struct FrameRecord {
  std::string stamp, depth_stamp;
  double timestamp = 0;
  Rigid3 world_from_cam;
  std::vector<SimulatedMover> movers;
};

FrameRecord write_frame(const Simulator& simulator, int index, const std::filesystem::path& folder) {
  constexpr int kQuality = 95;
  const SimulatedFrame f = simulator.render_without_true_depth(index);
  write_image_file(folder / "rgb" / (f.stamp + ".jpg"), encode_jpeg(f.image.colour, kQuality));
  Image<uint16_t> depth(f.image.depth.width(), f.image.depth.height());
  for (size_t i = 0; i < depth.size(); ++i)
    depth.data()[i] = static_cast<uint16_t>(
        std::lround(static_cast<double>(f.image.depth.data()[i]) * simulator.camera().depth_factor));
  write_image_file(folder / "depth" / (f.depth_stamp + ".png"), encode_png(depth, 1));
  write_image_file(folder / "masks" / (f.stamp + ".png"), encode_png(f.mask, 1));
  return {f.stamp, f.depth_stamp, f.image.timestamp, f.world_from_cam, f.movers};
}

// The camera file without the key `readout`, which is not known (see SimulatorOptions).
std::string camera_file(const CameraModel& camera) {
  std::string text = camera.to_yaml();
  const size_t start = text.find("readout:");
  if (start != std::string::npos) text.erase(start, text.find('\n', start) + 1 - start);
  return text;
}

// What a robot's wheels would tell that is off by `drift` in length and turns by `drift` rad more in every metre, about
// the vertical `up` of the world. The body is the camera; it starts where the camera does.
Trajectory wheel_odometry(const std::vector<FrameRecord>& records, double drift, const Eigen::Vector3d& up) {
  Trajectory odometry;
  Rigid3 odom_from_cam = records.front().world_from_cam, world_from_before = odom_from_cam;
  for (const FrameRecord& r : records) {
    Rigid3 step = world_from_before.inverse() * r.world_from_cam;
    const Eigen::Vector3d up_in_cam = world_from_before.rotation.conjugate() * up;
    const Eigen::AngleAxisd turn(drift * step.translation.norm(), up_in_cam);
    step.translation *= 1 + drift;
    step.rotation = (Eigen::Quaterniond(turn) * step.rotation).normalized();
    odom_from_cam = odom_from_cam * step;
    world_from_before = r.world_from_cam;
    odometry.push_back({r.timestamp, r.stamp, odom_from_cam});
  }
  return odometry;
}

void write_lists(const Simulator& simulator, const std::vector<FrameRecord>& records,
                 const std::filesystem::path& folder) {
  std::string rgb = "# timestamp filename\n", depth = rgb;
  std::string pairs = "# rgb_timestamp rgb_filename depth_timestamp depth_filename\n";
  std::string boxes = "# rgb_timestamp class x y w h score\n";
  std::string movers = "timestamp,id,class,x,y,z,vx,vy,vz,position_sd,box_x,box_y,box_w,box_h\n";
  Trajectory truth;
  for (const FrameRecord& r : records) {
    rgb += fmt::format("{0} rgb/{0}.jpg\n", r.stamp);
    depth += fmt::format("{0} depth/{0}.png\n", r.depth_stamp);
    pairs += fmt::format("{0} rgb/{0}.jpg {1} depth/{1}.png\n", r.stamp, r.depth_stamp);
    truth.push_back({r.timestamp, r.stamp, r.world_from_cam});
    for (const SimulatedMover& m : r.movers) {
      boxes += fmt::format("{} {} {} {} {} {} 1\n", r.stamp, m.kind, m.box_x, m.box_y, m.box_width, m.box_height);
      const Eigen::Vector3d &p = m.position_in_world, &v = m.velocity_in_world;
      movers += fmt::format("{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},0,{},{},{},{}\n", r.stamp, m.id, m.kind,
                            p.x(), p.y(), p.z(), v.x(), v.y(), v.z(), m.box_x, m.box_y, m.box_width, m.box_height);
    }
  }
  write_file_atomically(folder / "camera.yaml", camera_file(simulator.camera()));
  write_trajectory(folder / "groundtruth.txt", truth);
  if (const auto drift = simulator.odometry_drift())
    write_file_atomically(folder / "odometry.txt",
                          fmt::format("# drift {}\n", std::abs(*drift)) +
                              trajectory_to_text(wheel_odometry(records, *drift, simulator.up_in_world())));
  write_file_atomically(folder / "boxes.txt", boxes);
  write_file_atomically(folder / "movers.csv", movers);
  write_file_atomically(folder / "rgb.txt", rgb);
  write_file_atomically(folder / "depth.txt", depth);
  write_file_atomically(folder / "associations.txt", pairs);
}

}  // namespace

void SequenceWriterOptions::check() const {
  require_option(threads >= 1 && threads <= 64, "threads", threads, "1 ... 64");
}

void write_sequence(const Simulator& simulator, const std::filesystem::path& folder,
                    const std::function<void(int)>& progress, const SequenceWriterOptions& options) {
  options.check();
  make_output_folder(folder);
  for (const char* sub : {"rgb", "depth", "masks"}) make_output_folder(folder / sub);
  std::error_code ignored;
  // Lists of an earlier sequence would make one that is not finished look whole.
  for (const char* list :
       {"associations.txt", "rgb.txt", "depth.txt", "groundtruth.txt", "boxes.txt", "movers.csv", "odometry.txt"})
    std::filesystem::remove(folder / list, ignored);

  std::vector<FrameRecord> records(static_cast<size_t>(simulator.frames()));
  std::mutex mutex;
  std::condition_variable changed;
  int next = 0, done = 0, running = options.threads;
  std::exception_ptr failure;
  const auto work = [&] {
    std::unique_lock lock(mutex);
    while (next < simulator.frames() && !failure) {
      const int index = next++;
      lock.unlock();
      FrameRecord record;
      std::exception_ptr error;
      try {
        record = write_frame(simulator, index, folder);
      } catch (...) {
        error = std::current_exception();
      }
      lock.lock();
      if (error && !failure) failure = error;
      records[static_cast<size_t>(index)] = std::move(record);
      ++done;
      changed.notify_one();
    }
    --running;
    changed.notify_one();
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < options.threads; ++i) threads.emplace_back(work);
  try {
    int reported = 0;
    std::unique_lock lock(mutex);
    for (;;) {
      changed.wait(lock, [&] { return running == 0 || done != reported; });
      if (done == reported) break;
      reported = done;
      if (!progress) continue;
      lock.unlock();
      progress(reported);
      lock.lock();
    }
  } catch (...) {
    {
      const std::unique_lock lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  }
  for (std::thread& t : threads) t.join();
  if (failure) std::rethrow_exception(failure);
  write_lists(simulator, records, folder);
}

}  // namespace dkb

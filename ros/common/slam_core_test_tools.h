// SPDX-License-Identifier: Apache-2.0
// For tests of the node without a middleware.
#pragma once

#include <arpa/inet.h>
#include <dkb_slam/slam.h>
#include <dkb_slam/source.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "ros_core.h"

namespace dkb_ros {

using namespace std::chrono_literals;

// The optical axes in those of a body that looks where the camera looks.
inline Rigid3 optical() {
  return {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0, 0, 0}};
}

// Keeps what is published; knows the transforms that a test sets.
class Recorder final : public Middleware {
 public:
  void log(LogLevel, const std::string& text) override {
    const std::lock_guard lock(mutex);
    logged.push_back(text);
    changed.notify_all();
  }
  bool wanted(Topic) override { return true; }
  int64_t now_ns() override { return 0; }
  std::optional<Rigid3> transform(const std::string& target, const std::string& source,
                                  std::optional<int64_t>) override {
    const std::lock_guard lock(mutex);
    const auto known = known_transforms.find(target + " " + source);
    return known == known_transforms.end() ? std::nullopt : std::optional(known->second);
  }
  void publish(const std::vector<TransformOutput>& t) override { keep(&transforms, t); }
  void publish(const OdometryOutput& o) override {
    if (broken) throw std::runtime_error("the context is shut down");
    keep(&odometry, o);
  }
  void publish(const PoseMessage& p) override { keep(&poses, p); }
  void publish(const PathOutput& p) override { keep(&paths, p); }
  void publish(const CloudOutput& c) override { keep(&clouds, c); }
  void publish(const MoversOutput& m) override { keep(&movers, m); }
  void publish(const ColourImageOutput& i) override { keep(&images, i); }
  void publish(const GridOutput& g) override { keep(&grids, g); }
  void publish(const DiagnosticsOutput& d) override { keep(&diagnostics, d); }

  template <class T>
  void keep(std::vector<T>* list, const T& value) {
    const std::lock_guard lock(mutex);
    list->push_back(value);
    changed.notify_all();
  }
  // Waits until `condition` holds; a machine that is never done fails.
  template <class Condition>
  bool wait(const Condition& condition) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, 100s, condition);
  }
  // For a test that failed: what people would have read.
  std::string told() {
    const std::lock_guard lock(mutex);
    std::string text = "state " + last_value("state");
    for (const std::string& line : logged) text += "; " + line;
    return text;
  }
  std::string last_value(const std::string& key) const {
    if (diagnostics.empty()) return "";
    for (const auto& [name, value] : diagnostics.back().values)
      if (name == key) return value;
    return "";
  }

  std::atomic<bool> broken = false;  // publishing odometry throws
  std::mutex mutex;
  std::condition_variable changed;
  std::map<std::string, Rigid3> known_transforms;  // "target source"
  std::vector<std::string> logged;
  std::vector<std::vector<TransformOutput>> transforms;
  std::vector<OdometryOutput> odometry;
  std::vector<PoseMessage> poses;
  std::vector<PathOutput> paths;
  std::vector<CloudOutput> clouds;
  std::vector<MoversOutput> movers;
  std::vector<ColourImageOutput> images;
  std::vector<GridOutput> grids;
  std::vector<DiagnosticsOutput> diagnostics;
};

inline ImageMessage message_of(const dkb::Frame& frame, bool depth) {
  const dkb::ImageView view = depth ? frame.depth() : frame.colour();
  ImageMessage m;
  m.stamp_ns = frame.stamp_ns();  // of both, so that a pair waits for no other image
  m.frame_id = "camera_optical";
  m.encoding = depth ? "32FC1" : "rgb8";
  m.width = view.width;
  m.height = view.height;
  m.step = view.row_bytes();
  m.data = view.row(0);
  m.size = m.step * static_cast<size_t>(m.height);
  m.owner = std::make_shared<dkb::Frame>(frame);
  return m;
}

inline void show_instead(const std::shared_ptr<std::vector<uint8_t>>& pixels, ImageMessage* image) {
  image->data = pixels->data();
  image->owner = pixels;
}

inline CameraInfoMessage info_of(const dkb::Camera& c) {
  CameraInfoMessage info;
  info.width = c.width;
  info.height = c.height;
  info.distortion_model = "plumb_bob";
  info.d = {c.k1, c.k2, c.p1, c.p2, c.k3};
  info.k = {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1};
  return info;
}

// What the buttons of the page send. Returns the answer's status line.
inline std::string order_of_a_visitor(int port, const std::string& what) {
  const std::string body = R"({"do":")" + what + R"("})";
  const std::string request =
      "POST /api/command HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" +
      body;
  const int connection = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in page{};
  page.sin_family = AF_INET;
  page.sin_port = htons(static_cast<uint16_t>(port));
  page.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  char answer[64] = {};
  if (::connect(connection, reinterpret_cast<const sockaddr*>(&page), sizeof page) == 0 &&
      ::send(connection, request.data(), request.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(request.size()))
    ::recv(connection, answer, sizeof answer - 1, MSG_WAITALL);
  ::close(connection);
  const std::string text = answer;
  return text.substr(0, text.find('\r'));
}

class SlamCoreTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    source_camera() = dkb::Camera();
    const auto source = dkb::open_folder(DKB_TEST_SEQUENCE);
    source_camera() = source->camera();
    for (dkb::SourceFrame next; (next = source->next()).state != dkb::SourceState::ended;)
      if (next.state == dkb::SourceState::frame) frames().push_back(next.frame);
  }
  static std::vector<dkb::Frame>& frames() {
    static std::vector<dkb::Frame> all;
    return all;
  }
  static dkb::Camera& source_camera() {
    static dkb::Camera camera;
    return camera;
  }

  std::unique_ptr<RosCore> start(std::map<std::string, ParameterValue> values = {}) {
    values.emplace("base_from_cam", std::vector<double>{0.1, 0, 0.4, -0.5, 0.5, -0.5, 0.5});
    return make_core(values, out);
  }
  void feed(RosCore& core, size_t i) {
    core.colour(message_of(frames().at(i), false));
    core.depth(message_of(frames().at(i), true));
  }
  // Its stamp moved by so much.
  void feed_at(RosCore& core, size_t i, int64_t offset_ns) {
    ImageMessage colour = message_of(frames().at(i), false), depth = message_of(frames().at(i), true);
    colour.stamp_ns += offset_ns;
    depth.stamp_ns += offset_ns;
    core.colour(std::move(colour));
    core.depth(std::move(depth));
  }
  // Each frame once the one before is out, so that no machine is too slow.
  void feed_all(RosCore& core, size_t from, size_t count) {
    for (size_t i = from; i < from + count; ++i) {
      const size_t before = out.odometry.size();
      feed(core, i);
      ASSERT_TRUE(out.wait([&] { return out.odometry.size() > before; })) << "frame " << i << ": " << out.told();
    }
  }
  // As it is logged; 0 where it is not.
  int port_of_the_page() {
    const std::lock_guard lock(out.mutex);
    for (const std::string& line : out.logged)
      if (line.starts_with("viewer: http://127.0.0.1:")) return std::stoi(line.substr(25));
    return 0;
  }
  static Answer answer_of(const std::function<void(RosCore::Done)>& request) {
    std::promise<Answer> promise;
    request([&](const Answer& answer) { promise.set_value(answer); });
    return promise.get_future().get();
  }

  Recorder out;
};

}  // namespace dkb_ros

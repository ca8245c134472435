// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/v4l2_device.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>
#include <utility>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/paced_source.h"
#include "dkb/devices/device_source.h"
#include "dkb/devices/v4l2_formats.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr uint32_t kBuffers = 4;

int control(int fd, unsigned long request, void* argument) {
  int result = 0;
  do result = ioctl(fd, request, argument);
  while (result < 0 && errno == EINTR);
  return result;
}

// A file descriptor that is closed.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(const std::string& path) : fd_(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {}
  ~Descriptor() { reset(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  void reset() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }
  int get() const { return fd_; }

 private:
  int fd_ = -1;
};

std::vector<uint32_t> formats_of(int fd) {
  std::vector<uint32_t> formats;
  v4l2_fmtdesc description{};
  description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; control(fd, VIDIOC_ENUM_FMT, &description) == 0; ++description.index)
    formats.push_back(description.pixelformat);
  return formats;
}

// One of the two video devices, streaming into buffers that it shares with us.
class V4l2Stream {
 public:
  enum class Kind { colour, depth };
  V4l2Stream(std::string path, Kind kind, const Camera& camera) : path_(std::move(path)), kind_(kind), camera_(camera) {
    open();
  }
  ~V4l2Stream() { close(); }
  V4l2Stream(const V4l2Stream&) = delete;
  V4l2Stream& operator=(const V4l2Stream&) = delete;

  int fd() const { return fd_.get(); }

  void open() {
    close();
    try {
      start();
    } catch (...) {
      close();  // the constructor has no destructor that would
      throw;
    }
  }

  void close() {
    for (const auto& [data, size] : buffers_) munmap(data, size);
    buffers_.clear();
    fd_.reset();
  }

  // The oldest image that has not been given out; false when there is none. ENODEV comes back as `gone`.
  bool take(DeviceImages* images, bool* gone) {
    give_back();
    v4l2_buffer buffer = empty_buffer();
    if (control(fd_.get(), VIDIOC_DQBUF, &buffer) < 0) {
      *gone = errno != EAGAIN && errno != EIO;
      return false;
    }
    held_ = buffer;
    if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 || buffer.index >= buffers_.size()) return false;
    const auto& [data, size] = buffers_[buffer.index];
    try {
      const ImageView view =
          v4l2_image(pixels_, static_cast<const uint8_t*>(data), std::min<size_t>(buffer.bytesused, size),
                     camera_.width, camera_.height, stride_, &scratch_, path_);
      const int64_t stamp = static_cast<int64_t>(buffer.timestamp.tv_sec) * 1'000'000'000 +
                            static_cast<int64_t>(buffer.timestamp.tv_usec) * 1000;
      (kind_ == Kind::depth ? images->depth : images->colour) = DeviceImage{view, stamp};
    } catch (const InputError& e) {
      images->broken = e.what();
    }
    return true;
  }

 private:
  [[noreturn]] void fail(const std::string& what, const std::string& remedy) const {
    throw InputError(path_ + ": " + what + "; " + remedy);
  }

  void start() {
    fd_ = Descriptor(path_);
    if (fd_.get() < 0) fail(std::strerror(errno), "is the camera plugged in, and are you in the group video?");
    v4l2_capability capability{};
    if (control(fd_.get(), VIDIOC_QUERYCAP, &capability) < 0 ||
        (capability.device_caps & V4L2_CAP_VIDEO_CAPTURE) == 0 || (capability.device_caps & V4L2_CAP_STREAMING) == 0)
      fail("is no video device that streams", "`v4l2-ctl --list-devices` names those that do");
    choose_format();
    share_buffers();
    auto type = static_cast<int>(V4L2_BUF_TYPE_VIDEO_CAPTURE);
    if (control(fd_.get(), VIDIOC_STREAMON, &type) < 0)
      fail(std::string("does not start (") + std::strerror(errno) + ")", "is another program using it?");
  }

  static v4l2_buffer empty_buffer() {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    return buffer;
  }

  void choose_format() {
    static constexpr std::array kColour{V4l2Pixels::rgb24, V4l2Pixels::bgr24, V4l2Pixels::yuyv, V4l2Pixels::mjpeg,
                                        V4l2Pixels::grey};
    const std::vector<uint32_t> offered = formats_of(fd_.get());
    const auto offers = [&](V4l2Pixels p) {
      return std::find(offered.begin(), offered.end(), fourcc_of(p)) != offered.end();
    };
    if (kind_ == Kind::depth) {
      pixels_ = V4l2Pixels::z16;
      if (!offers(pixels_)) fail("gives no depth (Z16)", "v4l2:COLOUR,DEPTH wants the colour device first");
    } else {
      const auto found = std::find_if(kColour.begin(), kColour.end(), offers);
      if (found == kColour.end()) fail("gives no colour as YUYV, RGB, MJPEG or grey", "name another device");
      pixels_ = *found;
    }
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    format.fmt.pix.width = static_cast<uint32_t>(camera_.width);
    format.fmt.pix.height = static_cast<uint32_t>(camera_.height);
    format.fmt.pix.pixelformat = fourcc_of(pixels_);
    format.fmt.pix.field = V4L2_FIELD_NONE;
    const bool set = control(fd_.get(), VIDIOC_S_FMT, &format) == 0;
    if (!set || format.fmt.pix.pixelformat != fourcc_of(pixels_) ||
        format.fmt.pix.width != static_cast<uint32_t>(camera_.width) ||
        format.fmt.pix.height != static_cast<uint32_t>(camera_.height))
      fail("gives no images of the camera's " + std::to_string(camera_.width) + "x" + std::to_string(camera_.height) +
               " px" + (set ? "" : std::string(" (") + std::strerror(errno) + ")"),
           "`v4l2-ctl --list-formats-ext` lists the sizes; put one that both devices give into the camera file");
    stride_ = pixels_ == V4l2Pixels::mjpeg ? 0 : format.fmt.pix.bytesperline;
  }

  void share_buffers() {
    v4l2_requestbuffers request{};
    request.count = kBuffers;
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    if (control(fd_.get(), VIDIOC_REQBUFS, &request) < 0)
      fail(std::string("gives no buffers (") + std::strerror(errno) + ")", "is another program using it?");
    for (uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer buffer = empty_buffer();
      buffer.index = i;
      if (control(fd_.get(), VIDIOC_QUERYBUF, &buffer) < 0) fail(std::strerror(errno), "plug it in again");
      void* data = mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(), buffer.m.offset);
      if (data == MAP_FAILED) fail(std::strerror(errno), "plug it in again");
      buffers_.emplace_back(data, buffer.length);
      control(fd_.get(), VIDIOC_QBUF, &buffer);
    }
    held_.reset();
  }

  void give_back() {
    if (held_) control(fd_.get(), VIDIOC_QBUF, &*held_);
    held_.reset();
  }

  const std::string path_;
  const Kind kind_;
  const Camera camera_;
  Descriptor fd_;
  V4l2Pixels pixels_ = V4l2Pixels::z16;
  size_t stride_ = 0;
  std::vector<std::pair<void*, size_t>> buffers_;
  std::optional<v4l2_buffer> held_;  // the image that was given out last is in it
  std::vector<uint8_t> scratch_;
};

class V4l2Device final : public ImageDevice {
 public:
  V4l2Device(const V4l2Place& place, const Camera& camera)
      : place_(place),
        colour_(place.colour, V4l2Stream::Kind::colour, camera),
        depth_(place.depth, V4l2Stream::Kind::depth, camera) {}

  DeviceState next(int timeout_ms, DeviceImages* images) override {
    std::array<pollfd, 2> waiting{{{colour_.fd(), POLLIN, 0}, {depth_.fd(), POLLIN, 0}}};
    const int ready = ::poll(waiting.data(), waiting.size(), timeout_ms);
    if (ready == 0 || (ready < 0 && errno == EINTR)) return DeviceState::waiting;
    bool gone = ready < 0, any = false;
    for (size_t i = 0; i < 2 && !gone; ++i) {
      if (waiting[i].revents == 0) continue;
      any |= (i == 0 ? colour_ : depth_).take(images, &gone);
      // A device that was unplugged has errors and nothing to give.
      gone |= !any && (waiting[i].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
    }
    return gone ? DeviceState::unplugged : any ? DeviceState::images : DeviceState::waiting;
  }

  bool reopen() override {
    colour_.close(), depth_.close();
    try {
      colour_.open(), depth_.open();
    } catch (const InputError&) {
      return false;
    }
    return true;
  }

  std::string description() const override { return "video devices " + place_.colour + " and " + place_.depth; }

 private:
  const V4l2Place place_;
  V4l2Stream colour_, depth_;
};

}  // namespace

V4l2Place parse_v4l2_place(const std::string& where) {
  const size_t colon = where.find(':');
  const std::string rest = colon == std::string::npos ? "" : where.substr(colon + 1);
  const size_t comma = rest.find(',');
  const auto device = [](const std::string& text) {
    const bool number = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
    return number ? "/dev/video" + text : text;
  };
  V4l2Place place;
  if (comma != std::string::npos) place = {device(rest.substr(0, comma)), device(rest.substr(comma + 1))};
  if (place.colour.empty() || place.depth.empty() || place.depth.find(',') != std::string::npos)
    throw InputError(where + ": must be v4l2:COLOUR,DEPTH, two video devices: v4l2:/dev/video4,/dev/video2");
  if (place.colour == place.depth) throw InputError(where + ": colour and depth must come from two video devices");
  return place;
}

std::unique_ptr<Source> open_v4l2_device(const std::string& where, const SourceOptions& options) {
  const V4l2Place place = parse_v4l2_place(where);
  if (options.camera.empty() && !options.fallback_camera)
    throw InputError(where + ": video devices do not tell their intrinsics; give --camera FILE");
  Camera camera = options.camera.empty() ? *options.fallback_camera : choose_camera(options.camera, {}).camera;
  if (camera.fps == 0) camera.fps = 30;
  return PacedSource::of_device(
      std::make_unique<DeviceSource>(std::make_unique<V4l2Device>(place, camera), camera, options));
}

std::vector<std::string> v4l2_pairs(std::vector<V4l2Node> nodes) {
  // By the number at the end: video10 comes after video9.
  const auto less = [](const V4l2Node& a, const V4l2Node& b) {
    return std::pair(a.path.size(), a.path) < std::pair(b.path.size(), b.path);
  };
  std::sort(nodes.begin(), nodes.end(), less);
  std::vector<std::pair<std::string, std::string>> depth;  // path, where it is plugged in
  std::map<std::string, std::string> colour, grey;         // where, path
  for (const V4l2Node& node : nodes) {
    bool gives_colour = false, gives_grey = false, gives_depth = false;
    for (const uint32_t fourcc : node.formats) {
      V4l2Pixels pixels{};
      if (!v4l2_pixels_of(fourcc, &pixels)) continue;
      (pixels == V4l2Pixels::z16 ? gives_depth : pixels == V4l2Pixels::grey ? gives_grey : gives_colour) = true;
    }
    if (gives_depth)
      depth.emplace_back(node.path, node.bus);
    else if (gives_colour)
      colour.emplace(node.bus, node.path);
    else if (gives_grey)
      grey.emplace(node.bus, node.path);
  }
  colour.merge(grey);  // where a camera has no other
  std::vector<std::string> devices;
  devices.reserve(depth.size());
  for (const auto& [path, bus] : depth)
    devices.push_back("v4l2:" + (colour.contains(bus) ? colour[bus] : "COLOUR") + "," + path);
  return devices;
}

std::vector<std::string> v4l2_devices() {
  std::vector<V4l2Node> nodes;
  std::error_code ec;
  for (std::filesystem::directory_iterator it("/dev", ec), end; !ec && it != end; it.increment(ec)) {
    if (!it->path().filename().string().starts_with("video")) continue;
    const std::string path = it->path().string();
    const Descriptor fd(path);
    v4l2_capability capability{};
    if (fd.get() < 0 || control(fd.get(), VIDIOC_QUERYCAP, &capability) < 0) continue;
    nodes.push_back({path, reinterpret_cast<const char*>(capability.bus_info), formats_of(fd.get())});
  }
  return v4l2_pairs(std::move(nodes));
}

}  // namespace dkb

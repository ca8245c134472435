// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/stream_test_tools.h"

#include <cstring>

#include "dkb/map/map_test_tools.h"
#include "dkb/viewer/map_deltas.h"

namespace dkb::test {
namespace {

template <class T>
T at(const std::string& bytes, size_t i) {
  T value;
  std::memcpy(&value, bytes.data() + i, sizeof value);
  return value;
}

}  // namespace

Map world(int keyframes, int points) {
  Map map;
  for (KeyframeId k = 0; k < keyframes; ++k) {
    Keyframe keyframe = keyframe_at(k, 0, points);
    keyframe.frame = 10 * k;
    keyframe.cam_from_world = Rigid3({Eigen::Quaterniond::Identity()}, {-1.0 * k, 0, 0});
    map.add_keyframe(keyframe);
    for (int i = 0; i < points; ++i) {
      MapPoint point;
      point.id = make_point_id(k, i);
      point.position = {k + 0.01 * i, 0, 2};
      map.add_point(point);
      map.observe(point.id, k, i);
    }
  }
  return map;
}
Map unjoined(int keyframes) {
  Map map;
  for (KeyframeId id = 0; id < keyframes; ++id) {
    Keyframe keyframe;
    keyframe.id = id;
    keyframe.features = std::make_shared<RgbdFeatures>();
    map.add_keyframe(keyframe);
  }
  return map;
}

bool StreamReader::take(const std::string& s) {
  for (size_t i = 0; i < s.size();) {
    if (i + 8 > s.size()) return false;
    const size_t end = i + 8 + at<uint32_t>(s, i);
    const auto kind = static_cast<StreamMessage>(s[i + 4]);
    if (end > s.size()) return false;
    ++counts[s[i + 4]];
    i += 8;
    if (kind == StreamMessage::hello) {
      const size_t before = hellos;
      *this = {};
      hellos = before + 1;
    }
    if (kind == StreamMessage::keyframes)
      for (size_t k = i; k < end; k += 40) {
        const int id = at<int32_t>(s, k);
        roots[id] = at<int32_t>(s, k + 4);
        if (at<uint32_t>(s, k + 8) == 1)
          keyframes.erase(id);
        else
          keyframes[id] = {at<float>(s, k + 28), at<float>(s, k + 32), at<float>(s, k + 36)};
      }
    if (kind == StreamMessage::points)
      for (size_t b = i; b < end;) {
        const auto host = at<uint32_t>(s, b), n = at<uint32_t>(s, b + 4);
        b += 8;
        for (uint32_t p = 0; p < n; ++p, b += 12) {
          const auto index = at<uint16_t>(s, b);
          if (s[b + 11] == 0)
            points.erase({host, index});
          else
            points[{host, index}] = {at<int16_t>(s, b + 2), at<int16_t>(s, b + 4), at<int16_t>(s, b + 6)};
          ++points_sent;
        }
      }
    if (kind == StreamMessage::loops) loops = (end - i) / 8;
    if (kind == StreamMessage::facts) {
      facts += (end - i) / 16;
      last_fact = at<int32_t>(s, end - 16);
    }
    if (kind == StreamMessage::path) path += (end - i) / 20;
    if (kind == StreamMessage::path_reset) path = 0;
    if (kind == StreamMessage::events) events = s.substr(i, end - i);
    if (kind == StreamMessage::frame) frame = s.substr(i, end - i);
    if (kind == StreamMessage::image) images[at<int32_t>(s, i)] = s.substr(i, end - i);
    i = end;
  }
  return true;
}

}  // namespace dkb::test

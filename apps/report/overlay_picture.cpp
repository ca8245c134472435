// SPDX-License-Identifier: Apache-2.0
#include "report/overlay_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dkb/dataset/reduced_jpeg.h"
#include "dkb/evaluation/svg_drawing.h"

namespace dkb::report {
namespace {

constexpr double kWantedWidth = 320;  // [px] wanted
constexpr int kQuality = 72;

const char* shape_of(FeatureState state) {
  switch (state) {
    case FeatureState::used:
      return "h.1";  // a dot, by round caps
    case FeatureState::outlier:
      return "m-2.5-2.5l5 5m0-5l-5 5";
    case FeatureState::dynamic:
      return "m-3 2.2h6l-3-5.2z";
    case FeatureState::unused:
      break;
  }
  return "h.1";
}

std::string mask_path(const MoverMask& mask, double scale) {
  std::string path;
  const double cell = mask.cell * scale;
  for (int y = 0; y < mask.cells.height(); ++y)
    for (int x = 0; x < mask.cells.width(); ++x) {
      if (mask.cells(x, y) == 0) continue;
      const int begin = x;
      while (x < mask.cells.width() && mask.cells(x, y) != 0) ++x;
      path += fmt::format("M{:.4g} {:.4g}h{:.4g}v{:.4g}h{:.4g}z", begin * cell, y * cell, (x - begin) * cell, cell,
                          (begin - x) * cell);
    }
  return path;
}

}  // namespace

std::string base64(const std::string& bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  const auto byte = [&](size_t i) {
    return i < bytes.size() ? static_cast<uint32_t>(static_cast<unsigned char>(bytes[i])) : 0U;
  };
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const uint32_t three = byte(i) << 16 | byte(i + 1) << 8 | byte(i + 2);
    for (size_t k = 0; k < 4; ++k) out += i + k <= bytes.size() ? kDigits[three >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

OverlayPicture take_picture(size_t row, const Frame& frame, const FrameResult& result) {
  const int full_width = frame.grey().width, full_height = frame.grey().height;
  const int factor = std::max(1, static_cast<int>(std::lround(full_width / kWantedWidth)));
  OverlayPicture picture{
      row, full_width / factor, full_height / factor, 1.0 / factor, reduced_jpeg(frame, factor, kQuality), {}, {}, {}};
  for (const FeatureReport& f : result.features)
    picture.marks.push_back({static_cast<int16_t>(std::lround(f.image_x / static_cast<float>(factor))),
                             static_cast<int16_t>(std::lround(f.image_y / static_cast<float>(factor))), f.state});
  picture.mask = result.mask;
  picture.boxes = result.detections;
  return picture;
}

std::string overlay_svg(const OverlayPicture& picture, const std::string& description) {
  std::string out = fmt::format(
      "<svg class=\"overlay\" viewBox=\"0 0 {0} {1}\" role=\"img\" aria-label=\"{2}\">\n<image width=\"{0}\" "
      "height=\"{1}\" href=\"data:image/jpeg;base64,{3}\"/>\n",
      picture.width, picture.height, svg::escaped(description), base64(picture.jpeg));
  if (const std::string path = mask_path(picture.mask, picture.scale); !path.empty())
    out += "<path class=\"mask\" d=\"" + path + "\"/>\n";
  for (const FeatureState state :
       {FeatureState::unused, FeatureState::used, FeatureState::outlier, FeatureState::dynamic}) {
    std::string path;
    for (const OverlayPicture::Mark& m : picture.marks)
      if (m.state == state) path += fmt::format("M{} {}{}", m.x, m.y, shape_of(state));
    if (!path.empty()) out += fmt::format("<path class=\"{}\" d=\"{}\"/>\n", name_of(state), path);
  }
  for (const Detection& d : picture.boxes) {
    const double x = d.box.x * picture.scale, y = d.box.y * picture.scale;
    out += fmt::format("<rect class=\"box\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>\n", x, y,
                       d.box.w * picture.scale, d.box.h * picture.scale);
    out += fmt::format("<text class=\"box\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x + 3, y + 11,
                       svg::escaped(d.class_name));
  }
  return out + "</svg>\n";
}

}  // namespace dkb::report

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "dkb/image/image.h"
#include "dkb/util/random.h"

namespace dkb {

inline GreyImage noise_image(int width, int height, uint64_t seed) {
  Random random(seed);
  GreyImage image(width, height);
  for (size_t i = 0; i < image.size(); ++i) image.data()[i] = static_cast<uint8_t>(random.below(256));
  return image;
}

// 320 x 240 pixels in blocks of random greys: corners without end.
inline GreyImage blocks_image(uint64_t seed) {
  const GreyImage cells = noise_image(40, 30, seed);
  GreyImage image(320, 240);
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) image(x, y) = cells(x / 8, y / 8);
  return image;
}

// Turn, scale and shift of a view of a plane.
struct PlaneMotion {
  double a = 1, b = 0, tx = 0, ty = 0;
  static PlaneMotion turned(double radians, double scale = 1, double tx = 0, double ty = 0) {
    return {scale * std::cos(radians), scale * std::sin(radians), tx, ty};
  }
};

// A plane covered by soft-edged squares of random place, size, turn and brightness, seen by a camera that may be moved:
// pixel (x, y) shows the plane at (a * (x - cx) - b * (y - cy) + cx + tx, b * (x - cx) + a * (y - cy) + cy + ty).
// Intensities are known everywhere, not only on a pixel grid, so images of any motion are exact up to rounding.
class SquareWorld {
 public:
  using Motion = PlaneMotion;

  SquareWorld(int width, int height, int squares, uint64_t seed) : width_(width), height_(height) {
    Random random(seed);
    for (int i = 0; i < squares; ++i) {
      const double angle = random.uniform(0, 6.3);
      squares_.push_back({random.uniform(-60, width + 60), random.uniform(-60, height + 60), std::cos(angle),
                          std::sin(angle), random.uniform(5, 22), random.uniform(20, 235)});
    }
  }

  // Where a point of the unmoved image appears in the moved one.
  void move(const Motion& m, double x, double y, double& moved_x, double& moved_y) const {
    const double dx = x - centre_x() - m.tx, dy = y - centre_y() - m.ty, d = m.a * m.a + m.b * m.b;
    moved_x = (m.a * dx + m.b * dy) / d + centre_x();
    moved_y = (-m.b * dx + m.a * dy) / d + centre_y();
  }

  GreyImage render(const Motion& m = {}, double noise = 0, uint64_t seed = 1) const {
    Image<float> values(width_, height_, 110.0F);
    const double size = std::hypot(m.a, m.b);
    for (const Square& s : squares_) {
      double cx = 0, cy = 0;
      move(m, s.x, s.y, cx, cy);
      const double half_size = (1.5 * s.half + 3) / size;
      const int x0 = std::max(0, static_cast<int>(cx - half_size)),
                x1 = std::min(width_ - 1, static_cast<int>(cx + half_size));
      const int y0 = std::max(0, static_cast<int>(cy - half_size)),
                y1 = std::min(height_ - 1, static_cast<int>(cy + half_size));
      for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x) {
          const double px = m.a * (x - centre_x()) - m.b * (y - centre_y()) + centre_x() + m.tx - s.x;
          const double py = m.b * (x - centre_x()) + m.a * (y - centre_y()) + centre_y() + m.ty - s.y;
          const double cover =
              edge(s.half - std::abs(s.c * px + s.s * py)) * edge(s.half - std::abs(s.c * py - s.s * px));
          values(x, y) += static_cast<float>(cover * (s.brightness - values(x, y)));
        }
    }
    Random random(seed);
    GreyImage image(width_, height_);
    for (size_t i = 0; i < image.size(); ++i) {
      const double value = values.data()[i] + (noise > 0 ? noise * random.normal() : 0.0);
      image.data()[i] = static_cast<uint8_t>(std::clamp(value + 0.5, 0.0, 255.0));
    }
    return image;
  }

 private:
  struct Square {
    double x, y, c, s, half, brightness;
  };
  static double edge(double distance) { return 0.5 * (1 + std::tanh(1.2 * distance)); }  // about 1.5 px wide
  double centre_x() const { return 0.5 * (width_ - 1); }
  double centre_y() const { return 0.5 * (height_ - 1); }

  int width_, height_;
  std::vector<Square> squares_;
};

}  // namespace dkb

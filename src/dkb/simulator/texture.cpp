// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/texture.h"

#include <algorithm>
#include <cmath>

#include "dkb/simulator/noise.h"

namespace dkb::sim {
namespace {

float clamp255(float v) {
  return std::clamp(v, 0.0F, 255.0F);
}

// Share of the texel [i, i + 1] that lies in [a, b].
float coverage(int i, double a, double b) {
  return static_cast<float>(std::max(0.0, std::min<double>(i + 1, b) - std::max<double>(i, a)));
}

}  // namespace

Canvas::Canvas(int width, int height, double width_m, double height_m)
    : width_(width),
      height_(height),
      width_m_(width_m),
      height_m_(height_m),
      sx_(width / width_m),
      sy_(height / height_m),
      pixels_(static_cast<size_t>(width) * static_cast<size_t>(height)) {}

void Canvas::blend(int x, int y, Colour c, float alpha) {
  Colour& p = pixel(x, y);
  p.r += alpha * (c.r - p.r);
  p.g += alpha * (c.g - p.g);
  p.b += alpha * (c.b - p.b);
}

void Canvas::fill(Colour c) {
  std::fill(pixels_.begin(), pixels_.end(), c);
}

void Canvas::rect(double x0, double y0, double x1, double y1, Colour c, float alpha) {
  x0 *= sx_;
  x1 *= sx_;
  y0 *= sy_;
  y1 *= sy_;
  const int left = std::max(0, static_cast<int>(std::floor(x0))),
            right = std::min(width_, static_cast<int>(std::ceil(x1)));
  const int top = std::max(0, static_cast<int>(std::floor(y0))),
            bottom = std::min(height_, static_cast<int>(std::ceil(y1)));
  for (int y = top; y < bottom; ++y)
    for (int x = left; x < right; ++x) blend(x, y, c, alpha * coverage(x, x0, x1) * coverage(y, y0, y1));
}

void Canvas::disc(double cx, double cy, double radius, Colour c, float alpha) {
  const int left = std::max(0, static_cast<int>((cx - radius) * sx_) - 1);
  const int right = std::min(width_ - 1, static_cast<int>((cx + radius) * sx_) + 1);
  const int top = std::max(0, static_cast<int>((cy - radius) * sy_) - 1);
  const int bottom = std::min(height_ - 1, static_cast<int>((cy + radius) * sy_) + 1);
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const double d = std::hypot((x + 0.5) / sx_ - cx, (y + 0.5) / sy_ - cy);
      const double edge = (radius - d) * std::min(sx_, sy_) + 0.5;
      if (edge > 0) blend(x, y, c, alpha * static_cast<float>(std::min(1.0, edge)));
    }
}

void Canvas::line(double x0, double y0, double x1, double y1, double thickness, Colour c) {
  const double half = thickness / 2, length2 = std::max(1e-12, (x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0));
  const int left = std::max(0, static_cast<int>((std::min(x0, x1) - half) * sx_) - 1);
  const int right = std::min(width_ - 1, static_cast<int>((std::max(x0, x1) + half) * sx_) + 1);
  const int top = std::max(0, static_cast<int>((std::min(y0, y1) - half) * sy_) - 1);
  const int bottom = std::min(height_ - 1, static_cast<int>((std::max(y0, y1) + half) * sy_) + 1);
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const double px = (x + 0.5) / sx_ - x0, py = (y + 0.5) / sy_ - y0;
      const double s = std::clamp((px * (x1 - x0) + py * (y1 - y0)) / length2, 0.0, 1.0);
      const double d = std::hypot(px - s * (x1 - x0), py - s * (y1 - y0));
      const double edge = (half - d) * std::min(sx_, sy_) + 0.5;
      if (edge > 0) blend(x, y, c, static_cast<float>(std::min(1.0, edge)));
    }
}

void Canvas::triangle(const std::array<double, 6>& p, Colour c) {
  const double area = (p[2] - p[0]) * (p[5] - p[1]) - (p[4] - p[0]) * (p[3] - p[1]);
  if (std::abs(area) < 1e-12) return;
  const int left = std::max(0, static_cast<int>(std::min({p[0], p[2], p[4]}) * sx_));
  const int right = std::min(width_ - 1, static_cast<int>(std::max({p[0], p[2], p[4]}) * sx_));
  const int top = std::max(0, static_cast<int>(std::min({p[1], p[3], p[5]}) * sy_));
  const int bottom = std::min(height_ - 1, static_cast<int>(std::max({p[1], p[3], p[5]}) * sy_));
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const double px = (x + 0.5) / sx_, py = (y + 0.5) / sy_;
      const double a = ((p[2] - px) * (p[5] - py) - (p[4] - px) * (p[3] - py)) / area;
      const double b = ((p[4] - px) * (p[1] - py) - (p[0] - px) * (p[5] - py)) / area;
      if (a >= 0 && b >= 0 && a + b <= 1) blend(x, y, c, 1);
    }
}

void Canvas::grain(double size_x, double size_y, float strength, int octaves, uint64_t seed) {
  std::vector<float> noise(static_cast<size_t>(width_));
  for (int y = 0; y < height_; ++y) {
    fractal_noise_row(static_cast<float>(1 / sx_ / size_x), static_cast<float>(y / sy_ / size_y), octaves, seed,
                      &noise);
    for (int x = 0; x < width_; ++x) {
      Colour& p = pixel(x, y);
      const float k = 1 + strength * noise[static_cast<size_t>(x)];
      p = {clamp255(p.r * k), clamp255(p.g * k), clamp255(p.b * k)};
    }
  }
}

void Canvas::stain(double size, const Ink& ink, float amount) {
  std::vector<float> noise(static_cast<size_t>(width_));
  for (int y = 0; y < height_; ++y) {
    fractal_noise_row(static_cast<float>(1 / sx_ / size), static_cast<float>(y / sy_ / size), 4, ink.seed, &noise);
    for (int x = 0; x < width_; ++x)
      blend(x, y, ink.colour, amount * std::clamp(0.5F + 1.2F * noise[static_cast<size_t>(x)], 0.0F, 1.0F));
  }
}

void Canvas::text(double x, double y, double x_end, double size, const Ink& ink) {
  const Colour c = ink.colour;
  const double cell = size * 0.5, pen = size * 0.16;
  uint64_t h = hash64(ink.seed);
  int left_in_word = 2 + static_cast<int>(h % 7);
  for (int i = 0; x + cell < x_end; ++i, x += cell * 1.25) {
    h = hash64(ink.seed, static_cast<uint64_t>(i) + 1);
    if (left_in_word-- == 0) {
      left_in_word = 1 + static_cast<int>(h % 9);
      continue;
    }
    // A letter: two or three of eight strokes in a box.
    const double l = x, r = x + cell, t = y + ((h >> 3) % 3 == 0 ? 0 : size * 0.3), b = y + size, m = (t + b) / 2;
    if (h & 1) rect(l, t, l + pen, b, c);
    if (h & 2) rect(r - pen, t, r, b, c);
    if (h & 4) rect(l, b - pen, r, b, c);
    if ((h & 24) == 0) rect(l, t, r, t + pen, c);
    if (h & 32) rect(l, m - pen / 2, r, m + pen / 2, c);
    if ((h & 7) == 0) line(l, b, r, t, pen, c);
    if ((h & 96) == 96) rect((l + r - pen) / 2, t, (l + r + pen) / 2, b, c);
  }
}

void Canvas::paragraph(double x0, double y0, double x1, double y1, double size, const Ink& ink) {
  uint64_t i = 0;
  for (double y = y0; y + size < y1; y += size * 1.7, ++i) {
    const uint64_t h = hash64(ink.seed, i);
    if (h % 11 == 0) continue;  // between paragraphs
    const double end = h % 5 == 0 ? x0 + (x1 - x0) * (0.3 + 0.5 * unit_float(h)) : x1;
    text(x0, y, end, size, {h, ink.colour});
  }
}

Texture::Texture(const Canvas& canvas) : width_(canvas.width()), height_(canvas.height()) {
  std::vector<Colour> level(static_cast<size_t>(width_) * static_cast<size_t>(height_));
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x)
      level[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)] = canvas.at(x, y);
  int w = width_, h = height_;
  while (true) {
    offsets_.push_back(texels_.size());
    for (const Colour& c : level) {
      const auto byte = [](float v) { return static_cast<uint32_t>(std::clamp(v, 14.0F, 238.0F) + 0.5F); };
      texels_.push_back(byte(c.r) | byte(c.g) << 8 | byte(c.b) << 16);
    }
    if (w == 1 && h == 1) break;
    const int w2 = std::max(1, w / 2), h2 = std::max(1, h / 2), dx = w > 1, dy = h > 1;
    std::vector<Colour> half(static_cast<size_t>(w2) * static_cast<size_t>(h2));
    for (int y = 0; y < h2; ++y)
      for (int x = 0; x < w2; ++x) {
        const auto at = [&](int i, int j) {
          return level[static_cast<size_t>(j) * static_cast<size_t>(w) + static_cast<size_t>(i)];
        };
        const int x0 = x << dx, y0 = y << dy;
        const Colour a = at(x0, y0), b = at(x0 + dx, y0), c = at(x0, y0 + dy), d = at(x0 + dx, y0 + dy);
        half[static_cast<size_t>(y) * static_cast<size_t>(w2) + static_cast<size_t>(x)] = {
            (a.r + b.r + c.r + d.r) / 4, (a.g + b.g + c.g + d.g) / 4, (a.b + b.b + c.b + d.b) / 4};
      }
    level = std::move(half);
    w = w2;
    h = h2;
  }
}

}  // namespace dkb::sim

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace dkb::sim {

struct Colour {
  float r = 128, g = 128, b = 128;  // display values, 0 ... 255
};

// What a stain or text is painted with; the seed tells its shape.
struct Ink {
  uint64_t seed = 0;
  Colour colour;
};

// What procedural textures are painted on: floats, later packed into a Texture. Coordinates of the drawing functions
// are metres of the painted surface, x right, y down, so that a drawing looks alike at any resolution.
class Canvas {
 public:
  // Sides in texels are powers of two.
  Canvas(int width, int height, double width_m, double height_m);

  void fill(Colour c);
  void rect(double x0, double y0, double x1, double y1, Colour c, float alpha = 1);
  void disc(double x, double y, double radius, Colour c, float alpha = 1);
  void line(double x0, double y0, double x1, double y1, double thickness, Colour c);
  void triangle(const std::array<double, 6>& xy, Colour c);
  // Multiplies brightness by 1 + strength * noise; `size_x`, `size_y` [m] are the largest features.
  void grain(double size_x, double size_y, float strength, int octaves, uint64_t seed);
  // Adds a noise that mixes in the ink.
  void stain(double size, const Ink& ink, float amount);
  // A line of letter-like shapes of height `size` from (x, y), ending before `x_end`.
  void text(double x, double y, double x_end, double size, const Ink& ink);
  // Lines of text filling a box.
  void paragraph(double x0, double y0, double x1, double y1, double size, const Ink& ink);

  int width() const { return width_; }
  int height() const { return height_; }
  double width_m() const { return width_m_; }
  double height_m() const { return height_m_; }
  const Colour& at(int x, int y) const {
    return pixels_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  }

 private:
  Colour& pixel(int x, int y) {
    return pixels_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  }
  void blend(int x, int y, Colour c, float alpha);

  int width_, height_;
  double width_m_, height_m_;
  double sx_, sy_;  // [texels per metre]
  std::vector<Colour> pixels_;
};

// A picture with its mip levels, 8 bits per channel.
class Texture {
 public:
  explicit Texture(const Canvas& canvas);

  int width() const { return width_; }
  int height() const { return height_; }
  int levels() const { return static_cast<int>(offsets_.size()); }
  // Texels of one level, row by row: red in the lowest byte, then green, then blue.
  struct Level {
    const uint32_t* texels;
    int width, height;
  };
  Level level(int number) const {
    return {texels_.data() + offsets_[static_cast<size_t>(number)], std::max(1, width_ >> number),
            std::max(1, height_ >> number)};
  }

  // Bilinear value at (u, v) in [0, 1]^2 (clamped) of one level, as four 16-bit lanes r, b, g, 0 of 8.8 fixed point.
  uint64_t sample(float u, float v, int level) const {
    const int w = width_ >> level > 0 ? width_ >> level : 1, h = height_ >> level > 0 ? height_ >> level : 1;
    const uint32_t* base = texels_.data() + offsets_[static_cast<size_t>(level)];
    float x = u * static_cast<float>(w) - 0.5F, y = v * static_cast<float>(h) - 0.5F;
    x = x > 0 ? x : 0;
    y = y > 0 ? y : 0;
    int xf = static_cast<int>(x * 256.0F), yf = static_cast<int>(y * 256.0F);
    const int x_max = (w - 1) << 8, y_max = (h - 1) << 8;
    xf = xf < x_max ? xf : x_max;
    yf = yf < y_max ? yf : y_max;
    const int x0 = xf >> 8, y0 = yf >> 8;
    const int x1 = x0 + (x0 < w - 1), y1 = y0 + (y0 < h - 1);
    const uint32_t* row0 = base + static_cast<size_t>(y0) * static_cast<size_t>(w);
    const uint32_t* row1 = base + static_cast<size_t>(y1) * static_cast<size_t>(w);
    const auto a = static_cast<uint64_t>(xf & 255), b = static_cast<uint64_t>(yf & 255);
    const uint64_t top = lanes(row0[x0]) * (256 - a) + lanes(row0[x1]) * a;
    const uint64_t bottom = lanes(row1[x0]) * (256 - a) + lanes(row1[x1]) * a;
    return ((top >> 8) & 0x00FF00FF00FF00FFULL) * (256 - b) + ((bottom >> 8) & 0x00FF00FF00FF00FFULL) * b;
  }

 private:
  static uint64_t lanes(uint32_t c) { return (c & 0x00FF00FFU) | (static_cast<uint64_t>(c & 0xFF00FF00U) << 24); }
  int width_, height_;
  std::vector<size_t> offsets_;
  std::vector<uint32_t> texels_;
};

}  // namespace dkb::sim

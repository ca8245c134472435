// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/materials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dkb/simulator/noise.h"
#include "dkb/util/random.h"

namespace dkb::sim {
namespace {

Colour vivid(Random& random) {
  const double hue = random.uniform(0, 6), strength = random.uniform(0.35, 0.85), light = random.uniform(70, 215);
  const auto channel = [&](double shift) {
    const double k = std::fmod(hue + shift, 6.0), f = std::clamp(std::abs(k - 3.0) - 1.0, 0.0, 1.0);
    return static_cast<float>(light * (1 - strength + strength * f));
  };
  return {channel(0), channel(4), channel(2)};
}
Colour pale(Random& random) {
  const double v = random.uniform(180, 228);
  return {static_cast<float>(v + random.uniform(-12, 8)), static_cast<float>(v + random.uniform(-10, 6)),
          static_cast<float>(v + random.uniform(-18, 6))};
}
Colour dark(Random& random) {
  const double v = random.uniform(22, 60);
  return {static_cast<float>(v + random.uniform(0, 15)), static_cast<float>(v + random.uniform(0, 12)),
          static_cast<float>(v + random.uniform(0, 22))};
}
// Here and below what is drawn at random is drawn in a stated order: C++ states none for a function's arguments.
Ink ink(Colour (*kind)(Random&), Random& random) {
  return {random.next(), kind(random)};
}

void shapes(Canvas& c, double x0, double y0, double x1, double y1, int count, Random& random) {
  const double size = std::min(x1 - x0, y1 - y0);
  for (int i = 0; i < count; ++i) {
    const double x = random.uniform(x0, x1), y = random.uniform(y0, y1), s = size * random.uniform(0.03, 0.22);
    const Colour colour = random.below(5) == 0 ? dark(random) : vivid(random);
    switch (random.below(4)) {
      case 0:
        c.disc(x, y, s / 2, colour);
        break;
      case 1:
        c.rect(std::max(x0, x - s / 2), std::max(y0, y - s / 3), std::min(x1, x + s / 2), std::min(y1, y + s / 3),
               colour);
        break;
      case 2: {
        const double a = random.uniform(0, 6.28);
        c.triangle({x + s * std::cos(a), y + s * std::sin(a), x + s * std::cos(a + 2.2), y + s * std::sin(a + 2.2),
                    x + s * std::cos(a + 4.0), y + s * std::sin(a + 4.0)},
                   colour);
        break;
      }
      default: {
        const double y_end = random.uniform(y0, y1), x_end = random.uniform(x0, x1);
        c.line(x, y, x_end, y_end, size * 0.012, colour);
      }
    }
  }
}

void border(Canvas& c, double thickness, const Colour& colour) {
  const double w = c.width_m(), h = c.height_m();
  c.rect(0, 0, w, thickness, colour);
  c.rect(0, h - thickness, w, h, colour);
  c.rect(0, 0, thickness, h, colour);
  c.rect(w - thickness, 0, w, h, colour);
}

void paint_planks(Canvas& c, Random& random) {
  const double plank = 0.12;
  int row = 0;
  for (double y = 0; y < c.height_m(); y += plank, ++row)
    for (double x = -random.uniform(0, 1.2); x < c.width_m();) {
      const double length = random.uniform(0.5, 1.3), tone = random.uniform(0.72, 1.15);
      const Colour colour{static_cast<float>(132 * tone), static_cast<float>(92 * tone), static_cast<float>(60 * tone)};
      c.rect(x, y, x + length, y + plank, colour);
      for (int k = 0; k < 3; ++k) {
        const double gy = y + random.uniform(0.01, plank - 0.01), gx = x + random.uniform(0, length * 0.6);
        const double down = random.uniform(-0.006, 0.006), across = random.uniform(0.1, 0.5);
        c.line(gx, gy, std::min(x + length, gx + across), gy + down, 0.004,
               {colour.r * 0.7F, colour.g * 0.68F, colour.b * 0.66F});
      }
      if (random.below(3) == 0) {
        const double size = random.uniform(0.006, 0.014), down = random.uniform(0.02, 0.1);
        c.disc(x + random.uniform(0.05, length), y + down, size, {60, 38, 24}, 0.8F);
      }
      c.rect(x, y, x + 0.004, y + plank, {48, 32, 22});
      x += length;
    }
  for (double y = 0; y < c.height_m(); y += plank) c.rect(0, y, c.width_m(), y + 0.004, {48, 32, 22});
  c.grain(0.35, 0.012, 0.30F, 3, random.next());
}

void paint_wood(Canvas& c, Random& random) {
  const double tone = random.uniform(0.85, 1.1);
  c.fill({static_cast<float>(205 * tone), static_cast<float>(188 * tone), static_cast<float>(160 * tone)});
  c.grain(0.5, 0.02, 0.16F, 4, random.next());
  c.grain(0.05, 0.003, 0.06F, 2, random.next());
  for (int i = 0; i < 10; ++i) {
    const double x = random.uniform(0, c.width_m()), y = random.uniform(0, c.height_m());
    c.disc(x, y, random.uniform(0.002, 0.006), {90, 74, 58}, 0.6F);
  }
}

void paint_poster(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m(), m = 0.06 * w;
  c.fill(random.below(3) == 0 ? vivid(random) : pale(random));
  const Colour black = dark(random), bar = vivid(random);
  c.rect(0, 0, w, h * 0.16, bar);
  c.text(m, h * 0.035, w - m, h * 0.07, ink(pale, random));
  const double split = random.uniform(0.35, 0.65), top = h * 0.2, middle = h * random.uniform(0.5, 0.65);
  c.rect(m, top, w - m, middle, vivid(random));
  shapes(c, m, top, w - m, middle, 26, random);
  const double size = std::max(0.008, h * 0.018);
  c.paragraph(m, middle + m * 0.6, w * split - m * 0.3, h - m, size, {random.next(), black});
  if (random.below(2) == 0) {
    c.paragraph(w * split + m * 0.3, middle + m * 0.6, w - m, h - m, size, {random.next(), black});
  } else {
    c.rect(w * split + m * 0.3, middle + m * 0.6, w - m, h - m, pale(random));
    shapes(c, w * split + m * 0.3, middle + m * 0.6, w - m, h - m, 14, random);
  }
  c.grain(0.25, 0.25, 0.05F, 3, random.next());
}

void paint_picture(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  const Colour sky = vivid(random);
  c.fill(sky);
  c.stain(w * 0.5, ink(vivid, random), 0.9F);
  c.stain(w * 0.15, ink(vivid, random), 0.7F);
  shapes(c, 0, h * 0.3, w, h, 34, random);
  c.stain(w * 0.05, ink(dark, random), 0.35F);
  border(c, 0.035 * std::min(w, h) + 0.008, dark(random));
}

void paint_page(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m(), m = 0.1 * w;
  c.fill({226, 226, 220});
  const Colour black = dark(random);
  c.text(m, m, w - m, h * 0.035, {random.next(), black});
  if (random.below(2) == 0) {
    const double y = h * random.uniform(0.2, 0.55), y1 = y + h * 0.25;
    c.paragraph(m, m + h * 0.07, w - m, y - 0.01, h * 0.013, {random.next(), black});
    c.rect(m, y, w - m, y1, pale(random));
    shapes(c, m, y, w - m, y1, 14, random);
    c.paragraph(m, y1 + 0.01, w - m, h - m, h * 0.013, {random.next(), black});
  } else {
    c.paragraph(m, m + h * 0.07, w - m, h - m, h * 0.013, {random.next(), black});
  }
}

void paint_cover(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  c.fill(vivid(random));
  c.rect(0, h * 0.08, w, h * 0.3, random.below(2) == 0 ? dark(random) : pale(random));
  c.text(w * 0.08, h * 0.11, w * 0.92, h * 0.06, ink(vivid, random));
  c.text(w * 0.08, h * 0.2, w * 0.7, h * 0.045, ink(vivid, random));
  c.rect(w * 0.1, h * 0.38, w * 0.9, h * 0.85, pale(random));
  shapes(c, w * 0.1, h * 0.38, w * 0.9, h * 0.85, 22, random);
  c.text(w * 0.2, h * 0.9, w * 0.8, h * 0.04, ink(pale, random));
}

void paint_spine(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  c.fill(random.below(4) == 0 ? pale(random) : random.below(4) == 0 ? dark(random) : vivid(random));
  const Colour ink = random.below(2) == 0 ? pale(random) : vivid(random);
  for (int i = 0; i < 2; ++i) {
    const double y = h * random.uniform(0.03, 0.9);
    const Colour colour = vivid(random);
    c.rect(0, y, w, y + h * random.uniform(0.015, 0.08), colour);
  }
  // The title runs down the spine: bars of the length of words.
  for (double y = h * random.uniform(0.12, 0.25); y < h * 0.75; y += h * 0.05) {
    if (random.below(4) == 0) continue;
    c.rect(w * 0.25, y, w * random.uniform(0.5, 0.8), y + h * 0.028, ink);
  }
  c.grain(0.02, 0.05, 0.12F, 2, random.next());
}

void paint_carton(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  c.fill(random.below(2) == 0 ? Colour{186, 146, 100} : pale(random));
  c.grain(0.04, 0.01, 0.10F, 3, random.next());
  c.rect(w * 0.44, 0, w * 0.56, h, {204, 178, 138}, 0.7F);
  const double x = w * random.uniform(0.05, 0.3), y = h * random.uniform(0.1, 0.4), x1 = x + w * 0.55,
               y1 = y + h * 0.45;
  c.rect(x, y, x1, y1, pale(random));
  c.text(x + w * 0.03, y + h * 0.04, x1 - w * 0.02, h * 0.1, ink(dark, random));
  c.paragraph(x + w * 0.03, y + h * 0.18, x1 - w * 0.02, y1, h * 0.045, ink(dark, random));
  shapes(c, w * 0.6, h * 0.55, w * 0.96, h * 0.95, 6, random);
}

void paint_keyboard(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m(), px = w / 19.5, py = h / 6.8;
  const bool black = random.below(2) == 0;
  c.fill(black ? Colour{44, 44, 48} : Colour{196, 194, 186});
  for (int row = 0; row < 6; ++row)
    for (int col = 0; col < 19; ++col) {
      if (col == 14 || (row == 0 && col % 5 == 1)) continue;
      const double x = (col + 0.35) * px, y = (row + 0.45) * py;
      c.rect(x, y, x + px * 0.86, y + py * 0.86, black ? Colour{66, 66, 72} : Colour{150, 148, 142});
      c.rect(x + px * 0.06, y + py * 0.04, x + px * 0.78, y + py * 0.72,
             black ? Colour{30, 30, 34} : Colour{214, 212, 204});
      c.text(x + px * 0.2, y + py * 0.16, x + px * 0.62, py * 0.34,
             Ink{random.next(), black ? Colour{210, 210, 210} : Colour{50, 50, 50}});
    }
}

void paint_screen(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  c.fill({20, 20, 24});
  if (random.below(3) != 0) {  // switched on
    c.rect(0.015, 0.015, w - 0.015, h - 0.015, vivid(random));
    for (int i = 0; i < 3; ++i) {
      const double x = random.uniform(0.02, w * 0.45), y = random.uniform(0.02, h * 0.4), x1 = x + w * 0.5,
                   y1 = y + h * 0.5;
      c.rect(x, y, x1, y1, i == 1 ? Colour{36, 38, 46} : pale(random));
      c.rect(x, y, x1, y + h * 0.05, vivid(random));
      c.paragraph(x + 0.01, y + h * 0.07, x1 - 0.01, y1 - 0.005, 0.007, ink(i == 1 ? vivid : dark, random));
    }
  }
  border(c, 0.015, {24, 24, 27});
  c.text(w * 0.46, h - 0.012, w * 0.55, 0.008, {random.next(), {180, 180, 185}});
}

void paint_fabric(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  const Colour base = random.below(3) == 0 ? pale(random) : vivid(random), other = vivid(random);
  c.fill(base);
  switch (random.below(3)) {
    case 0:  // plaid
      for (double x = 0; x < w; x += 0.07) c.rect(x, 0, x + 0.025, h, other, 0.55F);
      for (double y = 0; y < h; y += 0.07) c.rect(0, y, w, y + 0.025, other, 0.55F);
      break;
    case 1:  // hoops
      for (double y = 0; y < h; y += 0.06) c.rect(0, y, w, y + 0.025, other);
      break;
    default:;
  }
  // A print on the chest, which is at u = 0.5.
  shapes(c, w * 0.38, h * 0.2, w * 0.62, h * 0.55, 14, random);
  c.text(w * 0.38, h * 0.6, w * 0.62, h * 0.07, ink(dark, random));
  c.text(w * 0.88, h * 0.25, w, h * 0.08, ink(pale, random));
  c.grain(0.16, 0.3, 0.35F, 4, random.next());  // folds
  c.grain(0.01, 0.01, 0.12F, 2, random.next());
}

void paint_skin(Canvas& c, Random& random) {
  const double tone = random.uniform(0.75, 1.1);
  c.fill({static_cast<float>(200 * tone), static_cast<float>(152 * tone), static_cast<float>(124 * tone)});
  c.grain(0.05, 0.05, 0.16F, 3, random.next());
}

void paint_face(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  paint_skin(c, random);
  // u = 0.5 looks ahead; v runs from crown to chin.
  for (const double side : {-1.0, 1.0}) {
    const double x = w * (0.5 + side * 0.075);
    c.disc(x, h * 0.47, 0.013, {225, 222, 216});
    c.disc(x, h * 0.47, 0.007, {40, 30, 28});
    c.rect(x - 0.016, h * 0.40, x + 0.016, h * 0.42, {60, 40, 30});
  }
  c.rect(w * 0.485, h * 0.5, w * 0.515, h * 0.62, {150, 100, 84}, 0.6F);
  c.rect(w * 0.44, h * 0.7, w * 0.56, h * 0.74, {150, 70, 66});
}

void paint_whiteboard(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  c.fill({222, 224, 224});
  c.grain(0.4, 0.4, 0.04F, 3, random.next());
  for (int block = 0; block < 7; ++block) {
    const double x = w * random.uniform(0.04, 0.65), y = h * random.uniform(0.06, 0.7);
    const std::array<Colour, 4> pens{Colour{30, 30, 34}, Colour{30, 40, 140}, Colour{170, 30, 30}, Colour{20, 110, 50}};
    const Colour pen = pens[random.below(4)];
    if (block % 2 == 0) {
      c.paragraph(x, y, x + w * 0.28, y + h * 0.25, 0.03, {random.next(), pen});
    } else {
      double px = x, py = y;
      for (int k = 0; k < 7; ++k) {
        const double qx = x + w * random.uniform(0, 0.25), qy = y + h * random.uniform(0, 0.25);
        c.line(px, py, qx, qy, 0.008, pen);
        px = qx;
        py = qy;
      }
    }
  }
  border(c, 0.03, {110, 112, 116});
}

void paint_door(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  const Colour base = random.below(2) == 0 ? Colour{150, 108, 74} : pale(random);
  c.fill(base);
  c.grain(0.05, 0.6, 0.16F, 4, random.next());
  for (const double y : {0.1, 0.55})
    for (int k = 0; k < 2; ++k) {
      const double x = w * (0.12 + 0.41 * k), x1 = x + w * 0.35, y0 = h * y, y1 = y0 + h * 0.35;
      c.rect(x, y0, x1, y1, {base.r * 0.8F, base.g * 0.8F, base.b * 0.8F});
      c.rect(x + 0.02, y0 + 0.02, x1 - 0.02, y1 - 0.02, base);
    }
  c.disc(w * 0.92, h * 0.5, 0.03, {190, 180, 140});
  c.disc(w * 0.92, h * 0.54, 0.012, {30, 28, 26});
  c.rect(w * 0.35, h * 0.47, w * 0.65, h * 0.53, pale(random));
  c.text(w * 0.38, h * 0.485, w * 0.64, h * 0.022, ink(dark, random));
}

void paint_drawers(Canvas& c, Random& random) {
  const double w = c.width_m(), h = c.height_m();
  const Colour base = pale(random);
  c.fill(base);
  const int rows = std::max(2, static_cast<int>(h / 0.28));
  for (int i = 0; i < rows; ++i) {
    const double y = h * i / rows, y1 = h * (i + 1) / rows;
    c.rect(0, y, w, y + 0.008, {70, 70, 72});
    c.rect(w * 0.38, y + (y1 - y) * 0.2, w * 0.62, y + (y1 - y) * 0.2 + 0.015, {66, 66, 70});
    c.rect(w * 0.36, y + (y1 - y) * 0.45, w * 0.64, y + (y1 - y) * 0.75, {224, 224, 214});
    c.text(w * 0.38, y + (y1 - y) * 0.52, w * 0.62, (y1 - y) * 0.13, ink(dark, random));
  }
  for (int i = 0; i < 5; ++i) {
    const double y = h * random.uniform(0, 0.8), x = w * random.uniform(0, 0.7);
    shapes(c, x, y, w * 0.98, h * 0.98, 1, random);
  }
  c.grain(0.3, 0.3, 0.06F, 4, random.next());
}

void paint_plain(Canvas& c, Material material, Random& random) {
  switch (material) {
    case Material::plaster:
      c.fill(pale(random));
      c.grain(1.2, 1.2, 0.10F, 3, random.next());
      c.grain(0.12, 0.12, 0.07F, 4, random.next());
      for (int i = 0; i < static_cast<int>(c.width_m() * c.height_m() * 3); ++i) {
        const double size = random.uniform(0.004, 0.012), y = random.uniform(0, c.height_m());
        c.disc(random.uniform(0, c.width_m()), y, size, {120, 116, 108}, 0.5F);
      }
      break;
    case Material::carpet:
      c.fill(vivid(random));
      c.stain(0.6, ink(dark, random), 0.4F);
      for (int i = 0; i < 80; ++i) shapes(c, 0, 0, c.width_m(), c.height_m(), 1, random);
      c.grain(0.03, 0.03, 0.35F, 3, random.next());
      break;
    case Material::paint:
      c.fill(pale(random));
      c.grain(2.5, 2.5, 0.04F, 1, random.next());
      break;
    case Material::linoleum: {
      const auto v = static_cast<float>(random.uniform(150, 172));
      c.fill({v, v + 4, v + 1});
      c.grain(1.5, 1.5, 0.05F, 2, random.next());
      break;
    }
    case Material::lacquer: {
      const auto v = static_cast<float>(random.uniform(120, 190));
      c.fill({v, v * 0.94F, v * 0.84F});
      c.grain(0.8, 0.8, 0.04F, 1, random.next());
      break;
    }
    case Material::denim:
      c.fill(dark(random));
      c.stain(0.2, ink(vivid, random), 0.5F);
      c.grain(0.1, 0.25, 0.35F, 4, random.next());
      break;
    case Material::hair:
      c.fill(dark(random));
      c.grain(0.01, 0.1, 0.4F, 3, random.next());
      break;
    case Material::metal:
      c.fill({130, 132, 138});
      c.grain(0.02, 0.2, 0.15F, 3, random.next());
      break;
    case Material::rubber:
      c.fill({26, 26, 30});
      c.grain(0.02, 0.02, 0.3F, 3, random.next());
      break;
    case Material::leaves:
      c.fill({58, 110, 52});
      c.stain(0.06, {random.next(), {120, 160, 70}}, 0.8F);
      c.grain(0.02, 0.02, 0.3F, 3, random.next());
      break;
    default:
      c.fill(vivid(random));
      c.grain(0.1, 0.1, 0.15F, 3, random.next());
      shapes(c, c.width_m() * 0.1, c.height_m() * 0.2, c.width_m() * 0.9, c.height_m() * 0.8, 5, random);
  }
}

void paint(Canvas& c, Material material, Random& random) {
  constexpr std::pair<Material, void (*)(Canvas&, Random&)> kPainters[] = {
      {Material::planks, paint_planks},     {Material::wood, paint_wood},
      {Material::poster, paint_poster},     {Material::picture, paint_picture},
      {Material::page, paint_page},         {Material::cover, paint_cover},
      {Material::spine, paint_spine},       {Material::carton, paint_carton},
      {Material::keyboard, paint_keyboard}, {Material::screen, paint_screen},
      {Material::fabric, paint_fabric},     {Material::skin, paint_skin},
      {Material::face, paint_face},         {Material::whiteboard, paint_whiteboard},
      {Material::door, paint_door},         {Material::drawers, paint_drawers}};
  for (const auto& [painted, painter] : kPainters)
    if (painted == material) return painter(c, random);
  paint_plain(c, material, random);
}

// [texels per metre]: a little finer than the camera resolves from where such things are usually seen.
double density(Material material) {
  switch (material) {
    case Material::paint:
    case Material::linoleum:
    case Material::lacquer:
      return 40;
    case Material::plaster:
      return 180;
    case Material::planks:
    case Material::carpet:
      return 350;
    case Material::page:
    case Material::cover:
    case Material::keyboard:
    case Material::spine:
      return 1300;
    case Material::denim:
    case Material::hair:
    case Material::metal:
    case Material::rubber:
      return 300;
    default:
      return 750;
  }
}

int texels(double metres, double per_metre) {
  int n = 16;
  while (n < metres * per_metre && n < 2048) n *= 2;
  // The nearer power of two, in the logarithm.
  return n > 16 && n * 0.7 > metres * per_metre ? n / 2 : n;
}

}  // namespace

const std::vector<std::string>& material_names() {
  static const std::vector<std::string> names{
      "plaster", "planks",   "carpet", "wood",       "poster",  "picture", "page",  "cover",    "spine",
      "carton",  "keyboard", "screen", "fabric",     "denim",   "skin",    "face",  "hair",     "metal",
      "plastic", "rubber",   "door",   "whiteboard", "drawers", "leaves",  "paint", "linoleum", "lacquer"};
  return names;
}

int Materials::get(Material material, uint64_t seed, double width_m, double height_m) {
  const auto key = std::make_tuple(static_cast<int>(material), seed, static_cast<int>(std::lround(width_m * 50)),
                                   static_cast<int>(std::lround(height_m * 50)));
  const auto found = known_.find(key);
  if (found != known_.end()) return found->second;
  Entry& entry = entries_.emplace_back();
  entry.material = material;
  entry.seed = seed;
  entry.width_m = width_m;
  entry.height_m = height_m;
  const int index = static_cast<int>(entries_.size()) - 1;
  known_.emplace(key, index);
  return index;
}

const Texture& Materials::texture(int index) const {
  const Entry& entry = entries_[static_cast<size_t>(index)];
  std::call_once(entry.painted, [&entry] {
    const double d = density(entry.material);
    Canvas canvas(texels(entry.width_m, d), texels(entry.height_m, d), entry.width_m, entry.height_m);
    Random random(hash64(entry.seed, static_cast<uint64_t>(entry.material)));
    paint(canvas, entry.material, random);
    entry.texture = std::make_unique<const Texture>(canvas);
  });
  return *entry.texture;
}

}  // namespace dkb::sim

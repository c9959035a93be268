// SPDX-License-Identifier: Apache-2.0
// Procedural textures of the built-in scenes: linear light R, G, B as a function of (u, v), from
// geometric patterns and octaves of periodic value noise. The noise hashes lattice cells (middle
// step of Wellons' lowbias32), so textures need no files and no state. Cost: about 4 hashes per
// octave and texel.
#include "simulate/procedural_textures.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace raystage::simulate {
namespace {

using Eigen::Vector3f;

// Returns a smooth step from 0 at `from` to 1 at `to`.
float smooth(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return t * t * (3 - 2 * t);
}

Vector3f mix(const Vector3f& a, const Vector3f& b, float t) { return a + (b - a) * t; }

// Returns a random number in [0, 1) for a lattice cell.
float cell_value(int x, int y, unsigned salt) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9E3779B1U +
                    static_cast<std::uint32_t>(y) * 0x85EBCA77U + salt * 0xC2B2AE3DU;
  h = (h ^ (h >> 15U)) * 0x2C1B3C6DU;  // the middle of lowbias32 (C. Wellons)
  h = (h ^ (h >> 12U)) * 0x297A2D39U;
  return static_cast<float>((h ^ (h >> 15U)) >> 8U) * 0x1p-24F;
}

// Replaces std::floor, which is a function call on baseline x86-64 and dominates the time.
int floor_index(float x) {
  const int truncated = static_cast<int>(x);
  return truncated - (x < static_cast<float>(truncated) ? 1 : 0);
}

float fraction(float x) { return x - static_cast<float>(floor_index(x)); }

// Returns value noise in [0, 1], periodic after `period_x` x `period_y` lattice cells.
float noise(float x, float y, int period_x, int period_y, unsigned salt) {
  const int left = floor_index(x), top = floor_index(y);
  const auto wrap = [](int i, int period) {
    if (static_cast<unsigned>(i) < static_cast<unsigned>(period)) return i;
    return ((i % period) + period) % period;
  };
  const int x0 = wrap(left, period_x), y0 = wrap(top, period_y);
  const int x1 = x0 + 1 == period_x ? 0 : x0 + 1, y1 = y0 + 1 == period_y ? 0 : y0 + 1;
  const float fx = x - static_cast<float>(left), fy = y - static_cast<float>(top);
  const float tx = fx * fx * (3 - 2 * fx), ty = fy * fy * (3 - 2 * fy);
  const float a = cell_value(x0, y0, salt), b = cell_value(x1, y0, salt);
  const float c = cell_value(x0, y1, salt), d = cell_value(x1, y1, salt);
  const float upper = a + (b - a) * tx, lower = c + (d - c) * tx;
  return upper + (lower - upper) * ty;
}

// Sums octaves of noise in [0, 1]; the coarsest has `cells_x` x `cells_y` cells in all.
float octaves(float u, float v, int cells_x, int cells_y, int count, unsigned salt) {
  float sum = 0, weight = 0.5F, total = 0;
  for (int i = 0; i < count; ++i) {
    sum += weight * noise(u * static_cast<float>(cells_x), v * static_cast<float>(cells_y), cells_x,
                          cells_y, salt + static_cast<unsigned>(i));
    total += weight;
    weight /= 2;
    cells_x *= 2;
    cells_y *= 2;
  }
  return sum / total;
}

// Sets the colour of a house on `ground` at (x, y), y up; returns whether (x, y) is on it.
bool paint_house(float x, float y, float left, float width, float ground, float height,
                 Vector3f& colour) {
  const float u = (x - left) / width, h = (y - ground) / height;
  if (h < 0 || h > 1.5F || u < -0.08F || u > 1.08F) return false;
  if (h > 1) {
    if (std::abs(u - 0.5F) > 0.58F * (1.5F - h) / 0.5F) return false;
    colour =
        mix({0.33F, 0.06F, 0.03F}, {0.45F, 0.12F, 0.05F}, fraction(h * 12) < 0.5F ? 0.0F : 1.0F);
    return true;
  }
  if (u < 0 || u > 1) return false;
  colour = {0.55F, 0.47F, 0.36F};
  const float column = fraction(u * 3), row = fraction(h * 2);
  if (column > 0.3F && column < 0.7F && row > 0.3F && row < 0.75F) colour = {0.95F, 0.72F, 0.22F};
  return true;
}

}  // namespace

Vector3f paint_backdrop(float u, float v) {
  const float brush = octaves(u, v, 40, 60, 4, 1) - 0.5F;
  // Sky: blue at the top, warm at the horizon, with a sun in rings and clouds.
  Vector3f colour = mix({0.05F, 0.13F, 0.36F}, {0.85F, 0.46F, 0.22F}, smooth(0, 0.72F, v));
  const float sun = std::hypot((u - 0.6F) * 1.92F, v - 0.42F);
  colour =
      mix({0.98F, 0.80F, 0.42F}, colour, smooth(0.02F, 0.34F, sun + 0.015F * std::sin(sun * 180)));
  if (sun < 0.075F) colour = {0.99F, 0.90F, 0.62F};
  const float cloud = v > 0.75F ? 0 : octaves(u, v + 0.05F * brush, 5, 14, 5, 11);
  colour = mix(colour, {0.90F, 0.74F, 0.66F},
               0.85F * smooth(0.52F, 0.68F, cloud) * smooth(0.75F, 0.5F, v));
  // Ridges: nearer ones are lower and darker.
  const float height = 1 - v;
  for (int ridge = 0; ridge < 3; ++ridge) {
    const auto i = static_cast<float>(ridge);
    const float top = 0.50F - 0.09F * i +
                      0.16F * (octaves(u, 0.1F + 0.2F * i, 6 + 2 * ridge, 8, 5,
                                       21 + 7 * static_cast<unsigned>(ridge)) -
                               0.5F);
    if (height >= top) continue;
    const float shade = 0.5F + octaves(u, v, 48, 48, 3, 40 + static_cast<unsigned>(ridge));
    const Vector3f far(0.34F, 0.30F, 0.42F), near(0.06F, 0.17F, 0.08F);
    colour = mix(far, near, i / 2) * shade;
  }
  // A field with furrows, and trees and houses on its edge.
  const float edge = 0.29F + 0.02F * std::sin(u * 9);
  if (height < edge) {
    const float furrow = std::sin((u - 0.5F) * 160 / (0.12F + (edge - height)) * 0.16F);
    colour = mix({0.16F, 0.24F, 0.05F}, {0.52F, 0.45F, 0.12F}, 0.5F + 0.5F * furrow);
    colour *= 0.7F + 0.6F * octaves(u, v, 64, 64, 3, 60);
  }
  for (int i = 0; i < 26 && std::abs(height - edge) < 0.15F; ++i) {
    const auto salt = static_cast<unsigned>(i);
    const float x = cell_value(i, 1, 5), size = 0.05F + 0.07F * cell_value(i, 2, 5);
    const float up = height - (edge - 0.02F * cell_value(i, 3, 5));
    const float width = 0.14F * size * (1 - up / size);
    if (up > 0 && up < size && std::abs(u - x) < width * (0.7F + 0.5F * fraction(up * 60))) {
      colour = mix({0.02F, 0.07F, 0.03F}, {0.08F, 0.22F, 0.06F}, octaves(u, v, 128, 128, 2, salt));
    }
  }
  for (int i = 0; i < 9 && std::abs(height - edge) < 0.15F; ++i) {
    const float left = 0.06F + 0.10F * static_cast<float>(i) + 0.04F * cell_value(i, 4, 6);
    if (i == 4) continue;
    paint_house(u, height, left, 0.035F + 0.02F * cell_value(i, 5, 6),
                edge - 0.025F - 0.05F * cell_value(i, 6, 6), 0.05F + 0.03F * cell_value(i, 7, 6),
                colour);
  }
  return (colour * (1 + 0.5F * brush)).cwiseMin(0.95F).cwiseMax(0.01F);
}

Vector3f paint_floor(float u, float v) {
  const bool light = (u < 0.5F) == (v < 0.5F);
  const float across = light ? u : v, along = light ? v : u;
  const float grain = octaves(across, along, 32, 4, 4, 70);
  const float board = cell_value(static_cast<int>(across * 8), light ? 1 : 0, 71);
  Vector3f colour = light ? Vector3f(0.72F, 0.60F, 0.42F) : Vector3f(0.05F, 0.12F, 0.14F);
  colour *= 0.62F + 0.5F * grain + 0.25F * board;
  const float gap = std::min(fraction(across * 8), 1 - fraction(across * 8));
  return colour * (gap < 0.03F ? 0.4F : 1.0F);
}

Vector3f paint_velvet(float u, float v) {
  Vector3f colour(0.42F, 0.02F, 0.03F);
  colour *= 0.65F + 0.7F * octaves(u, v, 32, 16, 3, 80);
  const float a = fraction(u * 2 + v * 2), b = fraction(u * 2 - v * 2);
  const float lattice = std::min(std::min(a, 1 - a), std::min(b, 1 - b));
  const float flower = std::hypot(fraction(u * 2) - 0.5F, fraction(v * 2) - 0.5F);
  const float petals =
      0.16F + 0.06F * std::cos(6 * std::atan2(fraction(v * 2) - 0.5F, fraction(u * 2) - 0.5F));
  if (lattice < 0.035F || flower < petals) colour = Vector3f(0.70F, 0.46F, 0.10F);
  return colour;
}

Vector3f paint_wallpaper(float u, float v) {
  const float stripe = fraction(u * 4);
  Vector3f colour = stripe < 0.5F ? Vector3f(0.20F, 0.30F, 0.28F) : Vector3f(0.42F, 0.47F, 0.36F);
  const float x = fraction(u * 4) - 0.25F,
              y = fraction(v * 4 + (fraction(u * 2) < 0.5F ? 0.0F : 0.5F)) - 0.5F;
  const float leaf = std::abs(x) * 2.4F + std::abs(y + 0.18F * std::cos(12 * x));
  if (leaf < 0.26F) colour = Vector3f(0.66F, 0.60F, 0.38F);
  return colour * (0.8F + 0.4F * octaves(u, v, 24, 24, 4, 90));
}

Vector3f paint_poster(float u, float v) {
  const float paper = 0.9F + 0.1F * octaves(u, v, 16, 16, 4, 100);
  const Vector3f cream = Vector3f(0.86F, 0.80F, 0.64F) * paper;
  if (u < 0.03F || u > 0.97F || v < 0.02F || v > 0.98F) return {0.12F, 0.05F, 0.03F};
  const bool heading = v < 0.26F;
  const float line_height = heading ? 0.12F : 0.045F, letter_width = heading ? 0.09F : 0.03F;
  const float line = (v - 0.04F) / line_height, letter = (u - 0.08F) / letter_width;
  const float x = fraction(letter) * 1.3F, y = fraction(line) * 1.45F;
  if (u < 0.08F || u > 0.92F || v < 0.04F || x > 1 || y > 1) return cream;
  const int row = static_cast<int>(line), column = static_cast<int>(letter);
  const int salt = heading ? 7 : 0;
  if (cell_value(column + salt, row, 101) < 0.15F) return cream;  // a space
  // Letters of 3 x 5 dots, most of them ink.
  const bool ink = cell_value(column * 3 + static_cast<int>(x * 3),
                              row * 5 + static_cast<int>(y * 5) + salt, 102) < 0.58F;
  if (!ink) return cream;
  return heading ? Vector3f(0.55F, 0.05F, 0.03F) : Vector3f(0.03F, 0.03F, 0.05F);
}

Vector3f paint_beach_ball(float u, float v) {
  const Vector3f colours[] = {{0.80F, 0.06F, 0.04F}, {0.88F, 0.84F, 0.76F}, {0.92F, 0.56F, 0.04F},
                              {0.88F, 0.84F, 0.76F}, {0.04F, 0.20F, 0.62F}, {0.88F, 0.84F, 0.76F}};
  if (v < 0.08F || v > 0.92F) return colours[1];
  const Vector3f& colour = colours[static_cast<int>(u * 6) % 6];
  // Fine rings give stereo matching some texture within a segment.
  return colour * (fraction(v * 24) < 0.12F ? 0.6F : 1.0F) *
         (0.85F + 0.3F * octaves(u, v, 16, 8, 3, 110));
}

Vector3f paint_dotted_ball(float u, float v) {
  const float x = fraction(u * 8 + (static_cast<int>(v * 6) % 2 == 0 ? 0.0F : 0.5F)) - 0.5F;
  const float y = fraction(v * 6) - 0.5F;
  const float squeeze = std::max(0.2F, std::sin(std::numbers::pi_v<float> * v));
  const bool dot = std::hypot(x * squeeze * 1.3F, y) < 0.27F;
  const Vector3f colour = dot ? Vector3f(0.92F, 0.80F, 0.18F) : Vector3f(0.03F, 0.28F, 0.50F);
  return colour * (0.8F + 0.4F * octaves(u, v, 24, 12, 3, 120));
}

Vector3f paint_marble(float u, float v) {
  const float flow = octaves(u, v, 6, 6, 5, 130);
  const float vein = std::abs(std::sin(2 * std::numbers::pi_v<float> * (2 * u + 3 * flow)));
  return mix({0.03F, 0.20F, 0.12F}, {0.78F, 0.86F, 0.74F}, smooth(0.35F, 0.95F, vein));
}

Vector3f paint_crate(float u, float v) {
  const bool frame = u < 0.12F || u > 0.88F || v < 0.12F || v > 0.88F;
  const bool brace = std::abs(u - v) < 0.075F;
  const float grain = frame || brace ? octaves(u, v, 6, 48, 4, 140) : octaves(u, v, 48, 6, 4, 141);
  Vector3f colour = frame || brace ? Vector3f(0.52F, 0.31F, 0.13F) : Vector3f(0.36F, 0.20F, 0.08F);
  if (!frame && !brace && fraction(u * 6) < 0.06F) colour *= 0.35F;
  const float nail = std::hypot(fraction(u * 8) - 0.5F, fraction(v * 8) - 0.5F);
  if (frame && nail < 0.13F) colour = Vector3f(0.10F, 0.10F, 0.11F);
  return colour * (0.55F + 0.9F * grain);
}

Vector3f paint_twist(float u, float v) {
  const float stripe = fraction(4 * u + v);
  const Vector3f colour = stripe < 0.33F   ? Vector3f(0.55F, 0.06F, 0.36F)
                          : stripe < 0.66F ? Vector3f(0.90F, 0.76F, 0.20F)
                                           : Vector3f(0.06F, 0.42F, 0.42F);
  return colour * (0.8F + 0.4F * octaves(u, v, 24, 12, 3, 150));
}

Vector3f paint_chart(float u, float v) {
  const int x = static_cast<int>(u * 8), y = static_cast<int>(v * 8);
  const bool light = (x + y) % 2 == 0;
  const int fine_x = static_cast<int>(u * 64), fine_y = static_cast<int>(v * 64);
  const float grey = (light ? 0.55F : 0.04F) + 0.3F * cell_value(fine_x, fine_y, 160);
  return mix({grey, grey, grey},
             {cell_value(x, y, 161), cell_value(x, y, 162), cell_value(x, y, 163)}, 0.3F);
}

}  // namespace raystage::simulate

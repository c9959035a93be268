// SPDX-License-Identifier: Apache-2.0
// Tabulates the conversion between 16-bit codes and linear light: one entry per code, and the
// inverse sRGB curve at 4096 equal steps of the square root of light, linear between.
#include "store/processing/mattes/transfer_function.h"

#include <algorithm>
#include <cmath>

#include "base/transfer_function.h"

namespace raystage::store {
namespace {

constexpr std::size_t kRoots = 4096;  // linear interpolation is within 1e-6

}  // namespace

TransferFunction::TransferFunction(const CodeScale& scale)
    : space_(scale.space),
      full_scale_(static_cast<float>(scale.full_scale)),
      linear_(65536),
      of_root_(kRoots + 2) {
  for (std::size_t i = 0; i < linear_.size(); ++i) {
    const double code = static_cast<double>(i) / 65535;
    linear_[i] = static_cast<float>(scale.full_scale * part_from_value(space_, code));
  }
  for (std::size_t i = 0; i < of_root_.size(); ++i) {
    const double root = static_cast<double>(i) / kRoots;
    of_root_[i] = static_cast<float>(srgb_from_linear(root * root));
  }
}

float TransferFunction::srgb(float linear) const {
  const float root = std::sqrt(std::clamp(linear, 0.0F, 1.0F)) * kRoots;
  const auto below = static_cast<std::size_t>(root);
  const float part = root - static_cast<float>(below);
  return of_root_[below] + part * (of_root_[below + 1] - of_root_[below]);
}

float TransferFunction::code(float linear) const {
  const float part = linear / full_scale_;
  if (space_ == BlendSpace::kHighRange) {
    return 65535 * std::pow(std::clamp(part, 0.0F, 1.0F), 1 / 2.4F);
  }
  return 65535 * (space_ == BlendSpace::kPerceptual ? srgb(part) : std::clamp(part, 0.0F, 1.0F));
}

}  // namespace raystage::store

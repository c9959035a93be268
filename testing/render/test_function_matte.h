// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "store/processing/frames/frame_matte.h"

namespace raystage::testing {

/// A matte defined by a function of the camera and the position of a pixel's centre in its frame.
class FunctionMatte : public store::FrameMatte {
 public:
  using Function = std::function<double(int camera, double x, double y)>;
  explicit FunctionMatte(Function alpha) : alpha_(std::move(alpha)) {}

  std::unique_ptr<const store::FrameKeyer> make_keyer(int camera, int,
                                                      const store::CodeScale&) const override {
    return std::make_unique<Key>(alpha_, camera);
  }

 private:
  class Key : public store::FrameKeyer {
   public:
    Key(const Function& alpha, int camera) : alpha_(alpha), camera_(camera) {}
    void key_row(int x, int y, std::span<std::uint16_t> rgba) const override {
      for (std::size_t i = 0; i < rgba.size(); ++i) {
        const std::size_t pixel = i / 4;
        const double alpha = alpha_(camera_, x + static_cast<double>(pixel) + 0.5, y + 0.5);
        rgba[i] = static_cast<std::uint16_t>(rgba[i] * alpha + 0.5);
      }
    }

   private:
    const Function& alpha_;
    int camera_;
  };
  Function alpha_;
};

}  // namespace raystage::testing

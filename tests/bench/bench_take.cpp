// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/bench_take.h"

#include <cstdlib>

namespace raystage {

testing::SyntheticTake make_painted_rig(int rows, int columns) {
  testing::SyntheticTake options;
  options.cameras = testing::camera_grid(rows, columns, 0.0615, 960, 640);
  options.plane_depth = 5;
  options.depth_range = schemas::DepthRange{3, 40};
  options.jpeg = {90, store::JpegEncodeOptions::Chroma::k420, -1};
  return options;
}

BenchTake::BenchTake(const testing::SyntheticTake& written) {
  write_synthetic_take(written, folder_.path() / "take");
  take_ = std::make_unique<store::Take>(folder_.path() / "take");
}

BenchTake::BenchTake(const char* variable, const testing::SyntheticTake& written) {
  const char* folder = std::getenv(variable);
  if (folder == nullptr) {
    write_synthetic_take(written, folder_.path() / "take");
    take_ = std::make_unique<store::Take>(folder_.path() / "take");
  } else {
    take_ = std::make_unique<store::Take>(folder);
  }
}

}  // namespace raystage

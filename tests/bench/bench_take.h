// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "store/take.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"

namespace raystage {

/// Returns `rows` x `columns` cameras of 960x640, 61.5 mm apart as in the light field shop, in
/// front of a painted plane at 5 m. Depth range: 3 to 40 m. JPEG: quality 90 with restart markers.
testing::SyntheticTake make_painted_rig(int rows, int columns);

/// A take for measurements.
class BenchTake {
 public:
  /// Opens the take in the folder that the environment variable names, or writes one if it is
  /// unset.
  BenchTake(const char* variable, const testing::SyntheticTake& written);
  /// Writes a new take.
  explicit BenchTake(const testing::SyntheticTake& written);

  const store::Take& take() const { return *take_; }

 private:
  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
};

}  // namespace raystage
